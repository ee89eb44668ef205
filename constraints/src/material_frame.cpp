#include "limber/constraints/material_frame.h"

#include <Eigen/Eigenvalues>
#include <limits>

#include "limber/core/error.h"

namespace limber {
namespace {

/// Directions in which a patch extends less than this part of its largest second moment do not tell a rotation.
constexpr double kThinPatch = 1e-6;

Vec3 rest_point(const ModalModel& model, const SurfacePoint& at) { return deformed_point(model, at, {}); }

/// I⁺ of a patch: inverse on the directions that it extends around.
Mat3 pseudo_inverse(const Mat3& inertia) {
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(inertia);
  Mat3 inverse = Mat3::Zero();
  for (int i = 0; i < 3; ++i)
    if (eigen.eigenvalues()[i] > kThinPatch * eigen.eigenvalues()[2])
      inverse += eigen.eigenvectors().col(i) * eigen.eigenvectors().col(i).transpose() / eigen.eigenvalues()[i];
  return inverse;
}

}  // namespace

MaterialFrame::MaterialFrame(const JointFrame& in_world) : rest_(in_world) {}

MaterialFrame::MaterialFrame(Index body, const JointFrame& in_body) : body_(body), rest_(in_body) {}

MaterialFrame::MaterialFrame(Index body, const ModalModel& model, const SurfacePoint& at) : body_(body) {
  validate(model, at);
  rest_.origin = rest_point(model, at);
  for (Index i = 0; i < model.modes(); ++i) displacement_.push_back(shape_at(model, at, i));
}

MaterialFrame::MaterialFrame(Index body, const ModalModel& model, std::span<const SurfacePoint> patch,
                             const JointFrame& in_body)
    : body_(body), rest_(in_body) {
  if (patch.empty()) throw InvalidArgument("MaterialFrame: the patch of \"" + model.name() + "\" has no points");
  const double weight = 1.0 / static_cast<double>(patch.size());
  Vec3 mean = Vec3::Zero();
  for (const SurfacePoint& at : patch) {
    validate(model, at);
    mean += weight * rest_point(model, at);
  }
  Mat3 inertia = Mat3::Zero();
  for (const SurfacePoint& at : patch) {
    const Vec3 x = rest_point(model, at) - mean;
    inertia += weight * (x.squaredNorm() * Mat3::Identity() - x * x.transpose());
  }
  const Mat3 inverse = pseudo_inverse(inertia);
  for (Index i = 0; i < model.modes(); ++i) {
    Vec3 displacement = Vec3::Zero(), moment = Vec3::Zero();
    for (const SurfacePoint& at : patch) {
      const Vec3 u = shape_at(model, at, i);
      displacement += weight * u;
      moment += weight * (rest_point(model, at) - mean).cross(u);
    }
    rotation_.push_back(inverse * moment);
    displacement_.push_back(displacement + rotation_.back().cross(in_body.origin - mean));
  }
}

Vec3 MaterialFrame::displace(std::span<const double> z) const {
  Vec3 u = Vec3::Zero();
  for (std::size_t i = 0; i < displacement_.size(); ++i) u += z[i] * displacement_[i];
  return u;
}

Vec3 MaterialFrame::turn(std::span<const double> z) const {
  Vec3 theta = Vec3::Zero();
  for (std::size_t i = 0; i < rotation_.size(); ++i) theta += z[i] * rotation_[i];
  return theta;
}

Vec3 MaterialFrame::position(const BodyStates& states, StepTime when) const {
  return states.pose(body_, when) * (rest_.origin + displace(states.amplitudes(body_, when)));
}

Mat3 MaterialFrame::axes(const BodyStates& states, StepTime when) const {
  Quaternion q_WB = states.pose(body_, when).q;
  if (!rotation_.empty()) q_WB = q_WB * quaternion_from_rotation_vector(turn(states.amplitudes(body_, when)));
  return to_matrix(q_WB) * rest_.axes;
}

Vec3 MaterialFrame::velocity(const BodyStates& states, StepTime when) const {
  if (body_ < 0) return Vec3::Zero();
  const RigidTransform& X = states.pose(body_, when);
  return states.velocity(body_, when) + states.angular_velocity(body_, when).cross(position(states, when) - X.p) +
         X.q * displace(states.rates(body_, when));
}

Vec3 MaterialFrame::angular_velocity(const BodyStates& states, StepTime when) const {
  if (body_ < 0) return Vec3::Zero();
  return states.angular_velocity(body_, when) + states.pose(body_, when).q * turn(states.rates(body_, when));
}

RowSide MaterialFrame::point_row(const BodyStates& states, StepTime when, const Vec3& p, const Vec3& n, double scale,
                                 std::vector<double>& modal) const {
  modal.clear();
  if (body_ < 0) return {};
  const RigidTransform& X = states.pose(body_, when);
  const Vec3 arm = p - X.p;
  const Vec3 n_B = scale * (X.q.conjugate() * n);
  Vec3 twist_B = Vec3::Zero();  // how a turn of the patch moves a point off its origin
  if (!rotation_.empty()) twist_B = (X.q.conjugate() * (p - position(states, when))).cross(n_B);
  for (std::size_t i = 0; i < displacement_.size(); ++i)
    modal.push_back(displacement_[i].dot(n_B) + (rotation_.empty() ? 0.0 : rotation_[i].dot(twist_B)));
  return {body_, scale * n, scale * arm.cross(n), modal};
}

RowSide MaterialFrame::angular_row(const BodyStates& states, StepTime when, const Vec3& a, double scale,
                                   std::vector<double>& modal) const {
  modal.clear();
  if (body_ < 0) return {};
  const Vec3 a_B = scale * (states.pose(body_, when).q.conjugate() * a);
  for (const Vec3& turn : rotation_) modal.push_back(turn.dot(a_B));
  return {body_, Vec3::Zero(), scale * a, modal};
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
