#include "limber/precompute/modal_analysis.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>

#include "eigen/blas_threads.h"
#include "eigen/eigen_body.h"
#include "eigen/elastic_modes.h"
#include "eigen/join_slices.h"
#include "eigen/lanczos.h"
#include "eigen/sparse_operations.h"
#include "limber/core/error.h"
#include "limber/precompute/eigenvalue_count.h"

namespace limber {
namespace {

using internal::append_columns;
using internal::BlasThreads;
using internal::complete;
using internal::confirm_zero_modes;
using internal::dofs_of;
using internal::EigenBody;
using internal::EigenPairs;
using internal::ElasticInverse;
using internal::end_of_cluster;
using internal::join_slices;
using internal::LanczosOptions;
using internal::lowest_modes;
using internal::make_clusters_canonical;
using internal::make_eigen_body;
using internal::multiply;
using internal::norm_estimate;
using internal::NullSpace;
using internal::order_nodes;
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

void describe_freedom(const EigenBody& body, ModalAnalysis& analysis, Warnings& warnings) {
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

void write_modes(const EigenBody& body, const EigenPairs& pairs, ModalAnalysis& analysis) {
  const auto mechanisms = body.problem.N.rightCols(body.null_space.mechanisms);
  const auto mass_times_mechanisms = body.problem.MN.rightCols(body.null_space.mechanisms);
  analysis.eigenvalues.assign(body.null_space.mechanisms, 0.0);
  for (const double lambda : pairs.lambda) analysis.eigenvalues.push_back(lambda * body.eigenvalue_unit());
  const double root = std::sqrt(body.mass_unit);
  append_columns(body, analysis.nodes, mechanisms, 1.0 / root, analysis.shapes);
  append_columns(body, analysis.nodes, pairs.W, 1.0 / root, analysis.shapes);
  append_columns(body, analysis.nodes, mass_times_mechanisms, root, analysis.mass_times_shapes);
  append_columns(body, analysis.nodes, pairs.MW, root, analysis.mass_times_shapes);
}

void warn_of_residuals(const ModalAnalysis& analysis, Warnings& warnings) {
  if (analysis.accuracy.residual_max <= analysis.accuracy.residual_bound) return;
  std::ostringstream text;
  text << "a mode's residual, " << analysis.accuracy.residual_max << " of its inertia force, exceeds "
       << analysis.accuracy.residual_bound;
  warnings.push_back(text.str());
}

void warn_of_shortfalls(int wanted, Eigen::Index elastic, double shift, Warnings& warnings) {
  if (elastic < wanted)
    warnings.push_back(std::to_string(wanted) + " modes were asked for, but the mesh has only " +
                       std::to_string(elastic) + " elastic ones");
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
  FactoredBody(EigenBody body, Index nodes) : body_(std::move(body)), nodes_(nodes) {}

  const EigenBody& body() const { return body_; }
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

  EigenBody body_;
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

namespace {

/// The lowest modes by Lanczos, as many as are wanted.
EigenPairs compute_modes(const EigenBody& body, ElasticInverse& inverse, const std::vector<Index>& order,
                         const ModalAnalysisOptions& wanted, ModalAnalysis& analysis, Stopwatch& watch,
                         Warnings& warnings) {
  Eigen::Index kept = 0;
  EigenPairs pairs = lowest_modes(body.problem, inverse, wanted.modes, lanczos_options(wanted), kept);
  watch.lap(analysis.seconds.iterate);
  if (wanted.certify) {
    EigenvalueCounter counter(body.problem.K, body.problem.node_mass, order);
    complete(body.problem, inverse, counter, pairs, wanted.modes, kept);
    confirm_zero_modes(body.problem, pairs, counter, warnings);
    analysis.accuracy.certified = true;
  }
  watch.lap(analysis.seconds.certify);
  pairs.keep_first(kept);
  warn_of_shortfalls(wanted.modes, kept, inverse.shift(), warnings);
  return pairs;
}

/// The lowest modes that the slices hold, as many as are wanted.
EigenPairs modes_of_slices(const EigenBody& body, const ModalAnalysisOptions& wanted, ModalAnalysis& analysis,
                           Stopwatch& watch) {
  EigenPairs pairs = join_slices(body, wanted.slices);
  const Eigen::Index count = pairs.count();
  const Eigen::Index end = end_of_cluster(pairs.lambda, std::min<Eigen::Index>(wanted.modes, count), count);
  pairs.keep_first(end);
  analysis.accuracy.certified =
      std::all_of(wanted.slices.begin(), wanted.slices.end(), [](const SpectrumSlice& slice) { return slice.counted; });
  watch.lap(analysis.seconds.iterate);
  return pairs;
}

}  // namespace

ModalAnalysis analyse_modes(const TetMesh& mesh, std::span<const Material> materials,
                            std::span<const Index> fixed_nodes, const ModalAnalysisOptions& options, Warnings& warnings,
                            Jobs& jobs) {
  options.validate();
  ModalAnalysis analysis;
  analysis.nodes = static_cast<Index>(mesh.nodes.size());
  const BlasThreads threads(options.blas_threads);
  Stopwatch watch;

  const auto factored =
      std::make_shared<FactoredBody>(make_eigen_body(mesh, materials, fixed_nodes, options.mass, jobs), analysis.nodes);
  const EigenBody& body = factored->body();
  describe_freedom(body, analysis, warnings);
  watch.lap(analysis.seconds.assemble);
  if (body.free_nodes.empty()) {
    analysis.accuracy.certified = options.certify;  // nothing could be missed
    return analysis;
  }

  const bool sliced = !options.slices.empty(), factors = !sliced || options.keep_compliance,
             counts = std::isfinite(options.below);
  const std::vector<Index> order = factors || counts ? order_nodes(body.problem.K) : std::vector<Index>{};
  watch.lap(analysis.seconds.order);
  ElasticInverse* inverse = factors ? &factored->factor(order) : nullptr;
  watch.lap(analysis.seconds.factor);

  ModalAnalysisOptions wanted = options;
  if (counts) {
    EigenvalueCounter counter(body.problem.K, body.problem.node_mass, order);
    analysis.elastic_below = counter.below(options.below / body.eigenvalue_unit()) - analysis.freedom.zero_modes();
    wanted.modes = std::min(options.modes, analysis.elastic_below);
    watch.lap(analysis.seconds.certify);
  }

  EigenPairs pairs = sliced ? modes_of_slices(body, wanted, analysis, watch)
                            : compute_modes(body, *inverse, order, wanted, analysis, watch, warnings);
  make_clusters_canonical(pairs);
  measure_residuals(body.problem, pairs, analysis);
  warn_of_residuals(analysis, warnings);
  analysis.accuracy.orthogonality_max = orthogonality_error(body.problem, pairs);
  analysis.solves = inverse ? inverse->solves() : 0;
  write_modes(body, pairs, analysis);
  if (options.keep_compliance) analysis.compliance = factored;
  watch.lap(analysis.seconds.iterate);
  return analysis;
}

}  // namespace limber
