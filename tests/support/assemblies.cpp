#include "assemblies.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numbers>
#include <random>

#include "grouped_parts.h"
#include "limber/core/error.h"
#include "shells.h"

namespace limber::assemblies {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kDegree = kPi / 180.0;
constexpr double kOpen = std::numeric_limits<double>::infinity();

/// Where a joint's own drawing is put: z along its axis.
struct Place {
  Mat3 R = Mat3::Identity();
  Vec3 t = Vec3::Zero();

  Shell operator()(const Shell& shell) const { return shell.placed(R, t); }
  Vec3 operator()(const Vec3& p) const { return R * p + t; }
};

/// Z along `axis`, x anywhere.
Place at(const Vec3& t, const Vec3& axis = Vec3::UnitZ()) {
  return {Eigen::Quaterniond::FromTwoVectors(Vec3::UnitZ(), axis).toRotationMatrix(), t};
}

/// Z along `axis`, x along `x`.
Place at(const Vec3& t, const Vec3& axis, const Vec3& x) {
  Place out;
  out.R << x.normalized(), axis.cross(x).normalized(), axis.normalized();
  out.t = t;
  return out;
}

/// Collects parts and the truth about them.
class Builder {
 public:
  explicit Builder(const Variant& variant) : v(variant) {}

  void add(const std::string& part, const Shell& shell) {
    const auto found = std::find_if(parts.begin(), parts.end(), [&](const Part& p) { return p.name == part; });
    Part& p = found == parts.end() ? parts.emplace_back(Part{part, {}}) : *found;
    p.shells.push_back(shell);
  }

  void truth(const std::string& a, const std::string& b, JointType type, const Place& place, double pitch = 0.0) {
    joints.push_back({a, b, type, place.t, place.R.col(2), pitch});
  }

  // How far the joint told last goes. Bearings below are drawn to be free; who puts something in the way says so.

  void turns(double low = -kOpen, double high = kOpen) {
    set({TrueRange::Freedom::kRotation, joints.back().axis, {low, high}});
  }
  void slides(double low = -kOpen, double high = kOpen) { slides_along(joints.back().axis, low, high); }
  void slides_along(const Vec3& direction, double low = -kOpen, double high = kOpen) {
    set({TrueRange::Freedom::kTranslation, direction, {low, high}});
  }
  void swings(double cone) { set({TrueRange::Freedom::kCone, Vec3::Zero(), {0.0, cone}}); }
  /// Something stops it at an angle that no short formula gives.
  void range_unknown() { joints.back().ranges.clear(); }

  void set(const TrueRange& range) {
    auto& ranges = joints.back().ranges;
    std::erase_if(ranges, [&](const TrueRange& r) { return r.freedom == range.freedom && r.along == range.along; });
    ranges.push_back(range);
  }

  int n() const { return v.segments; }
  double gap(double diameter) const { return v.clearance * diameter; }

  /// A square bar between two points.
  void bar(const std::string& part, const Vec3& from, const Vec3& to, double width) {
    const double length = (to - from).norm();
    add(part, at(from, (to - from) / length)(box({-width / 2, -width / 2, 0.0}, {width / 2, width / 2, length})));
  }

  // Bearings in which b's shaft, ball or bar of radius (half width) r sits in a.

  /// A sleeve between the two flanges of a shaft.
  void hinge(const std::string& a, const std::string& b, const Place& place, double r, double h) {
    const double g = gap(2 * r), flange = h + g, end = flange + 0.6 * r, R = 1.5 * r;
    sleeve(a, place, r, h);
    add(b, place(lathe({{0, -end}, {R, -end}, {R, -flange}, {r, -flange}, {r, flange}, {R, flange}, {R, end}, {0, end}},
                       n(), 0.0, {1, 1, 0, 0, 0, 1, 1, 1})));
    truth(a, b, JointType::kRevolute, place);
    turns();
  }

  /// A plain shaft through a sleeve.
  void slider(const std::string& a, const std::string& b, const Place& place, double r, double h, double reach = 2.0) {
    sleeve(a, place, r, h);
    add(b, place(lathe({{0, -reach * h}, {r, -reach * h}, {r, reach * h}, {0, reach * h}}, n(), 0.0, {1, 0, 1, 1})));
    truth(a, b, JointType::kCylindrical, place);
    turns();
    slides();
  }

  void sleeve(const std::string& part, const Place& place, double r, double h) {
    const double inner = r + gap(2 * r), outer = 1.8 * r;
    add(part, place(lathe({{inner, -h}, {outer, -h}, {outer, h}, {inner, h}}, n(), v.phase, {0, 1, 0, 0})));
  }

  /// A ball with a neck along z in a ring that holds it.
  void ball(const std::string& a, const std::string& b, const Place& place, double r, double half_arc = 50 * kDegree) {
    const double inner = r + gap(2 * r), high = inner * std::sin(half_arc), outer = 1.4 * r;
    Loop ring = {{outer, -high}, {outer, high}};
    const int steps = std::max(2, static_cast<int>(std::lround(n() * 2 * half_arc / (2 * kPi))));
    for (int i = 0; i <= steps; ++i) {
      const double angle = half_arc - 2 * half_arc * i / steps;
      ring.emplace_back(inner * std::cos(angle), inner * std::sin(angle));
    }
    add(a, place(lathe(ring, n(), v.phase, {1})));
    add(b, place(ball_with_neck(r, 0.4 * r, 2.5 * r)));
    truth(a, b, JointType::kBall, place);
    turns();
    swings(neck_meets_rim(r, half_arc));
  }

  /// How far a neck of 0.4 r leans until its side meets the edge of the ring. Both are polygons; the least is where a
  /// flat of the ring's or a corner of both is in line. Where the ring overlaps the ball, its edge lies inside the
  /// ball, and it is the corners at which the neck leaves the ball that first come down to the ring's face.
  double neck_meets_rim(double r, double half_arc) const {
    const double inner = r + gap(2 * r), high = inner * std::sin(half_arc), rim = inner * std::cos(half_arc);
    if (inner < r) return std::acos(high / r) - std::asin(0.4);
    const double flat = std::cos(kPi / n());
    const auto lean = [&](double rim_here, double neck_here) {
      return std::atan2(rim_here, high) - std::asin(neck_here / std::hypot(rim_here, high));
    };
    const double neck = 0.4 * r;
    if (v.phase == 0.5) return std::min(lean(rim * flat, neck), lean(rim, neck * flat));
    return std::min(lean(rim, neck), lean(rim * flat, neck * flat));
  }

  /// How far the sleeve of a hinge or slider reaches along its own x.
  double sleeve_reach(double r) const { return 1.8 * r * std::cos(2 * kPi * std::min(v.phase, 1 - v.phase) / n()); }

  Shell ball_with_neck(double r, double neck, double length) const {
    Loop profile;
    const double top = std::acos(neck / r);
    const int steps = std::max(3, static_cast<int>(std::lround(n() * (kPi / 2 + top) / (2 * kPi))));
    for (int i = 0; i <= steps; ++i) {
      const double angle = -kPi / 2 + (top + kPi / 2) * i / steps;
      profile.emplace_back(i == 0 ? 0.0 : r * std::cos(angle), r * std::sin(angle));
    }
    profile.emplace_back(neck, length);
    profile.emplace_back(0.0, length);
    return lathe(profile, n());
  }

  /// A rectangular bar through a rectangular tube.
  void prism(const std::string& a, const std::string& b, const Place& place, double w, double d, double h,
             double reach = 2.0) {
    const double g = gap(2 * w), wall = 0.4 * w;
    add(a, place(extrusion(rectangle(-w - g - wall, -d - g - wall, w + g + wall, d + g + wall),
                           {rectangle(-w - g, -d - g, w + g, d + g)}, -h, h)));
    add(b, place(box({-w, -d, -reach * h}, {w, d, reach * h})));
    truth(a, b, JointType::kPrismatic, place);
    slides();
  }

  /// A square peg in a blind square hole.
  void peg(const std::string& a, const std::string& b, const Place& place, double w, double depth, double reach) {
    const double g = gap(2 * w), o = 2.0 * w;
    add(a, place(cup(rectangle(-o, -o, o, o), rectangle(-w - g, -w - g, w + g, w + g), -depth - w, -depth - g, 0.0)));
    add(b, place(box({-w, -w, -depth}, {w, w, reach})));
    truth(a, b, JointType::kFixed, place);
  }

  /// A block with a blind hole; loops of equal count.
  static Shell cup(const Loop& outer, const Loop& inner, double bottom, double floor, double top) {
    Shell out;
    const auto m = static_cast<Index>(outer.size());
    for (const auto& [loop, z] : {std::pair(&outer, bottom), {&outer, top}, {&inner, top}, {&inner, floor}})
      for (const auto& p : *loop) out.vertices.emplace_back(p.x(), p.y(), z);
    const auto add_triangle = [&](Index i, Index j, Index k) { out.triangles.push_back({i, j, k}); };
    for (Index row = 0; row < 3; ++row)
      for (Index i = 0; i < m; ++i) {
        const Index j = (i + 1) % m, base = row * m;
        add_triangle(base + i, base + j, base + m + j);
        add_triangle(base + i, base + m + j, base + m + i);
      }
    for (Index i = 2; i < m; ++i) {
      add_triangle(0, i, i - 1);
      add_triangle(3 * m, 3 * m + i - 1, 3 * m + i);
    }
    out.idle.assign(out.triangles.size(), 0);
    return out;
  }

  struct Part {
    std::string name;
    std::vector<Shell> shells;
  };

  Variant v;
  std::vector<Part> parts;
  std::vector<TrueJoint> joints;
};

// The assemblies.

/// Base, two arms, shade: a turntable, two hinges, a ball.
void lamp(Builder& b) {
  const Vec3 y = Vec3::UnitY();
  b.add("base", lathe({{0, 0}, {0.12, 0}, {0.12, 0.02}, {0, 0.02}}, b.n()));
  b.add("base", lathe({{0, 0.01}, {0.005, 0.01}, {0.005, 0.045}, {0, 0.045}}, b.n()));
  b.hinge("column", "base", at({0, 0, 0.06}), 0.012, 0.014);
  b.bar("column", {0.018, 0, 0.06}, {0.06, 0, 0.06}, 0.008);
  b.bar("column", {0.057, 0, 0.06}, {0.057, 0, 0.15}, 0.008);
  b.hinge("column", "arm 1", at({0.057, 0, 0.165}, y), 0.01, 0.012);
  b.range_unknown();
  b.bar("arm 1", {0.057, 0.0165, 0.165}, {0.057, 0.04, 0.165}, 0.006);
  b.bar("arm 1", {0.057, 0.04, 0.165}, {-0.1, 0.04, 0.4}, 0.008);
  b.bar("arm 1", {-0.1, 0.04, 0.4}, {-0.1, 0.018, 0.4}, 0.006);
  b.hinge("arm 2", "arm 1", at({-0.1, 0, 0.4}, y), 0.01, 0.012);
  b.range_unknown();
  b.bar("arm 2", {-0.1, 0, 0.415}, {0.044, 0, 0.498}, 0.006);
  b.ball("arm 2", "shade", at({0.07, 0, 0.5}, -Vec3::UnitZ()), 0.02);
  b.add("shade", at({0.07, 0, 0.45})(
                     lathe({{0, 0}, {0, -0.006}, {0.018, -0.006}, {0.085, -0.08}, {0.09, -0.08}, {0.02, 0}}, b.n())));
}

/// A swivel chair on castors. Every part is one shell.
void chair(Builder& b) {
  const double r = 0.014, g = b.gap(2 * r);
  // The stem slides and turns in the foot; the seat's hub turns on the stem between collar and disc.
  b.add("foot",
        lathe({{r + g, 0}, {0.05, 0}, {0.05, 0.02}, {0.03, 0.03}, {0.025, 0.2}, {r + g, 0.2}}, b.n(), b.v.phase));
  const double q = 0.01, k = b.gap(2 * q), low = 0.38, high = 0.43;
  b.add("stem", lathe({{0, -0.02},
                       {r, -0.02},
                       {r, 0.36},
                       {0.022, 0.36},
                       {0.022, low - k},
                       {q, low - k},
                       {q, high + k},
                       {0.018, high + k},
                       {0.018, high + k + 0.008},
                       {0, high + k + 0.008}},
                      b.n(), 0.0, {1, 0, 0, 0, 0, 0, 0, 0, 1}));
  b.add("seat", lathe({{q + k, low}, {0.05, low}, {0.2, low + 0.02}, {0.2, low + 0.05}, {0.04, high}, {q + k, high}},
                      b.n(), b.v.phase));
  b.truth("foot", "stem", JointType::kCylindrical, at({0, 0, 0.1}));
  b.turns();
  b.slides(0.2 - 0.36);  // the collar comes down on the foot
  b.truth("stem", "seat", JointType::kRevolute, at({0, 0, 0.405}));
  b.turns();
  // The back leans on a square post that slides in the seat's lug.
  b.prism("lug", "back", at({0.3, 0, 0.42}), 0.02, 0.01, 0.03, 3.0);
}

/// All six types in a row.
void brush_arm(Builder& b) {
  const Vec3 x = Vec3::UnitX(), y = Vec3::UnitY(), z = Vec3::UnitZ();
  b.peg("base", "column", at({0, 0, 0}), 0.03, 0.05, 0.2);
  b.bar("column", {0, 0.02, 0.19}, {0, 0.095, 0.19}, 0.02);
  const double gap = b.gap(0.06);
  b.hinge("arm", "column", at({0, 0.13, 0.19}, y), 0.02, 0.025);
  {  // In the plane across the hinge, from its axis: the board comes round to one side of the base or to the other.
    const double near_edge = 0.17, top = 0.19 + gap, bottom = top + 0.02, half_base = 0.06;
    const double r = std::hypot(near_edge, bottom), corner = std::hypot(half_base, 0.27);
    b.turns(std::asin(half_base / r) - std::asin(near_edge / r),
            2 * kPi - std::acos(top / corner) - std::asin(half_base / corner));
  }
  b.bar("arm", {0.01, 0.13, 0.156}, {0.16, 0.13, 0.156}, 0.015);
  b.prism("arm", "slide", at({0.2, 0.13, 0.19}, x), 0.02, 0.015, 0.05, 2.4);
  b.slides(b.sleeve_reach(0.02) - 0.08);  // its end meets the hinge
  b.bar("slide", {0.31, 0.13, 0.19}, {0.3415, 0.13, 0.19}, 0.012);
  b.slider("slide", "rod", at({0.37, 0.13, 0.19}, z), 0.02, 0.03, 2.5);
  b.slides(-kOpen, 0.16 - 0.06 - (0.02 + b.gap(0.04)) * std::sin(50 * kDegree));  // the ball's ring meets the sleeve
  b.bar("rod", {0.37, 0.13, 0.12}, {0.37, 0.13, 0.1}, 0.01);
  b.ball("brush", "rod", at({0.37, 0.13, 0.06}, z), 0.02);
  b.add("brush", at({0.37, 0.13, 0.0})(box({-0.06, -0.03, 0.0}, {0.06, 0.03, 0.02})));
  b.bar("brush", {0.345, 0.13, 0.01}, {0.345, 0.13, 0.055}, 0.006);
  b.add("board", box({0.17, -0.07, -0.02 - gap}, {0.57, 0.33, -gap}));
  b.truth("board", "brush", JointType::kPlanar, at({0.37, 0.13, -gap / 2}));
  b.slides_along(x, -kOpen, 0.17 - 0.06);  // the base comes along and meets the board
  b.slides_along(y);
  b.turns();
}

void humanoid(Builder& b) {
  const Vec3 x = Vec3::UnitX(), z = Vec3::UnitZ();
  b.add("torso", box({-0.12, -0.05, 0.95}, {0.12, 0.05, 1.4}));
  b.ball("torso", "head", at({0, 0, 1.46}, z), 0.03);
  b.bar("torso", {0.036, 0, 1.39}, {0.036, 0, 1.46}, 0.008);
  b.add("head", at({0, 0, 1.6})(sphere(0.09, b.n())));
  for (const double side : {-1.0, 1.0}) {
    const std::string s = side < 0 ? "left " : "right ";
    b.ball("torso", s + "thigh", at({side * 0.08, 0, 0.88}, -z), 0.04);
    b.range_unknown();
    b.bar("torso", {side * 0.08, 0.05, 0.88}, {side * 0.08, 0.05, 1.0}, 0.012);
    b.bar(s + "thigh", {side * 0.08, 0, 0.8}, {side * 0.08, 0, 0.54}, 0.06);
    b.bar(s + "thigh", {side * 0.08, 0, 0.55}, {side * 0.08, 0, 0.525}, 0.02);
    b.hinge(s + "thigh", s + "shin", at({side * 0.08, 0, 0.5}, x), 0.018, 0.02);
    b.range_unknown();
    b.bar(s + "shin", {side * 0.08 + 0.029, 0, 0.5}, {side * 0.08 + 0.05, 0, 0.5}, 0.02);
    b.bar(s + "shin", {side * 0.08 + 0.048, 0, 0.51}, {side * 0.08 + 0.048, 0, 0.1}, 0.02);
    b.add(s + "shin", box({side * 0.08, -0.05, 0.05}, {side * 0.08 + 0.06, 0.1, 0.11}));
    b.ball("torso", s + "arm", at({side * 0.17, 0, 1.36}, side * x), 0.03);
    b.bar("torso", {side * 0.11, 0.036, 1.36}, {side * 0.17, 0.036, 1.36}, 0.01);
    b.bar(s + "arm", {side * 0.24, 0, 1.36}, {side * 0.45, 0, 1.36}, 0.04);
    b.bar(s + "arm", {side * 0.445, 0, 1.36}, {side * 0.47, 0, 1.36}, 0.016);
    b.hinge(s + "arm", s + "forearm", at({side * 0.485, 0, 1.36}, z), 0.014, 0.016);
    b.bar(s + "forearm", {side * 0.485, 0, 1.383}, {side * 0.485, 0, 1.41}, 0.016);
    b.bar(s + "forearm", {side * 0.477, 0, 1.408}, {side * 0.75, 0, 1.408}, 0.016);
  }
}

void dog(Builder& b) {
  const Vec3 x = Vec3::UnitX(), y = Vec3::UnitY();
  b.add("body", box({-0.25, -0.06, 0.3}, {0.25, 0.06, 0.42}));
  for (const double fore : {-1.0, 1.0})
    for (const double side : {-1.0, 1.0}) {
      const std::string s = std::string(fore < 0 ? "hind " : "fore ") + (side < 0 ? "left " : "right ");
      const Vec3 hip(fore * 0.2, side * 0.09, 0.36), knee = hip + Vec3(fore * 0.02, side * 0.045, -0.16);
      b.bar("body", hip + Vec3(0, -side * 0.035, 0.0297), hip + Vec3(0, side * 0.005, 0.0297), 0.004);
      b.hinge("body", s + "thigh", at(hip, y), 0.018, 0.014);
      b.bar(s + "thigh", hip + Vec3(0, side * 0.023, 0), hip + Vec3(0, side * 0.045, 0), 0.02);
      b.bar(s + "thigh", hip + Vec3(0, side * 0.045, 0.01), knee + Vec3(0, 0, 0.023), 0.016);
      b.hinge(s + "thigh", s + "shin", at(knee, y), 0.015, 0.012);
      b.bar(s + "shin", knee + Vec3(0, side * 0.019, 0), knee + Vec3(0, side * 0.035, 0), 0.014);
      b.bar(s + "shin", knee + Vec3(0, side * 0.034, 0.007), knee + Vec3(0, side * 0.034, -0.15), 0.014);
    }
  b.ball("body", "tail", at({-0.29, 0, 0.4}, -x), 0.02);
  b.bar("body", {-0.24, 0.024, 0.4}, {-0.29, 0.024, 0.4}, 0.006);
  b.bar("tail", {-0.335, 0, 0.4}, {-0.5, 0, 0.5}, 0.015);
  b.hinge("body", "head", at({0.3, 0, 0.4}, y), 0.02, 0.03);
  {  // From the axis: the head is the box above (−0.03 … 0.15, 0.08), the body's corners are (−0.05, 0.02), (−0.05,
     // −0.1).
    const double lower = std::hypot(0.03, 0.08), corner = std::hypot(0.05, 0.1);
    b.turns(std::asin(0.02 / lower) + std::atan2(0.08, -0.03) - kPi,
            std::asin(0.08 / corner) + kPi - std::acos(0.05 / corner));
  }
  b.bar("body", {0.24, 0, 0.4}, {0.272, 0, 0.4}, 0.02);
  b.bar("head", {0.3, 0.041, 0.4}, {0.3, 0.07, 0.4}, 0.02);
  b.bar("head", {0.3, 0.065, 0.39}, {0.3, 0.065, 0.5}, 0.02);
  b.add("head", box({0.27, -0.05, 0.48}, {0.45, 0.08, 0.58}));
}

/// Two blades and a rivet; the blades also lie on each other. Every part is one shell.
void scissors(Builder& b) {
  const double r = 0.004, g = b.gap(2 * r), t = 0.003, hole = r + g;
  const auto blade = [&](double tilt, double z0) {
    Shell s = extrusion(stadium(0.011, -0.08, 0.1, b.n()), {circle(hole, b.n(), b.v.phase)}, z0, z0 + t);
    return s.placed(Eigen::AngleAxisd(tilt, Vec3::UnitZ()).toRotationMatrix(), Vec3::Zero());
  };
  b.add("blade 1", blade(0.3, -t - g / 2));
  b.add("blade 2", blade(-0.3, g / 2));
  const double h = t + g / 2 + g, e = h + 0.002, R = 0.007;
  b.add("rivet",
        lathe({{0, -e}, {R, -e}, {R, -h}, {r, -h}, {r, h}, {R, h}, {R, e}, {0, e}}, b.n(), 0.0, {1, 1, 0, 0, 0, 1, 1}));
  b.truth("blade 1", "blade 2", JointType::kPlanar, at({0, 0, 0}));  // in a closed chain: the rivet is left out
  b.slides_along(Vec3::UnitX());
  b.slides_along(Vec3::UnitY());
  b.turns();
  b.truth("blade 1", "rivet", JointType::kRevolute, at({0, 0, -t / 2}));
  b.turns();
  b.truth("blade 2", "rivet", JointType::kRevolute, at({0, 0, t / 2}));
  b.turns();
}

/// A slider crank: one closed loop. Every part is one shell but for the block and the crank.
void piston(Builder& b) {
  const Vec3 y = Vec3::UnitY();
  const double throw_ = 0.03, rod = 0.12, angle = 50 * kDegree;
  const Vec3 crank_pin(throw_ * std::sin(angle), 0, throw_ * std::cos(angle));
  const double top = crank_pin.z() + std::sqrt(rod * rod - crank_pin.x() * crank_pin.x());
  const Vec3 wrist(0, 0, top);
  // Main bearing and crank pin.
  b.hinge("block", "crank", at(Vec3(0, -0.06, 0), y), 0.015, 0.015);
  b.bar("crank", {0, -0.033, 0}, {0, -0.018, 0}, 0.016);
  const Vec3 web_end = crank_pin + Vec3(0, -0.022, 0);
  b.bar("crank", Vec3(0, -0.022, 0) - 0.3 * crank_pin, web_end + 0.2 * crank_pin, 0.008);
  {
    const double r = 0.009, g = b.gap(2 * r), h = 0.007;
    const Place p = at(crank_pin, y);
    b.add("crank", p(lathe({{0, -0.024},
                            {0.013, -0.024},
                            {0.013, -h - g},
                            {r, -h - g},
                            {r, h + g},
                            {0.013, h + g},
                            {0.013, 0.015},
                            {0, 0.015}},
                           b.n())));
    const Vec3 along = (wrist - crank_pin).normalized();
    const double length = (wrist - crank_pin).norm(), q = 0.007, k = b.gap(2 * q);
    // The rod lies in the plane of the crank: x along the rod, z along y.
    Place lie = at(crank_pin, y, along);
    b.add("rod",
          lie(extrusion(stadium(0.016, 0.0, length, b.n()),
                        {circle(r + g, b.n(), b.v.phase), circle(q + k, b.n(), b.v.phase, {length, 0})}, -h, h)));
    b.truth("crank", "rod", JointType::kRevolute, p);
    b.turns();
    // The wrist pin turns in the rod and is caught by the piston's two walls, of which it is a part.
    const Place w = at(wrist, y);
    b.add("piston", w(lathe({{0, -0.014},
                             {0.012, -0.014},
                             {0.012, -h - k},
                             {q, -h - k},
                             {q, h + k},
                             {0.012, h + k},
                             {0.012, 0.014},
                             {0, 0.014}},
                            b.n())));
    b.truth("rod", "piston", JointType::kRevolute, w);
    // The rod's side, 0.016 from its axis, meets the lower edge of the piston, (±0.035, 0.022) from the pin.
    const double now = std::atan2(along.z(), -along.x()),  // below the horizontal
        meets = std::atan2(0.022, 0.035) - std::asin(0.016 / std::hypot(0.022, 0.035));
    b.turns(-(kPi - now + meets), now + meets);
  }
  const double bore = 0.035, g = b.gap(2 * bore), low = wrist.z() + 0.022;
  b.add("piston", lathe({{0, low}, {bore, low}, {bore, low + 0.03}, {0, low + 0.03}}, b.n()));
  for (const double side : {-1.0, 1.0})
    b.bar("piston", wrist + Vec3(0, side * 0.0125, -0.004), wrist + Vec3(0, side * 0.0125, 0.026), 0.004);
  b.add("block", lathe({{bore + g, low - 0.01}, {0.05, low - 0.01}, {0.05, low + 0.08}, {bore + g, low + 0.08}}, b.n(),
                       b.v.phase));
  b.bar("block", {0, -0.048, low + 0.02}, {0, -0.065, low + 0.02}, 0.01);
  b.bar("block", {0, -0.06, low + 0.025}, {0, -0.06, 0.02}, 0.01);
  b.truth("block", "piston", JointType::kCylindrical, at(Vec3(0, 0, low + 0.015)));
  b.turns();
  b.slides();
}

/// A cabinet with two drawers, one half open and one nearly closed.
void drawer(Builder& b) {
  const double w = 0.2, h = 0.08, g = b.gap(2 * h), wall = 0.015, depth = 0.4;
  const Place front = at(Vec3::Zero(), -Vec3::UnitY(), Vec3::UnitX());  // z comes out of the cabinet, its y is up
  const double pitch = 2 * (h + g) + wall;
  Loop outline = rectangle(-w - g - wall, -h - g - wall, w + g + wall, pitch + h + g + wall);
  b.add("cabinet",
        front(extrusion(
            outline, {rectangle(-w - g, -h - g, w + g, h + g), rectangle(-w - g, pitch - h - g, w + g, pitch + h + g)},
            -depth, 0.0)));
  for (int i = 0; i < 2; ++i) {
    const std::string name = i == 0 ? "lower" : "upper";
    const double out = i == 0 ? 0.2 : 0.03;
    Shell d = Builder::cup(rectangle(-w, out - depth, w, out),
                           rectangle(-w + 0.01, out - depth + 0.01, w - 0.01, out - 0.01), -h, -h + 0.01, h);
    // The drawer's own y comes out, its z is up.
    b.add(name, front(at(Vec3(0, i * pitch, 0), Vec3::UnitY(), -Vec3::UnitX())(d)));
    b.truth("cabinet", name, JointType::kPrismatic, {front.R, front(Vec3(0, i * pitch, 0))});
    b.slides();  // the cabinet has no back
  }
}

/// A ball hitch and a clevis with its pin. Every part is one shell but for the coupler.
void hitch(Builder& b) {
  const Vec3 z = Vec3::UnitZ(), y = Vec3::UnitY();
  b.ball("coupler", "tongue", at({0, 0, 0}, -z), 0.025, 60 * kDegree);
  b.bar("coupler", {0.03, 0, 0}, {0.2, 0, 0}, 0.02);
  const double r = 0.015, g = b.gap(2 * r);
  const double near = 0.0203 + std::max(0.0, g), far = near + 0.012, beside = near + 0.005 - 0.02;
  b.slider("coupler", "pin", at({0.22, 0, 0}, y), r, 0.02, 1.8);
  b.slides(-beside);  // the clevis comes along and meets the sleeve
  b.add("clevis", at({0.22, 0, 0}, y, Vec3::UnitX())(extrusion(stadium(0.03, 0.0, 0.15, b.n()),
                                                               {circle(r + g, b.n(), b.v.phase)}, near + 0.005, far)));
  b.truth("clevis", "pin", JointType::kCylindrical, at({0.22, 0.5 * (near + 0.005 + far), 0}, y));
  b.turns();
  b.slides(-kOpen, beside);
}

/// A door on three hinges, its pins on the frame.
void door(Builder& b) {
  b.add("frame", box({-0.1, -0.05, 0}, {-0.03, 0.05, 2.0}));
  b.add("door", box({0.03, -0.02, 0.02}, {0.8, 0.02, 1.98}));
  const double r = 0.008, h = 0.03;
  for (const double height : {0.3, 1.0, 1.7}) {
    b.hinge("door", "frame", at({0, 0, height}), r, h);
    b.bar("door", {0.011, 0, height}, {0.04, 0, height}, 0.01);
    b.bar("frame", {0, 0, height + h + 0.0035}, {0, 0, height + h + 0.02}, 0.006);
    b.bar("frame", {0.003, 0, height + h + 0.018}, {-0.05, 0, height + h + 0.018}, 0.006);
  }
  b.joints.clear();
  b.truth("door", "frame", JointType::kRevolute, at({0, 0, 1.0}));
  const double edge = std::hypot(0.03, 0.05);  // of the frame; the door's face is 0.02 from the plane of the axis
  const double opens = std::atan2(0.05, -0.03) - std::asin(0.02 / edge);
  b.turns(-opens, opens);
}

void sliding_plate(Builder& b) {
  const double g = b.gap(0.2);
  b.add("table", box({-0.4, -0.3, -0.05}, {0.4, 0.3, 0}));
  b.add("plate", at(Vec3(0.1, 0.05, 0), Vec3::UnitZ(), Vec3(0.9, 0.3, 0))(box({-0.1, -0.1, g}, {0.1, 0.1, g + 0.02})));
  const double k = b.gap(0.06);
  b.add("puck", at(Vec3(-0.2, -0.1, 0))(lathe({{0, k}, {0.03, k}, {0.03, 0.02}, {0, 0.02}}, b.n())));
  // A square and a circle have no axes of their own: how far they slide along those found no formula tells.
  b.truth("table", "plate", JointType::kPlanar, at({0.1, 0.05, g / 2}));
  b.turns();
  b.truth("table", "puck", JointType::kPlanar, at({-0.2, -0.1, k / 2}));
  b.turns();
}

void welded_pair(Builder& b) { b.peg("block", "post", at({0, 0, 0}), 0.05, 0.08, 0.3); }

/// Beads on no string: neighbours touch at a point, overlap by 1 % or stand 1 % apart.
void snake(Builder& b) {
  double x = 0.0;
  const double r = 0.05;
  for (int i = 0; i < 8; ++i) {
    b.add("bead " + std::to_string(i + 1), at({x, 0, 0})(sphere(r, b.n(), i % 2 ? b.v.phase : 0.0)));
    x += 2 * r * (1.0 + 0.01 * (i % 3 - 1)) + std::max(0.0, b.gap(2 * r));
  }
}

// Held out: thresholds were not chosen on these.

void telescope(Builder& b) {
  const auto tube = [&](double inner, double outer, double z0, double z1, double phase) {
    return lathe({{inner, z0}, {outer, z0}, {outer, z1}, {inner, z1}}, b.n(), phase);
  };
  const double g1 = b.gap(0.06), g2 = b.gap(0.05);
  b.add("outer", tube(0.03 + g1, 0.035, 0, 0.3, b.v.phase));
  b.add("middle", tube(0.025 + g2, 0.03, 0.1, 0.4, 0.0));
  b.add("inner", lathe({{0, 0.25}, {0.025, 0.25}, {0.025, 0.5}, {0, 0.5}}, b.n(), b.v.phase));
  b.truth("outer", "middle", JointType::kCylindrical, at({0, 0, 0.2}));
  b.turns();
  b.slides();
  b.truth("middle", "inner", JointType::kCylindrical, at({0, 0, 0.325}));
  b.turns();
  b.slides();
}

/// A ring in a ring in a fork, on journals with flanges.
void gimbal(Builder& b) {
  const Vec3 x = Vec3::UnitX(), y = Vec3::UnitY();
  for (const double side : {-1.0, 1.0}) {
    b.hinge("fork", "ring", at(side * 0.2 * x, x), 0.012, 0.01);
    b.bar("fork", side * 0.2 * x - Vec3(0, 0, 0.017), side * 0.2 * x - Vec3(0, 0, 0.25), 0.012);
    b.hinge("ring", "gyro", at(side * 0.12 * y, y), 0.012, 0.01);
    b.bar("gyro", side * 0.103 * y, side * 0.03 * y, 0.01);
  }
  b.bar("fork", {-0.21, 0, -0.25}, {0.21, 0, -0.25}, 0.012);
  for (const double side : {-1.0, 1.0}) {
    b.bar("ring", {side * 0.183, 0, 0}, {side * 0.15, 0, 0}, 0.01);
    b.bar("ring", {side * 0.152, 0, 0}, {side * 0.152, 0, 0.06}, 0.01);
  }
  b.bar("ring", {-0.157, 0, 0.06}, {0.157, 0, 0.06}, 0.01);
  b.bar("ring", {0, -0.12, 0.06}, {0, 0.12, 0.06}, 0.01);
  for (const double side : {-1.0, 1.0}) b.bar("ring", {0, side * 0.12, 0.06}, {0, side * 0.12, 0.017}, 0.01);
  b.add("gyro", lathe({{0, -0.01}, {0.05, -0.01}, {0.05, 0.01}, {0, 0.01}}, b.n()));
  b.joints.clear();
  b.truth("fork", "ring", JointType::kRevolute, at(Vec3::Zero(), x));
  b.turns();
  b.truth("ring", "gyro", JointType::kRevolute, at(Vec3::Zero(), y));
  b.turns();
}

/// A dovetail slide, and a wheel turning on a stub axle with a cone at its end. Every part is one shell.
void dovetail(Builder& b) {
  const double w = 0.03, g = b.gap(2 * w);
  const auto tail = [&](double o) {
    return Loop{{-w - o, -0.02 - o}, {w + o, -0.02 - o}, {0.6 * w + o, 0.0}, {-0.6 * w - o, 0.0}};
  };
  // The rail's groove is open above: its outline goes around the groove.
  const Loop t = tail(g);
  const Loop rail = {{-0.06, -0.05}, {0.06, -0.05}, {0.06, 0.0}, t[2], t[1], t[0], t[3], {-0.06, 0.0}};
  b.add("rail", extrusion(rail, {}, -0.15, 0.15));
  b.add("carriage", extrusion(tail(0.0), {}, -0.05, 0.08));
  b.truth("rail", "carriage", JointType::kPrismatic, at({0, -0.01, 0.015}));
  b.slides();
  const double r = 0.012, k = b.gap(2 * r);
  const Place axle = at({0.3, 0, 0}, Vec3::UnitX());
  b.add("axle", axle(lathe({{0, -0.06},
                            {0.02, -0.06},
                            {0.02, -0.02 - k},
                            {r, -0.02},
                            {r, 0.02},
                            {0.02, 0.028 + k},
                            {0.02, 0.04},
                            {0, 0.04}},
                           b.n())));
  b.add("wheel",
        axle(lathe({{r + k, -0.02}, {0.02 + k, -0.02}, {0.06, -0.015}, {0.06, 0.02}, {0.02, 0.028}, {r + k, 0.02}},
                   b.n(), b.v.phase)));
  b.truth("axle", "wheel", JointType::kRevolute, at({0.3, 0, 0}, Vec3::UnitX()));
  b.turns();
}

/// A stack of three plates, and a T-shaped peg in a T-shaped blind hole.
void stack(Builder& b) {
  const double g = b.gap(0.1);
  b.add("lower", box({-0.2, -0.2, -0.04}, {0.2, 0.2, 0}));
  b.add("middle", lathe({{0, g}, {0.1, g}, {0.1, 0.02 + g}, {0, 0.02 + g}}, b.n()));
  b.add("upper", at(Vec3(0.02, 0, 0), Vec3::UnitZ(),
                    Vec3(1, 1, 0))(box({-0.05, -0.05, 0.02 + 2 * g}, {0.05, 0.05, 0.05 + 2 * g})));
  b.truth("lower", "middle", JointType::kPlanar, at({0, 0, g / 2}));
  b.turns();
  b.truth("middle", "upper", JointType::kPlanar, at({0.02, 0, 0.02 + 1.5 * g}));
  b.turns();
  const double k = b.gap(0.04);
  const auto tee = [](double o) {
    return Loop{{-0.04 - o, -0.02 - o}, {0.04 + o, -0.02 - o},  {0.04 + o, 0.02 + o},   {0.015 + o, 0.02 + o},
                {0.015 + o, 0.06 + o},  {-0.015 - o, 0.06 + o}, {-0.015 - o, 0.02 + o}, {-0.04 - o, 0.02 + o}};
  };
  const Place far = at({0.5, 0, 0});
  b.add("socket", far(extrusion(rectangle(-0.08, -0.06, 0.08, 0.1), {tee(k)}, 0.0, 0.05)));
  b.add("key", far(extrusion(tee(0.0), {}, -0.03, 0.1)));
  b.truth("socket", "key", JointType::kPrismatic, far);
  b.slides();
}

/// Two balls on one rod, as in a drop link.
void drop_link(Builder& b) {
  const Vec3 x = Vec3::UnitX();
  b.ball("left eye", "rod", at({-0.1, 0, 0}, x), 0.015, 40 * kDegree);
  b.bar("rod", {-0.07, 0, 0}, {0.07, 0, 0}, 0.008);
  b.ball("right eye", "rod", at({0.1, 0, 0}, -x), 0.02, 55 * kDegree);
  b.bar("left eye", {-0.1, 0, 0.018}, {-0.1, 0, 0.1}, 0.006);
  b.bar("right eye", {0.1, 0, 0.0245}, {0.1, 0, 0.1}, 0.007);
}

/// A bolt in a nut.
void screw(Builder& b) {
  const double r = 0.01, depth = 0.003, pitch = 0.004 / (2 * kPi), g = b.gap(2 * r);
  b.add("bolt", thread(r, depth, pitch, -0.03, 0.03, b.n(), 0.0, false));
  b.add("nut", thread(r + g, depth, pitch, -0.008, 0.008, b.n(), b.v.phase, true, 0.02));
  b.truth("bolt", "nut", JointType::kCylindrical, at({0, 0, 0}), pitch);
  b.turns();
}

// Drawn after the method was settled on all of the above.

/// A left-handed spindle of a coarse pitch between two collars, with its nut off the middle.
void spindle(Builder& b) {
  const double r = 0.012, depth = 0.0035, pitch = -0.0075 / (2 * kPi), end = 0.05, low = -0.018, high = 0.006;
  b.add("spindle", thread(r, depth, pitch, -end, end, b.n(), 0.0, false));
  for (const double side : {-1.0, 1.0}) {
    const double z = side * (end + 0.004);
    b.add("spindle", lathe({{0, z - 0.005}, {0.02, z - 0.005}, {0.02, z + 0.005}, {0, z + 0.005}}, b.n()));
  }
  b.add("nut", thread(r + b.gap(2 * r), depth, pitch, low, high, b.n(), b.v.phase, true, 0.025));
  b.truth("spindle", "nut", JointType::kCylindrical, at({0, 0, 0}), pitch);
  // The collars' inner faces are 1 mm inside the ends of the thread.
  b.turns((end - 0.001 - high) / pitch, (-end + 0.001 - low) / pitch);
}

/// A flat bolt with a head and a handle in its housing.
void latch(Builder& b) {
  b.prism("housing", "bolt", at(Vec3::Zero(), Vec3::UnitX()), 0.01, 0.006, 0.025, 2.4);
  b.add("bolt", box({0.045, -0.009, -0.016}, {0.05, 0.009, 0.016}));
  b.bar("bolt", {-0.056, 0, 0}, {-0.056, 0, 0.05}, 0.008);
  b.slides(0.025 - 0.045, 0.052 - 0.025);  // head and handle meet the housing's ends
}

/// An arm on a post between two stops.
void gate(Builder& b) {
  b.hinge("post", "arm", at(Vec3::Zero()), 0.01, 0.015);
  b.bar("arm", {0, 0, 0.0205}, {0, 0, 0.04}, 0.008);
  b.bar("arm", {0, 0, 0.036}, {0.12, 0, 0.036}, 0.008);
  b.add("post", box({-0.1, -0.1, -0.035}, {0.1, 0.1, -0.03}));
  b.add("post", box({0.07, 0.05, -0.032}, {0.09, 0.09, 0.05}));
  b.add("post", box({-0.09, -0.08, -0.032}, {-0.06, -0.05, 0.05}));
  // The arm's sides, 0.004 from the axis, meet the corners (0.09, 0.05) and (−0.06, −0.08).
  b.turns(std::atan2(-0.08, -0.06) + std::asin(0.004 / 0.1),
          std::atan2(0.05, 0.09) - std::asin(0.004 / std::hypot(0.09, 0.05)));
}

/// A wheel in a fork that swivels under a plate.
void caster(Builder& b) {
  b.hinge("plate", "fork", at({0, 0, 0.1}), 0.012, 0.012);
  b.add("plate", box({-0.04, -0.04, 0.13}, {0.04, 0.04, 0.135}));
  b.bar("fork", {0, 0, 0.083}, {0, 0, 0.075}, 0.01);
  b.bar("fork", {0, -0.031, 0.075}, {0, 0.031, 0.075}, 0.008);
  for (const double side : {-1.0, 1.0}) {
    b.bar("fork", {0, side * 0.028, 0.079}, {0, side * 0.028, 0.0275}, 0.006);
    b.bar("fork", {0, side * 0.0125, 0.03}, {0, side * 0.031, 0.03}, 0.005);
  }
  b.hinge("wheel", "fork", at({0, 0, 0.03}, Vec3::UnitY()), 0.006, 0.01);
  b.add("wheel", at({0, 0, 0.03},
                    Vec3::UnitY())(lathe({{0.01, -0.008}, {0.035, -0.008}, {0.035, 0.008}, {0.01, 0.008}}, b.n())));
}

/// Two yokes on a cross.
void cardan(Builder& b) {
  const Vec3 x = Vec3::UnitX(), y = Vec3::UnitY(), z = Vec3::UnitZ();
  for (const double end : {-1.0, 1.0}) {
    const std::string yoke = end < 0 ? "lower yoke" : "upper yoke";
    const Vec3 along = end < 0 ? x : y;
    for (const double side : {-1.0, 1.0}) {
      const Vec3 ear = side * 0.04 * along;
      b.hinge(yoke, "cross", at(ear, along), 0.006, 0.005);
      b.bar(yoke, ear + end * 0.008 * z, ear + end * 0.06 * z, 0.006);
    }
    b.bar(yoke, -0.043 * along + end * 0.06 * z, 0.043 * along + end * 0.06 * z, 0.006);
    b.bar(yoke, end * 0.058 * z, end * 0.1 * z, 0.01);
    b.bar("cross", -0.034 * along, 0.034 * along, 0.006);
  }
  b.joints.clear();  // how far it bends no short formula tells
  b.truth("lower yoke", "cross", JointType::kRevolute, at(Vec3::Zero(), x));
  b.truth("upper yoke", "cross", JointType::kRevolute, at(Vec3::Zero(), y));
}

struct Recipe {
  std::function<void(Builder&)> build;
  bool compound;
};

const std::map<std::string, Recipe>& recipes() {
  static const std::map<std::string, Recipe> all = {{"lamp", {lamp, true}},
                                                    {"chair", {chair, false}},
                                                    {"brush arm", {brush_arm, true}},
                                                    {"humanoid", {humanoid, true}},
                                                    {"dog", {dog, true}},
                                                    {"scissors", {scissors, false}},
                                                    {"piston", {piston, true}},
                                                    {"drawer", {drawer, false}},
                                                    {"hitch", {hitch, true}},
                                                    {"door", {door, true}},
                                                    {"sliding plate", {sliding_plate, false}},
                                                    {"welded pair", {welded_pair, false}},
                                                    {"snake", {snake, false}},
                                                    {"telescope", {telescope, false}},
                                                    {"gimbal", {gimbal, true}},
                                                    {"dovetail", {dovetail, false}},
                                                    {"stack", {stack, false}},
                                                    {"drop link", {drop_link, true}},
                                                    {"screw", {screw, false}},
                                                    {"spindle", {spindle, true}},
                                                    {"latch", {latch, true}},
                                                    {"gate", {gate, true}},
                                                    {"caster", {caster, true}},
                                                    {"cardan", {cardan, true}}};
  return all;
}

// Variants.

double box_diagonal(const std::vector<Vec3>& points) {
  Eigen::AlignedBox3d box;
  for (const Vec3& p : points) box.extend(p);
  return box.diagonal().norm();
}

/// All shells of a part as one surface. @pre at least one shell
SurfaceMesh part_surface(const Builder::Part& part, const Variant& v) {
  SurfaceMesh out;
  for (const Shell& shell : part.shells) {
    const auto offset = static_cast<Index>(out.vertices.size());
    out.vertices.insert(out.vertices.end(), shell.vertices.begin(), shell.vertices.end());
    for (std::size_t i = 0; i < shell.triangles.size(); ++i) {
      if (v.open && shell.idle[i]) continue;
      const Triangle& t = shell.triangles[i];
      out.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
    }
  }
  return out;
}

/// Normal numbers by Box and Muller: the standard leaves its own distribution's algorithm open.
double normal_number(std::mt19937& random) {
  const double u = (random() + 1.0) / 4294967297.0, w = random() / 4294967296.0;
  return std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * kPi * w);
}

void vary(SurfaceMesh& part, const Variant& v, std::mt19937& random) {
  const double sigma = v.jitter * box_diagonal(part.vertices) / std::sqrt(3.0);
  for (Vec3& p : part.vertices)
    for (double& c : p) c += sigma * normal_number(random);
  if (v.shuffled)
    for (std::size_t i = part.triangles.size(); i > 1; --i)
      std::swap(part.triangles[i - 1], part.triangles[random() % i]);
  if (v.soup) {
    SurfaceMesh soup;
    for (const Triangle& t : part.triangles) {
      const auto first = static_cast<Index>(soup.vertices.size());
      for (const Index i : t) soup.vertices.push_back(part.vertices[static_cast<std::size_t>(i)]);
      soup.triangles.push_back({first, first + 1, first + 2});
    }
    part = std::move(soup);
  }
  for (Vec3& p : part.vertices) p = v.rotation * p * v.scale + v.translation;
}

}  // namespace

const std::vector<std::string>& tuning_names() {
  static const std::vector<std::string> names = {"lamp",          "chair",       "brush arm", "humanoid", "dog",
                                                 "scissors",      "piston",      "drawer",    "hitch",    "door",
                                                 "sliding plate", "welded pair", "snake",     "screw"};
  return names;
}

const std::vector<std::string>& held_out_names() {
  static const std::vector<std::string> names = {"telescope", "gimbal", "dovetail", "stack",  "drop link",
                                                 "spindle",   "latch",  "gate",     "caster", "cardan"};
  return names;
}

MadeAssembly make(const std::string& name, const Variant& variant) {
  const auto recipe = recipes().find(name);
  if (recipe == recipes().end()) throw InvalidArgument("assemblies::make: there is no assembly \"" + name + "\"");
  Builder builder(variant);
  recipe->second.build(builder);

  MadeAssembly out;
  out.compound = recipe->second.compound;
  std::mt19937 random(variant.seed);
  if (variant.swapped) std::reverse(builder.parts.begin(), builder.parts.end());
  for (const auto& part : builder.parts) {
    SurfaceMesh surface = part_surface(part, variant);
    vary(surface, variant, random);
    append_group(surface, part.name, out.surface);
  }
  for (TrueJoint joint : builder.joints) {
    joint.origin = variant.rotation * joint.origin * variant.scale + variant.translation;
    joint.axis = variant.rotation * joint.axis;
    joint.pitch *= variant.scale;
    for (TrueRange& range : joint.ranges) {
      range.along = variant.rotation * range.along;
      if (range.freedom == TrueRange::Freedom::kTranslation)
        range.range = {variant.scale * range.range.low, variant.scale * range.range.high};
    }
    out.joints.push_back(joint);
  }
  out.diagonal = box_diagonal(out.surface.surface.vertices);
  return out;
}

}  // namespace limber::assemblies
