#include "limber/precompute/eigenvalue_count.h"

#include <string>

#include "eigen/indefinite_factor.h"
#include "eigen/sparse_operations.h"
#include "limber/core/error.h"

namespace limber {

EigenvalueCounter::EigenvalueCounter(const SparseMatrix& K, const SparseMatrix& node_mass,
                                     std::span<const Index> node_order)
    : K_(K), node_mass_(node_mass) {
  if (K.size != 3 * node_mass.size || node_order.size() != static_cast<std::size_t>(node_mass.size) || K.size == 0)
    throw InvalidArgument("EigenvalueCounter: K has " + std::to_string(K.size) + " rows, the mass " +
                          std::to_string(node_mass.size) + " nodes and the order " + std::to_string(node_order.size()) +
                          ", expected 3n > 0, n and n");
  factor_ = std::make_unique<internal::IndefiniteFactor>(K, node_order, internal::IndefiniteFactor::Keeps::kPivotSigns);
}

EigenvalueCounter::~EigenvalueCounter() = default;

int EigenvalueCounter::below(double sigma) { return factor_->factor(internal::add_mass(K_, -sigma, node_mass_)); }

}  // namespace limber
