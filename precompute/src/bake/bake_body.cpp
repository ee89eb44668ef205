#include "bake/bake_body.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "bake/body_surfaces.h"
#include "bake/modal_blocks.h"
#include "bake/residual.h"
#include "bake/sound.h"
#include "eigen/hertz.h"
#include "fem/frequency_error.h"
#include "fem/locking.h"
#include "fem/mass_properties.h"
#include "skin/bake_skin.h"

namespace limber::internal {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

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
  for (Index mode = a.freedom.mechanisms; mode < static_cast<Index>(a.eigenvalues.size()); ++mode) {
    const double lambda = a.eigenvalues[mode];
    const double shown = largest_displacement(a, mode, render);
    const double touched = largest_displacement(a, mode, touching);
    strengths.push_back({.eigenvalue = lambda,
                         .decay = decay_of(options.damping, lambda),
                         .max_observable = shown,
                         .max_loadable = std::max(shown, touched)});
    report.modes.frequencies_hz.push_back(internal::hz_of_eigenvalue(lambda));
  }
  report.modes.selection = select_modes(strengths, options.limits);
  std::vector<Index> columns;
  columns.reserve(static_cast<std::size_t>(a.freedom.mechanisms) + report.modes.selection.kept.size());
  for (Index m = 0; m < a.freedom.mechanisms; ++m) columns.push_back(m);
  for (const Index m : report.modes.selection.kept) columns.push_back(a.freedom.mechanisms + m);
  return columns;
}

/// The kept modes' part of the static compliance where loads were foreseen, in directions of forces: the columns of
/// the loads are three a node, then six a patch.
std::vector<CapturedLoad> captured_loads(const BodyInput& in, const ResidualModes& modes) {
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
    const Eigen::MatrixXd more = patch_loads(in.part.mesh, touching.surface, touching.embedding, patch);
    F.conservativeResize(Eigen::NoChange, F.cols() + more.cols());
    F.rightCols(more.cols()) = more;
  }
  const ResidualModes added = append_residual_modes(a, kept, F);
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

void add_frame(ModalModelData& data, const ModalAnalysis& a, const MassProperties& p) {
  const bool about_pivot = a.freedom.motion == FrameMotion::kPoint || a.freedom.motion == FrameMotion::kLine;
  data.motion = a.freedom.motion;
  data.line_axis = a.freedom.line_axis;
  data.mass = p.mass;
  data.volume = p.volume;
  data.origin_in_input = about_pivot ? a.freedom.pivot : p.center;
  data.center_of_mass = about_pivot ? Vec3(p.center - a.freedom.pivot) : Vec3(Vec3::Zero());
  data.inertia = p.inertia_about(data.center_of_mass);
}

/// By names: the regions of a field are one.
std::vector<RegionReport> region_reports(const TetMesh& mesh, std::span<const Material> materials) {
  std::vector<RegionReport> reports;
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    const std::string& name = mesh.regions[mesh.tet_region[t]].name;
    auto found = std::find_if(reports.begin(), reports.end(), [&](const RegionReport& r) { return r.name == name; });
    if (found == reports.end()) found = reports.insert(reports.end(), {.name = name});
    const double volume = signed_volume(mesh, static_cast<Index>(t));
    ++found->tets;
    found->volume += volume;
    found->mass += materials[mesh.tet_region[t]].density * volume;
  }
  return reports;
}

void fill_report(BodyReport& r, const BodyInput& in, std::span<const Material> materials, const ModalAnalysis& a,
                 const MassProperties& p) {
  const auto free_dofs = 3 * (static_cast<std::size_t>(a.nodes) - in.fixed.size());
  r.name = in.name;
  r.mesh = {.nodes = a.nodes,
            .tets = static_cast<Index>(in.part.mesh.tets.size()),
            .nodes_per_tet = in.part.mesh.has_mid_edge_nodes() ? 10 : 4};
  r.solid = {.mass = p.mass, .volume = p.volume, .center_of_mass = p.center, .inertia = p.inertia};
  r.regions = region_reports(in.part.mesh, materials);
  r.freedom = a.freedom;
  r.modes.all = static_cast<std::size_t>(a.freedom.rigid_modes) + a.eigenvalues.size() >= free_dofs;
  r.accuracy = a.accuracy;
  r.solves = a.solves;
  r.seconds.modes = a.seconds;
}

/// Of all elastic modes of the analysis.
void estimate_errors(const BodyInput& in, std::span<const Material> materials, const ModalAnalysis& a,
                     const ModalAnalysisOptions& options, BodyReport& report, Jobs& jobs) {
  const auto start = Clock::now();
  const auto mechanisms = static_cast<std::size_t>(a.freedom.mechanisms);
  report.modes.frequency_errors =
      frequency_errors(in.part.mesh, materials, in.fixed, options.mass, std::span(a.eigenvalues).subspan(mechanisms),
                       std::span(a.shapes).subspan(3 * mechanisms * static_cast<std::size_t>(a.nodes)), jobs);
  report.seconds.estimate = seconds_since(start);
}

/// What the asset tells of each mode kept: mechanisms are exact, and modes that join for static loads are no modes of
/// the continuum.
std::vector<double> errors_of(std::span<const Index> kept, const ModalAnalysis& a, const BodyReport& report) {
  std::vector<double> errors;
  for (const Index m : kept) {
    const auto elastic = static_cast<std::size_t>(m - a.freedom.mechanisms);
    if (m < a.freedom.mechanisms)
      errors.push_back(0.0);
    else
      errors.push_back(elastic < report.modes.frequency_errors.size() ? report.modes.frequency_errors[elastic]
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
  const auto lowest = static_cast<std::size_t>(a.freedom.mechanisms);
  if (mesh.has_mid_edge_nodes() || largest < kNearHalf || a.eigenvalues.size() <= lowest) return;
  const std::span<const double> shapes(a.shapes);
  const double share = dilatation_share(
      mesh, materials, shapes.subspan(lowest * 3 * mesh.nodes.size(), 3 * mesh.nodes.size()), a.eigenvalues[lowest]);
  const double error = locking_error(share, largest);
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
  if (kept.empty() || a.freedom.motion == FrameMotion::kPoint || a.freedom.motion == FrameMotion::kLine) {
    warnings.push_back("skin: body \"" + in.name + "\" gets none, as it " +
                       (kept.empty() ? "has no modes" : "turns about a point or a line"));
    return std::nullopt;
  }
  const auto start = Clock::now();
  const TetMesh& mesh = in.part.mesh;
  const auto body = skin_body(a, kept, mesh, materials, in.fixed, options.analysis, origin);
  NodalSkin nodal = bake_skin(body, options.skin, report);
  nodal.skin.render = surface_influences(nodal, mesh, surfaces.render.embedding);
  if (surfaces.collision) nodal.skin.collision = surface_influences(nodal, mesh, surfaces.collision->embedding);
  if (options.volume_block) nodal.skin.volume = nodal.nodes;
  report.bytes = bytes_of(nodal.skin);
  report.seconds = seconds_since(start);
  return std::move(nodal.skin);
}

}  // namespace

BakedBody bake_body(const BodyInput& in, std::span<const Material> materials, const BakeOptions& options,
                    BodyReport& report, Warnings& warnings, Jobs& jobs) {
  const TetMesh& mesh = in.part.mesh;
  if (options.sound.make) require_losses(in, materials, options);
  const MassProperties mass = mass_properties(mesh, materials);
  ModalAnalysisOptions wanted = options.analysis;
  wanted.keep_compliance = options.residual.surface || in.answers_loads();
  ModalAnalysis a = analyse_modes(mesh, materials, in.fixed, wanted, warnings, jobs);
  fill_report(report, in, materials, a, mass);
  warn_of_locking(in, materials, a, warnings);
  estimate_errors(in, materials, a, wanted, report, jobs);

  const auto start = Clock::now();
  const BodySurfaces surfaces =
      place_surfaces(mesh, in.render, in.collision, options.collision_triangles, report.surfaces);
  warn_of_far_surface(surfaces.render, mesh, "render", warnings);
  if (in.collision) warn_of_far_surface(*surfaces.collision, mesh, "collision", warnings);
  std::vector<Index> kept = choose_modes(a, mesh, surfaces, options, report);
  report.seconds.embed = seconds_since(start);

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
  report.modes.kept_errors = errors_of(kept, a, report);
  add_inertial_integrals(data, a, mesh, kept);
  data.render = modal_surface(surfaces.render, a, mesh, kept, data.origin_in_input);
  if (surfaces.collision) data.collision = modal_surface(*surfaces.collision, a, mesh, kept, data.origin_in_input);
  if (options.volume_block) data.volume_block = modal_volume(a, mesh, kept, data.origin_in_input);
  data.residual_compliance = std::move(residual);
  for (const CapturedLoad& load : report.residual.captured)
    data.captured.push_back({load.at - data.origin_in_input, load.share});
  data.skin = modal_skin(a, kept, in, materials, surfaces, options, data.origin_in_input, report.skin, warnings);
  auto model = std::make_shared<const ModalModel>(std::move(data));
  report.surfaces.render = surfaces.render.report();
  report.surfaces.collision = surfaces.touching().report();
  report.seconds.embed += seconds_since(store_start) - report.skin.seconds;
  std::shared_ptr<const SoundModes> sound;
  if (options.sound.make) sound = bake_sound(in, materials, surfaces.touching(), options, report.sound, warnings, jobs);
  return {model, sound};
}

}  // namespace limber::internal
