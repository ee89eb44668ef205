// Surfaces and states between two steps.
#pragma once

#include <span>
#include <vector>

#include "body_table.h"
#include "limber/core/stage_times.h"
#include "limber/dynamics/reconstruct.h"
#include "step_path.h"

namespace limber::internal {

class Drawing {
 public:
  explicit Drawing(const BodyTable& bodies) : bodies_(&bodies) {}

  // Indentations before the last step.
  /// Before each step. @param path whose contacts press indentations, here and below
  void keep_indentations(const StepPath& path);
  void forget(Index body);
  void forget_all() { indentations_before_.clear(); }
  void save_state(StateWriter& state) const;
  void restore_state(StateReader& state);

  // In the names of World's functions, and with their checks of the id and of `s`, the place between two states.
  void reconstruct(std::span<const DrawTarget> targets, double s, const Vec3& origin, const StepPath& path, Jobs& jobs,
                   StageTimes* times);
  RigidTransform pose(BodyId id, double s) const;
  void amplitudes(BodyId id, double s, std::span<float> amplitudes) const;
  void weights(BodyId id, double s, std::span<float> weights) const;
  void handles(BodyId id, double s, std::span<float> numbers);

 private:
  using Entry = BodyTable::Entry;
  /// One of the targets.
  struct Drawn {
    Index group;
    bool half;
    Index modes;
    std::size_t target;
  };
  /// Kept so that it is not allocated again.
  struct Scratch {
    std::vector<Drawn> drawn;  // by model
    std::vector<double> amplitudes;
    std::vector<float> indentations;
    std::vector<ReconstructionTarget> targets;  // as `drawn`
  };
  template <class Real>
  void interpolate(const Entry& e, double s, Real* amplitudes) const;
  RigidTransform pose(const Entry& e, double s) const;
  double half_precision_error(const Entry& e, double tolerance, double s) const;
  Index modes_to_draw(const Entry& e, double tolerance, double s) const;
  const SkinPose* skin_at(const Entry& e, const double* z) const;
  std::span<const IndentationLoad> indentations_before(BodyId id) const;
  bool is_indented(BodyId id, double s, const StepPath& path) const;
  void prepare(std::span<const DrawTarget> targets, double s, const StepPath& path);
  void list_targets(std::span<const DrawTarget> targets, double s, const Vec3& origin, const StepPath& path);
  void draw_models(Jobs& jobs);

  const BodyTable* bodies_;
  std::vector<std::vector<IndentationLoad>>
      indentations_before_;  // what pressed indentations into each body before the last step
  Scratch scratch_;
};

}  // namespace limber::internal
