#include "joint_breaks.h"

namespace limber::internal {

void JointBreaks::find(const ConstraintStage& constraints, const BodyTable& bodies) {
  events_.clear();
  for (std::size_t place = 0; place < constraints.entries().size(); ++place) {
    const ConstraintStage::Entry& e = constraints.entries()[place];
    if (!e.joint || !(e.joint->force().norm() > e.strength)) continue;
    const auto id = [&](Index body) { return body < 0 ? BodyId{} : bodies.id(body); };
    const auto [a, b] = e.joint->bodies();
    events_.push_back({.joint = {static_cast<std::uint32_t>(place), e.generation},
                       .a = id(a),
                       .b = id(b),
                       .user_data = e.user_data,
                       .force = e.joint->force()});
  }
}

}  // namespace limber::internal
