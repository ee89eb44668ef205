#include "files/kinematic_tree.h"

#include <algorithm>
#include <numeric>

#include "limber/core/disjoint_sets.h"

namespace limber::internal {
namespace {

/// How much a joint wants to be in the tree: what no equality constraint can say comes first.
int rank(JointType type) {
  switch (type) {
    case JointType::kCylindrical:
    case JointType::kPrismatic:
    case JointType::kPlanar:
      return 0;
    case JointType::kRevolute:
      return 1;
    case JointType::kBall:
      return 2;
    case JointType::kFixed:
      break;
  }
  return 3;
}

std::vector<std::size_t> by_rank(const std::vector<DetectedJoint>& joints) {
  std::vector<std::size_t> order(joints.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](auto i, auto j) { return rank(joints[i].joint.type) < rank(joints[j].joint.type); });
  return order;
}

Interval scaled(const Interval& i, double by) { return {by * i.low, by * i.high}; }

/// Freedoms that go along with each other, by screws and couplings: the first of each such set leads all others.
class Leading {
 public:
  Leading(KinematicTree& tree, const std::vector<DetectedJoint>& joints, const RobotOptions& options) : tree_(tree) {
    for (std::size_t i = 0; i < tree.links.size(); ++i) {
      const TreeLink& link = tree.links[i];
      for (std::size_t f = 0; f < link.freedoms.size(); ++f) nodes_.push_back({i, f});
      const double pitch = link.parent < 0 ? 0.0 : joints[link.joint].joint.pitch;
      if (pitch != 0.0) edges_.push_back({nodes_.size() - 2, nodes_.size() - 1, options.metres_per_unit * pitch});
    }
    const auto metres = [&](const JointAxis& axis) { return axis.turns ? 1.0 : options.metres_per_unit; };
    for (std::size_t c = 0; c < options.couplings.size(); ++c) {
      const JointCoupling& coupling = options.couplings[c];
      const std::size_t first = node(coupling.first), second = node(coupling.second);
      if (coupling.even && std::max(first, second) < nodes_.size())
        edges_.push_back({first, second, coupling.ratio * metres(coupling.second) / metres(coupling.first)});
      else
        tree.uncoupled.push_back(c);
    }
  }

  void lead() {
    std::vector<bool> seen(nodes_.size(), false);
    for (std::size_t first = 0; first < nodes_.size(); ++first) {
      if (seen[first]) continue;
      seen[first] = true;
      std::vector<std::pair<std::size_t, double>> open{{first, 1.0}};
      for (std::size_t i = 0; i < open.size(); ++i)
        for (const Edge& e : edges_)
          for (const auto& [from, to, ratio] : {e, Edge{e.to, e.from, 1.0 / e.ratio}}) {
            if (from != open[i].first || seen[to]) continue;
            seen[to] = true;
            open.emplace_back(to, open[i].second * ratio);
            freedom(to).leader = {static_cast<int>(nodes_[first].link), nodes_[first].freedom, open.back().second};
          }
    }
  }

 private:
  struct Node {
    std::size_t link, freedom;
  };
  struct Edge {
    std::size_t from, to;  ///< nodes
    double ratio;          ///< of the speeds, rad or m
  };
  AxisFreedom& freedom(std::size_t node) { return tree_.links[nodes_[node].link].freedoms[nodes_[node].freedom]; }
  std::size_t node(const JointAxis& axis) {
    std::size_t n = 0;
    while (n < nodes_.size() && !(link(n).joint == axis.joint && freedom(n).turns == axis.turns)) ++n;
    return n;
  }
  const TreeLink& link(std::size_t node) const { return tree_.links[nodes_[node].link]; }

  KinematicTree& tree_;
  std::vector<Node> nodes_;
  std::vector<Edge> edges_;
};

}  // namespace

std::vector<AxisFreedom> axis_freedoms(const JointSpec& joint, bool reversed, double metres_per_unit) {
  static const char* const kNames[] = {"x", "y", "z"};
  const auto turn = [&](int axis, const Interval& range) {
    return AxisFreedom{true, joint.frame.axes.col(axis), range, std::string("r") + kNames[axis]};
  };
  const auto slide = [&](int axis, const Interval& range) {
    return AxisFreedom{false, joint.frame.axes.col(axis), scaled(range, metres_per_unit),
                       std::string("t") + kNames[axis]};
  };
  const JointLimits& l = joint.limits;
  std::vector<AxisFreedom> out;
  switch (joint.type) {
    case JointType::kBall:
      out = {turn(0, l.euler[0]), turn(1, l.euler[1]), turn(2, l.euler[2])};
      break;
    case JointType::kRevolute:
      out = {turn(0, l.rotation)};
      break;
    case JointType::kPrismatic:
      out = {slide(0, l.translation[0])};
      break;
    case JointType::kPlanar:
      out = {slide(0, l.translation[0]), slide(1, l.translation[1]), turn(2, l.rotation)};
      break;
    case JointType::kCylindrical:
      out = {turn(0, l.rotation), slide(0, l.translation[0])};
      break;
    case JointType::kFixed:
      break;
  }
  if (!reversed) return out;
  // The inverse of a product of motions: the last one first, each about the opposite axis.
  if (joint.type != JointType::kCylindrical) std::reverse(out.begin(), out.end());
  for (AxisFreedom& f : out) f.axis = -f.axis;
  return out;
}

KinematicTree kinematic_tree(const Assembly& assembly, const std::vector<DetectedJoint>& joints,
                             const RobotOptions& options) {
  const double metres_per_unit = options.metres_per_unit;
  const std::size_t count = assembly.components.size();
  KinematicTree tree;
  DisjointSets sets(count);
  std::vector<std::vector<std::size_t>> around(count);
  for (const std::size_t j : by_rank(joints)) {
    if (!sets.join(joints[j].a, joints[j].b)) {
      tree.closed.push_back(j);
      continue;
    }
    around[static_cast<std::size_t>(joints[j].a)].push_back(j);
    around[static_cast<std::size_t>(joints[j].b)].push_back(j);
  }
  std::sort(tree.closed.begin(), tree.closed.end());
  for (std::size_t c = 0; c < count; ++c) {
    if (sets.root(static_cast<Index>(c)) != static_cast<Index>(c)) continue;
    tree.roots.push_back(static_cast<int>(tree.links.size()));
    tree.links.push_back({.component = static_cast<Index>(c)});
    for (std::size_t open = tree.links.size() - 1; open < tree.links.size(); ++open) {
      const TreeLink here = tree.links[open];
      auto& edges = around[static_cast<std::size_t>(here.component)];
      std::sort(edges.begin(), edges.end());
      for (const std::size_t j : edges) {
        if (here.parent >= 0 && j == here.joint) continue;
        const bool reversed = joints[j].b == here.component;
        tree.links[open].children.push_back(static_cast<int>(tree.links.size()));
        tree.links.push_back({.component = reversed ? joints[j].a : joints[j].b,
                              .parent = static_cast<int>(open),
                              .joint = j,
                              .origin = metres_per_unit * joints[j].joint.frame.origin,
                              .freedoms = axis_freedoms(joints[j].joint, reversed, metres_per_unit)});
      }
    }
  }
  Leading(tree, joints, options).lead();
  return tree;
}

}  // namespace limber::internal
