#include "rigid_models.h"

#include <algorithm>

namespace limber::internal {

template <class Make>
RigidModel RigidModels::find_or_make(std::span<const ShapePart> parts, const MassProperties& mass, const Make& make) {
  const auto is_gone = [](const Made& m) {
    return m.model.expired() || std::ranges::any_of(m.parts, [](const Part& part) { return part.of.expired(); });
  };
  std::erase_if(made_, is_gone);
  const auto same = [](const Part& known, const ShapePart& part) {
    const Quaternion &q = known.pose.q, &r = part.pose.q;
    return known.of.lock() == part.shape && known.pose.p == part.pose.p && q.w == r.w && q.vector() == r.vector();
  };
  for (const Made& m : made_)
    if (std::equal(m.parts.begin(), m.parts.end(), parts.begin(), parts.end(), same) && m.mass.mass == mass.mass &&
        m.mass.center_of_mass == mass.center_of_mass && m.mass.inertia == mass.inertia)
      return {m.model.lock(), m.shape.lock()};
  RigidModel fresh = make();
  Made& made = made_.emplace_back(Made{.mass = mass, .model = fresh.model, .shape = fresh.shape});
  for (const ShapePart& part : parts) made.parts.push_back({part.shape, part.pose});
  return fresh;
}

RigidModel RigidModels::get(const std::shared_ptr<const Shape>& shape, const MassProperties& mass) {
  const ShapePart part{.shape = shape};
  return find_or_make({&part, 1}, mass, [&] { return make_rigid_model(shape, mass); });
}

RigidModel RigidModels::get(std::span<const ShapePart> parts, const MassProperties& mass) {
  RigidModel rigid = find_or_make(parts, mass, [&] { return make_rigid_model(parts, mass); });
  rigid.parts.clear();
  for (const ShapePart& part : parts)
    rigid.parts.push_back({part.shape, {part.pose.q, part.pose.p - mass.center_of_mass}});
  return rigid;
}

RigidModel RigidModels::get_kinematic(const std::shared_ptr<const Shape>& shape) {
  const ShapePart part{.shape = shape};
  return find_or_make({&part, 1}, {}, [&] { return make_kinematic_model(shape); });
}

RigidModel RigidModels::get_kinematic(std::span<const ShapePart> parts) {
  RigidModel led = find_or_make(parts, {}, [&] { return make_kinematic_model(parts); });
  led.parts.assign(parts.begin(), parts.end());
  return led;
}

}  // namespace limber::internal
