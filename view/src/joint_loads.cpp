#include "joint_loads.h"

#include <queue>
#include <tuple>

namespace limber::internal {
namespace {

struct Side {
  JointLoad load{};
  bool tied = false;  // to the world, without the joint
};

/// What a joint's `from` leads to, but for that joint itself; by the shortest ways in links.
Side side_of(const Linkage& linkage, std::size_t joint, Index from) {
  Side side;
  std::vector<bool> seen(linkage.bodies.size(), false);
  std::queue<std::tuple<Index, Vec3, double>> next;  // body, where the way comes into it, and how long it was
  next.emplace(from, linkage.joints[joint].origin, 0.0);
  while (!next.empty()) {
    const auto [number, entry, way] = next.front();
    next.pop();
    if (seen[static_cast<std::size_t>(number)]) continue;
    seen[static_cast<std::size_t>(number)] = true;
    const Linkage::Body& body = linkage.bodies[static_cast<std::size_t>(number)];
    const double arm = way + (body.centre - entry).norm();
    side.load.mass += body.mass;
    side.load.moment += body.mass * arm;
    side.load.inertia += body.mass * arm * arm + body.turning;
    for (std::size_t j = 0; j < linkage.joints.size(); ++j) {
      const Linkage::Joint& other = linkage.joints[j];
      if (j == joint || (other.a != number && other.b != number)) continue;
      const Index there = other.a == number ? other.b : other.a;
      if (there == Linkage::kWorld)
        side.tied = true;
      else
        next.emplace(there, other.origin, way + (other.origin - entry).norm());
    }
  }
  return side;
}

JointLoad load_of(const Linkage& linkage, std::size_t joint) {
  const Linkage::Joint& j = linkage.joints[joint];
  Side b = side_of(linkage, joint, j.b), a;
  if (j.a == Linkage::kWorld)
    a.tied = true;
  else
    a = side_of(linkage, joint, j.a);
  const bool heavier = a.load.mass > b.load.mass;
  const bool takes_a = a.tied == b.tied ? heavier == a.tied : b.tied;
  JointLoad load = takes_a && j.a != Linkage::kWorld ? a.load : b.load;
  load.held = a.tied || b.tied;
  return load;
}

}  // namespace

std::vector<JointLoad> joint_loads(const Linkage& linkage) {
  std::vector<JointLoad> loads;
  for (std::size_t j = 0; j < linkage.joints.size(); ++j) loads.push_back(load_of(linkage, j));
  return loads;
}

}  // namespace limber::internal
