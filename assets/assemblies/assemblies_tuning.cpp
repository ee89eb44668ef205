#include "assembly_builder.h"

namespace limber::assemblies {
namespace {

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
    // A pin between two flanges, from `low` to `high` along its axis.
    const auto spool = [&](double flange, double pin, double half, double low, double high) {
      return lathe({{0, low},
                    {flange, low},
                    {flange, -half},
                    {pin, -half},
                    {pin, half},
                    {flange, half},
                    {flange, high},
                    {0, high}},
                   b.n());
    };
    b.add("crank", p(spool(0.013, r, h + g, -0.024, 0.015)));
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
    b.add("piston", w(spool(0.012, q, h + k, -0.014, 0.014)));
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

/// A bolt in a nut.
void screw(Builder& b) {
  const double r = 0.01, depth = 0.003, pitch = 0.004 / (2 * kPi), g = b.gap(2 * r);
  b.add("bolt", thread(r, depth, pitch, -0.03, 0.03, b.n(), 0.0, false));
  b.add("nut", thread(r + g, depth, pitch, -0.008, 0.008, b.n(), b.v.phase, true, 0.02));
  b.truth("bolt", "nut", JointType::kCylindrical, at({0, 0, 0}), pitch);
  b.turns();
}

}  // namespace

const std::map<std::string, Recipe>& tuning_recipes() {
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
                                                    {"screw", {screw, false}}};
  return all;
}

}  // namespace limber::assemblies
