#include "limber/precompute/tetrahedralise.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <sstream>

#include "cgal_steps.h"
#include "fill_body.h"
#include "limber/core/disjoint_sets.h"
#include "limber/core/error.h"

namespace limber {
namespace {

using internal::Bodies;
using internal::Body;
using internal::FilledBody;
using internal::MeasuredBody;

// Defaults and bounds; docs/tetrahedralisation.md has the measurements behind them.
constexpr double kCellsPerDiagonal = 40.0, kQuadraticCellsPerDiagonal = 16.0;
constexpr double kAlphasPerDiagonal = 50.0;
constexpr double kOffsetPerAlpha = 1.0 / 30.0;
constexpr double kTetsPerCubicCell = 6.0;  ///< tets in a volume of cell_size³
constexpr double kMostTets = 20e6;
constexpr double kFlatSurface = 1e-9;  ///< of its extent: a surface that is thinner bounds nothing

std::string text(double value) {
  std::ostringstream s;
  s.precision(4);
  s << value;
  return s.str();
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

Eigen::AlignedBox3d bounding_box(const SurfaceMesh& surface) {
  Eigen::AlignedBox3d box;
  for (const Triangle& t : surface.triangles)
    for (const Index v : t) box.extend(surface.vertices[v]);
  return box;
}

/// Joins vertices at equal coordinates, leaves out unused ones and triangles that collapse: exporters split vertices
/// where normals or texture coordinates jump.
SurfaceMesh welded(const SurfaceMesh& surface) {
  const auto before = [](const Vec3& a, const Vec3& b) {
    return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
  };
  std::map<Vec3, Index, decltype(before)> index_of(before);
  SurfaceMesh out;
  for (const Triangle& t : surface.triangles) {
    Triangle joined;
    for (int a = 0; a < 3; ++a) {
      const auto [entry, fresh] = index_of.try_emplace(surface.vertices[t[a]], static_cast<Index>(out.vertices.size()));
      if (fresh) out.vertices.push_back(surface.vertices[t[a]]);
      joined[a] = entry->second;
    }
    if (joined[0] != joined[1] && joined[1] != joined[2] && joined[2] != joined[0]) out.triangles.push_back(joined);
  }
  return out;
}

Index count_flat_triangles(const SurfaceMesh& surface) {
  Index flat = 0;
  for (const Triangle& t : surface.triangles) {
    const Vec3 a = surface.vertices[t[1]] - surface.vertices[t[0]], b = surface.vertices[t[2]] - surface.vertices[t[0]];
    const double longest = std::max({a.squaredNorm(), b.squaredNorm(), (a - b).squaredNorm()});
    if (!(a.cross(b).norm() > 1e-12 * longest)) ++flat;
  }
  return flat;
}

/// "12 boundary edges, 3 pairs of crossing triangles"; empty for a clean closed surface.
std::string what_is_not_clean(const SurfaceMesh& surface) {
  std::string reasons;
  const auto note = [&](Index count, const char* what) {
    if (count > 0) reasons += (reasons.empty() ? "" : ", ") + std::to_string(count) + " " + what;
  };
  const SurfaceQuality quality = surface_quality(surface);
  note(quality.boundary_edges, "boundary edges");
  note(quality.non_manifold_edges, "edges of three or more triangles");
  note(quality.misoriented_edges, "edges between triangles of opposite orientation");
  note(count_flat_triangles(surface), "flat triangles");
  if (!reasons.empty()) return reasons;
  const internal::Crossings crossings = internal::find_crossings(surface);
  note(crossings.pinched_vertices, "vertices where parts touch at a point");
  note(crossings.triangle_pairs, "pairs of crossing triangles");
  return reasons;
}

/// A surface in one plane bounds no volume, whatever its triangles are.
void refuse_flat(const SurfaceMesh& surface) {
  Vec3 middle = Vec3::Zero();
  for (const Vec3& v : surface.vertices) middle += v / static_cast<double>(surface.vertices.size());
  Mat3 spread = Mat3::Zero();
  for (const Vec3& v : surface.vertices) spread += (v - middle) * (v - middle).transpose();
  const Mat3 axes = Eigen::SelfAdjointEigenSolver<Mat3>(spread).eigenvectors();
  double thickness = 0.0;
  for (const Vec3& v : surface.vertices) thickness = std::max(thickness, std::abs(axes.col(0).dot(v - middle)));
  if (surface.triangles.empty() || thickness <= kFlatSurface * bounding_box(surface).diagonal().norm())
    throw InputError("tetrahedralise: the surface is flat: its " + std::to_string(surface.triangles.size()) +
                     " triangles lie in one plane, expected a surface around a volume; try giving it a thickness");
}

void tell(const TetrahedralisationOptions& options, const std::string& stage) {
  if (options.progress) options.progress(stage);
}

double area(const SurfaceMesh& surface) {
  double sum = 0.0;
  for (const Triangle& t : surface.triangles)
    sum +=
        0.5 *
        (surface.vertices[t[1]] - surface.vertices[t[0]]).cross(surface.vertices[t[2]] - surface.vertices[t[0]]).norm();
  return sum;
}

/// Closes every hole with a cone from its rim to the rim's middle, whatever its size: a wrap that went in through a
/// hole would be a shell as thin as its offset on both sides of the surface, and no cell fits in there.
void cap_holes(SurfaceMesh& surface) {
  std::map<std::pair<Index, Index>, int> triangles_at;  // per edge
  for (const Triangle& t : surface.triangles)
    for (int a = 0; a < 3; ++a) {
      const Index i = t[a], j = t[(a + 1) % 3];
      triangles_at[std::minmax(i, j)] += 1;
    }
  DisjointSets rims(surface.vertices.size());
  for (const auto& [edge, triangles] : triangles_at)
    if (triangles == 1) rims.join(edge.first, edge.second);
  std::map<Index, std::pair<Vec3, double>>
      middle;  // per rim, the length-weighted sum of its edges' middles, and the length
  for (const auto& [edge, triangles] : triangles_at) {
    if (triangles != 1) continue;
    const Vec3 &a = surface.vertices[edge.first], &b = surface.vertices[edge.second];
    auto& [sum, length] = middle.try_emplace(rims.root(edge.first), Vec3::Zero(), 0.0).first->second;
    sum += 0.5 * (b - a).norm() * (a + b);
    length += (b - a).norm();
  }
  std::map<Index, Index> tip;
  for (const auto& [rim, m] : middle) {
    tip[rim] = static_cast<Index>(surface.vertices.size());
    surface.vertices.push_back(m.first / m.second);
  }
  for (const auto& [edge, triangles] : triangles_at)
    if (triangles == 1) surface.triangles.push_back({edge.first, edge.second, tip[rims.root(edge.first)]});
}

void refuse_huge_wrap(const SurfaceMesh& surface, double alpha) {
  const double expected =
      4.0 * area(surface) / (alpha * alpha);  // both sides of every sheet, triangles of side about alpha
  if (!(expected <= kMostTets))
    throw ComputationError("tetrahedralise: alpha " + text(alpha) + " m would give about " + text(expected) +
                           " triangles of wrap, expected at most " + text(kMostTets) + "; try alpha " +
                           text(alpha * std::sqrt(expected / kMostTets) * 2.0));
}

/// Mends what it can, and tells it; `why_wrapped` is then of the surface as mended.
void mend(SurfaceMesh& surface, Tetrahedralisation& result, Warnings& warnings) {
  const std::string before = result.why_wrapped;
  result.mending = mend_surface(surface, weld_tolerance(surface));
  if (!result.mending.any()) return;
  refuse_flat(surface);
  result.why_wrapped = what_is_not_clean(surface);
  if (result.why_wrapped.empty())
    warnings.push_back("tetrahedralise: the surface has been mended (" + result.mending.text() + "); it had " + before);
}

/// What the offset adds, by Steiner's formula to first order: the volume between parallel surfaces is their area times
/// the distance.
void warn_of_wrap(const SurfaceMesh& wrap, double offset, Tetrahedralisation& result, Warnings& warnings) {
  const double volume = enclosed_volume(wrap);
  result.wrap_adds = std::min(offset * area(wrap), volume);
  warnings.push_back("tetrahedralise: the surface has been wrapped, since it has " + result.why_wrapped +
                     "; the wrap stands " + text(offset) + " m off, which makes about " + text(result.wrap_adds) +
                     " of its " + text(volume) + " m^3 (" + text(std::round(100.0 * result.wrap_adds / volume)) +
                     " % of volume and mass); a smaller alpha adds less");
}

void refuse_huge_mesh(const std::vector<MeasuredBody>& bodies, double cell_size) {
  double expected = 0.0;
  for (const MeasuredBody& b : bodies) expected += kTetsPerCubicCell * b.body->volume / std::pow(b.cell_size, 3);
  if (!(expected <= kMostTets))
    throw ComputationError("tetrahedralise: cell size " + text(cell_size) + " m would give about " + text(expected) +
                           " tetrahedra, expected at most " + text(kMostTets) + "; try cell size " +
                           text(cell_size * std::cbrt(expected / kMostTets) * 1.1));
}

/// Adds the tets of one body, its nodes renumbered in order of appearance so that none is left over.
void append(const TetMesh& body, TetMesh& mesh) {
  std::vector<Index> new_index(body.nodes.size(), -1);
  for (Tet t : body.tets) {
    for (Index& n : t) {
      if (new_index[n] < 0) {
        new_index[n] = static_cast<Index>(mesh.nodes.size());
        mesh.nodes.push_back(body.nodes[n]);
      }
      n = new_index[n];
    }
    mesh.tets.push_back(t);
    mesh.tet_region.push_back(0);
  }
}

/// What to try where a mesh failed. More nodes help thin parts that wait for them, none help a surface that bends
/// within a cell; the walls of a wrap can be made thicker.
std::string way_out(double nodes_to_resolve, bool wrapped, const TetrahedralisationOptions& options) {
  if (nodes_to_resolve <= options.max_nodes)
    return "; its surface bends too sharply for such cells: try a smaller cell size (--cell-size), or smooth it";
  return "; its thin parts ask for " + text(nodes_to_resolve) +
         " nodes in all: try max_nodes (--max-nodes) above that" +
         (wrapped ? ", or a larger alpha (--alpha): the wrap is alpha / 15 thick where it is an open sheet's"
                  : ", or another cell size");
}

/// Fills one body and adds its tets to the whole. @param advice for where that fails
void add_body(const MeasuredBody& body, const std::string& which, const internal::Filling& how,
              const std::string& advice, Tetrahedralisation& result, Warnings& warnings) {
  const FilledBody filled = internal::fill(body, result.smallest_cell, how);
  result.tries += filled.tries;
  result.sharp_edges_kept = result.sharp_edges_kept && filled.sharp_edges_kept;
  const std::string sized = "tetrahedralise: " + which + " (diagonal " + text(body.body->diagonal) + " m, cells of " +
                            text(body.cell_size) + " m, " + text(result.smallest_cell) + " m where it is thin): ";
  if (filled.mesh.tets.empty())
    throw ComputationError(sized + filled.fault + " in the best of " + std::to_string(filled.tries) +
                           " tries, expected a mesh" + advice);
  if (!filled.fault.empty()) warnings.push_back(sized + filled.fault + advice);
  if (filled.dropped_tets > 0)
    warnings.push_back("tetrahedralise: " + which + ": " + std::to_string(filled.dropped_tets) +
                       " stray tetrahedra, joined to the rest by less than a face, have been dropped");
  append(filled.mesh, result.mesh);
}

/// Fills all bodies, the cells as small as thin parts ask for and the budget of nodes allows.
void fill_bodies(const Bodies& bodies, double cell_size, const TetrahedralisationOptions& options,
                 Tetrahedralisation& result, Warnings& warnings) {
  auto start = std::chrono::steady_clock::now();
  tell(options, "measuring thickness");
  std::vector<MeasuredBody> measured;
  for (const Body& body : bodies.bodies) measured.push_back(internal::measure(body, cell_size));
  refuse_huge_mesh(measured, cell_size);
  const internal::Filling how{.keep_sharp_edges = !result.wrapped, .wide_cells = options.quadratic};
  result.smallest_cell = internal::smallest_affordable_cell(measured, options.max_nodes / how.nodes_per_expected());
  result.seconds_thickness = seconds_since(start);

  start = std::chrono::steady_clock::now();
  result.sharp_edges_kept = !result.wrapped;
  double nodes_to_resolve = 0.0;
  for (const MeasuredBody& b : measured) nodes_to_resolve += how.nodes_per_expected() * b.nodes_to_resolve();
  const std::string advice = way_out(nodes_to_resolve, result.wrapped, options);
  for (std::size_t b = 0; b < measured.size(); ++b) {
    tell(options, "meshing body " + std::to_string(b + 1) + " of " + std::to_string(measured.size()));
    add_body(measured[b], "body " + std::to_string(b), how, advice, result, warnings);
    result.volume_before += bodies.bodies[b].volume;
  }
  result.seconds_mesh = seconds_since(start);
}

}  // namespace

void TetrahedralisationOptions::validate() const {
  for (const auto& [name, value] : {std::pair("cell_size", cell_size), std::pair("alpha", alpha)})
    if (!(value >= 0.0 && std::isfinite(value)))
      throw InvalidArgument(std::string("TetrahedralisationOptions: ") + name + " is " + text(value) +
                            " m, expected a finite length above 0, or 0 for the default");
  if (max_nodes < 1)
    throw InvalidArgument("TetrahedralisationOptions: max_nodes is " + std::to_string(max_nodes) +
                          ", expected at least 1");
}

Tetrahedralisation tetrahedralise(const SurfaceMesh& surface, const TetrahedralisationOptions& options,
                                  Warnings& warnings) {
  options.validate();
  SurfaceMesh input = surface;
  validate(input, "tetrahedralise", warnings);
  const double diagonal = bounding_box(input).diagonal().norm();
  if (!(diagonal > 0.0 && std::isfinite(diagonal)))
    throw InputError("tetrahedralise: the surface's bounding box has diagonal " + text(diagonal) +
                     " m, expected a finite length above 0");
  const double cell_size = options.cell_size > 0.0
                               ? options.cell_size
                               : diagonal / (options.quadratic ? kQuadraticCellsPerDiagonal : kCellsPerDiagonal);
  const double alpha = options.alpha > 0.0 ? options.alpha : diagonal / kAlphasPerDiagonal;

  Tetrahedralisation result;
  input = welded(input);
  refuse_flat(input);
  tell(options, "checking the surface");
  result.why_wrapped = what_is_not_clean(input);
  if (!result.why_wrapped.empty()) {
    tell(options, "mending the surface");
    mend(input, result, warnings);
  }
  result.wrapped = !result.why_wrapped.empty();
  if (result.wrapped) {
    tell(options, "wrapping");
    refuse_huge_wrap(input, alpha);
    cap_holes(input);
    const auto start = std::chrono::steady_clock::now();
    input = internal::wrap(input, alpha, kOffsetPerAlpha * alpha);
    result.seconds_wrap = seconds_since(start);
    warn_of_wrap(input, kOffsetPerAlpha * alpha, result, warnings);
  }

  Bodies bodies = internal::split_into_bodies(input);
  for (const SurfaceMesh& inner : options.inner_surfaces) {
    SurfaceMesh clean = inner;
    validate(clean, "tetrahedralise: an inner surface", warnings);
    clean = welded(clean);
    result.followed.push_back(what_is_not_clean(clean).empty() && internal::add_inner_surface(clean, bodies));
  }
  if (bodies.turned > 0)
    warnings.push_back("tetrahedralise: " + std::to_string(bodies.turned) +
                       " closed shells were inside out for where they lie and have been turned");
  fill_bodies(bodies, cell_size, options, result, warnings);

  result.mesh.regions = {{"*", 0}};
  validate(result.mesh, "tetrahedralise", warnings);
  result.volume_after = volume_properties(result.mesh).volume;
  return result;
}

Index crossing_triangles(const SurfaceMesh& a, const SurfaceMesh& b) {
  SurfaceMesh both = a;
  internal::append(b, both);
  return internal::find_crossings(both).triangle_pairs;
}

}  // namespace limber
