#include "limber/precompute/tetrahedralise.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <numbers>
#include <sstream>

#include "cgal_steps.h"
#include "limber/core/disjoint_sets.h"
#include "limber/core/error.h"
#include "shells.h"

namespace limber {
namespace {

// Defaults and bounds; docs/tetrahedralisation.md has the measurements behind them.
constexpr double kCellsPerDiagonal = 40.0;
constexpr double kAlphasPerDiagonal = 50.0;
constexpr double kOffsetPerAlpha = 1.0 / 30.0;
constexpr double kFacetDistancePerCell = 0.1;
constexpr double kLeastCellsPerBody = 8.0;  ///< a body smaller than this many cells gets smaller ones
constexpr double kTetsPerCubicCell = 6.0;   ///< tets in a volume of cell_size³
constexpr double kMostTets = 20e6;
/// Refinement that makes this many times the nodes expected is running away.
constexpr double kNodesPerExpected = 20.0;
constexpr double kWorstShape = 0.01;  ///< a mesh with a flatter tet (see worst_shape) is made again, finer
constexpr double kFiner = 0.8;        ///< cells of the next try
constexpr int kTries = 4;
constexpr double kStrayPart = 0.01;  ///< of its body's volume: a smaller loose piece is dropped
constexpr double kWorrisomeVolumeError = 0.1;

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
  const cgal::Crossings crossings = cgal::find_crossings(surface);
  note(crossings.pinched_vertices, "vertices where parts touch at a point");
  note(crossings.triangle_pairs, "pairs of crossing triangles");
  return reasons;
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

double cell_size_of(const Body& body, double cell_size) {
  return std::min(cell_size, body.diagonal / kLeastCellsPerBody);
}

void refuse_huge_mesh(const Bodies& bodies, double cell_size) {
  double expected = 0.0;
  for (const Body& body : bodies.bodies)
    expected += kTetsPerCubicCell * body.volume / std::pow(cell_size_of(body, cell_size), 3);
  if (!(expected <= kMostTets))
    throw ComputationError("tetrahedralise: cell size " + text(cell_size) + " m would give about " + text(expected) +
                           " tetrahedra, expected at most " + text(kMostTets) + "; try cell size " +
                           text(cell_size * std::cbrt(expected / kMostTets) * 1.1));
}

/// Drops pieces that are no more than a splinter of the body: they hang on by a node or an edge, or not at all, and
/// each would swing or fly as a body of its own.
Index drop_stray_pieces(TetMesh& mesh, Index& pieces_left) {
  const std::vector<Index> piece = face_connected_parts(mesh);
  std::vector<double> volume(1 + *std::max_element(piece.begin(), piece.end()), 0.0);
  double whole = 0.0;
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    const double v = signed_volume(mesh, static_cast<Index>(i));
    volume[piece[i]] += v;
    whole += v;
  }
  std::vector<Tet> kept;
  for (std::size_t i = 0; i < mesh.tets.size(); ++i)
    if (volume[piece[i]] >= kStrayPart * whole) kept.push_back(mesh.tets[i]);
  pieces_left = static_cast<Index>(
      std::count_if(volume.begin(), volume.end(), [&](double v) { return v >= kStrayPart * whole; }));
  const auto dropped = static_cast<Index>(mesh.tets.size() - kept.size());
  mesh.tets = std::move(kept);
  return dropped;
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

/// More nodes than a body of this volume, boundary and detail can need.
std::size_t most_nodes(const Body& body, double cell_size) {
  const double inside = body.volume / std::pow(cell_size, 3),
               on_boundary = area(body.boundary) / std::pow(cell_size, 2);
  return static_cast<std::size_t>(kNodesPerExpected * (inside + on_boundary)) + 4 * body.boundary.vertices.size() +
         1000;
}

/// Volume of the flattest tet over that of the regular tet with the same mean squared edge: 1 is best, 0 flat.
double worst_shape(const TetMesh& mesh) {
  double worst = 1.0;
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    double squared = 0.0;
    for (int a = 0; a < 4; ++a)
      for (int b = a + 1; b < 4; ++b)
        squared += (mesh.nodes[mesh.tets[i][a]] - mesh.nodes[mesh.tets[i][b]]).squaredNorm();
    const double regular = std::pow(squared / 6.0, 1.5) / (6.0 * std::numbers::sqrt2);
    worst = std::min(worst, signed_volume(mesh, static_cast<Index>(i)) / regular);
  }
  return worst;
}

/// Tets of a body, none so flat that it spoils the stiffness. Where all nodes lie on sharp edges, as in a rod one cell
/// thick, flat tets cannot be helped: smaller cells can, and the last resort is to let the edges go.
TetMesh mesh_well(const Body& body, double cell_size, bool keep_sharp_edges) {
  const auto attempt = [&](double size, bool edges) {
    return cgal::mesh_body(body.boundary, body.seeds,
                           {.cell_size = size,
                            .facet_distance = kFacetDistancePerCell * size,
                            .keep_sharp_edges = edges,
                            .max_nodes = most_nodes(body, size)});
  };
  double size = cell_size;
  for (int i = 0; i < kTries; ++i, size *= kFiner)
    if (TetMesh mesh = attempt(size, keep_sharp_edges); worst_shape(mesh) >= kWorstShape) return mesh;
  return attempt(cell_size, false);
}

/// Meshes one body and adds it to the whole.
void add_body(const Body& body, double wanted_cell_size, bool keep_sharp_edges, const std::string& which, TetMesh& mesh,
              Warnings& warnings) {
  const double cell_size = cell_size_of(body, wanted_cell_size);
  TetMesh tets = mesh_well(body, cell_size, keep_sharp_edges);
  if (tets.tets.empty())
    throw ComputationError("tetrahedralise: " + which + " (diagonal " + text(body.diagonal) +
                           " m) gave no tetrahedron at "
                           "cell size " +
                           text(cell_size) + " m: it is too thin; try a smaller cell size");
  Index pieces = 0;
  const Index dropped = drop_stray_pieces(tets, pieces);
  if (dropped > 0)
    warnings.push_back("tetrahedralise: " + which + ": " + std::to_string(dropped) +
                       " stray tetrahedra, joined to the rest by less than a face, have been dropped");
  if (pieces > 1)
    warnings.push_back("tetrahedralise: " + which + " came apart into " + std::to_string(pieces) +
                       " pieces: parts of it are thinner than the cell size of " + text(cell_size) +
                       " m; try a smaller one");
  append(tets, mesh);
}

}  // namespace

void TetrahedralisationOptions::validate() const {
  for (const auto& [name, value] : {std::pair("cell_size", cell_size), std::pair("alpha", alpha)})
    if (!(value >= 0.0 && std::isfinite(value)))
      throw InvalidArgument(std::string("TetrahedralisationOptions: ") + name + " is " + text(value) +
                            " m, expected a finite length above 0, or 0 for the default");
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
  const double cell_size = options.cell_size > 0.0 ? options.cell_size : diagonal / kCellsPerDiagonal;
  const double alpha = options.alpha > 0.0 ? options.alpha : diagonal / kAlphasPerDiagonal;

  Tetrahedralisation result;
  input = welded(input);
  result.why_wrapped = what_is_not_clean(input);
  result.wrapped = !result.why_wrapped.empty();
  if (result.wrapped) {
    refuse_huge_wrap(input, alpha);
    cap_holes(input);
    const auto start = std::chrono::steady_clock::now();
    input = cgal::wrap(input, alpha, kOffsetPerAlpha * alpha);
    result.seconds_wrap = seconds_since(start);
  }

  const Bodies bodies = split_into_bodies(input);
  if (bodies.turned > 0)
    warnings.push_back("tetrahedralise: " + std::to_string(bodies.turned) +
                       " closed shells were inside out for where they lie and have been turned");
  refuse_huge_mesh(bodies, cell_size);

  const auto start = std::chrono::steady_clock::now();
  for (std::size_t b = 0; b < bodies.bodies.size(); ++b) {
    add_body(bodies.bodies[b], cell_size, !result.wrapped, "body " + std::to_string(b), result.mesh, warnings);
    result.volume_before += bodies.bodies[b].volume;
  }
  result.seconds_mesh = seconds_since(start);

  result.mesh.regions = {{"*", 0}};
  validate(result.mesh, "tetrahedralise", warnings);
  result.volume_after = volume_properties(result.mesh).volume;
  if (std::abs(result.volume_after - result.volume_before) > kWorrisomeVolumeError * result.volume_before)
    warnings.push_back("tetrahedralise: the surface encloses " + text(result.volume_before) + " m^3, the tetrahedra " +
                       text(result.volume_after) +
                       " m^3: parts are thinner than the cell size; try a smaller one than " + text(cell_size) + " m");
  return result;
}

}  // namespace limber
