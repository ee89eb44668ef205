#pragma once

#include <span>
#include <vector>

#include "dense_fem.h"
#include "dense_modes.h"

namespace limber::testing {

/// All eigenvalues, ascending, with the fixed nodes' rows and columns struck out.
inline Eigen::VectorXd dense_eigenvalues(const DenseModel& model, std::span<const Index> fixed_nodes = {}) {
  std::vector<bool> held(model.K.rows(), false);
  for (const Index node : fixed_nodes)
    for (int axis = 0; axis < 3; ++axis) held[3 * node + axis] = true;
  std::vector<Eigen::Index> kept;
  for (Eigen::Index i = 0; i < model.K.rows(); ++i)
    if (!held[i]) kept.push_back(i);
  return dense_modes(model.K(kept, kept), model.M(kept, kept)).lambda;
}

}  // namespace limber::testing
