// limber-precompute: a mesh in, an asset out.

#include <fmt/format.h>
#include <sys/resource.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "assembly_baking.h"
#include "limber/core/error.h"
#include "limber/core/version.h"
#include "limber/jobs_tbb/tbb_jobs.h"
#include "limber/mesh/merge_nodes.h"
#include "limber/mesh_assimp/read_surface_mesh.h"
#include "limber/model/sha256.h"
#include "limber/precompute/bake.h"
#include "limber/precompute/tetrahedralise.h"
#include "precompute_report.h"
#include "program.h"

namespace limber::tools {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

// The user's arguments, uninterpreted.

struct MaterialArguments {
  std::string file, name;
  std::optional<double> youngs_modulus, poisson_ratio, density;
};

struct ModeArguments {
  int modes = 64;
  std::string mass, elements, frequency_error, damping_ratio;
  std::string load = "sudden";
  std::vector<double> rayleigh;
  SceneLimits limits;
  int blas_threads = 1;
  bool no_certify = false;
};

struct GeometryArguments {
  std::vector<std::string> fixes;
  std::string render_surface, collision_surface;
  int collision_triangles = 0;
  TetrahedralisationOptions tets;
  double scale = 1.0;
  std::optional<double> merge_nodes;
};

/// Of the blocks that an asset may have beside its modes.
struct ResponseArguments {
  std::vector<std::string> residuals;
  double residual_megabytes = 32.0;
  std::string skin;
  bool volume_block = false;
};

struct AssemblyArguments {
  AssemblyOptions options;
  bool auto_joints = false;
  std::string components = "auto";
  std::string scene;
};

struct Arguments {
  std::string mesh, output;
  bool list_materials = false;
  MaterialArguments material;
  ModeArguments modal;
  GeometryArguments geometry;
  ResponseArguments response;
  AssemblyArguments assembly;
};

void declare_material_options(CLI::App& app, Arguments& a) {
  app.add_option("--youngs-modulus", a.material.youngs_modulus, "Young's modulus E of the whole body")->type_name("PA");
  app.add_option("--poisson-ratio", a.material.poisson_ratio, "Poisson's ratio, in (-1, 0.5)")->type_name("NU");
  app.add_option("--density", a.material.density, "density of the whole body")->type_name("KG_M3");
  app.add_option("--material", a.material.name, "a material by name, such as steel or rubber")->type_name("NAME");
  app.add_option("--materials", a.material.file,
                 "materials by region: {\"REGION\": {\"youngs_modulus\", \"poisson_ratio\", \"density\"} or \"NAME\"}; "
                 "\"*\" is the rest")
      ->type_name("FILE.json");
  app.add_flag("--list-materials", a.list_materials, "print the materials known by name and their sources, then stop");
}

void declare_mode_options(CLI::App& app, Arguments& a) {
  app.add_option("--modes", a.modal.modes, "elastic modes computed, and the most kept, lowest first")
      ->type_name("N")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  app.add_option("--max-force", a.modal.limits.max_force,
                 "largest force of the scene; with --min-displacement, drops what it cannot show")
      ->type_name("N")
      ->check(positive_number());
  app.add_option("--min-displacement", a.modal.limits.min_displacement, "smallest motion that anyone can see")
      ->type_name("M")
      ->check(positive_number());
  app.add_option("--load", a.modal.load, "how the largest force comes")
      ->check(CLI::IsMember({"static", "sudden", "resonant"}))
      ->capture_default_str();
  app.add_option("--frame-rate", a.modal.limits.frame_rate, "drops modes whose damped frequency is above half of it")
      ->type_name("HZ")
      ->check(positive_number());
  app.add_flag("--keep-all", a.modal.limits.keep_all, "switches off the limits on force and frame rate");
  app.add_option("--mass", a.modal.mass,
                 "mass matrix; default: lumped of linear elements, consistent of quadratic ones")
      ->check(CLI::IsMember({"lumped", "consistent"}));
  app.add_option("--elements", a.modal.elements,
                 "four nodes a tet (linear) or ten (quadratic), which bend as they should; default: quadratic for tets "
                 "made from a surface, else as the file has them; parts of an assembly: linear")
      ->check(CLI::IsMember({"linear", "quadratic"}));
  app.add_option("--rayleigh", a.modal.rayleigh, "damping a1 K + a2 M: a1 in s, a2 in 1/s")
      ->type_name("A1,A2")
      ->delimiter(',')
      ->expected(2);
  app.add_option("--damping-ratio", a.modal.damping_ratio, "damping ratio Z at two frequencies (1 is critical)")
      ->type_name("Z@F1,F2");
  app.add_option("--blas-threads", a.modal.blas_threads,
                 "threads of the linear algebra, 0 for all; more than one pays on huge meshes on a quiet machine")
      ->type_name("N")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  app.add_flag("--no-certify", a.modal.no_certify, "skip the proof that no mode was missed (for huge meshes)");
}

void declare_geometry_options(CLI::App& app, Arguments& a) {
  app.add_option("--fix", a.geometry.fixes,
                 "hold nodes: group:NAME, box:x0,y0,z0,x1,y1,z1 (m) or nodes:I,J,... (0-based); repeatable")
      ->type_name("SELECTOR")
      ->allow_extra_args(false);
  app.add_option("--render-surface", a.geometry.render_surface,
                 "surface to draw, embedded in the tets; default: the input surface, or the tets' boundary")
      ->type_name("FILE");
  app.add_option("--collision-surface", a.geometry.collision_surface,
                 "surface that touches; default: the tets' boundary")
      ->type_name("FILE");
  app.add_option("--collision-triangles", a.geometry.collision_triangles,
                 "most triangles of the surface that touches, by edge collapse; default: as many as it has")
      ->type_name("N")
      ->check(CLI::Range(4, 100'000'000));
  app.add_option("--cell-size", a.geometry.tets.cell_size,
                 "tets from a surface: largest circumradius; default: 1/40 of the diagonal, less where parts are thin")
      ->type_name("M")
      ->check(positive_number());
  app.add_option("--frequency-error", a.modal.frequency_error,
                 "tets from a surface: cells so small that the ten lowest elastic frequencies are within this of the "
                 "continuum's, by the estimate that the asset keeps, as far as --max-nodes allows")
      ->type_name("PERCENT%");
  app.add_option("--alpha", a.geometry.tets.alpha,
                 "wrap of a soup: smallest hole it enters; default: 1/50 of the diagonal")
      ->type_name("M")
      ->check(positive_number());
  app.add_option(
         "--max-nodes", a.geometry.tets.max_nodes,
         "tets from a surface: nodes that cells smaller than --cell-size may cost, where parts or gaps are thin, or by "
         "--frequency-error")
      ->type_name("N")
      ->check(CLI::Range(1, 100'000'000))
      ->capture_default_str();
  app.add_option("--scale", a.geometry.scale,
                 "multiplies all input lengths, after the unit that the file states, for files that are not in metres")
      ->type_name("FACTOR")
      ->check(positive_number())
      ->capture_default_str();
  app.add_option("--merge-nodes", a.geometry.merge_nodes,
                 "tetrahedra: nodes that are no farther apart become one, for parts that were meshed one by one")
      ->type_name("M")
      ->check(CLI::NonNegativeNumber);
  app.add_option(
         "--residual", a.response.residuals,
         "what dropped modes still answer statically: at nodes (as --fix names them), three further modes each, "
         "or of the whole 'surface' that touches, stored beside the modes; repeatable")
      ->type_name("SELECTOR|surface")
      ->allow_extra_args(false);
  app.add_option("--residual-max-mb", a.response.residual_megabytes,
                 "largest table of --residual surface between all pairs of vertices; above, single vertices alone")
      ->type_name("MB")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_flag("--skin{auto}", a.response.skin,
               "also bake a modal skin, which bends far without swelling; --skin=HANDLES with so many handles, else "
               "as many as it needs, 8 to 24");
  app.add_flag("--volume", a.response.volume_block,
               "also bake all nodes, so that any initial deformation can be given to the runtime");
}

void declare_assembly_options(CLI::App& app, Arguments& a) {
  app.add_option("--joints", a.assembly.options.joints_file,
                 "the mesh is an assembly: a body for each component, joined as this file of limber-joints says; "
                 "materials are named by components")
      ->type_name("JOINTS.json");
  app.add_flag("--auto-joints", a.assembly.auto_joints, "the same, with joints and limits found in the geometry");
  app.add_option("--components", a.assembly.components,
                 "what makes a component: shared vertices, or names in the file; auto: groups, where joints are to be "
                 "found and no part's triangles belong to two, else shared vertices")
      ->check(CLI::IsMember({"auto", "connectivity", "groups", "materials"}))
      ->capture_default_str();
  app.add_option("--scene", a.assembly.scene, "of an assembly: the scene in which it stands and moves by its joints")
      ->type_name("SCENE.json");
  app.add_option("--rigid", a.assembly.options.rigid, "component that does not bend, or '*' for all; repeatable")
      ->type_name("NAME")
      ->allow_extra_args(false);
  app.add_option("--ground", a.assembly.options.ground, "component that stands still; repeatable; default: the first")
      ->type_name("NAME")
      ->allow_extra_args(false);
  app.add_flag("--no-ground", a.assembly.options.free, "no component stands still");
  app.add_flag(
      "--no-joint-modes", [&a](std::int64_t) { a.assembly.options.joint_compliance = false; },
      "of an assembly: leave out the up to six modes of a part for each of its joints, by which it answers exactly "
      "what "
      "the joint does to it at rest");
}

// Meaning -----------------------------------------------------------------------------------------------------------

MaterialTable materials_of(const Arguments& a) {
  const bool by_numbers = a.material.youngs_modulus || a.material.poisson_ratio || a.material.density;
  const int ways = (by_numbers ? 1 : 0) + (a.material.name.empty() ? 0 : 1) + (a.material.file.empty() ? 0 : 1);
  if (ways != 1)
    throw InvalidArgument(
        std::string(ways == 0 ? "no material is given" : "the material is given twice") +
        "; give --material NAME, or --youngs-modulus, --poisson-ratio and --density, or --materials FILE");
  if (!a.material.file.empty()) return read_materials(a.material.file);
  if (!a.material.name.empty()) return {{"*", material_preset(a.material.name)}};
  if (!a.material.youngs_modulus || !a.material.poisson_ratio || !a.material.density)
    throw InvalidArgument("--youngs-modulus, --poisson-ratio and --density go together: one of them is missing");
  const Material material{*a.material.youngs_modulus, *a.material.poisson_ratio, *a.material.density};
  material.validate("material");
  return {{"*", material}};
}

RayleighDamping damping_of(const Arguments& a) {
  if (!a.modal.rayleigh.empty() && !a.modal.damping_ratio.empty())
    throw InvalidArgument("the damping is given twice: by --rayleigh and by --damping-ratio");
  if (!a.modal.rayleigh.empty())
    return {.stiffness_proportional = a.modal.rayleigh[0], .mass_proportional = a.modal.rayleigh[1]};
  if (a.modal.damping_ratio.empty()) return {};
  double ratio = 0.0, first = 0.0, second = 0.0;
  char rest = 0;
  if (std::sscanf(a.modal.damping_ratio.c_str(), "%lf@%lf,%lf%c", &ratio, &first, &second, &rest) != 3)
    throw InvalidArgument("--damping-ratio " + a.modal.damping_ratio + ": expected Z@F1,F2, such as 0.02@100,1000");
  return RayleighDamping::from_ratio(ratio, first, second);
}

ResidualOptions residual_of(const Arguments& a) {
  ResidualOptions residual;
  for (const std::string& text : a.response.residuals) {
    if (text == "surface")
      residual.surface = true;
    else
      residual.nodes.push_back(parse_node_selector(text));
  }
  residual.max_full_bytes = 1e6 * a.response.residual_megabytes;
  return residual;
}

SkinOptions skin_of(const std::string& text) {
  if (text.empty()) return {};
  SkinOptions skin{.make = true};
  if (text == "auto") return skin;
  char rest = 0;
  if (std::sscanf(text.c_str(), "%d%c", &skin.handles, &rest) != 1 || skin.handles < 1)
    throw InvalidArgument("--skin=" + text + ": expected a number of handles, such as --skin=12, or --skin alone");
  return skin;
}

/// "1%" or "0.5 %" as a ratio; 0 for an empty text.
double frequency_error_of(const std::string& text) {
  if (text.empty()) return 0.0;
  double percent = 0.0;
  char sign = 0, rest = 0;
  if (std::sscanf(text.c_str(), "%lf %c %c", &percent, &sign, &rest) != 2 || sign != '%' || !(percent > 0.0) ||
      !std::isfinite(percent))
    throw InvalidArgument("--frequency-error " + text + ": expected per cent above 0, such as 1%");
  return 0.01 * percent;
}

LoadKind load_of(const std::string& text) {
  return text == "static" ? LoadKind::kStatic : text == "resonant" ? LoadKind::kResonant : LoadKind::kSudden;
}

BakeOptions options_of(const Arguments& a) {
  BakeOptions o;
  o.materials = materials_of(a);
  for (const std::string& text : a.geometry.fixes) o.fixed.push_back(parse_node_selector(text));
  if (!a.modal.elements.empty()) o.elements = a.modal.elements == "linear" ? Elements::kLinear : Elements::kQuadratic;
  o.damping = damping_of(a);
  o.analysis = {.modes = a.modal.modes,
                .mass = a.modal.mass == "consistent" ? MassKind::kConsistent : MassKind::kLumped,
                .certify = !a.modal.no_certify,
                .blas_threads = a.modal.blas_threads};
  o.limits = a.modal.limits;
  o.limits.max_modes = a.modal.modes;
  o.limits.load = load_of(a.modal.load);
  if ((a.modal.limits.max_force > 0.0) != (a.modal.limits.min_displacement > 0.0))
    throw InvalidArgument("--max-force and --min-displacement go together: one of them is missing");
  o.residual = residual_of(a);
  o.skin = skin_of(a.response.skin);
  o.collision_triangles = a.geometry.collision_triangles;
  o.volume_block = a.response.volume_block;
  o.validate();
  a.geometry.tets.validate();
  (void)frequency_error_of(a.modal.frequency_error);
  return o;
}

// Work --------------------------------------------------------------------------------------------------------------

class Stopwatch {
 public:
  explicit Stopwatch(nlohmann::ordered_json& seconds) : seconds_(seconds) {}
  template <class F>
  auto time(const char* stage, F&& work) {
    const auto start = Clock::now();
    auto result = work();
    add(stage, std::chrono::duration<double>(Clock::now() - start).count());
    return result;
  }
  void add(const char* stage, double seconds) { seconds_[stage] = seconds; }

 private:
  nlohmann::ordered_json& seconds_;
};

double peak_memory_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

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

/// Fills a surface with tets, told of failures by the file's name.
Tetrahedralisation tets_of(Program& program, const Arguments& a, const SurfaceMesh& surface, double cell_size,
                           Warnings& warnings) {
  TetrahedralisationOptions options = a.geometry.tets;
  options.cell_size = cell_size;
  options.quadratic = a.modal.elements != "linear";
  options.progress = [&](const std::string& stage) { program.progress().stage(stage); };
  try {
    return tetrahedralise(surface, options, warnings);
  } catch (const ComputationError& e) {
    throw ComputationError("\"" + a.mesh + "\": " + e.what());
  } catch (const InputError& e) {
    throw InputError("\"" + a.mesh + "\": " + e.what());
  }
}

/// Quadratic elements where limber makes the tets; each kind with the mass by which its frequencies err less.
void choose_elements(const Arguments& a, bool made_here, bool has_mid_edge_nodes, BakeOptions& options) {
  if (a.modal.elements.empty() && made_here) options.elements = Elements::kQuadratic;
  const bool quadratic =
      options.elements == Elements::kQuadratic || (options.elements == Elements::kAsGiven && has_mid_edge_nodes);
  if (a.modal.mass.empty() && quadratic) options.analysis.mass = MassKind::kConsistent;
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
TriedCells try_cells(Program& program, const Arguments& a, const BakeInput& input, BakeOptions options,
                     double cell_size) {
  TriedCells tried;
  tried.tets = tets_of(program, a, *input.render, cell_size, tried.warnings);
  choose_elements(a, true, false, options);
  options.analysis.modes = options.limits.max_modes = kModesTold;
  options.residual = {};
  options.skin = {};
  options.volume_block = false;
  Warnings unread;  // those of the whole bake follow
  TbbJobs jobs;
  const BakeResult result = bake({.name = input.name, .mesh = tried.tets.mesh}, options, unread, jobs);
  for (const BodyReport& body : result.bodies) {
    tried.error = std::max(tried.error, largest_frequency_error(body));
    tried.nodes += body.nodes;
  }
  // The circumradius of the regular tet of mean volume; the mesher's tets have 0.75 of the radius that it was given.
  const double mean = tried.tets.volume_after / static_cast<double>(tried.tets.mesh.tets.size());
  tried.size = std::cbrt(mean * 1.948) / 0.75;
  return tried;
}

/// Smaller and smaller cells until the error is what was asked for, or nodes run out.
Tetrahedralisation cells_by_error(Program& program, const Arguments& a, const BakeInput& input,
                                  const BakeOptions& options) {
  const double wanted = frequency_error_of(a.modal.frequency_error);
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
void fill_with_tets(Program& program, const Arguments& a, const BakeOptions& bake, BakeInput& input,
                    Stopwatch& stopwatch) {
  Tetrahedralisation t = stopwatch.time("tetrahedralise", [&] {
    return a.modal.frequency_error.empty()
               ? tets_of(program, a, *input.render, a.geometry.tets.cell_size, program.warnings())
               : cells_by_error(program, a, input, bake);
  });
  stopwatch.add("wrap", t.seconds_wrap);
  stopwatch.add("thickness", t.seconds_thickness);
  stopwatch.add("mesh", t.seconds_mesh);
  program.report()["surface"] = surface_report(*input.render, t);
  const std::string done = t.wrapped         ? ", wrapped (" + t.why_wrapped + ")"
                           : t.mending.any() ? ", mended (" + t.mending.text() + ")"
                                             : "";
  program.print(fmt::format("surface: {} triangles{}; it encloses {:.6g} m^3, its tets {:.6g} m^3\n",
                            input.render->triangles.size(), done, t.volume_before, t.volume_after));
  input.mesh = std::move(t.mesh);
}

/// Joins nodes where that was asked for, and tells of those that look as if they were meant to be one.
void join_parts(Program& program, const Arguments& a, TetMesh& mesh) {
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

/// Tells which unit of the file counts.
void tell_unit(Program& program, const FileUnit& unit) {
  nlohmann::ordered_json& told = program.report()["unit"];
  told = {{"metres", unit.metres}, {"stated", unit.stated}, {"up", nullptr}};
  if (unit.up != 0) told["up"] = std::string(1, unit.up);
  if (unit.metres != 1.0) program.print(fmt::format("lengths: the file's unit is {:.6g} m\n", unit.metres));
}

BakeInput read_input(Program& program, const Arguments& a, const BakeOptions& bake, Stopwatch& stopwatch) {
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
    fill_with_tets(program, a, bake, input, stopwatch);
  }
  if (!a.geometry.render_surface.empty())
    input.render = read_surface(program, a.geometry.render_surface, a.geometry.scale);
  if (!a.geometry.collision_surface.empty())
    input.collision = read_surface(program, a.geometry.collision_surface, a.geometry.scale);
  return input;
}

void print_materials(Program& program) {
  for (const MaterialPreset& m : material_presets())
    program.print(fmt::format("{:<12} E {:>8.3g} Pa  nu {:>5.3g}  rho {:>6.5g} kg/m^3  {}\n", m.name,
                              m.material.youngs_modulus, m.material.poisson_ratio, m.material.density, m.source));
}

/// The options that shape the result, in the order of --help; names of files without their folders, so that equal bakes
/// give equal bytes wherever they are run.
std::string options_line(const CLI::App& app) {
  std::string line;
  for (const CLI::Option* o : app.get_options()) {
    if (o->count() == 0 || o->get_name() == "--report" || o->get_name().rfind("--", 0) != 0 ||
        o->get_name() == "--output")
      continue;
    const bool is_flag = o->get_items_expected_max() == 0;
    for (const std::string& value : o->results()) {
      line += (line.empty() ? "" : " ") + o->get_name();
      if (!is_flag) line += " " + fs::path(value).filename().string();
      if (is_flag && value != "true") line += "=" + value;
    }
  }
  return line;
}

Provenance provenance_of(const Program& program, const Arguments& a, const CLI::App& app) {
  Provenance p;
  p.tool = program.name_and_version();
  p.input = fs::path(a.mesh).filename().string();
  p.input_hash = sha256_hex(read_file(a.mesh));
  p.options = options_line(app);
  return p;
}

/// Mass of the surface as given, beside that of its tets.
void add_surface_mass(nlohmann::ordered_json& report, const MaterialTable& materials) {
  const auto material = materials.find("*");  // of the one region that a surface's tets have
  if (!report.contains("surface") || material == materials.end()) return;
  auto& surface = report["surface"];
  surface["mass_before"] = material->second.density * surface["volume_before"].get<double>();
  surface["mass_after"] = material->second.density * surface["volume_after"].get<double>();
}

/// "seconds: read 0.02, wrap 1.7, …; peak memory 139 MB"
std::string stage_line(const nlohmann::ordered_json& seconds) {
  std::string line = "seconds:";
  for (const auto& [stage, value] : seconds.items()) line += fmt::format(" {} {:.3g},", stage, value.get<double>());
  line.back() = ';';
  return line + fmt::format(" peak memory {:.0f} MB\n", 1e-6 * peak_memory_bytes());
}

/// Options for assemblies alone.
void check_assembly(const Arguments& a) {
  if (a.assembly.auto_joints && !a.assembly.options.joints_file.empty())
    throw InvalidArgument("the joints are given twice: by --joints and by --auto-joints");
  const bool is_one = a.assembly.auto_joints || !a.assembly.options.joints_file.empty();
  const bool asks = !a.assembly.scene.empty() || !a.assembly.options.rigid.empty() ||
                    !a.assembly.options.ground.empty() || a.assembly.options.free;
  if (asks && !is_one)
    throw InvalidArgument(
        "--scene, --rigid, --ground and --no-ground are for assemblies: give --joints or --auto-joints");
  if (is_one &&
      !(a.geometry.fixes.empty() && a.geometry.render_surface.empty() && a.geometry.collision_surface.empty()))
    throw InvalidArgument("--fix, --render-surface and --collision-surface are for single bodies, not for assemblies");
  if (is_one && !a.modal.frequency_error.empty())
    throw InvalidArgument("--frequency-error is for single surfaces, not for assemblies");
  if (a.assembly.options.free && !a.assembly.options.ground.empty())
    throw InvalidArgument("--ground and --no-ground exclude each other");
}

void precompute_assembly(Program& program, const Arguments& a, const BakeOptions& options) {
  AssemblyOptions assembly = a.assembly.options;
  assembly.scale = a.geometry.scale;
  assembly.tets = a.geometry.tets;
  assembly.tets.quadratic = a.modal.elements == "quadratic";
  if (a.assembly.components == "groups") assembly.components = ComponentRule::kGroups;
  if (a.assembly.components == "materials") assembly.components = ComponentRule::kMaterials;
  if (a.assembly.components == "connectivity") assembly.components = ComponentRule::kConnectivity;
  program.add_input(a.mesh);
  TbbJobs jobs;
  BakedAssembly baked = bake_assembly(program, a.mesh, assembly, options, jobs);
  baked.asset.provenance = provenance_of(program, a, program.options());
  const std::string bytes = asset_bytes(baked.asset);
  program.write_file(a.output, bytes);
  add_bake(program.report(), baked.bodies);
  warn_of_stiff_elements(baked.bodies, program.warnings());
  program.report()["joints"] = nlohmann::ordered_json::parse(joints_text(baked.joints))["joints"];
  program.report()["asset_bytes"] = bytes.size();
  for (const auto& body : baked.asset.bodies)
    program.print(fmt::format("{:<24} {:>10.4g} kg  {:>3} modes\n", body->name(), body->data().mass, body->modes()));
  program.print(fmt::format("{}: {} bodies, {} joints, {:.2f} MB\n", a.output, baked.asset.bodies.size(),
                            baked.asset.joints.size(), 1e-6 * static_cast<double>(bytes.size())));
  if (a.assembly.scene.empty()) return;
  const fs::path folder = fs::absolute(a.assembly.scene).parent_path();
  program.write_file(a.assembly.scene, machine_scene(fs::path(a.mesh).stem().string(),
                                                     fs::absolute(a.output).lexically_relative(folder).string()));
}

void precompute(Program& program, const Arguments& a) {
  if (a.list_materials) return print_materials(program);
  if (a.mesh.empty() || a.output.empty()) throw InvalidArgument("MESH and --output are both needed; see --help");
  check_assembly(a);
  BakeOptions options = options_of(a);
  if (a.assembly.auto_joints || !a.assembly.options.joints_file.empty()) {
    choose_elements(a, false, false, options);
    return precompute_assembly(program, a, options);
  }
  nlohmann::ordered_json seconds;
  Stopwatch stopwatch(seconds);

  for (const std::string& input : {a.mesh, a.material.file, a.geometry.render_surface, a.geometry.collision_surface})
    if (!input.empty()) program.add_input(input);
  program.progress().stage("reading");
  BakeInput input = read_input(program, a, options, stopwatch);
  input.provenance = provenance_of(program, a, program.options());
  choose_elements(a, program.report().contains("surface"), input.mesh.has_mid_edge_nodes(), options);

  program.progress().stage("modes");
  TbbJobs jobs;
  const BakeResult result = bake(input, options, program.warnings(), jobs);
  program.progress().stage("writing");
  const std::string bytes = stopwatch.time("encode", [&] { return asset_bytes(result.asset); });
  program.write_file(a.output, bytes);

  add_bake(program.report(), result.bodies);
  warn_of_stiff_elements(result.bodies, program.warnings());
  add_bake_seconds(seconds, result.bodies);
  add_surface_mass(program.report(), options.materials);
  program.report()["asset_bytes"] = bytes.size();
  program.report()["peak_memory_bytes"] = peak_memory_bytes();
  program.print(bake_summary(result.bodies));
  program.print(stage_line(seconds));
  program.report()["seconds"] = std::move(seconds);
  program.print(fmt::format("{}: {:.2f} MB\n", a.output, 1e-6 * static_cast<double>(bytes.size())));
}

}  // namespace
}  // namespace limber::tools

int main(int argc, char** argv) {
  using namespace limber::tools;
  Program program("limber-precompute",
                  "Bakes a mesh into an asset: its vibration modes by finite elements, those of them that a scene "
                  "can show, and the surfaces that move with them. Lengths in metres.");
  Arguments arguments;
  program.options().add_option("MESH", arguments.mesh,
                               "tetrahedra (Gmsh .msh, MEDIT .mesh, TetGen .node/.ele, VTK legacy .vtk) or a surface "
                               "(OBJ, STL, PLY, OFF, glTF, 3DS, ...), which is filled with tetrahedra first");
  program.options().add_option("-o,--output", arguments.output, "asset to write")->type_name("ASSET.glb");
  declare_material_options(program.options(), arguments);
  declare_mode_options(program.options(), arguments);
  declare_geometry_options(program.options(), arguments);
  declare_assembly_options(program.options(), arguments);
  return program.run(argc, argv, [&] { precompute(program, arguments); });
}
