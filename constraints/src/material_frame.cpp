#include "limber/constraints/material_frame.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "limber/core/cross_matrix.h"
#include "limber/core/error.h"
#include "limber/mesh/patch_samples.h"
#include "tuning.h"

namespace limber {
namespace {

Vec3 rest_point(const ModalModel& model, const SurfacePoint& at) { return deformed_point(model, at, {}); }

/// I⁺ of a patch: inverse on the directions that it extends around.
Mat3 pseudo_inverse(const Mat3& inertia) {
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(inertia);
  Mat3 inverse = Mat3::Zero();
  for (int i = 0; i < 3; ++i)
    if (eigen.eigenvalues()[i] > internal::kConstraintsTuning.rows.thin_patch * eigen.eigenvalues()[2])
      inverse += eigen.eigenvectors().col(i) * eigen.eigenvectors().col(i).transpose() / eigen.eigenvalues()[i];
  return inverse;
}

const ModalSurface& surface_of(const ModalModel& model, const SurfacePoint& at) {
  return at.surface == SurfacePoint::Surface::kRender ? model.render() : model.collision();
}

struct WeightedPoint {
  SurfacePoint at;
  double weight = 1.0;
};

/// What a patch is a mean over: the samples of a patch of vertices of one surface; else its points.
std::vector<WeightedPoint> weighted_points(const ModalModel& model, std::span<const SurfacePoint> patch) {
  const ModalSurface& s = surface_of(model, patch[0]);
  std::vector<bool> inside(s.rest.size(), false);
  bool vertices = true;
  for (const SurfacePoint& at : patch) {
    const auto corner = std::ranges::find(at.weight, 1.0) - at.weight.begin();
    vertices = vertices && corner < 3 && at.surface == patch[0].surface;
    if (!vertices) break;
    const Triangle& corners = s.triangles[static_cast<std::size_t>(at.triangle)];
    inside[static_cast<std::size_t>(corners[static_cast<std::size_t>(corner)])] = true;
  }
  std::vector<WeightedPoint> points;
  if (vertices)
    for (const auto& [triangle, at, weight] :
         patch_samples(s.triangles, inside, [&](std::size_t v) { return Vec3(s.rest[v].cast<double>()); }))
      points.push_back({{patch[0].surface, triangle, at}, weight});
  else
    for (const SurfacePoint& at : patch) points.push_back({at, 1.0 / static_cast<double>(patch.size())});
  return points;
}

/// Of all points of a patch, in the mean.
SkinInfluences mean_influences(const ModalModel& model, std::span<const WeightedPoint> patch) {
  std::vector<double> weights(static_cast<std::size_t>(model.data().skin->handles), 0.0);
  for (const auto& [at, share] : patch) {
    const Triangle& corners = surface_of(model, at).triangles[static_cast<std::size_t>(at.triangle)];
    for (std::size_t c = 0; c < 3; ++c) {
      const SkinInfluences& of = skin_influences(model, at.surface)[static_cast<std::size_t>(corners[c])];
      for (std::size_t i = 0; i < SkinInfluences::kMost; ++i)
        weights[of.handle[i]] += share * at.weight[c] * static_cast<double>(of.weight[i]);
    }
  }
  return skin_influences(weights);
}

/// Sums apart: in a vector in memory each would wait for the one before.
Vec3 times(const std::vector<Vec3>& shapes, std::span<const double> z) {
  double u = 0.0, v = 0.0, w = 0.0;
  for (std::size_t i = 0; i < shapes.size(); ++i)
    u += z[i] * shapes[i][0], v += z[i] * shapes[i][1], w += z[i] * shapes[i][2];
  return {u, v, w};
}

/// to = q x of so many vectors, in registers (cross_matrix.h says why).
void turn_vectors(const Quaternion& q, const double* x, int count, double* to) {
  const double tx = 2.0 * q.x, ty = 2.0 * q.y, tz = 2.0 * q.z, wx = tx * q.w, wy = ty * q.w, wz = tz * q.w,
               xx = tx * q.x, xy = ty * q.x, xz = tz * q.x, yy = ty * q.y, yz = tz * q.y, zz = tz * q.z;
  for (int i = 0; i < count; ++i, x += 3, to += 3) {
    const double u = x[0], v = x[1], w = x[2];
    to[0] = (1.0 - (yy + zz)) * u + (xy - wz) * v + (xz + wy) * w;
    to[1] = (xy + wz) * u + (1.0 - (xx + zz)) * v + (yz - wx) * w;
    to[2] = (xz - wy) * u + (yz + wx) * v + (1.0 - (xx + yy)) * w;
  }
}

HalfTurn half_of(const Vec3& r) {
  const double angle = r.norm();
  return {angle, std::cos(0.5 * angle), angle > 0.0 ? std::sin(0.5 * angle) / angle : 0.5};
}

/// exp([r]ₓ) by Rodrigues.
Mat3 rotation_by(const Vec3& r, const HalfTurn& half) {
  const Vec3 across = 2.0 * half.factor * half.factor * r;
  Mat3 R = across * r.transpose() + cross_matrix(2.0 * half.factor * half.cosine * r);
  R.diagonal().array() += 1.0 - across.dot(r);
  return R;
}

/// (sinc √v − sinc √u)/(u − v), u = ¼(|a| + |b|)², v = ¼(|a| − |b|)²: by its series where turns are small, else by that
/// of two ways to write it whose denominator is large.
double sinc_slope(const HalfTurn& a, const HalfTurn& b) {
  constexpr double kSmall = internal::kConstraintsTuning.rows.series_of_turns;
  const double half = 0.5 * (a.angle + b.angle), across = 0.5 * (a.angle - b.angle), u = half * half,
               v = across * across;
  const auto sinc = [](double x) { return x != 0.0 ? std::sin(x) / x : 1.0; };
  if (u - v > 0.25 * kSmall) return (sinc(across) - sinc(half)) / (u - v);
  if (u > kSmall) return (b.cosine * a.factor - a.cosine * b.factor) / (half * across);
  double e = 0.0, term = 1.0 / 6.0, sum = 1.0, power = 1.0;  // ±1/(2k + 1)!, Σ uʲ vᵏ⁻¹⁻ʲ, vᵏ⁻¹
  for (double k = 1.0; k < 17.0; ++k) {
    e += term * sum;
    term /= -(2.0 * k + 2.0) * (2.0 * k + 3.0);
    power *= v, sum = u * sum + power;
  }
  return e;
}

/// G of the Cayley vector G (b − a) of exp([b]ₓ) exp(−[a]ₓ), which is what exp turns by per unit of its vector where
/// both meet. With m = ½(a + b), halves' c = cos and s = the factor, and e = sinc_slope() the vector part of the
/// quaternion is ½(c_a s_b + c_b s_a)(b − a) + s_a s_b m × (b − a) + ½ e m m·(b − a).
Mat3 turning_between(const FrameInstant::Bend& start, const FrameInstant::Bend& end) {
  const HalfTurn &from = start.half, &to = end.half;
  const Vec3 &a = start.turned, &b = end.turned, m = 0.5 * (a + b);
  const double both = from.factor * to.factor, w = from.cosine * to.cosine + both * a.dot(b);
  return ((from.cosine * to.factor + to.cosine * from.factor) * Mat3::Identity() + 2.0 * both * cross_matrix(m) +
          sinc_slope(from, to) * m * m.transpose()) /
         w;
}

}  // namespace

MaterialFrame::MaterialFrame(const JointFrame& in_world) : rest_(in_world) {}

MaterialFrame::MaterialFrame(Index body, const JointFrame& in_body) : body_(body), rest_(in_body) {}

MaterialFrame::MaterialFrame(Index body, const ModalModel& model, const SurfacePoint& at, bool skinned) : body_(body) {
  validate(model, at);
  rest_.origin = rest_point(model, at);
  for (Index i = 0; i < model.modes(); ++i) displacement_.push_back(shape_at(model, at, i));
  for (std::size_t c = 0; skinned && c < 3; ++c) {
    if (at.weight[c] == 0.0) continue;
    SurfacePoint corner{.surface = at.surface, .triangle = at.triangle, .weight = {0.0, 0.0, 0.0}};
    corner.weight[c] = 1.0;
    const WeightedPoint whole{corner};
    Anchor anchor{mean_influences(model, {&whole, 1}), rest_point(model, corner), at.weight[c]};
    for (Index i = 0; i < model.modes(); ++i) anchor.shapes.push_back(shape_at(model, corner, i));
    anchors_.push_back(std::move(anchor));
  }
}

MaterialFrame::MaterialFrame(Index body, const ModalModel& model, std::span<const SurfacePoint> patch,
                             const JointFrame& in_body, bool skinned)
    : body_(body), rest_(in_body) {
  if (patch.empty()) throw InvalidArgument("MaterialFrame: the patch of \"" + model.name() + "\" has no points");
  for (const SurfacePoint& at : patch) validate(model, at);
  const std::vector<WeightedPoint> points = weighted_points(model, patch);
  Vec3 mean = Vec3::Zero();
  for (const auto& [at, weight] : points) mean += weight * rest_point(model, at);
  Mat3 inertia = Mat3::Zero();
  for (const auto& [at, weight] : points) {
    const Vec3 x = rest_point(model, at) - mean;
    inertia += weight * (x.squaredNorm() * Mat3::Identity() - x * x.transpose());
  }
  const Mat3 inverse = pseudo_inverse(inertia);
  for (Index i = 0; i < model.modes(); ++i) {
    Vec3 displacement = Vec3::Zero(), moment = Vec3::Zero();
    for (const auto& [at, weight] : points) {
      const Vec3 u = shape_at(model, at, i);
      displacement += weight * u;
      moment += weight * (rest_point(model, at) - mean).cross(u);
    }
    rotation_.push_back(inverse * moment);
    displacement_.push_back(displacement + rotation_.back().cross(in_body.origin - mean));
  }
  if (skinned) anchors_.push_back({mean_influences(model, points), in_body.origin, 1.0, displacement_});
}

Vec3 MaterialFrame::displace(std::span<const double> z) const { return times(displacement_, z); }

/// Of the origin, body frame.
Vec3 MaterialFrame::place(const BodyShape& shape) const {
  Vec3 p = Vec3::Zero();
  for (const Anchor& a : anchors_)
    p += a.share * shape.handles().position(a.influences, a.rest, times(a.shapes, shape.amplitudes()));
  return p;
}

/// g += Jᵀ f of the origin.
void MaterialFrame::add_rows(const BodyShape& shape, const Vec3& f_B, std::span<double> g) const {
  for (const Anchor& a : anchors_) {
    const Vec3 turned =
        shape.differentiated().add_rows(a.influences, a.rest, times(a.shapes, shape.amplitudes()), a.share * f_B, g);
    for (std::size_t i = 0; i < g.size(); ++i) g[i] += a.shapes[i].dot(turned);
  }
}

void MaterialFrame::add_rows(const BodyStates& states, StepTime when, const Vec3& f_B, std::span<double> g) const {
  if (when != StepTime::kMiddle) return add_rows(states.shape(body_, when), f_B, g);
  for (const auto& [shape, weight] : states.shapes_between(body_)) add_rows(shape, weight * f_B, g);
}

std::span<const Vec3> MaterialFrame::displacements(const BodyStates& states, std::vector<Vec3>& room) const {
  if (anchors_.empty()) return displacement_;
  std::vector<double> row(displacement_.size());
  room.assign(displacement_.size(), Vec3::Zero());
  for (int axis = 0; axis < 3; ++axis) {
    std::fill(row.begin(), row.end(), 0.0);
    add_rows(states, StepTime::kEnd, Vec3::Unit(axis), row);
    for (std::size_t i = 0; i < row.size(); ++i) room[i][axis] = row[i];
  }
  return room;
}

Vec3 MaterialFrame::turn(std::span<const double> z) const { return times(rotation_, z); }

Vec3 MaterialFrame::position(const BodyStates& states, StepTime when) const {
  if (when == StepTime::kMiddle) return 0.5 * (position(states, StepTime::kStart) + position(states, StepTime::kEnd));
  if (!anchors_.empty()) return states.pose(body_, when) * place(states.shape(body_, when));
  return states.pose(body_, when) * (rest_.origin + displace(states.amplitudes(body_, when)));
}

Vec3 MaterialFrame::velocity(const BodyStates& states, StepTime when) const {
  if (body_ < 0) return Vec3::Zero();
  const RigidTransform& X = states.pose(body_, when);
  const std::span<const double> rates = states.rates(body_, when);
  Vec3 bending = Vec3::Zero();
  for (const Anchor& a : anchors_) {
    const BodyShape shape = states.shape(body_, when);
    bending += a.share * shape.differentiated().velocity(a.influences, a.rest, times(a.shapes, shape.amplitudes()),
                                                         times(a.shapes, rates), rates);
  }
  if (anchors_.empty()) bending = displace(rates);
  return states.velocity(body_, when) + states.angular_velocity(body_, when).cross(position(states, when) - X.p) +
         X.q * bending;
}

Vec3 MaterialFrame::turn(const BodyStates& states) const {
  if (rotation_.empty()) return states.turn(body_);
  const Vec3 bent = turn(states.amplitudes(body_, StepTime::kEnd)) - turn(states.amplitudes(body_, StepTime::kStart));
  return states.turn(body_) + states.rotation(body_, StepTime::kMiddle) * bent;
}

FrameInstant MaterialFrame::at_end(const BodyStates& states, StepTime when, bool axes) const {
  const RigidTransform& pose = states.pose(body_, when);
  FrameInstant at{.states = states, .when = when, .body = body_, .origin = pose.p};
  const auto write = [&](const Vec3& origin_B, const Mat3& axes_B) {
    double arm[3];
    turn_vectors(pose.q, origin_B.data(), 1, arm);
    at.position = {pose.p[0] + arm[0], pose.p[1] + arm[1], pose.p[2] + arm[2]};
    if (axes) turn_vectors(pose.q, axes_B.data(), 3, at.axes.data());
  };
  if (displacement_.empty()) {
    write(rest_.origin, rest_.axes);
    return at;
  }
  const std::span<const double> z = states.amplitudes(body_, when);
  // Named for clang, to which a nested class has no default constructor within the class about it.
  FrameInstant::Bend& bend =
      at.bend.emplace(FrameInstant::Bend{.R_BW = to_matrix(pose.q).transpose(), .axes_B = rest_.axes});
  if (axes && !rotation_.empty()) {
    bend.turned = turn(z), bend.half = half_of(bend.turned);
    bend.axes_B = rotation_by(bend.turned, bend.half) * rest_.axes;
  }
  write(anchors_.empty() ? Vec3(rest_.origin + displace(z)) : place(states.shape(body_, when)), bend.axes_B);
  return at;
}

FrameInstant MaterialFrame::between(const FrameInstant& start, const FrameInstant& end) const {
  FrameInstant at{.states = end.states,
                  .when = StepTime::kMiddle,
                  .body = body_,
                  .position = 0.5 * (start.position + end.position),
                  .axes = 0.5 * (start.axes + end.axes),
                  .origin = 0.5 * (start.origin + end.origin)};
  if (!start.bend) return at;
  const Mat3 R_BW = start.bend->R_BW - 0.5 * start.bend->R_BW * cross_matrix(at.states.turn(body_));
  at.bend.emplace(FrameInstant::Bend{.R_BW = R_BW, .axes_B = 0.5 * (start.bend->axes_B + end.bend->axes_B)});
  if (!rotation_.empty()) at.bend->turning = turning_between(*start.bend, *end.bend);
  return at;
}

void FrameInstant::find_turning() {
  if (bend && bend->half.angle > 0.0) bend->turning = turning_between(*bend, *bend);
}

void FrameInstant::bend_origin(const Vec3& n, FrameMeasure& to) const { to.shift_B += bend->R_BW * n; }

void FrameInstant::bend_point(const Vec3& p, const Vec3& n, FrameMeasure& to) const {
  bend_origin(n, to);
  to.turn_B += bend->R_BW * (p - position).cross(n);
}

void FrameInstant::bend_axis(int axis, const Vec3& u, FrameMeasure& to) const {
  to.turn_B += bend->turning.transpose() * bend->axes_B.col(axis).cross(bend->R_BW * u);
}

void FrameInstant::bend_turn(const Vec3& a, FrameMeasure& to) const {
  to.turn_B += bend->turning.transpose() * (bend->R_BW * a);
}

RowSide MaterialFrame::side(const FrameInstant& at, const Vec3& n, std::vector<double>& modal) const {
  RowSide side{body_, n, (at.position - at.origin).cross(n), {}};
  if (!at.bend) return side;
  FrameMeasure bent;
  at.bend_origin(n, bent);
  write_modal(at, bent, modal);
  side.modal = modal;
  return side;
}

void MaterialFrame::write_modal(const FrameInstant& at, const FrameMeasure& measure, std::vector<double>& modal) const {
  modal.resize(displacement_.size());
  const Vec3 shift = anchors_.empty() ? measure.shift_B : Vec3(Vec3::Zero()), turn = measure.turn_B;
  const bool turns = !rotation_.empty() && !turn.isZero(0.0);
  for (std::size_t i = 0; i < modal.size(); ++i)
    modal[i] = displacement_[i].dot(shift) + (turns ? rotation_[i].dot(turn) : 0.0);
  if (!anchors_.empty() && !measure.shift_B.isZero(0.0)) add_rows(at.states, at.when, measure.shift_B, modal);
}

std::vector<SurfacePoint> patch_around(const ModalModel& model, SurfacePoint::Surface surface, const Vec3& center,
                                       double radius) {
  const ModalSurface& s = surface == SurfacePoint::Surface::kRender ? model.render() : model.collision();
  std::vector<SurfacePoint> patch;
  std::vector<bool> seen(s.rest.size(), false);
  SurfacePoint nearest;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < s.triangles.size(); ++t)
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const auto v = static_cast<std::size_t>(s.triangles[t][corner]);
      if (seen[v]) continue;
      seen[v] = true;
      SurfacePoint at{.surface = surface, .triangle = static_cast<Index>(t), .weight = {0.0, 0.0, 0.0}};
      at.weight[corner] = 1.0;
      const double distance = (s.rest[v].cast<double>() - center).norm();
      if (distance <= radius) patch.push_back(at);
      if (distance < least) least = distance, nearest = at;
    }
  if (patch.empty()) patch.push_back(nearest);
  return patch;
}

}  // namespace limber
