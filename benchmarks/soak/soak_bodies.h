/// @file soak_bodies.h
/// Boxes and bars of the soak, baked with the residual compliance of their surfaces.
#pragma once

#include <memory>

#include "limber/model/modal_model.h"

namespace limber::testing {

struct SoakBodies {
  std::shared_ptr<const ModalModel> box;    ///< 0.3 m cubed, 12 modes
  std::shared_ptr<const ModalModel> bar;    ///< 0.5 × 0.12 × 0.12 m, 12 modes
  std::shared_ptr<const ModalModel> rigid;  ///< the box without modes
};
SoakBodies bake_soak_bodies();

/// The largest eigenvalue of a vertex's own block of the model's residual compliance, m/N; 0 without.
double largest_compliance(const ModalModel& model);

}  // namespace limber::testing
