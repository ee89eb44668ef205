#include "limber/precompute/spectrum_slice.h"

#include <cmath>

#include "eigen/blas_threads.h"
#include "eigen/eigen_body.h"
#include "eigen/elastic_modes.h"
#include "eigen/hertz.h"
#include "eigen/join_slices.h"
#include "limber/core/error.h"
#include "limber/precompute/modal_analysis.h"

namespace limber {

SpectrumSlice analyse_slice(const TetMesh& mesh, std::span<const Material> materials,
                            std::span<const Index> fixed_nodes, const FrequencyBand& band,
                            const ModalAnalysisOptions& options, Warnings& warnings, Jobs& jobs) {
  options.validate();
  band.validate();
  const internal::BlasThreads threads(options.blas_threads);
  const internal::EigenBody body = internal::make_eigen_body(mesh, materials, fixed_nodes, options.mass, jobs);
  SpectrumSlice slice{
      .band = band, .problem = internal::fingerprint(body), .nodes = static_cast<Index>(mesh.nodes.size())};
  if (body.free_nodes.empty()) return slice;

  const internal::ScaledProblem& problem = body.problem;
  const std::vector<Index> order = internal::order_nodes(problem.K);
  EigenvalueCounter counter(problem.K, problem.node_mass, order);
  const double low = internal::eigenvalue_of_hz(band.low) / body.eigenvalue_unit(),
               high = internal::eigenvalue_of_hz(band.high) / body.eigenvalue_unit();
  slice.below_low = low > 0.0 ? counter.below(low) : static_cast<int>(problem.N.cols());
  slice.below_high = counter.below(high);

  internal::ShiftedInverse inverse(problem, order, (low + high) / 2.0);
  internal::EigenPairs pairs = internal::modes_between(problem, inverse, low, high, slice.below_high - slice.below_low,
                                                       {.tolerance = 1e-8, .seed = options.seed});
  if (low == 0.0 && pairs.count() > 0) internal::confirm_zero_modes(problem, pairs, counter, warnings);
  internal::make_clusters_canonical(pairs);
  for (const double lambda : pairs.lambda) slice.eigenvalues.push_back(lambda * body.eigenvalue_unit());
  internal::append_columns(body, slice.nodes, pairs.W, 1.0 / std::sqrt(body.mass_unit), slice.shapes);
  return slice;
}

}  // namespace limber
