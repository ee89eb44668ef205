// One rigid body that slides or rolls over what stands still: a step of few lines (projected Gauss–Seidel on eight
// substeps, gaps measured again in each) that takes contacts at their word, to see what they do to it.
#pragma once

#include <algorithm>
#include <cmath>
#include <variant>
#include <vector>

#include "finder_scenes.h"

namespace limber::testing {

class SlidingBody {
 public:
  /// @param scene what stands still; the body is added to it as the last one
  SlidingBody(ContactScene& scene, const Shape& shape, const RigidTransform& pose, double friction)
      : scene_(scene), friction_(friction), body_(scene.add(shape, pose)) {
    const double size = std::holds_alternative<Sphere>(shape) ? std::get<Sphere>(shape).radius
                        : std::holds_alternative<Box>(shape)  ? std::get<Box>(shape).half_extents.maxCoeff()
                                                              : 0.2;
    size_ = size;
    inertia_ = (std::holds_alternative<Sphere>(shape) ? 0.4 : 2.0 / 3.0) * size * size;  // of unit mass
  }

  Vec3 v = Vec3::Zero(), w = Vec3::Zero();
  RigidTransform& pose() { return scene_.poses[static_cast<std::size_t>(body_)]; }
  double energy() { return 0.5 * v.squaredNorm() + 0.5 * inertia_ * w.squaredNorm() + kGravity * pose().p.z(); }
  double kinetic() const { return 0.5 * v.squaredNorm() + 0.5 * inertia_ * w.squaredNorm(); }
  const std::vector<ContactPoint>& contacts() const { return contacts_; }

  void step(ContactSource& finder) {
    std::vector<BodyState> states = scene_.states();
    for (std::size_t i = 0; i + 1 < states.size(); ++i) states[i].asleep = true;
    states.back().displacement = kStep * v, states.back().rotation = kStep * w;
    states.back().reach = kGravity * kStep * kStep + 2.0 * size_ * std::min(1.0, kStep * w.norm());
    finder.find_contacts({.states = states, .margin = 1e-3 * size_}, contacts_, serial_jobs());
    rows_.clear();
    for (const ContactPoint& c : contacts_) add_row(c);
    for (int s = 0; s < kSubsteps; ++s) substep();
  }

 private:
  static constexpr double kGravity = 9.80665, kStep = 1.0 / 60.0;
  static constexpr int kSubsteps = 8;
  struct Row {
    Vec3 normal, arm_B, foot;  // out of what stands still; the body's point, or its centre; the other's, world
    double radius;             // about that centre
    double force = 0.0;        // impulses of the substep before
    Vec3 slip = Vec3::Zero();
  };

  void add_row(const ContactPoint& c) {
    const bool is_b = c.b.body == body_;
    const ContactSide &mine = is_b ? c.b : c.a, &other = is_b ? c.a : c.b;
    const Vec3 normal = is_b ? Vec3(-c.normal) : c.normal;
    const RigidTransform& X = pose();
    rows_.push_back({normal, mine.point_B + mine.radius * (X.q.conjugate() * normal),
                     scene_.poses[static_cast<std::size_t>(other.body)] * other.point_B, mine.radius});
  }

  void substep() {
    constexpr double h = kStep / kSubsteps;
    v.z() -= kGravity * h;
    struct Now {
      Vec3 arm;
      double gap;
    };
    std::vector<Now> now;
    for (const Row& row : rows_) {
      const Vec3 arm = pose().q * row.arm_B;
      now.push_back({arm - row.radius * row.normal, row.normal.dot(pose().p + arm - row.foot) - row.radius});
    }
    for (std::size_t i = 0; i < rows_.size(); ++i) push(now[i].arm, rows_[i].force * rows_[i].normal + rows_[i].slip);
    for (int sweep = 0; sweep < 8; ++sweep)
      for (std::size_t k = 0; k < rows_.size(); ++k) {
        const std::size_t i = sweep % 2 == 0 ? k : rows_.size() - 1 - k;
        Row& row = rows_[i];
        const Vec3 u = v + w.cross(now[i].arm);
        const double target = now[i].gap > 0.0 ? -now[i].gap / h : 0.0;
        const double force = std::max(0.0, row.force + (target - row.normal.dot(u)) * mass(now[i].arm, row.normal));
        push(now[i].arm, (force - row.force) * row.normal);
        row.force = force;
        if (friction_ == 0.0) continue;
        Vec3 slip = v + w.cross(now[i].arm);
        slip -= row.normal.dot(slip) * row.normal;
        if (slip.norm() < 1e-15) continue;
        Vec3 drag = row.slip - mass(now[i].arm, slip.normalized()) * slip;
        drag *= std::min(1.0, friction_ * row.force / std::max(drag.norm(), 1e-300));
        push(now[i].arm, drag - row.slip);
        row.slip = drag;
      }
    RigidTransform& X = pose();
    X.p += h * v;
    X.q = quaternion_from_rotation_vector(h * w) * X.q;
  }

  double mass(const Vec3& arm, const Vec3& direction) const {
    return 1.0 / (1.0 + arm.cross(direction).squaredNorm() / inertia_);
  }
  void push(const Vec3& arm, const Vec3& impulse) {
    v += impulse;
    w += arm.cross(impulse) / inertia_;
  }

  ContactScene& scene_;
  double friction_, size_ = 0.0, inertia_ = 0.0;
  Index body_;
  std::vector<ContactPoint> contacts_;
  std::vector<Row> rows_;
};

}  // namespace limber::testing
