#include "limber/precompute/modal_analysis.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numeric>
#include <sstream>
#include <string>

#include "eigen/blas_threads.h"
#include "eigen/canonical_modes.h"
#include "eigen/elastic_modes.h"
#include "eigen/lanczos.h"
#include "eigen/null_space.h"
#include "eigen/sparse_operations.h"
#include "limber/core/error.h"
#include "limber/precompute/eigenvalue_count.h"

namespace limber {
namespace {

using internal::BlasThreads;
using internal::complete;
using internal::EigenPairs;
using internal::ElasticInverse;
using internal::find_null_space;
using internal::lanczos;
using internal::LanczosOptions;
using internal::lowest_modes;
using internal::make_canonical;
using internal::make_clusters_canonical;
using internal::multiply;
using internal::norm_estimate;
using internal::NullSpace;
using internal::order_nodes;
using internal::principal_submatrix;
using internal::ScaledProblem;

constexpr double kNearlyLoose = 1e-6;
constexpr double kResidual = 1e-8;  // relative to ‖λMw‖, unless round-off of K forbids it
constexpr double kRoundOffFactor = 100.0;

/// Adds the time since the last lap to a stage.
class Stopwatch {
 public:
  void lap(double& seconds) {
    const auto now = Clock::now();
    seconds += std::chrono::duration<double>(now - last_).count();
    last_ = now;
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point last_ = Clock::now();
};

/// The body after fixing, in units that make it dimensionless.
struct Body {
  std::vector<Index> fixed_nodes, free_nodes;  // ascending
  NullSpace null_space;                        // on all nodes
  ScaledProblem problem;                       // on the free nodes
  double stiffness_unit = 1.0;                 // N/m, a power of two: scaling by it does not round
  double mass_unit = 1.0;                      // kg, a power of two
};

std::vector<Index> checked_fixed_nodes(const TetMesh& mesh, std::span<const Index> fixed_nodes) {
  std::vector<Index> fixed(fixed_nodes.begin(), fixed_nodes.end());
  std::sort(fixed.begin(), fixed.end());
  fixed.erase(std::unique(fixed.begin(), fixed.end()), fixed.end());
  if (!fixed.empty() && (fixed.front() < 0 || static_cast<std::size_t>(fixed.back()) >= mesh.nodes.size()))
    throw InvalidArgument("analyse_modes: fixed node " +
                          std::to_string(fixed.front() < 0 ? fixed.front() : fixed.back()) + ", expected 0 to " +
                          std::to_string(mesh.nodes.size() - 1));
  return fixed;
}

void check_body(const TetMesh& mesh) {
  if (mesh.tets.empty()) throw InvalidArgument("analyse_modes: the mesh has no tetrahedra");
  std::vector<bool> used(mesh.nodes.size(), false);
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    for (const Index node : TetNodes(mesh, t)) used[node] = true;
  const auto unused = std::find(used.begin(), used.end(), false);
  if (unused != used.end())
    throw InvalidArgument("analyse_modes: no tetrahedron uses node " + std::to_string(unused - used.begin()) +
                          "; extract the body first (extract_component)");
  const auto component = connected_components(mesh);
  const Index bodies = 1 + *std::max_element(component.begin(), component.end());
  if (bodies != 1)
    throw InvalidArgument("analyse_modes: the mesh is " + std::to_string(bodies) +
                          " bodies, expected one; extract them first (extract_component)");
}

std::vector<Index> dofs_of(const std::vector<Index>& nodes) {
  std::vector<Index> dofs;
  dofs.reserve(3 * nodes.size());
  for (const Index node : nodes)
    for (Index axis = 0; axis < 3; ++axis) dofs.push_back(3 * node + axis);
  return dofs;
}

/// Divides by a power of two near the mean of the diagonal. @return it
double scale_to_one(SparseMatrix& A) {
  double trace = 0.0;
  for (Index j = 0; j < A.size; ++j)
    for (Index e = A.column_start[j]; e < A.column_start[j + 1]; ++e)
      if (A.row[e] == j) trace += A.value[e];
  const double unit = std::exp2(std::round(std::log2(trace / A.size)));
  for (double& v : A.value) v /= unit;
  return unit;
}

/// K X on the free nodes, in the problem's unit, by way of displacements of all nodes.
Eigen::MatrixXd stiffness_times(const TetMesh& mesh, std::span<const Material> materials,
                                const std::vector<Index>& free_dofs, double unit, const Eigen::MatrixXd& X) {
  Eigen::MatrixXd KX(X.rows(), X.cols());
  Eigen::VectorXd u = Eigen::VectorXd::Zero(3 * static_cast<Eigen::Index>(mesh.nodes.size())), f(u.size());
  for (Eigen::Index c = 0; c < X.cols(); ++c) {
    u(free_dofs) = X.col(c);
    elastic_forces(mesh, materials, {u.data(), u.data() + u.size()}, {f.data(), f.data() + f.size()});
    KX.col(c) = f(free_dofs) / unit;
  }
  return KX;
}

/// Makes NᵀMN = I without mixing a column with later ones, so that the rigid motions stay first. Twice: once leaves an
/// error of round-off times the condition of NᵀMN.
void orthonormalise(ScaledProblem& problem) {
  Eigen::MatrixXd& N = problem.N;
  for (int pass = 0; pass < 2; ++pass) {
    for (auto column : N.colwise()) column /= std::sqrt(column.dot(problem.mass_times(column).col(0)));
    const Eigen::MatrixXd gram = N.transpose() * problem.mass_times(N);
    Eigen::LLT<Eigen::MatrixXd>(gram).matrixU().solveInPlace<Eigen::OnTheRight>(N);
  }
  problem.MN = problem.mass_times(N);
}

Body make_body(const TetMesh& mesh, std::span<const Material> materials, std::span<const Index> fixed_nodes,
               MassKind mass, Jobs& jobs) {
  check_body(mesh);
  Body body;
  body.fixed_nodes = checked_fixed_nodes(mesh, fixed_nodes);
  std::vector<Index> all(mesh.nodes.size());
  std::iota(all.begin(), all.end(), 0);
  std::set_difference(all.begin(), all.end(), body.fixed_nodes.begin(), body.fixed_nodes.end(),
                      std::back_inserter(body.free_nodes));
  body.null_space = find_null_space(mesh, body.fixed_nodes);
  if (body.free_nodes.empty()) return body;

  const std::vector<Index> free_dofs = dofs_of(body.free_nodes);
  ScaledProblem& p = body.problem;
  p.K = principal_submatrix(assemble_stiffness(mesh, materials, jobs), free_dofs);
  p.node_mass = principal_submatrix(assemble_mass(mesh, materials, mass, jobs), body.free_nodes);
  body.stiffness_unit = scale_to_one(p.K);
  body.mass_unit = scale_to_one(p.node_mass);
  p.stiffness_times = [&mesh, materials, free_dofs, unit = body.stiffness_unit](const Eigen::MatrixXd& X) {
    return stiffness_times(mesh, materials, free_dofs, unit, X);
  };
  p.N = body.null_space.basis(free_dofs, Eigen::all);
  orthonormalise(p);
  make_canonical(p.N.rightCols(body.null_space.mechanisms));
  p.MN = p.mass_times(p.N);
  return body;
}

void describe_freedom(const Body& body, ModalAnalysis& analysis, Warnings& warnings) {
  const NullSpace& space = body.null_space;
  analysis.freedom.motion = space.rigid.motion;
  analysis.freedom.pivot = space.rigid.pivot;
  analysis.freedom.line_axis = space.rigid.line_axis;
  analysis.freedom.rigid_modes = space.rigid.dimension();
  analysis.freedom.mechanisms = space.mechanisms;
  if (space.mechanisms > 0)
    warnings.push_back(
        "the body has " + std::to_string(space.mechanisms) +
        " mechanism(s), parts that hang together only by nodes or edges and turn freely there: each stays "
        "as a mode of frequency zero");
  if (space.weakest_constraint < kNearlyLoose)
    warnings.push_back(
        "the joints between parts or the fixed nodes are nearly in line: a motion that they should hold is "
        "held only weakly, and its frequency is uncertain");
  if (body.free_nodes.empty()) warnings.push_back("every node is fixed: the body has no modes");
}

/// The zero modes are as many as geometry says: none but those of N lies below half the first elastic eigenvalue. Where
/// round-off makes K resist even N by as much as that, there is nothing to see, and the caller is told.
void confirm_zero_modes(const ScaledProblem& problem, const EigenPairs& pairs, EigenvalueCounter& counter,
                        Warnings& warnings) {
  const double sigma = pairs.lambda[0] / 2.0;
  const double round_off = (problem.N.transpose() * multiply(problem.K, problem.N)).norm();
  if (round_off > sigma / 10.0) {
    warnings.push_back(
        "the lowest frequencies lie within round-off of the stiffness matrix, so the number of zero modes is known "
        "from "
        "geometry alone");
    return;
  }
  const int counted = counter.below(sigma);
  if (counted != problem.N.cols())
    throw ComputationError("the body's geometry allows " + std::to_string(problem.N.cols()) +
                           " motions without deformation, but its stiffness matrix has " + std::to_string(counted) +
                           " eigenvalues near zero: look for tetrahedra that are nearly flat, or materials whose "
                           "stiffnesses differ by more than about 1e10");
}

void measure_residuals(const ScaledProblem& problem, const EigenPairs& pairs, ModalAnalysis& analysis) {
  const double norm_K = norm_estimate(problem.K);
  const double norm_M = norm_estimate(problem.node_mass);
  const Eigen::MatrixXd R = multiply(problem.K, pairs.W) - pairs.MW * pairs.lambda.asDiagonal();
  double worst = 0.0;  // relative to its own bound
  for (Eigen::Index i = 0; i < pairs.count(); ++i) {
    const double inertia = pairs.lambda[i] * pairs.MW.col(i).norm(), length = pairs.W.col(i).norm();
    const double residual = R.col(i).norm() / inertia;
    const double round_off = kRoundOffFactor * std::numeric_limits<double>::epsilon() * norm_K * length / inertia;
    const double bound = std::max(kResidual, round_off);
    if (residual / bound >= worst) {
      worst = residual / bound;
      analysis.accuracy.residual_max = residual;
      analysis.accuracy.residual_bound = bound;
    }
    analysis.accuracy.backward_error_max = std::max(analysis.accuracy.backward_error_max,
                                                    R.col(i).norm() / ((norm_K + pairs.lambda[i] * norm_M) * length));
  }
}

double orthogonality_error(const ScaledProblem& problem, const EigenPairs& pairs) {
  Eigen::MatrixXd all(problem.size(), problem.N.cols() + pairs.count()), mass_times_all(all.rows(), all.cols());
  all << problem.N, pairs.W;
  mass_times_all << problem.MN, pairs.MW;
  const Eigen::MatrixXd gram = all.transpose() * mass_times_all;
  return gram.size() == 0 ? 0.0 : (gram - Eigen::MatrixXd::Identity(gram.rows(), gram.cols())).cwiseAbs().maxCoeff();
}

/// Writes columns over the free nodes, times a unit, behind what `all` holds, with zeros at the fixed nodes.
void append_columns(const Body& body, Index nodes, const Eigen::Ref<const Eigen::MatrixXd>& columns, double unit,
                    std::vector<double>& all) {
  for (Eigen::Index c = 0; c < columns.cols(); ++c) {
    const std::size_t start = all.size();
    all.resize(start + 3 * static_cast<std::size_t>(nodes), 0.0);
    for (std::size_t i = 0; i < body.free_nodes.size(); ++i)
      for (int axis = 0; axis < 3; ++axis) all[start + 3 * body.free_nodes[i] + axis] = unit * columns(3 * i + axis, c);
  }
}

void write_modes(const Body& body, const EigenPairs& pairs, ModalAnalysis& analysis) {
  const auto mechanisms = body.problem.N.rightCols(body.null_space.mechanisms);
  const auto mass_times_mechanisms = body.problem.MN.rightCols(body.null_space.mechanisms);
  analysis.eigenvalues.assign(body.null_space.mechanisms, 0.0);
  for (const double lambda : pairs.lambda)
    analysis.eigenvalues.push_back(lambda * (body.stiffness_unit / body.mass_unit));
  const double root = std::sqrt(body.mass_unit);
  append_columns(body, analysis.nodes, mechanisms, 1.0 / root, analysis.shapes);
  append_columns(body, analysis.nodes, pairs.W, 1.0 / root, analysis.shapes);
  append_columns(body, analysis.nodes, mass_times_mechanisms, root, analysis.mass_times_shapes);
  append_columns(body, analysis.nodes, pairs.MW, root, analysis.mass_times_shapes);
}

void warn_of_shortfalls(const ModalAnalysis& analysis, const ModalAnalysisOptions& options, Eigen::Index elastic,
                        double shift, Warnings& warnings) {
  if (elastic < options.modes)
    warnings.push_back(std::to_string(options.modes) + " modes were asked for, but the mesh has only " +
                       std::to_string(elastic) + " elastic ones");
  if (analysis.accuracy.residual_max > analysis.accuracy.residual_bound) {
    std::ostringstream text;
    text << "a mode's residual, " << analysis.accuracy.residual_max << " of its inertia force, exceeds "
         << analysis.accuracy.residual_bound;
    warnings.push_back(text.str());
  }
  if (shift > 0.0)
    warnings.push_back(
        "the body is so near to a mechanism that its stiffness had to be shifted to be factored: the "
        "lowest frequencies are uncertain");
}

// Without the certificate Lanczos works to a finer tolerance: the copies of a multiple eigenvalue enter by round-off
// alone, and late.
LanczosOptions lanczos_options(const ModalAnalysisOptions& options) {
  return {.tolerance = options.certify ? 1e-8 : 1e-12, .seed = options.seed};
}

/// A body and the factor that refers to it, at one place in memory for as long as either is used.
class FactoredBody final : public ElasticCompliance {
 public:
  FactoredBody(Body body, Index nodes) : body_(std::move(body)), nodes_(nodes) {}

  const Body& body() const { return body_; }
  ElasticInverse& factor(const std::vector<Index>& order) { return inverse_.emplace(body_.problem, order); }

  std::vector<double> displacements(std::span<const double> forces) override {
    return on_all_nodes(inverse_->apply(on_free_nodes(forces)), 1.0 / body_.stiffness_unit);
  }
  std::vector<double> mass_times(std::span<const double> displacements) const override {
    return on_all_nodes(body_.problem.mass_times(on_free_nodes(displacements)), body_.mass_unit);
  }

 private:
  Eigen::MatrixXd on_free_nodes(std::span<const double> all) const {
    const auto rows = 3 * static_cast<Eigen::Index>(nodes_);
    if (all.size() % static_cast<std::size_t>(rows) != 0)
      throw InvalidArgument("ElasticCompliance: " + std::to_string(all.size()) + " numbers, expected a multiple of " +
                            std::to_string(rows));
    const Eigen::Map<const Eigen::MatrixXd> columns(all.data(), rows, static_cast<Eigen::Index>(all.size()) / rows);
    return columns(dofs_of(body_.free_nodes), Eigen::all);
  }
  std::vector<double> on_all_nodes(const Eigen::MatrixXd& columns, double unit) const {
    std::vector<double> all;
    append_columns(body_, nodes_, columns, unit, all);
    return all;
  }

  Body body_;
  Index nodes_;
  std::optional<ElasticInverse> inverse_;
};

}  // namespace

void ModalAnalysisOptions::validate() const {
  if (modes < 0)
    throw InvalidArgument("ModalAnalysisOptions::modes is " + std::to_string(modes) + ", expected 0 or more");
  if (!(below > 0.0))
    throw InvalidArgument("ModalAnalysisOptions::below is " + std::to_string(below) + ", expected above 0");
  if (blas_threads < 0)
    throw InvalidArgument("ModalAnalysisOptions::blas_threads is " + std::to_string(blas_threads) +
                          ", expected 0 or more");
}

ModalAnalysis analyse_modes(const TetMesh& mesh, std::span<const Material> materials,
                            std::span<const Index> fixed_nodes, const ModalAnalysisOptions& options, Warnings& warnings,
                            Jobs& jobs) {
  options.validate();
  ModalAnalysis analysis;
  analysis.nodes = static_cast<Index>(mesh.nodes.size());
  const BlasThreads threads(options.blas_threads);
  Stopwatch watch;

  const auto factored =
      std::make_shared<FactoredBody>(make_body(mesh, materials, fixed_nodes, options.mass, jobs), analysis.nodes);
  const Body& body = factored->body();
  describe_freedom(body, analysis, warnings);
  watch.lap(analysis.seconds.assemble);
  if (body.free_nodes.empty()) {
    analysis.accuracy.certified = options.certify;  // nothing could be missed
    return analysis;
  }

  const std::vector<Index> order = order_nodes(body.problem.K);
  watch.lap(analysis.seconds.order);
  ElasticInverse& inverse = factored->factor(order);
  watch.lap(analysis.seconds.factor);

  ModalAnalysisOptions wanted = options;
  if (std::isfinite(options.below)) {
    EigenvalueCounter counter(body.problem.K, body.problem.node_mass, order);
    const int zeros = static_cast<int>(body.problem.N.cols());
    analysis.elastic_below = counter.below(options.below * (body.mass_unit / body.stiffness_unit)) - zeros;
    wanted.modes = std::min(options.modes, analysis.elastic_below);
    watch.lap(analysis.seconds.certify);
  }

  Eigen::Index kept = 0;
  EigenPairs pairs = lowest_modes(body.problem, inverse, wanted.modes, lanczos_options(options), kept);
  watch.lap(analysis.seconds.iterate);
  if (options.certify) {
    EigenvalueCounter counter(body.problem.K, body.problem.node_mass, order);
    complete(body.problem, inverse, counter, pairs, wanted.modes, kept);
    confirm_zero_modes(body.problem, pairs, counter, warnings);
    analysis.accuracy.certified = true;
  }
  watch.lap(analysis.seconds.certify);

  pairs.keep_first(kept);
  make_clusters_canonical(pairs);
  measure_residuals(body.problem, pairs, analysis);
  analysis.accuracy.orthogonality_max = orthogonality_error(body.problem, pairs);
  analysis.solves = inverse.solves();
  write_modes(body, pairs, analysis);
  warn_of_shortfalls(analysis, wanted, kept, inverse.shift(), warnings);
  if (options.keep_compliance) analysis.compliance = factored;
  watch.lap(analysis.seconds.iterate);
  return analysis;
}

}  // namespace limber
