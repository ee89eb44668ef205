// Loads that act over a whole step, while the step is taken in parts (WorldOptions::substeps).
#pragma once

#include <span>
#include <tuple>
#include <vector>

#include "constraint_stage.h"
#include "limber/dynamics/rigid_frame.h"
#include "limber/dynamics/surface_point.h"
#include "limber/engine/world.h"

namespace limber::internal {

class Substeps {
 public:
  Substeps(ConstraintStage& constraints, int parts, double step)
      : constraints_(&constraints), parts_(parts), step_(step) {}

  int count() const { return parts_; }
  double length() const { return step_ / parts_; }
  void set_step(double step) { step_ = step; }
  bool impulses_wait() const { return !impulses_.empty(); }

  // Remembered until the step has been taken. The first part's share is the caller's.
  void hold_force(Index body, const SurfacePoint& at, const Vec3& newtons_W);
  /// @return whether the impulse belongs to the first part; its delay in that part is then `delay` as given
  bool keep_impulse(Index body, const SurfacePoint& at, const Vec3& newton_seconds_W, double delay);
  void lead(Index body, const KinematicFrame& target);
  void forget(Index body);  ///< all of that
  void forget_frame(Index body);

  /// Sets what acts in one part, 0 … count() − 1.
  void begin(int part);
  /// After the last one.
  void finish();

 private:
  friend struct limber::StateFields;
  /// Between steps.
  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.forces_, s.impulses_, s.leads_);
  }

  struct Load {
    Index body;
    SurfacePoint at;
    Vec3 load;  // world, N or N·s
    int part;   // of an impulse
    double delay;

    template <class Self>
    static auto state_fields(Self& s) {
      return std::tie(s.body, s.at, s.load, s.part, s.delay);
    }
  };
  struct Lead {
    Index body;
    KinematicFrame start, target;

    template <class Self>
    static auto state_fields(Self& s) {
      return std::tie(s.body, s.start, s.target);
    }
  };
  struct HandlePath {
    Vec3 start;
    HandleTarget target;
  };
  void lead_handles(int part);

  ConstraintStage* constraints_;
  int parts_;
  double step_;
  std::vector<Load> forces_, impulses_;
  std::vector<Lead> leads_;
  std::vector<HandlePath> handles_;  // by place, of the step under way
};

}  // namespace limber::internal
