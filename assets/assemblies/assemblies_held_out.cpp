#include "assembly_builder.h"

namespace limber::assemblies {
namespace {

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

/// A dovetail slide, and a wheel turning on a short axle with a cone at its end. Every part is one shell.
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

/// Crank, coupler and rocker on a frame: a closed chain of four hinges. Each turns in a layer of its own, so that
/// the crank goes round.
void four_bar(Builder& b) {
  const Vec3 x = Vec3::UnitX(), y = Vec3::UnitY(), layer = 0.034 * y;
  const double r = 0.01, h = 0.012, crank = 0.05, coupler = 0.12, rocker = 0.09, ground = 0.13, angle = 60 * kDegree;
  const Vec3 fixed = Vec3::Zero(), far = ground * x, pin(crank * std::cos(angle), 0, crank * std::sin(angle));
  // Where the circles of coupler and rocker meet above the frame.
  const Vec3 between = far - pin;
  const double d = between.norm(), along = (d * d + coupler * coupler - rocker * rocker) / (2 * d);
  const Vec3 across = y.cross(between) / d;
  const Vec3 knee = pin + along * between / d - std::sqrt(coupler * coupler - along * along) * across;
  const auto hinge = [&](const std::string& a, const std::string& part, const Vec3& place) {
    b.hinge(a, part, at(place, y), r, h);
    b.range_unknown();
  };
  /// From the end of a shaft to a sleeve in the next layer.
  const auto link = [&](const std::string& part, const Vec3& from, const Vec3& to) {
    const Vec3 way = (to - from).normalized();
    b.bar(part, from + 0.016 * y, from + layer, 0.01);
    b.bar(part, from + layer - 0.005 * way, to + layer - 0.015 * way, 0.01);
  };
  hinge("frame", "crank", fixed);
  hinge("frame", "rocker", far);
  b.bar("frame", fixed + 0.015 * x, far - 0.015 * x, 0.01);
  link("crank", fixed, pin);
  link("rocker", far, knee);
  hinge("crank", "coupler", pin + layer);
  hinge("rocker", "coupler", knee + layer);
  for (const Vec3& end : {pin, knee}) b.bar("coupler", end + layer + 0.016 * y, end + 2 * layer, 0.01);
  const Vec3 way = (knee - pin).normalized();
  b.bar("coupler", pin + 2 * layer - 0.005 * way, knee + 2 * layer + 0.005 * way, 0.01);
}

}  // namespace

const std::map<std::string, Recipe>& held_out_recipes() {
  static const std::map<std::string, Recipe> all = {
      {"telescope", {telescope, false}}, {"gimbal", {gimbal, true}},       {"dovetail", {dovetail, false}},
      {"stack", {stack, false}},         {"drop link", {drop_link, true}}, {"spindle", {spindle, true}},
      {"latch", {latch, true}},          {"gate", {gate, true}},           {"caster", {caster, true}},
      {"cardan", {cardan, true}},        {"four-bar", {four_bar, true}}};
  return all;
}

}  // namespace limber::assemblies
