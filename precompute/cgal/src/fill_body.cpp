#include "fill_body.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "cgal_steps.h"
#include "coarsen.h"
#include "flat_tets.h"
#include "pinched_edges.h"

namespace limber::internal {
namespace {

// docs/tetrahedralisation.md has the measurements behind these.
constexpr double kLeastCellsPerBody = 8.0;  ///< a body smaller than this many cells gets smaller ones
constexpr double kSamplesPerCell = 2.0;     ///< along a side
constexpr double kFacetDistancePerCell = 0.1, kFacetDistancePerWideCell = kFacetDistancePerCell / kNodesOfWideCells;
/// Refinement that makes this many times the nodes expected is running away.
constexpr double kRunaway = 2.5;
constexpr std::size_t kFewNodes = 2000;               ///< are never too many
constexpr double kWorstShape = 0.01;                  ///< flatter tets (see worst_shape) spoil the stiffness
constexpr double kFiner = std::numbers::sqrt2 / 2.0;  ///< cells of the next try: of half the area
constexpr int kTries = 4;                             ///< with smaller and smaller cells
constexpr int kFailures = 2;                          ///< tries without a mesh, after which smaller cells are no hope
constexpr double kStrayPart = 0.01;                   ///< of its body's volume: a smaller loose piece is dropped
constexpr double kWorstVolume = 0.1;                  ///< of the body's: a worse error is not good
constexpr double kUselessVolume = 0.5;                ///< a worse error is no mesh of the body
constexpr double kWidth = 2.5;                        ///< of wide cells, over the thickness
constexpr double kShortest = 1.0, kLongest = 1.8;     ///< edges of wide cells, over their size
constexpr double kDeviation = 0.03;       ///< of the boundary by widening, of the cell size that fits the thickness
constexpr double kLeastWideShape = 0.05;  ///< a wide cell across a thin part is flat
constexpr double kLeastSize = 1e-3;       ///< of the cell size: nothing is made smaller for what is thin

/// How good a mesh is, best first.
enum class Grade { kGood, kInaccurate, kFlat, kNone };

struct Judged {
  FilledBody filled;
  Grade grade = Grade::kNone;
};

double volume(const TetMesh& mesh) {
  double sum = 0.0;
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) sum += signed_volume(mesh, static_cast<Index>(i));
  return sum;
}

/// Drops pieces that are no more than a splinter of the body: they hang on by a node or an edge, or not at all, and
/// each would swing or fly as a body of its own. @return pieces that are left
Index drop_stray_pieces(TetMesh& mesh, Index& dropped) {
  const std::vector<Index> piece = face_connected_parts(mesh);
  std::vector<double> of_piece(1 + *std::max_element(piece.begin(), piece.end()), 0.0);
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) of_piece[piece[i]] += signed_volume(mesh, static_cast<Index>(i));
  const double stray = kStrayPart * volume(mesh);
  std::vector<Tet> kept;
  for (std::size_t i = 0; i < mesh.tets.size(); ++i)
    if (of_piece[piece[i]] >= stray) kept.push_back(mesh.tets[i]);
  dropped = static_cast<Index>(mesh.tets.size() - kept.size());
  mesh.tets = std::move(kept);
  return static_cast<Index>(std::count_if(of_piece.begin(), of_piece.end(), [&](double v) { return v >= stray; }));
}

std::string percent(double part) { return std::to_string(std::lround(100.0 * part)) + " %"; }

Judged judge(MeshedBody meshed, const Body& body) {
  Judged j{.filled = {.mesh = std::move(meshed.mesh), .fault = std::move(meshed.failure)}};
  FilledBody& f = j.filled;
  if (!f.fault.empty()) return j;
  if (f.mesh.tets.empty()) {
    f.fault = "no tetrahedron";
    return j;
  }
  peel_flat_tets(f.mesh, kWorstShape);
  const Index pieces = drop_stray_pieces(f.mesh, f.dropped_tets);
  open_pinched_edges(f.mesh);
  const double error = std::abs(volume(f.mesh) / body.volume - 1.0);
  if (error > kUselessVolume) {
    f.fault = "its volume is " + percent(error) + " off";
    f.mesh = {};
  } else if (worst_shape(f.mesh) < kWorstShape) {
    j.grade = Grade::kFlat;
    f.fault = "flat tetrahedra";
  } else if (error > kWorstVolume || pieces > 1) {
    j.grade = Grade::kInaccurate;
    f.fault = "its volume is " + percent(error) + " off, in " + std::to_string(pieces) + " pieces";
  } else {
    j.grade = Grade::kGood;
  }
  return j;
}

struct Attempt {
  double fineness = 1.0;  ///< factor of all cells that are not the smallest; ≤ 1
  bool keep_sharp_edges = false;
  bool wide_cells = false;
};

/// Widens cells where the body is thin. A mesh that is not good is left as it is.
void widen_cells(const MeasuredBody& body, double smallest_cell, Judged& judged) {
  if (judged.grade != Grade::kGood) return;
  std::vector<ThicknessSample> samples = body.samples;
  const SizeField narrow(samples, body.cell_size, smallest_cell);
  for (ThicknessSample& s : samples) s.thickness = kWidth * std::max(s.thickness, smallest_cell);
  const SizeField wide(samples, body.cell_size, smallest_cell);
  coarsen(judged.filled.mesh,
          {.shortest = [&](const Vec3& x) { return kShortest * kWidth / (kWidth - 1.0) * (wide(x) - narrow(x)); },
           .longest = [&](const Vec3& x) { return kLongest * wide(x); },
           .deviation = [&](const Vec3& x) { return kDeviation * narrow(x); },
           .least_shape = kLeastWideShape});
}

Judged make(const MeasuredBody& body, double smallest_cell, const Attempt& how) {
  const double largest = how.fineness * body.cell_size, least = std::min(smallest_cell, largest);
  const SizeField field(body.samples, body.cell_size, smallest_cell);
  const auto size = [&](const Vec3& x) { return std::max(how.fineness * field(x), least); };
  std::vector<ThicknessSample> samples = body.samples;
  for (ThicknessSample& s : samples) s.thickness *= how.fineness;
  const double expected = expected_nodes(samples, body.body->volume, largest, least);
  const double runaway = kRunaway * (how.wide_cells ? kNodesOfWideCells : 1.0);
  Judged j = judge(mesh_body(body.body->boundary, body.body->inner, body.body->seeds,
                             {.cell_size = size,
                              .facet_distance = how.wide_cells ? kFacetDistancePerWideCell : kFacetDistancePerCell,
                              .keep_sharp_edges = how.keep_sharp_edges,
                              .max_nodes = static_cast<std::size_t>(runaway * expected) + kFewNodes}),
                   *body.body);
  j.filled.sharp_edges_kept = how.keep_sharp_edges;
  return j;
}

/// The boundary and the inner surfaces, between which cells must fit.
SurfaceMesh all_surfaces(const Body& body) {
  SurfaceMesh all = body.boundary;
  for (const SurfaceMesh& surface : body.inner) append(surface, all);
  return all;
}

}  // namespace

double MeasuredBody::nodes_to_resolve() const { return expected_nodes(kLeastSize * cell_size); }

double MeasuredBody::expected_nodes(double smallest) const {
  return internal::expected_nodes(samples, body->volume, cell_size, smallest);
}

MeasuredBody measure(const Body& body, double cell_size) {
  const double size = std::min(cell_size, body.diagonal / kLeastCellsPerBody);
  return {&body, size, sample_thickness(all_surfaces(body), size / kSamplesPerCell, size)};
}

double smallest_affordable_cell(const std::vector<MeasuredBody>& bodies, double most_nodes) {
  const auto fits = [&](double smallest) {
    double expected = 0.0;
    for (const MeasuredBody& b : bodies) expected += b.expected_nodes(smallest);
    return expected <= most_nodes;
  };
  double high = 0.0;
  for (const MeasuredBody& b : bodies) high = std::max(high, b.cell_size);
  double low = kLeastSize * high;
  if (fits(low)) return low;
  while (high > 1.01 * low) {
    const double middle = std::sqrt(low * high);
    (fits(middle) ? high : low) = middle;
  }
  return high;
}

FilledBody fill(const MeasuredBody& body, double smallest_cell, const Filling& asked) {
  Filling filling = asked;
  filling.wide_cells = asked.wide_cells && body.body->inner.empty();  // widening would leave the inner surfaces
  Judged best;
  int tries = 0;
  const auto attempt = [&](const Attempt& how) {
    Judged j = make(body, smallest_cell, how);
    ++tries;
    const Grade grade = j.grade;
    if (tries == 1 || grade < best.grade) best = std::move(j);
    return grade;
  };
  Attempt how{.keep_sharp_edges = filling.keep_sharp_edges, .wide_cells = filling.wide_cells};
  int failures = 0;
  for (int i = 0; i < kTries && failures < kFailures && best.grade != Grade::kGood; ++i, how.fineness *= kFiner) {
    bool failed = attempt(how) == Grade::kNone;
    if (failed && how.keep_sharp_edges) {
      how.keep_sharp_edges = false;
      failed = attempt(how) == Grade::kNone;
    }
    failures += failed ? 1 : 0;
  }
  if (best.grade != Grade::kGood && how.keep_sharp_edges) attempt({.wide_cells = filling.wide_cells});
  if (filling.wide_cells) widen_cells(body, smallest_cell, best);
  best.filled.tries = tries;
  return best.filled;
}

}  // namespace limber::internal
