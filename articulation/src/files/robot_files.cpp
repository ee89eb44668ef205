#include "limber/articulation/robot_files.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>

#include "files/kinematic_tree.h"
#include "limber/core/error.h"
#include "limber/mesh/write_mesh.h"
#include "number_text.h"
#include "types/couplings.h"

namespace limber {
namespace {

using internal::AxisFreedom;
using internal::check_couplings;
using internal::kinematic_tree;
using internal::KinematicTree;
using internal::TreeLink;

/// The shortest text that reads back to the same bits; −0 is 0.
std::string exact(double x) {
  char buffer[32];
  const auto end = std::to_chars(buffer, buffer + sizeof buffer, x + 0.0).ptr;
  return {buffer, end};
}

std::string exact(const Vec3& v) { return exact(v.x()) + " " + exact(v.y()) + " " + exact(v.z()); }
std::string exact(const Interval& i) { return exact(i.low) + " " + exact(i.high); }

std::string attribute(const std::string& name, const std::string& value) { return " " + name + "=\"" + value + "\""; }

/// Names that every reader takes: letters, digits, "_", "-" and "."; each different.
std::vector<std::string> plain_names(const Assembly& assembly) {
  std::set<std::string> taken{"world"};
  std::vector<std::string> names;
  for (const Component& c : assembly.components) {
    std::string plain;
    for (const char ch : c.name) {
      const bool kept =
          (ch >= '0' && ch <= '9') || (ch >= 'a' && ch <= 'z') || (ch >= 'A' && ch <= 'Z') || ch == '-' || ch == '.';
      plain += kept ? ch : '_';
    }
    if (plain.empty()) plain = "part";
    std::string name = plain;
    for (int n = 2; !taken.insert(name).second; ++n) name = plain + "_" + std::to_string(n);
    names.push_back(name);
  }
  return names;
}

struct Mass {
  double mass = 0.0;                // kg
  Vec3 center = Vec3::Zero();       // m, input frame
  Mat3 inertia = Mat3::Identity();  // kg·m², about the centre
};

/// Source of both formats.
class Robot {
 public:
  Robot(const Assembly& parts, const std::vector<DetectedJoint>& links, const RobotOptions& o)
      : assembly(parts), joints(links), options(o), names(plain_names(parts)) {
    check();
    tree = kinematic_tree(assembly, joints, options);
    double size = 0.0;
    for (const Component& c : assembly.components) {
      size = std::max(size, c.diagonal * options.metres_per_unit);
      masses.push_back(mass_of(c));
    }
    far_ = kFar * std::max({size, assembly.diagonal * options.metres_per_unit, 1.0});
  }

  /// A range with both ends closed; what was open is far away.
  Interval closed_range(const Interval& i) const {
    return {std::isfinite(i.low) ? i.low : -far_, std::isfinite(i.high) ? i.high : far_};
  }

  const std::string& name(const TreeLink& link) const { return names[static_cast<std::size_t>(link.component)]; }
  const Mass& mass(const TreeLink& link) const { return masses[static_cast<std::size_t>(link.component)]; }
  const TreeLink& parent(const TreeLink& link) const { return tree.links[static_cast<std::size_t>(link.parent)]; }
  std::string joint_name(const TreeLink& link) const { return name(parent(link)) + "__" + name(link); }
  std::string joint_name(const TreeLink& link, const AxisFreedom& f) const {
    return joint_name(link) + (link.freedoms.size() > 1 ? "_" + f.suffix : "");
  }
  std::string leader_name(const AxisFreedom& f) const {
    const TreeLink& leader = tree.links[static_cast<std::size_t>(f.leader.link)];
    return joint_name(leader, leader.freedoms[f.leader.freedom]);
  }
  std::string pair_text(std::size_t joint) const {
    return names[static_cast<std::size_t>(joints[joint].a)] + " and " +
           names[static_cast<std::size_t>(joints[joint].b)];
  }

  /// The middle of a component's box, m: its mesh file has this as origin, to keep digits in float32.
  Vec3 middle(Index component) const {
    const auto& vertices = assembly.components[static_cast<std::size_t>(component)].surface.vertices;
    Vec3 low = vertices.front(), high = low;
    for (const Vec3& p : vertices) low = low.cwiseMin(p), high = high.cwiseMax(p);
    return options.metres_per_unit * 0.5 * (low + high);
  }

  std::vector<std::pair<std::string, std::string>> meshes() const {
    std::vector<std::pair<std::string, std::string>> out;
    for (std::size_t c = 0; c < assembly.components.size(); ++c) {
      SurfaceMesh surface = assembly.components[c].surface;
      const Vec3 origin = middle(static_cast<Index>(c));
      for (Vec3& p : surface.vertices) p = options.metres_per_unit * p - origin;
      out.emplace_back(names[c] + ".stl", stl_bytes(surface));
    }
    return out;
  }

  const Assembly& assembly;
  const std::vector<DetectedJoint>& joints;
  const RobotOptions& options;
  std::vector<std::string> names;
  KinematicTree tree;
  std::vector<Mass> masses;
  Warnings warnings;

 private:
  static constexpr double kFar = 1e3;

  void check() const {
    if (assembly.components.empty()) throw InvalidArgument("robot file: the assembly has no components");
    for (const auto& [value, what] :
         {std::pair{options.density, "density"}, {options.metres_per_unit, "metres_per_unit"}})
      if (!(value > 0.0) || !std::isfinite(value))
        throw InvalidArgument(std::string("RobotOptions: ") + what + " is " + exact(value) + ", expected a number > 0");
    const auto count = static_cast<Index>(assembly.components.size());
    for (const DetectedJoint& j : joints) {
      if (std::min(j.a, j.b) < 0 || std::max(j.a, j.b) >= count || j.a == j.b)
        throw InvalidArgument("robot file: a joint of components " + std::to_string(j.a) + " and " +
                              std::to_string(j.b) + ", expected two of " + std::to_string(count));
      j.joint.validate();
    }
    check_couplings(joints, options.couplings);
    for (const JointCoupling& c : options.couplings)
      if (c.even && (c.ratio == 0.0 || !std::isfinite(c.ratio)))
        throw InvalidArgument("robot file: a coupling with the ratio " + exact(c.ratio) + ", expected a number but 0");
  }

  Mass mass_of(const Component& c) {
    constexpr double kFilledPart = 0.1;  // of the box, for what bounds no solid
    constexpr double kLeastMass = 1e-9;  // kg; lighter bodies are refused by readers
    const double s = options.metres_per_unit;
    SolidProperties solid;
    if (c.closed) solid = solid_properties(bounding_surface(c));
    if (!(std::abs(solid.volume) > 0.0)) {
      solid = box_properties(c.surface, kFilledPart);
      warnings.push_back("Component \"" + c.name + "\" bounds no solid: its mass is that of a tenth of its box.");
    }
    // An inside-out surface has all integrals negative, but for the centre.
    const double sign = solid.volume < 0.0 ? -1.0 : 1.0;
    Mass m{sign * solid.volume * s * s * s * options.density, s * solid.centroid,
           sign * solid.inertia * std::pow(s, 5) * options.density};
    if (m.mass >= kLeastMass) return m;
    warnings.push_back("Component \"" + c.name + "\" has a mass of " + exact(m.mass) + " kg: it is given 1e-9 kg.");
    return {kLeastMass, m.center, kLeastMass * std::max(c.diagonal * s * c.diagonal * s, 1e-9) * Mat3::Identity()};
  }

  static SolidProperties box_properties(const SurfaceMesh& surface, double fill) {
    Vec3 low = surface.vertices.front(), high = low;
    for (const Vec3& p : surface.vertices) low = low.cwiseMin(p), high = high.cwiseMax(p);
    const Vec3 size = (high - low).cwiseMax(1e-3 * (high - low).norm());
    SolidProperties box{.volume = fill * size.prod(), .centroid = 0.5 * (low + high)};
    const Vec3 square = size.cwiseProduct(size);
    box.inertia = box.volume / 12.0 * (square.sum() * Mat3::Identity() - Mat3(square.asDiagonal()));
    return box;
  }

  double far_ = 0.0;
};

// URDF ----------------------------------------------------------------------------------------------------------------

std::string urdf_inertial(const Mass& m, const Vec3& origin) {
  return "    <inertial>\n      <origin" + attribute("xyz", exact(Vec3(m.center - origin))) +
         attribute("rpy", "0 0 0") + "/>\n      <mass" + attribute("value", exact(m.mass)) + "/>\n      <inertia" +
         attribute("ixx", exact(m.inertia(0, 0))) + attribute("ixy", exact(m.inertia(0, 1))) +
         attribute("ixz", exact(m.inertia(0, 2))) + attribute("iyy", exact(m.inertia(1, 1))) +
         attribute("iyz", exact(m.inertia(1, 2))) + attribute("izz", exact(m.inertia(2, 2))) + "/>\n    </inertial>\n";
}

std::string urdf_link(const Robot& robot, const TreeLink& link) {
  const std::string file =
      robot.options.mesh_folder + (robot.options.mesh_folder.empty() ? "" : "/") + robot.name(link) + ".stl";
  const std::string shape =
      "      <origin" + attribute("xyz", exact(Vec3(robot.middle(link.component) - link.origin))) +
      attribute("rpy", "0 0 0") + "/>\n      <geometry><mesh" + attribute("filename", file) + "/></geometry>\n";
  return "  <link" + attribute("name", robot.name(link)) + ">\n" + urdf_inertial(robot.mass(link), link.origin) +
         "    <visual>\n" + shape + "    </visual>\n    <collision>\n" + shape + "    </collision>\n  </link>\n";
}

std::string urdf_joint(const std::string& name, const std::string& type, const std::string& parent,
                       const std::string& child, const Vec3& origin, const std::string& more) {
  return "  <joint" + attribute("name", name) + attribute("type", type) + ">\n    <parent" + attribute("link", parent) +
         "/>\n    <child" + attribute("link", child) + "/>\n    <origin" + attribute("xyz", exact(origin)) +
         attribute("rpy", "0 0 0") + "/>\n" + more + "  </joint>\n";
}

/// Readers want numbers for effort and velocity; none is known from geometry.
std::string urdf_limit(const Interval& range) {
  return "    <limit" + attribute("lower", exact(range.low)) + attribute("upper", exact(range.high)) +
         attribute("effort", "1e6") + attribute("velocity", "1e3") + "/>\n";
}

std::string urdf_freedom(const Robot& robot, const TreeLink& link, const AxisFreedom& f, const std::string& parent,
                         const std::string& child, const Vec3& origin) {
  const bool continuous = f.turns && f.range.open();
  std::string more = "    <axis" + attribute("xyz", exact(f.axis)) + "/>\n";
  if (!continuous) more += urdf_limit(robot.closed_range(f.range));
  if (f.leader.link >= 0)
    more += "    <mimic" + attribute("joint", robot.leader_name(f)) + attribute("multiplier", exact(f.leader.ratio)) +
            "/>\n";
  return urdf_joint(robot.joint_name(link, f),
                    continuous ? "continuous"
                    : f.turns  ? "revolute"
                               : "prismatic",
                    parent, child, origin, more);
}

/// Between two freedoms: a link that weighs next to nothing (many readers drop or refuse links without mass).
std::string urdf_link_between(const std::string& name, const Mass& of) {
  constexpr double kShare = 1e-6;  // of the mass of the link that it leads to
  return "  <link" + attribute("name", name) + ">\n" +
         urdf_inertial({kShare * of.mass, Vec3::Zero(), kShare * of.inertia.trace() * Mat3::Identity()}, Vec3::Zero()) +
         "  </link>\n";
}

std::string urdf_joints(const Robot& robot, const TreeLink& link) {
  std::string text, parent = robot.name(robot.parent(link));
  Vec3 origin = link.origin - robot.parent(link).origin;
  if (link.freedoms.empty()) return urdf_joint(robot.joint_name(link), "fixed", parent, robot.name(link), origin, "");
  for (std::size_t i = 0; i < link.freedoms.size(); ++i) {
    const bool last = i + 1 == link.freedoms.size();
    const std::string child = last ? robot.name(link) : robot.name(link) + "__" + link.freedoms[i].suffix;
    if (!last) text += urdf_link_between(child, robot.mass(link));
    text += urdf_freedom(robot, link, link.freedoms[i], parent, child, origin);
    parent = child;
    origin.setZero();
  }
  return text;
}

// MJCF ----------------------------------------------------------------------------------------------------------------

std::string indent(int depth) { return std::string(static_cast<std::size_t>(2 * depth), ' '); }

std::string mjcf_freedoms(const Robot& robot, const TreeLink& link, int depth) {
  if (link.freedoms.empty()) return "";
  const bool ball = robot.joints[link.joint].joint.type == JointType::kBall;
  const auto open = [](const AxisFreedom& f) { return f.range.open(); };
  if (ball && std::all_of(link.freedoms.begin(), link.freedoms.end(), open))
    return indent(depth) + "<joint" + attribute("name", robot.joint_name(link)) + attribute("type", "ball") + "/>\n";
  std::string text;
  for (const AxisFreedom& f : link.freedoms) {
    text += indent(depth) + "<joint" + attribute("name", robot.joint_name(link, f)) +
            attribute("type", f.turns ? "hinge" : "slide") + attribute("axis", exact(f.axis));
    if (!f.range.open()) text += attribute("limited", "true") + attribute("range", exact(robot.closed_range(f.range)));
    text += "/>\n";
  }
  return text;
}

std::string mjcf_body(const Robot& robot, const TreeLink& link, int depth) {
  const Vec3 from = link.parent >= 0 ? robot.parent(link).origin : Vec3::Zero();
  const Mass& m = robot.mass(link);
  const Mat3& I = m.inertia;
  std::string text = indent(depth) + "<body" + attribute("name", robot.name(link)) +
                     attribute("pos", exact(Vec3(link.origin - from))) + ">\n";
  text +=
      indent(depth + 1) + "<inertial" + attribute("pos", exact(Vec3(m.center - link.origin))) +
      attribute("mass", exact(m.mass)) +
      attribute("fullinertia", exact(Vec3(I(0, 0), I(1, 1), I(2, 2))) + " " + exact(Vec3(I(0, 1), I(0, 2), I(1, 2)))) +
      "/>\n";
  text += mjcf_freedoms(robot, link, depth + 1);
  const Component& component = robot.assembly.components[static_cast<std::size_t>(link.component)];
  const bool closed = component.closed && component.caps.empty();  // the mesh file has no caps
  text += indent(depth + 1) + "<geom" + attribute("type", "mesh") + attribute("mesh", robot.name(link)) +
          attribute("pos", exact(Vec3(robot.middle(link.component) - link.origin))) +
          (closed ? "" : attribute("shellinertia", "true")) + attribute("contype", "0") +
          attribute("conaffinity", "0") + "/>\n";
  for (const int child : link.children)
    text += mjcf_body(robot, robot.tree.links[static_cast<std::size_t>(child)], depth + 1);
  return text + indent(depth) + "</body>\n";
}

Vec3 body_origin(const Robot& robot, Index component) {
  for (const TreeLink& link : robot.tree.links)
    if (link.component == component) return link.origin;
  return Vec3::Zero();
}

/// A chain closed: points of the joint that both bodies share. @return empty if no equality can say it
std::string mjcf_closure(Robot& robot, std::size_t joint) {
  const DetectedJoint& j = robot.joints[joint];
  const std::string bodies = attribute("body1", robot.names[static_cast<std::size_t>(j.a)]) +
                             attribute("body2", robot.names[static_cast<std::size_t>(j.b)]);
  const Vec3 at = robot.options.metres_per_unit * j.joint.frame.origin - body_origin(robot, j.a);
  const auto connect = [&](const Vec3& point) {
    return "    <connect" + bodies + attribute("anchor", exact(point)) + "/>\n";
  };
  const Component& a = robot.assembly.components[static_cast<std::size_t>(j.a)];
  const Vec3 along = 0.1 * robot.options.metres_per_unit * a.diagonal * j.joint.frame.axes.col(0);
  switch (j.joint.type) {
    case JointType::kBall:
      return connect(at);
    case JointType::kRevolute:
      return connect(at - along) + connect(at + along);
    case JointType::kFixed:
      return "    <weld" + bodies + "/>\n";
    default:
      break;
  }
  robot.warnings.push_back("The " + std::string(to_string(j.joint.type)) + " joint of " + robot.pair_text(joint) +
                           " closes a chain and is left out: MuJoCo has no equality constraint for it.");
  return "";
}

std::string mjcf_equalities(Robot& robot) {
  std::string text;
  for (const TreeLink& link : robot.tree.links)
    for (const AxisFreedom& f : link.freedoms)
      if (f.leader.link >= 0)
        text += "    <joint" + attribute("joint1", robot.joint_name(link, f)) +
                attribute("joint2", robot.leader_name(f)) +
                attribute("polycoef", "0 " + exact(f.leader.ratio) + " 0 0 0") + "/>\n";
  for (const std::size_t j : robot.tree.closed) text += mjcf_closure(robot, j);
  return text.empty() ? text : "  <equality>\n" + text + "  </equality>\n";
}

void warn_of_rest(Robot& robot) {
  for (const std::size_t c : robot.tree.uncoupled) {
    const JointCoupling& coupling = robot.options.couplings[c];
    robot.warnings.push_back(
        "The coupling of " + robot.pair_text(coupling.first.joint) + " with " + robot.pair_text(coupling.second.joint) +
        " is left out: " + (coupling.even ? "one of the joints closes a chain." : "its ratio changes on the way."));
  }
  for (std::size_t j = 0; j < robot.joints.size(); ++j)
    if (const double cone = robot.joints[j].joint.limits.cone; std::isfinite(cone))
      robot.warnings.push_back("The ball joint of " + robot.pair_text(j) + " has a cone of " +
                               internal::degrees_text(cone) + ", which the format cannot say: its Euler limits stand.");
}

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text)
    out += c == '&' ? "&amp;" : c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '"' ? "&quot;" : std::string(1, c);
  return out;
}

}  // namespace

RobotFile urdf_file(const Assembly& assembly, const std::vector<DetectedJoint>& joints, const RobotOptions& options) {
  Robot robot(assembly, joints, options);
  std::string text = "<?xml version=\"1.0\"?>\n<robot" + attribute("name", escaped(options.name)) + ">\n";
  text += "  <mujoco><compiler" + attribute("meshdir", escaped(options.mesh_folder)) + "/></mujoco>\n";
  const bool world = robot.tree.roots.size() > 1;
  if (world) text += "  <link name=\"world\"/>\n";
  for (const TreeLink& link : robot.tree.links) {
    text += urdf_link(robot, link);
    if (link.parent >= 0)
      text += urdf_joints(robot, link);
    else if (world)
      text += urdf_joint("world__" + robot.name(link), "fixed", "world", robot.name(link), Vec3::Zero(), "");
  }
  for (const std::size_t j : robot.tree.closed) {
    const std::string what = "the " + std::string(to_string(joints[j].joint.type)) + " joint of " + robot.pair_text(j) +
                             " at " + exact(Vec3(options.metres_per_unit * joints[j].joint.frame.origin));
    text += "  <!-- closed chain: " + what + " is not part of the tree -->\n";
    robot.warnings.push_back("URDF is a tree: " + what + " closes a chain and is left out.");
  }
  warn_of_rest(robot);
  return {text + "</robot>\n", robot.meshes(), robot.warnings};
}

RobotFile mjcf_file(const Assembly& assembly, const std::vector<DetectedJoint>& joints, const RobotOptions& options) {
  Robot robot(assembly, joints, options);
  std::string text = "<mujoco" + attribute("model", escaped(options.name)) + ">\n  <compiler angle=\"radian\"" +
                     attribute("meshdir", escaped(options.mesh_folder)) + "/>\n";
  text +=
      "  <!-- Geoms do not collide: MuJoCo takes convex hulls, which would fill every hole that a pin sits in. -->\n";
  text += "  <asset>\n";
  for (const std::string& name : robot.names)
    text += "    <mesh" + attribute("name", name) + attribute("file", name + ".stl") + "/>\n";
  text += "  </asset>\n  <worldbody>\n";
  for (const int root : robot.tree.roots) text += mjcf_body(robot, robot.tree.links[static_cast<std::size_t>(root)], 2);
  text += "  </worldbody>\n" + mjcf_equalities(robot);
  warn_of_rest(robot);
  return {text + "</mujoco>\n", robot.meshes(), robot.warnings};
}

}  // namespace limber
