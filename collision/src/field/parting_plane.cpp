#include "field/parting_plane.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "limber/mesh/closest_point.h"
#include "tuning.h"

namespace limber::internal {
namespace {

// The lowest samples of two bodies, those of b seen from above, along one direction; in the frame of a.
struct Look {
  HeightView of_a{}, of_b{};
  LowestSamples a{}, b{};
  float fall = 0.0f;  // of one of them along the direction, m

  Look(const FieldView& b_in_a, const Vec3f& n) {
    const FieldQuery& query = b_in_a.query;
    const Vec3f down = b_in_a.turned_back(-n);
    const Vec3f then = down - b_in_a.turning().transpose() * n;
    for (int axis = 0; axis < 3; ++axis) {
      of_a.now[axis] = of_a.then[axis] = n[axis];
      of_b.now[axis] = down[axis], of_b.then[axis] = then[axis];
    }
    of_a.base[0] = of_a.base[1] = 0.0f;
    of_b.base[0] = -n.dot(b_in_a.shift);
    of_b.base[1] = of_b.base[0] - n.dot(Eigen::Map<const Vec3f>(query.shift));
    fall = std::abs(n.dot(Eigen::Map<const Vec3f>(query.fall)));
    a = lowest_samples(b_in_a.other->view(), of_a), b = lowest_samples(b_in_a.mine->view(), of_b);
  }
  float gap(int end) const { return a.height[end] + b.height[end] - fall; }
  // Of the fall, across the direction.
  float aside(const FieldView& b_in_a) const { return Eigen::Map<const Vec3f>(b_in_a.query.fall).norm() - fall; }
  // From b to a.
  Vec3f between(const FieldView& b_in_a, int end) const {
    const Index v = b_in_a.other->shell().sample_vertex(a.sample[end]),
                w = b_in_a.mine->shell().sample_vertex(b.sample[end]);
    const Vec3f apart = b_in_a.other->vertex(v) - b_in_a.placed(b_in_a.mine->vertex(w));
    return end == 0 ? apart : Vec3f(apart + b_in_a.other->swing(v) - b_in_a.motion(w));
  }
  // @param reach of contacts
  void leave_planes(float reach, FieldView& a_in_b, FieldView& b_in_a) const {
    a_in_b.query.above = of_a, b_in_a.query.above = of_b;
    for (int end = 0; end < 2; ++end) {
      a_in_b.query.above.base[end] += b.height[end] + aside(b_in_a) + (a_in_b.query.reach - reach);
      b_in_a.query.above.base[end] += a.height[end] + aside(b_in_a) + (b_in_a.query.reach - reach);
    }
  }
};

Vec3f middle(const DeformedPointshell& body) { return 0.5f * (body.low() + body.high()); }

}  // namespace

bool part(FieldView& a_in_b, FieldView& b_in_a, float reach, Parting* parting) {
  FieldQuery& query = b_in_a.query;
  query.above = a_in_b.query.above = {};
  const float noise = kNoise * static_cast<float>(b_in_a.mine->shell().longest_side());
  const float enough = reach + noise + query.curve;
  const bool known = parting != nullptr && !parting->direction.isZero(0.0);
  Vec3f nearest =
      known ? parting->direction.cast<float>() : Vec3f(middle(*b_in_a.other) - b_in_a.placed(middle(*b_in_a.mine)));
  Vec3f last = Vec3f::Zero();
  float best = -std::numeric_limits<float>::infinity(), now = best;
  const FieldTuning& tuning = collision_tuning().field;
  for (int i = 0, looks = known ? tuning.looks_apart / 2 : tuning.looks_apart; i < looks; ++i) {
    const float length = nearest.norm();
    if (!(length > noise)) break;
    const Look look(b_in_a, nearest / length);
    const int end = look.gap(1) < look.gap(0) ? 1 : 0;
    if (look.gap(end) > best) {
      best = look.gap(end);
      if (parting != nullptr) parting->direction = (nearest / length).cast<double>();
      now = look.gap(0) - look.aside(b_in_a);
      look.leave_planes(reach, a_in_b, b_in_a);
    }
    if (best > enough || (i > 0 && best >= static_cast<float>(tuning.looked_enough) * length)) break;
    const Vec3 next = look.between(b_in_a, end).cast<double>();
    const TrianglePoints corners{i > 0 ? Vec3(nearest.cast<double>()) : next, i > 0 ? Vec3(last.cast<double>()) : next,
                                 next};
    nearest = closest_on_triangle(Vec3::Zero(), corners).point.cast<float>(), last = next.cast<float>();
  }
  if (best > enough && parting != nullptr) parting->gap = static_cast<double>(now - noise);
  return best > enough;
}

}  // namespace limber::internal
