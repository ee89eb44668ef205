#include "precompute_input.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "limber/core/error.h"
#include "limber/jobs_tbb/tbb_jobs.h"
#include "limber/mesh/merge_nodes.h"
#include "limber/mesh/unused_vertices.h"
#include "limber/mesh_assimp/read_surface_mesh.h"
#include "precompute_report.h"

namespace limber::tools {
namespace {

namespace fs = std::filesystem;

void scale(std::vector<Vec3>& points, double factor) {
  if (factor == 1.0) return;
  for (Vec3& p : points) p *= factor;
}

SurfaceMesh read_surface(Program& program, const std::string& path, double factor) {
  SurfaceMesh surface = read_any_surface_mesh(path, program.warnings());
  scale(surface.vertices, factor);
  return surface;
}

/// How the tets came from the surface.
const char* route_of(const Tetrahedralisation& t) {
  return t.wrapped ? "wrapped" : t.sharp_edges_kept ? "given" : "smooth";
}

nlohmann::ordered_json surface_report(const SurfaceMesh& surface, const Tetrahedralisation& t) {
  return {{"vertices", surface.vertices.size()},
          {"triangles", surface.triangles.size()},
          {"mended", t.mending.text()},
          {"wrapped", t.wrapped},
          {"why_wrapped", t.why_wrapped},
          {"route", route_of(t)},
          {"smallest_cell", t.smallest_cell},
          {"tries", t.tries},
          {"wrap_adds", t.wrap_adds},
          {"volume_before", t.volume_before},
          {"volume_after", t.volume_after}};
}

/// Names the regions whose shells faces of tets follow, and those whose boundaries run along the nearest faces.
void tell_followed_regions(Program& program, const BakeOptions& bake, const Tetrahedralisation& t) {
  std::vector<std::string> followed, nearest;
  std::size_t surface = 0;
  for (const MaterialRegion& region : bake.regions)
    if (!std::holds_alternative<Everywhere>(region.shape))
      (std::holds_alternative<InsideShells>(region.shape) && t.followed[surface++] ? followed : nearest)
          .push_back(region.name);
  program.report()["surface"]["followed_regions"] = followed;
  if (!followed.empty()) program.print(fmt::format("faces of tets follow: {}\n", fmt::join(followed, ", ")));
  if (!nearest.empty()) program.print(fmt::format("tets belong by their centroids to: {}\n", fmt::join(nearest, ", ")));
}

/// Fills a surface with tets, told of failures by the file's name.
Tetrahedralisation tets_of(Program& program, const PrecomputeArguments& a, const BakeOptions& bake,
                           const SurfaceMesh& surface, double cell_size, Warnings& warnings) {
  TetrahedralisationOptions options = a.geometry.tets;
  options.cell_size = cell_size;
  options.quadratic = a.modal.elements != "linear";
  for (const MaterialRegion& region : bake.regions)
    if (const auto* shells = std::get_if<InsideShells>(&region.shape))
      options.inner_surfaces.push_back(shells->surface);
  options.progress = [&](const std::string& stage) { program.progress().stage(stage); };
  try {
    return tetrahedralise(surface, options, warnings);
  } catch (const ComputationError& e) {
    throw ComputationError("\"" + a.mesh + "\": " + e.what());
  } catch (const InputError& e) {
    throw InputError("\"" + a.mesh + "\": " + e.what());
  }
}

/// Tets, and what a bake of the lowest modes alone tells of them.
struct TriedCells {
  Tetrahedralisation tets;
  Warnings warnings;
  double size = 0.0;   ///< of the tets as they are, m
  double error = 0.0;  ///< estimated, of the lowest frequencies
  Index nodes = 0;
};

/// Cells that were asked to be no larger than `cell_size`.
TriedCells try_cells(Program& program, const PrecomputeArguments& a, const BakeInput& input, BakeOptions options,
                     double cell_size) {
  TriedCells tried;
  tried.tets = tets_of(program, a, options, *input.render, cell_size, tried.warnings);
  choose_elements(a, true, false, options);
  options.analysis.modes = options.limits.max_modes = kModesTold;
  options.residual = {};
  options.skin = {};
  options.volume_block = false;
  Warnings unread;  // those of the whole bake follow
  TbbJobs jobs;
  const BakeResult result =
      bake({.name = input.name, .mesh = tried.tets.mesh, .named_faces = input.named_faces}, options, unread, jobs);
  for (const BodyReport& body : result.bodies) {
    tried.error = std::max(tried.error, largest_frequency_error(body));
    tried.nodes += body.mesh.nodes;
  }
  // The circumradius of the regular tet of mean volume; the mesher's tets have 0.75 of the radius that it was given.
  const double mean = tried.tets.volume_after / static_cast<double>(tried.tets.mesh.tets.size());
  tried.size = std::cbrt(mean * 1.948) / 0.75;
  return tried;
}

/// Smaller and smaller cells until the error is what was asked for, or nodes run out.
Tetrahedralisation cells_by_error(Program& program, const PrecomputeArguments& a, const BakeInput& input,
                                  const BakeOptions& options) {
  const double wanted = frequency_error_of(a);
  constexpr double kAim = 0.8, kLeast = 0.35, kMost = 0.9;  // of the size before, or of the error wanted
  double order = a.modal.elements == "linear" ? 2.0 : 3.0;
  TriedCells tried = try_cells(program, a, input, options, a.geometry.tets.cell_size);
  while (tried.error > wanted) {
    const double needed = std::clamp(std::pow(kAim * wanted / tried.error, 1.0 / order), kLeast, kMost);
    const double affordable = std::cbrt(tried.nodes / static_cast<double>(a.geometry.tets.max_nodes));
    if (affordable > kMost) {
      program.warnings().push_back(fmt::format(
          "--frequency-error: {} nodes leave an error of {:.2g} %, and smaller cells would take more than --max-nodes",
          tried.nodes, 100.0 * tried.error));
      break;
    }
    TriedCells finer = try_cells(program, a, input, options, tried.size * std::max(needed, affordable));
    if (finer.size < tried.size && finer.error < tried.error)
      order = std::clamp(std::log(finer.error / tried.error) / std::log(finer.size / tried.size), 1.0, 4.0);
    tried = std::move(finer);
  }
  program.warnings().insert(program.warnings().end(), tried.warnings.begin(), tried.warnings.end());
  return std::move(tried.tets);
}

/// Fills a surface with tets; it stays what is drawn.
void fill_with_tets(Program& program, const PrecomputeArguments& a, const BakeOptions& bake, BakeInput& input,
                    Stopwatch& stopwatch) {
  Tetrahedralisation t = stopwatch.time("tetrahedralise", [&] {
    return a.modal.frequency_error.empty()
               ? tets_of(program, a, bake, *input.render, a.geometry.tets.cell_size, program.warnings())
               : cells_by_error(program, a, input, bake);
  });
  stopwatch.add("wrap", t.seconds_wrap);
  stopwatch.add("thickness", t.seconds_thickness);
  stopwatch.add("mesh", t.seconds_mesh);
  program.report()["surface"] = surface_report(*input.render, t);
  tell_followed_regions(program, bake, t);
  const std::string done = t.wrapped         ? ", wrapped (" + t.why_wrapped + ")"
                           : t.mending.any() ? ", mended (" + t.mending.text() + ")"
                                             : "";
  program.print(fmt::format("surface: {} triangles{}; it encloses {:.6g} m^3, its tets {:.6g} m^3\n",
                            input.render->triangles.size(), done, t.volume_before, t.volume_after));
  input.mesh = std::move(t.mesh);
}

/// Joins nodes where that was asked for, and tells of those that look as if they were meant to be one.
void join_parts(Program& program, const PrecomputeArguments& a, TetMesh& mesh) {
  const std::string name = "\"" + a.mesh + "\"";
  if (a.geometry.merge_nodes) {
    const Index merged = merge_nodes(mesh, *a.geometry.merge_nodes);
    program.report()["merged_nodes"] = merged;
    program.print(fmt::format("{} nodes merged\n", merged));
    validate(mesh, name + " (--merge-nodes)", program.warnings());
  }
  if (const Index crowded = count_crowded_faces(mesh); crowded > 0)
    program.warnings().push_back(
        fmt::format("{}: {} triangles are faces of three or more tetrahedra, which overlap there", name, crowded));
  Eigen::AlignedBox3d box;
  for (const Vec3& p : mesh.nodes) box.extend(p);
  constexpr double kTouch = 1e-6;  // of the diagonal: a few last bits of a float
  const double touch = kTouch * box.diagonal().norm();
  if (const Index touching = count_touching_nodes(mesh, touch); touching > 0)
    program.warnings().push_back(fmt::format(
        "{}: {} nodes lie on nodes of another body, and nothing ties them; if these are one part, --merge-nodes {:.1g} "
        "joins them",
        name, touching, touch));
}

/// Whether materials are told by names of faces.
bool asks_for_faces(const BakeOptions& bake) {
  return std::ranges::any_of(bake.materials, [](const auto& entry) { return entry.first != "*"; }) ||
         std::ranges::any_of(bake.regions,
                             [](const MaterialRegion& r) { return std::holds_alternative<NearFaces>(r.shape); });
}

/// Reads the surface once more, with its names. Shells of regions leave it.
void read_named_faces(const PrecomputeArguments& a, const AskedBake& asked, BakeInput& input) {
  if (!asks_for_faces(asked.options) && asked.shell_groups.empty()) return;
  Warnings unread;  // they stand already
  GroupedSurface faces = read_any_grouped_surface(a.mesh, unread);
  scale(faces.surface.vertices, a.geometry.scale);
  for (const std::string& group : asked.shell_groups) take_group(faces, group);
  if (!asked.shell_groups.empty()) {
    input.render = faces.surface;
    weld(*input.render);
    drop_unused_vertices(*input.render, "", unread);
  }
  input.named_faces = std::move(faces);
}

}  // namespace

void tell_unit(Program& program, const FileUnit& unit) {
  nlohmann::ordered_json& told = program.report()["unit"];
  told = {{"metres", unit.metres}, {"stated", unit.stated}, {"up", nullptr}};
  if (unit.up != 0) told["up"] = std::string(1, unit.up);
  if (unit.metres != 1.0) program.print(fmt::format("lengths: the file's unit is {:.6g} m\n", unit.metres));
}

BakeInput read_input(Program& program, const PrecomputeArguments& a, const AskedBake& asked, Stopwatch& stopwatch) {
  BakeInput input;
  input.name = fs::path(a.mesh).stem().string();
  FileUnit unit;
  auto read = stopwatch.time("read", [&] { return read_any_mesh(a.mesh, program.warnings(), &unit); });
  tell_unit(program, unit);
  if (auto* mesh = std::get_if<TetMesh>(&read)) {
    input.mesh = std::move(*mesh);
    scale(input.mesh.nodes, a.geometry.scale);
    join_parts(program, a, input.mesh);
    if (a.geometry.tets.cell_size > 0.0 || a.geometry.tets.alpha > 0.0 || !a.modal.frequency_error.empty())
      program.warnings().push_back(
          "--cell-size, --frequency-error and --alpha have no effect: the input is made of tetrahedra already");
  } else {
    input.render = std::get<SurfaceMesh>(std::move(read));
    if (a.geometry.merge_nodes)
      program.warnings().push_back("--merge-nodes has no effect: the input is a surface, whose vertices are welded");
    scale(input.render->vertices, a.geometry.scale);
    read_named_faces(a, asked, input);
    fill_with_tets(program, a, asked.options, input, stopwatch);
  }
  if (!a.geometry.render_surface.empty())
    input.render = read_surface(program, a.geometry.render_surface, a.geometry.scale);
  if (!a.geometry.collision_surface.empty())
    input.collision = read_surface(program, a.geometry.collision_surface, a.geometry.scale);
  return input;
}

}  // namespace limber::tools
