#include "limber/precompute/bake.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>

#include "bake/residual.h"
#include "bake/simplify_surface.h"
#include "fem/frequency_error.h"
#include "fem/locking.h"
#include "fem/mass_properties.h"
#include "limber/core/error.h"
#include "limber/mesh/ten_node_tet.h"
#include "limber/model/embedding.h"
#include "skin/bake_skin.h"

namespace limber {
namespace {

using internal::append_residual_modes;
using internal::mass_properties;
using internal::MassProperties;
using internal::node_loads;
using internal::patch_loads;
using internal::residual_compliance;
using internal::SimplifiedSurface;
using internal::simplify_surface;

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

// Materials ---------------------------------------------------------------------------------------------------------

const Material* find_material(const MaterialTable& table, const Region& region) {
  for (const std::string& key : {region.name, std::to_string(region.tag), std::string("*")})
    if (const auto found = table.find(key); found != table.end()) return &found->second;
  return nullptr;
}

/// The material of each region; one that no tet uses may have none.
std::vector<Material> materials_by_region(const TetMesh& mesh, const MaterialTable& table) {
  for (const auto& [name, material] : table) material.validate("material of \"" + name + "\"");
  std::vector<char> used(mesh.regions.size(), 0);
  for (const Index r : mesh.tet_region) used[r] = 1;
  std::vector<Material> materials(mesh.regions.size());
  for (std::size_t r = 0; r < mesh.regions.size(); ++r) {
    const Material* found = find_material(table, mesh.regions[r]);
    if (!found && used[r])
      throw InputError("materials: region \"" + mesh.regions[r].name + "\" (tag " +
                       std::to_string(mesh.regions[r].tag) +
                       ") of the mesh has no material; name it, or give \"*\" for the rest");
    if (found) materials[r] = *found;
  }
  return materials;
}

void warn_of_unknown_regions(const TetMesh& mesh, const MaterialTable& table, Warnings& warnings) {
  for (const auto& [name, unused] : table) {
    const auto is_named = [&name = name](const Region& r) { return r.name == name || std::to_string(r.tag) == name; };
    if (name != "*" && std::none_of(mesh.regions.begin(), mesh.regions.end(), is_named))
      warnings.push_back("materials: the mesh has no region \"" + name + "\"");
  }
}

// Surfaces ----------------------------------------------------------------------------------------------------------

/// Deals the triangles of a surface of the whole input out to the bodies: each goes to the one that holds most of its
/// vertices.
std::vector<SurfaceMesh> deal(const SurfaceMesh& surface, const TetMesh& mesh, std::span<const Index> component,
                              Index bodies) {
  if (bodies == 1) return {surface};
  const Embedding whole = embed(surface.vertices, mesh);
  const auto body_of = [&](Index vertex) { return component[whole.vertices[vertex].tet]; };
  std::vector<SurfaceMesh> parts(bodies);
  std::vector<std::vector<Index>> new_index(bodies, std::vector<Index>(surface.vertices.size(), -1));
  for (const Triangle& t : surface.triangles) {
    const Index body = body_of(t[1]) == body_of(t[2]) ? body_of(t[1]) : body_of(t[0]);
    SurfaceMesh& part = parts[body];
    Triangle mapped{};
    for (int a = 0; a < 3; ++a) {
      Index& index = new_index[body][t[a]];
      if (index < 0) {
        index = static_cast<Index>(part.vertices.size());
        part.vertices.push_back(surface.vertices[t[a]]);
      }
      mapped[a] = index;
    }
    part.triangles.push_back(mapped);
  }
  return parts;
}

std::vector<std::optional<SurfaceMesh>> deal_if_any(const std::optional<SurfaceMesh>& surface, const TetMesh& mesh,
                                                    std::span<const Index> component, Index bodies, const char* which) {
  std::vector<std::optional<SurfaceMesh>> out(bodies);
  if (!surface) return out;
  auto parts = deal(*surface, mesh, component, bodies);
  for (Index b = 0; b < bodies; ++b) {
    if (parts[b].triangles.empty())
      throw InputError(std::string(which) + " surface: no triangle of it lies at body " + std::to_string(b + 1) +
                       " of " + std::to_string(bodies) + ", expected it to cover every connected part of the mesh");
    out[b] = std::move(parts[b]);
  }
  return out;
}

/// A surface with where its vertices sit in the mesh of one body.
struct PlacedSurface {
  SurfaceMesh surface;
  Embedding embedding;
  EmbeddingReport report() const {
    return {static_cast<Index>(surface.vertices.size()), embedding.outside, embedding.max_distance};
  }
};

PlacedSurface place(const SurfaceMesh& surface, const TetMesh& mesh) {
  return {surface, embed(surface.vertices, mesh)};
}

PlacedSurface place_boundary(const TetMesh& mesh) {
  BoundarySurface boundary = boundary_surface(mesh);
  Embedding embedding = embed_nodes(boundary.node_of, mesh);
  return {std::move(boundary.surface), std::move(embedding)};
}

/// A coarser surface on some of the vertices of a finer one.
PlacedSurface simplified(const PlacedSurface& fine, std::size_t triangles, double& error) {
  SimplifiedSurface coarse = simplify_surface(fine.surface, triangles);
  error = coarse.error;
  PlacedSurface placed{std::move(coarse.surface), fine.embedding};
  placed.embedding.vertices.clear();
  for (const Index v : coarse.vertex_of) placed.embedding.vertices.push_back(fine.embedding.vertices[v]);
  return placed;
}

// Modes at nodes and surfaces ---------------------------------------------------------------------------------------

/// Column `mode` of W or M W at a node.
Vec3 at_node(std::span<const double> shapes, Index nodes, Index mode, Index node) {
  return Eigen::Map<const Vec3>(shapes.data() + 3 * (static_cast<std::size_t>(mode) * nodes + node));
}

Vec3 at_vertex(const ModalAnalysis& a, Index mode, const NodeShares& v) {
  Vec3 u = Vec3::Zero();
  for (std::size_t c = 0; c < v.count; ++c) u += v.share[c] * at_node(a.shapes, a.nodes, mode, v.node[c]);
  return u;
}

std::vector<NodeShares> shares_of(const Embedding& embedding, const TetMesh& mesh) {
  std::vector<NodeShares> shares;
  shares.reserve(embedding.vertices.size());
  for (const EmbeddedVertex& v : embedding.vertices) shares.push_back(node_shares(mesh, v));
  return shares;
}

double largest_displacement(const ModalAnalysis& a, Index mode, std::span<const NodeShares> vertices) {
  double largest = 0.0;
  for (const NodeShares& v : vertices) largest = std::max(largest, at_vertex(a, mode, v).norm());
  return largest;
}

ModalSurface modal_surface(const PlacedSurface& placed, const ModalAnalysis& a, const TetMesh& mesh,
                           std::span<const Index> kept, const Vec3& origin) {
  ModalSurface s;
  s.triangles = placed.surface.triangles;
  for (const Vec3& x : placed.surface.vertices) s.rest.push_back((x - origin).cast<float>());
  s.basis = ModalBasis(s.vertices(), static_cast<Index>(kept.size()));
  const std::vector<NodeShares> shares = shares_of(placed.embedding, mesh);
  for (Index v = 0; v < s.vertices(); ++v)
    for (std::size_t m = 0; m < kept.size(); ++m)
      s.basis.set(v, static_cast<Index>(m), at_vertex(a, kept[m], shares[v]).cast<float>());
  return s;
}

ModalBasis basis_at_nodes(std::span<const double> shapes, Index nodes, std::span<const Index> kept) {
  ModalBasis basis(nodes, static_cast<Index>(kept.size()));
  for (Index n = 0; n < nodes; ++n)
    for (std::size_t m = 0; m < kept.size(); ++m)
      basis.set(n, static_cast<Index>(m), at_node(shapes, nodes, kept[m], n).cast<float>());
  return basis;
}

ModalVolume modal_volume(const ModalAnalysis& a, const TetMesh& mesh, std::span<const Index> kept, const Vec3& origin) {
  ModalVolume volume;
  for (const Vec3& x : mesh.nodes) volume.rest.push_back(x - origin);
  volume.tets = mesh.has_mid_edge_nodes() ? split_into_eight(mesh).tets : mesh.tets;
  volume.basis = basis_at_nodes(a.shapes, a.nodes, kept);
  volume.mass_times_basis = basis_at_nodes(a.mass_times_shapes, a.nodes, kept);
  return volume;
}

// One body ----------------------------------------------------------------------------------------------------------

struct BodyInput {
  std::string name;
  SubMesh part;
  std::vector<Index> fixed;           // of part.mesh
  std::vector<Index> residual_nodes;  // of part.mesh
  std::vector<AttachmentPatch> patches;

  bool answers_loads() const { return !residual_nodes.empty() || !patches.empty(); }
  std::optional<SurfaceMesh> render, collision;
};

struct BodySurfaces {
  PlacedSurface render;
  std::optional<PlacedSurface> collision;  // none: the render surface
  const PlacedSurface& touching() const { return collision ? *collision : render; }
};

/// A given render surface is often far finer than the tets, so what touches is then their boundary.
BodySurfaces place_surfaces(const BodyInput& in, const BakeOptions& options, BodyReport& report) {
  const TetMesh& mesh = in.part.mesh;
  BodySurfaces s;
  s.render = in.render ? place(*in.render, mesh) : place_boundary(mesh);
  if (in.collision) s.collision = place(*in.collision, mesh);
  if (!in.collision && in.render) s.collision = place_boundary(mesh);
  if (const auto most = static_cast<std::size_t>(options.collision_triangles);
      most > 0 && s.touching().surface.triangles.size() > most)
    s.collision = simplified(s.touching(), most, report.collision_error);
  report.collision_triangles = static_cast<Index>(s.touching().surface.triangles.size());
  return s;
}

/// A surface that lies elsewhere follows extrapolated modes: likely another unit or another origin than the mesh's.
void warn_of_far_surface(const PlacedSurface& placed, const TetMesh& mesh, const std::string& which,
                         Warnings& warnings) {
  constexpr double kFar = 0.1;  // of the diagonal of the mesh
  Eigen::AlignedBox3d box;
  for (const Vec3& x : mesh.nodes) box.extend(x);
  const double part = placed.embedding.max_distance / box.diagonal().norm();
  if (part <= kFar) return;
  warnings.push_back(which + " surface: " + std::to_string(placed.embedding.outside) + " of " +
                     std::to_string(placed.surface.vertices.size()) + " vertices lie outside the tetrahedra, up to " +
                     std::to_string(std::lround(100.0 * part)) +
                     " % of the mesh's diagonal away; are its unit and origin those of the mesh?");
}

double decay_of(const RayleighDamping& d, double lambda) {
  return 0.5 * (d.stiffness_proportional * lambda + d.mass_proportional);
}

/// Modes to keep, as columns of the analysis: mechanisms always, and of the elastic ones those that the limits leave.
/// Strikes and forces act on the render surface, contacts on the collision surface: a mode counts by the larger.
std::vector<Index> choose_modes(const ModalAnalysis& a, const TetMesh& mesh, const BodySurfaces& surfaces,
                                const BakeOptions& options, BodyReport& report) {
  const std::vector<NodeShares> render = shares_of(surfaces.render.embedding, mesh),
                                touching = shares_of(surfaces.touching().embedding, mesh);
  std::vector<ModeStrength> strengths;
  for (Index mode = a.mechanisms; mode < static_cast<Index>(a.eigenvalues.size()); ++mode) {
    const double lambda = a.eigenvalues[mode];
    const double shown = largest_displacement(a, mode, render);
    const double touched = largest_displacement(a, mode, touching);
    strengths.push_back({.eigenvalue = lambda,
                         .decay = decay_of(options.damping, lambda),
                         .max_observable = shown,
                         .max_loadable = std::max(shown, touched)});
    report.frequencies_hz.push_back(std::sqrt(lambda) / (2.0 * std::numbers::pi));
  }
  report.selection = select_modes(strengths, options.limits);
  std::vector<Index> columns;
  columns.reserve(static_cast<std::size_t>(a.mechanisms) + report.selection.kept.size());
  for (Index m = 0; m < a.mechanisms; ++m) columns.push_back(m);
  for (const Index m : report.selection.kept) columns.push_back(a.mechanisms + m);
  return columns;
}

/// The kept modes' part of the static compliance where loads were foreseen, in directions of forces: the columns of
/// the loads are three a node, then six a patch.
std::vector<CapturedLoad> captured_loads(const BodyInput& in, const internal::ResidualModes& modes) {
  std::vector<CapturedLoad> captured;
  Eigen::Index column = 0;
  const auto add = [&](const Vec3& at, Eigen::Index columns) {
    const double shown = modes.shown.segment<3>(column).sum(), all = shown + modes.left.segment<3>(column).sum();
    captured.push_back({at, all > 0.0 ? shown / all : 1.0});
    column += columns;
  };
  for (const Index n : in.residual_nodes) add(in.part.mesh.nodes[static_cast<std::size_t>(n)], 3);
  for (const AttachmentPatch& patch : in.patches) add(patch.center, 6);
  return captured;
}

/// Modes of the chosen nodes and patches join the analysis and those kept, which stay in order of frequency.
void add_residual_modes(ModalAnalysis& a, const BodyInput& in, const PlacedSurface& touching, std::vector<Index>& kept,
                        ResidualReport& report) {
  if (!in.answers_loads() || !a.compliance) return;
  const auto first = static_cast<Index>(a.eigenvalues.size());
  Eigen::MatrixXd F = node_loads(a.nodes, in.residual_nodes);
  for (const AttachmentPatch& patch : in.patches) {
    const Eigen::MatrixXd more = patch_loads(in.part.mesh, touching.surface.vertices, touching.embedding, patch);
    F.conservativeResize(Eigen::NoChange, F.cols() + more.cols());
    F.rightCols(more.cols()) = more;
  }
  const internal::ResidualModes added = append_residual_modes(a, kept, F);
  report.modes = added.appended;
  report.captured = captured_loads(in, added);
  for (Index m = 0; m < report.modes; ++m) kept.push_back(first + m);
  std::stable_sort(kept.begin(), kept.end(), [&](Index i, Index j) { return a.eigenvalues[i] < a.eigenvalues[j]; });
}

std::optional<ResidualCompliance> surface_compliance(const ModalAnalysis& a, std::span<const Index> kept,
                                                     const TetMesh& mesh, const PlacedSurface& surface,
                                                     const ResidualOptions& options, ResidualReport& report) {
  if (!options.surface || !a.compliance) return std::nullopt;
  using Form = ResidualCompliance::Form;
  report.vertices = static_cast<Index>(surface.surface.vertices.size());
  const auto bytes = [&](Form form) { return sizeof(float) * ResidualCompliance::value_count(form, report.vertices); };
  const bool fits = static_cast<double>(bytes(Form::kFull)) <= options.max_full_bytes;
  report.form = fits ? Form::kFull : Form::kLocal;
  report.bytes = bytes(*report.form);
  return residual_compliance(a, kept, mesh, surface.embedding, *report.form);
}

void add_inertial_integrals(ModalModelData& data, const ModalAnalysis& a, const TetMesh& mesh,
                            std::span<const Index> kept) {
  for (const Index mode : kept) {
    Vec3 momentum = Vec3::Zero();
    Mat3 moment = Mat3::Zero();
    for (Index n = 0; n < a.nodes; ++n) {
      const Vec3 mw = at_node(a.mass_times_shapes, a.nodes, mode, n);
      momentum += mw;
      moment += (mesh.nodes[n] - data.origin_in_input) * mw.transpose();
    }
    // Free modes are M-orthogonal to translations: what the sum leaves is round-off.
    data.participation.push_back(data.motion == FrameMotion::kFree ? Vec3(Vec3::Zero()) : momentum);
    data.moments.push_back(moment);
  }
}

void add_frame(ModalModelData& data, const ModalAnalysis& a, const MassProperties& p) {
  const bool about_pivot = a.motion == FrameMotion::kPoint || a.motion == FrameMotion::kLine;
  data.motion = a.motion;
  data.line_axis = a.line_axis;
  data.mass = p.mass;
  data.volume = p.volume;
  data.origin_in_input = about_pivot ? a.pivot : p.center;
  data.center_of_mass = about_pivot ? Vec3(p.center - a.pivot) : Vec3(Vec3::Zero());
  data.inertia = p.inertia_about(data.center_of_mass);
}

void fill_report(BodyReport& r, const BodyInput& in, const ModalAnalysis& a, const MassProperties& p) {
  const auto free_dofs = 3 * (static_cast<std::size_t>(a.nodes) - in.fixed.size());
  r.name = in.name;
  r.motion = a.motion;
  r.nodes = a.nodes;
  r.tets = static_cast<Index>(in.part.mesh.tets.size());
  r.nodes_per_tet = in.part.mesh.has_mid_edge_nodes() ? 10 : 4;
  r.mass = p.mass;
  r.volume = p.volume;
  r.center_of_mass = p.center;
  r.inertia = p.inertia;
  r.mechanisms = a.mechanisms;
  r.zero_modes = a.rigid_modes + a.mechanisms;
  r.all_modes = static_cast<std::size_t>(a.rigid_modes) + a.eigenvalues.size() >= free_dofs;
  r.residual_max = a.residual_max;
  r.residual_bound = a.residual_bound;
  r.backward_error_max = a.backward_error_max;
  r.orthogonality_max = a.orthogonality_max;
  r.certified = a.certified;
  r.solves = a.solves;
  r.seconds = a.seconds;
}

/// Of all elastic modes of the analysis.
void estimate_errors(const BodyInput& in, std::span<const Material> materials, const ModalAnalysis& a,
                     const ModalAnalysisOptions& options, BodyReport& report, Jobs& jobs) {
  const auto start = Clock::now();
  const auto mechanisms = static_cast<std::size_t>(a.mechanisms);
  report.frequency_errors = internal::frequency_errors(
      in.part.mesh, materials, in.fixed, options.mass, std::span(a.eigenvalues).subspan(mechanisms),
      std::span(a.shapes).subspan(3 * mechanisms * static_cast<std::size_t>(a.nodes)), jobs);
  report.seconds_estimate = seconds_since(start);
}

/// What the asset tells of each mode kept: mechanisms are exact, and modes that join for static loads are no modes of
/// the continuum.
std::vector<double> errors_of(std::span<const Index> kept, const ModalAnalysis& a, const BodyReport& report) {
  std::vector<double> errors;
  for (const Index m : kept) {
    const auto elastic = static_cast<std::size_t>(m - a.mechanisms);
    if (m < a.mechanisms)
      errors.push_back(0.0);
    else
      errors.push_back(elastic < report.frequency_errors.size() ? report.frequency_errors[elastic]
                                                                : std::numeric_limits<double>::quiet_NaN());
  }
  return errors;
}

/// Of the lowest elastic mode, where its linear tets lock.
void warn_of_locking(const BodyInput& in, std::span<const Material> materials, const ModalAnalysis& a,
                     Warnings& warnings) {
  constexpr double kNearHalf = 0.4, kWorthTelling = 0.05;
  const TetMesh& mesh = in.part.mesh;
  double largest = 0.0;
  for (const Index r : mesh.tet_region) largest = std::max(largest, materials[r].poisson_ratio);
  const auto lowest = static_cast<std::size_t>(a.mechanisms);
  if (mesh.has_mid_edge_nodes() || largest < kNearHalf || a.eigenvalues.size() <= lowest) return;
  const std::span<const double> shapes(a.shapes);
  const double share = internal::dilatation_share(
      mesh, materials, shapes.subspan(lowest * 3 * mesh.nodes.size(), 3 * mesh.nodes.size()), a.eigenvalues[lowest]);
  const double error = internal::locking_error(share, largest);
  if (error < kWorthTelling) return;
  warnings.push_back(
      "body \"" + in.name +
      "\": its linear tetrahedra lock near nu = 1/2: " + std::to_string(std::lround(100.0 * share)) +
      " % of the energy of its lowest mode goes into changes of volume, which makes its frequency about " +
      std::to_string(std::lround(100.0 * error)) +
      " % too high; quadratic elements (--elements quadratic) hardly lock");
}

std::size_t bytes_of(const ModalSkin& skin) {
  return sizeof(Vec3) * skin.rest.size() +
         sizeof(float) * (skin.rotations.size() + skin.arms.size() + skin.shifts.size()) +
         sizeof(SkinInfluences) * (skin.render.size() + skin.collision.size() + skin.volume.size()) +
         sizeof(double) * (skin.gauge.weights.size() + skin.gauge.rest.size() + skin.gauge.shapes.size());
}

std::optional<ModalSkin> modal_skin(const ModalAnalysis& a, std::span<const Index> kept, const BodyInput& in,
                                    std::span<const Material> materials, const BodySurfaces& surfaces,
                                    const BakeOptions& options, const Vec3& origin, SkinReport& report,
                                    Warnings& warnings) {
  if (!options.skin.make) return std::nullopt;
  if (kept.empty() || a.motion == FrameMotion::kPoint || a.motion == FrameMotion::kLine) {
    warnings.push_back("skin: body \"" + in.name + "\" gets none, as it " +
                       (kept.empty() ? "has no modes" : "turns about a point or a line"));
    return std::nullopt;
  }
  const auto start = Clock::now();
  const TetMesh& mesh = in.part.mesh;
  const auto body = internal::skin_body(a, kept, mesh, materials, in.fixed, options.analysis, origin);
  internal::NodalSkin nodal = internal::bake_skin(body, options.skin, report);
  nodal.skin.render = internal::surface_influences(nodal, mesh, surfaces.render.embedding);
  if (surfaces.collision)
    nodal.skin.collision = internal::surface_influences(nodal, mesh, surfaces.collision->embedding);
  if (options.volume_block) nodal.skin.volume = nodal.nodes;
  report.bytes = bytes_of(nodal.skin);
  report.seconds = seconds_since(start);
  return std::move(nodal.skin);
}

std::shared_ptr<const ModalModel> bake_body(const BodyInput& in, std::span<const Material> materials,
                                            const BakeOptions& options, BodyReport& report, Warnings& warnings,
                                            Jobs& jobs) {
  const TetMesh& mesh = in.part.mesh;
  const MassProperties mass = mass_properties(mesh, materials);
  ModalAnalysisOptions wanted = options.analysis;
  wanted.keep_compliance = options.residual.surface || in.answers_loads();
  ModalAnalysis a = analyse_modes(mesh, materials, in.fixed, wanted, warnings, jobs);
  fill_report(report, in, a, mass);
  warn_of_locking(in, materials, a, warnings);
  estimate_errors(in, materials, a, wanted, report, jobs);

  const auto start = Clock::now();
  const BodySurfaces surfaces = place_surfaces(in, options, report);
  warn_of_far_surface(surfaces.render, mesh, "render", warnings);
  if (in.collision) warn_of_far_surface(*surfaces.collision, mesh, "collision", warnings);
  std::vector<Index> kept = choose_modes(a, mesh, surfaces, options, report);
  report.seconds_embed = seconds_since(start);

  const auto residual_start = Clock::now();
  add_residual_modes(a, in, surfaces.touching(), kept, report.residual);
  auto residual = surface_compliance(a, kept, mesh, surfaces.touching(), options.residual, report.residual);
  report.residual.seconds = seconds_since(residual_start);

  const auto store_start = Clock::now();
  ModalModelData data;
  data.name = in.name;
  add_frame(data, a, mass);
  for (const Index m : kept) {
    data.eigenvalues.push_back(a.eigenvalues[m]);
    data.decays.push_back(decay_of(options.damping, a.eigenvalues[m]));
  }
  report.kept_errors = errors_of(kept, a, report);
  add_inertial_integrals(data, a, mesh, kept);
  data.render = modal_surface(surfaces.render, a, mesh, kept, data.origin_in_input);
  if (surfaces.collision) data.collision = modal_surface(*surfaces.collision, a, mesh, kept, data.origin_in_input);
  if (options.volume_block) data.volume_block = modal_volume(a, mesh, kept, data.origin_in_input);
  data.residual_compliance = std::move(residual);
  for (const CapturedLoad& load : report.residual.captured)
    data.captured.push_back({load.at - data.origin_in_input, load.share});
  data.skin = modal_skin(a, kept, in, materials, surfaces, options, data.origin_in_input, report.skin, warnings);
  auto model = std::make_shared<const ModalModel>(std::move(data));
  report.render = surfaces.render.report();
  report.collision = surfaces.touching().report();
  report.seconds_embed += seconds_since(store_start) - report.skin.seconds;
  return model;
}

// The whole ---------------------------------------------------------------------------------------------------------

std::vector<char> selected_flags(const TetMesh& mesh, std::span<const NodeSelector> selectors) {
  std::vector<char> selected(mesh.nodes.size(), 0);
  for (const NodeSelector& s : selectors)
    for (const Index n : select_nodes(mesh, s)) selected[n] = 1;
  return selected;
}

/// Makes the mesh's tets those that are asked for, and flags of nodes those of its new nodes: a middle that is added is
/// held where both ends of its edge are, as a four-node tet would hold it, and loaded nowhere.
void use_elements(Elements elements, TetMesh& mesh, std::vector<char>& fixed, std::vector<char>& loaded) {
  if (elements == Elements::kLinear && mesh.has_mid_edge_nodes()) {
    const std::vector<Index> node_of = drop_mid_edge_nodes(mesh);
    for (std::vector<char>* flags : {&fixed, &loaded}) {
      for (std::size_t n = 0; n < node_of.size(); ++n) (*flags)[n] = (*flags)[static_cast<std::size_t>(node_of[n])];
      flags->resize(node_of.size());
    }
  }
  if (elements == Elements::kQuadratic && !mesh.has_mid_edge_nodes()) {
    add_mid_edge_nodes(mesh);
    fixed.resize(mesh.nodes.size(), 0);
    loaded.resize(mesh.nodes.size(), 0);
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
      for (std::size_t e = 0; e < kTetEdges.size(); ++e)
        fixed[mesh.mid_edge_nodes[t][e]] =
            static_cast<char>(fixed[mesh.tets[t][kTetEdges[e][0]]] && fixed[mesh.tets[t][kTetEdges[e][1]]]);
  }
}

/// A node that does not move answers no load.
void warn_of_fixed_loads(std::span<const char> loaded, std::span<const char> fixed, Warnings& warnings) {
  std::size_t chosen = 0, idle = 0;
  for (std::size_t n = 0; n < loaded.size(); ++n) {
    chosen += loaded[n] ? 1 : 0;
    idle += loaded[n] && fixed[n] ? 1 : 0;
  }
  if (idle > 0)
    warnings.push_back("residual: " + std::to_string(idle) + " of the " + std::to_string(chosen) +
                       " chosen nodes are fixed and get no residual modes");
}

/// The body that has the node nearest to a patch's centre.
Index body_of(const AttachmentPatch& patch, const TetMesh& mesh, std::span<const Index> component) {
  Index body = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    for (const Index n : mesh.tets[t]) {
      const double distance = (mesh.nodes[static_cast<std::size_t>(n)] - patch.center).squaredNorm();
      if (distance < least) least = distance, body = component[t];
    }
  return body;
}

void warn_of_unused_nodes(const TetMesh& mesh, std::span<const char> fixed, Warnings& warnings) {
  std::vector<char> used(mesh.nodes.size(), 0);
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    for (const Index n : TetNodes(mesh, t)) used[n] = 1;
  std::size_t unused = 0, to_be_fixed = 0;
  for (std::size_t n = 0; n < used.size(); ++n) {
    if (used[n]) continue;
    ++unused;
    if (fixed[n]) ++to_be_fixed;
  }
  if (unused == 0) return;
  std::string message = "mesh: " + std::to_string(unused) + " of " + std::to_string(mesh.nodes.size()) +
                        " nodes belong to no tetrahedron and have been dropped";
  if (to_be_fixed > 0) message += ", " + std::to_string(to_be_fixed) + " of them were to be fixed";
  warnings.push_back(message);
}

}  // namespace

RayleighDamping RayleighDamping::from_ratio(double ratio, double first_hz, double second_hz) {
  if (!(ratio >= 0.0) || !(first_hz > 0.0) || !(second_hz > 0.0) || !std::isfinite(ratio + first_hz + second_hz))
    throw InvalidArgument("damping ratio " + std::to_string(ratio) + " at " + std::to_string(first_hz) + " and " +
                          std::to_string(second_hz) + " Hz: expected a ratio of 0 or more and frequencies above 0");
  const double w1 = 2.0 * std::numbers::pi * first_hz, w2 = 2.0 * std::numbers::pi * second_hz;
  return {.stiffness_proportional = 2.0 * ratio / (w1 + w2), .mass_proportional = 2.0 * ratio * w1 * w2 / (w1 + w2)};
}

void RayleighDamping::validate() const {
  const auto check = [](double value, const char* field) {
    if (!(value >= 0.0) || !std::isfinite(value))
      throw InvalidArgument(std::string("Rayleigh damping: ") + field + " is " + std::to_string(value) +
                            ", expected 0 or more");
  };
  check(stiffness_proportional, "a1 (stiffness-proportional, s)");
  check(mass_proportional, "a2 (mass-proportional, 1/s)");
}

void ResidualOptions::validate() const {
  for (const AttachmentPatch& patch : patches)
    if (!patch.center.allFinite() || !(patch.radius >= 0.0 && std::isfinite(patch.radius)))
      throw InvalidArgument("ResidualOptions::patches: a centre is not finite, or a radius not a finite number >= 0");
  if (!(max_full_bytes >= 0.0))
    throw InvalidArgument("ResidualOptions::max_full_bytes is " + std::to_string(max_full_bytes) +
                          ", expected 0 or more");
}

void SkinOptions::validate() const {
  if (handles < 0 || handles >= ModalSkin::kMaxHandles)
    throw InvalidArgument("SkinOptions::handles is " + std::to_string(handles) + ", expected 0 to " +
                          std::to_string(ModalSkin::kMaxHandles - 1));
}

void BakeOptions::validate() const {
  if (materials.empty()) throw InvalidArgument("bake: no material is given");
  damping.validate();
  analysis.validate();
  limits.validate();
  residual.validate();
  skin.validate();
  if (collision_triangles < 0)
    throw InvalidArgument("BakeOptions::collision_triangles is " + std::to_string(collision_triangles) +
                          ", expected 0 or more");
}

BakeResult bake(const BakeInput& input, const BakeOptions& options, Warnings& warnings, Jobs& jobs) {
  options.validate();
  if (input.mesh.tets.empty()) throw InputError("bake: the mesh holds no tetrahedra");
  const auto materials = materials_by_region(input.mesh, options.materials);
  warn_of_unknown_regions(input.mesh, options.materials, warnings);
  auto fixed = selected_flags(input.mesh, options.fixed);
  auto loaded = selected_flags(input.mesh, options.residual.nodes);
  warn_of_unused_nodes(input.mesh, fixed, warnings);
  warn_of_fixed_loads(loaded, fixed, warnings);

  TetMesh mesh = input.mesh;
  use_elements(options.elements, mesh, fixed, loaded);
  const auto component = connected_components(mesh);
  const Index bodies = 1 + *std::max_element(component.begin(), component.end());
  auto render = deal_if_any(input.render, mesh, component, bodies, "render");
  auto collision = deal_if_any(input.collision, mesh, component, bodies, "collision");

  BakeResult result;
  result.asset.provenance = input.provenance;
  for (Index b = 0; b < bodies; ++b) {
    BodyInput body;
    body.name = bodies == 1 ? input.name : input.name + "_" + std::to_string(b + 1);
    body.part = extract_component(mesh, component, b);
    for (std::size_t n = 0; n < body.part.node_of.size(); ++n) {
      if (fixed[body.part.node_of[n]])
        body.fixed.push_back(static_cast<Index>(n));
      else if (loaded[body.part.node_of[n]])
        body.residual_nodes.push_back(static_cast<Index>(n));
    }
    for (const AttachmentPatch& patch : options.residual.patches)
      if (body_of(patch, mesh, component) == b) body.patches.push_back(patch);
    body.render = std::move(render[b]);
    body.collision = std::move(collision[b]);
    result.asset.bodies.push_back(bake_body(body, materials, options, result.bodies.emplace_back(), warnings, jobs));
    result.asset.frequency_errors.push_back(result.bodies.back().kept_errors);
  }
  return result;
}

}  // namespace limber
