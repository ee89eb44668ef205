/// @file assembly_builder.h
/// What the drawn assemblies are put together from: bearings with their truth, and where they stand.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "assemblies.h"
#include "shells.h"

namespace limber::assemblies {

inline constexpr double kOpen = std::numeric_limits<double>::infinity();

/// Where a joint's own drawing is put: z along its axis.
struct Place {
  Mat3 R = Mat3::Identity();
  Vec3 t = Vec3::Zero();

  Shell operator()(const Shell& shell) const { return shell.placed(R, t); }
  Vec3 operator()(const Vec3& p) const { return R * p + t; }
};

/// Z along `axis`, x anywhere.
inline Place at(const Vec3& t, const Vec3& axis = Vec3::UnitZ()) {
  return {Eigen::Quaterniond::FromTwoVectors(Vec3::UnitZ(), axis).toRotationMatrix(), t};
}

/// Z along `axis`, x along `x`.
inline Place at(const Vec3& t, const Vec3& axis, const Vec3& x) {
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
    if (v.phase == 0.0 || v.phase == 0.5) swings(neck_meets_rim(r, half_arc));
  }

  /// How far a neck of 0.4 r leans until its side meets the edge of the ring. Both are polygons; the least is where a
  /// flat of the ring's or a corner of both is in line. @pre a phase of 0 or 0.5. Where the ring overlaps the ball, its
  /// edge lies inside the ball, and it is the corners at which the neck leaves the ball that first come down to the
  /// ring's face.
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

struct Recipe {
  void (*build)(Builder&);
  bool compound;  ///< parts are drawn as several shells
};

/// Per name: those that thresholds were chosen on, or the method was changed for.
const std::map<std::string, Recipe>& tuning_recipes();
/// Those that only judge.
const std::map<std::string, Recipe>& held_out_recipes();

}  // namespace limber::assemblies
