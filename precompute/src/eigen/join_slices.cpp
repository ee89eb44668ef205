#include "eigen/join_slices.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <sstream>
#include <vector>

#include "limber/core/error.h"
#include "limber/model/sha256.h"

namespace limber::internal {
namespace {

template <class T>
void update(Sha256& hash, const std::vector<T>& values) {
  hash.update({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)});
}

void update(Sha256& hash, const SparseMatrix& A) {
  update(hash, A.column_start);
  update(hash, A.row);
  update(hash, A.value);
}

std::string number_text(double x) {
  std::ostringstream text;
  text << x;
  return text.str();
}

std::string band_text(double low, double high) { return number_text(low) + " to " + number_text(high) + " Hz"; }

[[noreturn]] void fail(const std::string& what) { throw ComputationError("slices: " + what); }

/// Those of the body, lowest first; a slice that is given twice counts once.
std::vector<const SpectrumSlice*> slices_of(const EigenBody& body, std::span<const SpectrumSlice> slices) {
  const std::string problem = fingerprint(body);
  std::vector<const SpectrumSlice*> mine;
  for (const SpectrumSlice& slice : slices)
    if (slice.problem == problem) mine.push_back(&slice);
  if (mine.empty())
    fail("none of " + std::to_string(slices.size()) +
         " is of this body: they were made from another mesh, material or build");
  std::stable_sort(mine.begin(), mine.end(), [](auto* a, auto* b) { return a->band.low < b->band.low; });
  const auto same = [](auto* a, auto* b) { return a->band.low == b->band.low && a->band.high == b->band.high; };
  mine.erase(std::unique(mine.begin(), mine.end(), same), mine.end());
  return mine;
}

/// They follow each other from 0 Hz on, as many as were announced, and agree where they meet.
void check_chain(const std::vector<const SpectrumSlice*>& slices) {
  double end = 0.0;
  int below = slices.front()->below_low;
  for (const SpectrumSlice* slice : slices) {
    if (slice->band.low > end) fail(band_text(end, slice->band.low) + " is missing");
    if (slice->band.low < end) fail(band_text(slice->band.low, std::min(end, slice->band.high)) + " is in two of them");
    if (slice->below_low != below)
      fail("at " + number_text(end) + " Hz one counts " + std::to_string(below) + " eigenvalues below it, the next " +
           std::to_string(slice->below_low));
    end = slice->band.high;
    below = slice->below_high;
  }
  const int of = slices.front()->of, here = static_cast<int>(slices.size());
  if (here != of)
    fail(std::to_string(here) + " of " + std::to_string(of) + " are here, " + band_text(0.0, end) +
         ": what lies above is missing");
}

/// W (WᵀMW)^−½.
void orthonormalise(EigenPairs& pairs) {
  constexpr double kNearlyEqual = 0.5;  // of the smallest eigenvalue of a Gram matrix near I
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> gram(pairs.W.transpose() * pairs.MW);
  if (gram.eigenvalues().size() > 0 && gram.eigenvalues()[0] < kNearlyEqual)
    fail("two hold the same mode, as where their common frequency divides modes of equal frequency: choose another");
  const Eigen::MatrixXd root = gram.operatorInverseSqrt();
  pairs.W *= root;
  pairs.MW *= root;
}

}  // namespace

std::string fingerprint(const EigenBody& body) {
  Sha256 hash;
  update(hash, body.problem.K);
  update(hash, body.problem.node_mass);
  update(hash, body.free_nodes);
  update(hash, std::vector<double>{body.stiffness_unit, body.mass_unit});
  return hash.hex();
}

EigenPairs join_slices(const EigenBody& body, std::span<const SpectrumSlice> slices) {
  const std::vector<const SpectrumSlice*> mine = slices_of(body, slices);
  check_chain(mine);
  Eigen::Index count = 0;
  for (const SpectrumSlice* slice : mine) count += slice->modes();
  EigenPairs pairs{.lambda = Eigen::VectorXd(count), .W = Eigen::MatrixXd(body.problem.size(), count), .MW = {}};
  const std::vector<Index> free_dofs = dofs_of(body.free_nodes);
  const double root = std::sqrt(body.mass_unit);
  Eigen::Index column = 0;
  for (const SpectrumSlice* slice : mine) {
    const Eigen::Map<const Eigen::MatrixXd> shapes(slice->shapes.data(), 3 * static_cast<Eigen::Index>(slice->nodes),
                                                   slice->modes());
    pairs.W.middleCols(column, slice->modes()) = root * shapes(free_dofs, Eigen::all);
    for (const double lambda : slice->eigenvalues) pairs.lambda[column++] = lambda / body.eigenvalue_unit();
  }
  pairs.MW = body.problem.mass_times(pairs.W);
  orthonormalise(pairs);
  return pairs;
}

}  // namespace limber::internal
