#include "precompute_arguments.h"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

#include "limber/core/error.h"
#include "limber/mesh_assimp/read_surface_mesh.h"
#include "program.h"

namespace limber::tools {
namespace {

void declare_material_options(CLI::App& app, PrecomputeArguments& a) {
  app.add_option("--youngs-modulus", a.material.youngs_modulus, "Young's modulus E of the whole body")->type_name("PA");
  app.add_option("--poisson-ratio", a.material.poisson_ratio, "Poisson's ratio, in (-1, 0.5)")->type_name("NU");
  app.add_option("--density", a.material.density, "density of the whole body")->type_name("KG_M3");
  app.add_option("--loss-factor", a.material.loss_factor,
                 "for --sound: a vibration loses 2 pi ETA of its energy a period; in place of the materials' own")
      ->type_name("ETA")
      ->check(positive_number());
  app.add_option("--material", a.material.name, "a material by name, such as steel or rubber")->type_name("NAME");
  app.add_option("--materials", a.material.file,
                 "materials by region of the tets, or by groups or materials of a surface's faces: {\"REGION\": "
                 "{\"youngs_modulus\", \"poisson_ratio\", \"density\"} or \"NAME\"}; \"*\" is the rest; or a list of "
                 "regions by shells, boxes, balls, half-spaces and voxels")
      ->type_name("FILE.json");
  app.add_flag("--list-materials", a.list_materials, "print the materials known by name and their sources, then stop");
}

void declare_mode_options(CLI::App& app, PrecomputeArguments& a) {
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

void declare_slice_options(CLI::App& app, PrecomputeArguments& a) {
  app.add_option("--slice", a.slice.band,
                 "compute the modes between two frequencies alone and write them to --output, for --merge")
      ->type_name("HZ,HZ")
      ->delimiter(',')
      ->expected(2);
  app.add_option("--of", a.slice.of,
                 "how many slices there are in all, so that --merge can tell whether one is missing")
      ->type_name("N")
      ->check(CLI::Range(1, 1'000'000));
  app.add_option("--merge", a.slice.merge,
                 "take the modes of these slices, which follow each other from 0 Hz on, made of the same mesh with the "
                 "same options; repeatable")
      ->type_name("FILE");
  app.add_option(
         "--engine", a.slice.engine,
         "what computes the modes; slepc: limber-eigen, by mpirun; lobpcg: the same without a factor and without "
         "the proof that no mode is missed")
      ->type_name("NAME")
      ->check(CLI::IsMember({"arpack", "slepc", "lobpcg"}))
      ->capture_default_str();
  app.add_option("--processes", a.slice.processes, "of limber-eigen")
      ->type_name("N")
      ->check(CLI::Range(1, 100'000))
      ->capture_default_str();
  app.add_flag("--bodies", a.slice.bodies, "write to --output what limber-eigen computes slices from, for --merge");
}

void declare_geometry_options(CLI::App& app, PrecomputeArguments& a) {
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
  app.add_flag("--sound{all}", a.response.sound,
               "also bake what one hears: all modes from 20 Hz to 20 kHz, at most 1000, at the vertices of the surface "
               "that touches; --sound=MODES: at most so many");
  app.add_flag("--volume", a.response.volume_block,
               "also bake all nodes, so that any initial deformation can be given to the runtime");
}

void declare_assembly_options(CLI::App& app, PrecomputeArguments& a) {
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

/// Shells of two regions, or of one, that cross bound nothing.
void check_shells(const std::vector<MaterialRegion>& regions) {
  for (std::size_t i = 0; i < regions.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const auto *a = std::get_if<InsideShells>(&regions[j].shape), *b = std::get_if<InsideShells>(&regions[i].shape);
      if (!a || !b) continue;
      if (const Index pairs = crossing_triangles(a->surface, b->surface); pairs > 0)
        throw InputError(
            fmt::format("materials: the shells of regions \"{}\" and \"{}\" cross, at {} pairs of triangles",
                        regions[j].name, regions[i].name, pairs));
    }
}

void read_materials_of(Program& program, const PrecomputeArguments& a, AskedBake& asked) {
  const double scale = a.geometry.scale;
  const auto scaled = [scale](SurfaceMesh surface) {
    for (Vec3& v : surface.vertices) v *= scale;
    return surface;
  };
  Warnings unread;  // of the input, which is read again
  MaterialsFile file = read_materials_file(
      a.material.file,
      {.read_surface =
           [&](const std::filesystem::path& path) { return scaled(read_any_surface_mesh(path, program.warnings())); },
       .take_group =
           [&](const std::string& group) {
             GroupedSurface surface = read_any_grouped_surface(a.mesh, unread);
             SurfaceMesh shells = take_group(surface, group);
             if (shells.triangles.empty())
               throw InputError(
                   fmt::format("\"{}\" has no group \"{}\", which \"{}\" names", a.mesh, group, a.material.file));
             asked.shell_groups.push_back(group);
             return scaled(std::move(shells));
           },
       .scale = scale},
      program.warnings());
  for (const auto& path : file.files) program.add_input(path);
  check_shells(file.regions);
  asked.options.materials = std::move(file.table);
  asked.options.regions = std::move(file.regions);
}

void read_materials(Program& program, const PrecomputeArguments& a, AskedBake& asked) {
  const bool by_numbers = a.material.youngs_modulus || a.material.poisson_ratio || a.material.density;
  const int ways = (by_numbers ? 1 : 0) + (a.material.name.empty() ? 0 : 1) + (a.material.file.empty() ? 0 : 1);
  if (ways != 1)
    throw InvalidArgument(
        std::string(ways == 0 ? "no material is given" : "the material is given twice") +
        "; give --material NAME, or --youngs-modulus, --poisson-ratio and --density, or --materials FILE");
  if (!a.material.file.empty()) return read_materials_of(program, a, asked);
  if (!a.material.name.empty()) {
    asked.options.materials = {{"*", material_preset(a.material.name)}};
    return;
  }
  if (!a.material.youngs_modulus || !a.material.poisson_ratio || !a.material.density)
    throw InvalidArgument("--youngs-modulus, --poisson-ratio and --density go together: one of them is missing");
  const Material material{.youngs_modulus = *a.material.youngs_modulus,
                          .poisson_ratio = *a.material.poisson_ratio,
                          .density = *a.material.density};
  material.validate("material");
  asked.options.materials = {{"*", material}};
}

RayleighDamping damping_of(const PrecomputeArguments& a) {
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

ResidualOptions residual_of(const PrecomputeArguments& a) {
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

SoundOptions sound_of(const PrecomputeArguments& a) {
  const std::string& text = a.response.sound;
  if (text.empty()) {
    if (a.material.loss_factor) throw InvalidArgument("--loss-factor is for --sound, which is not given");
    return {};
  }
  SoundOptions sound{.make = true, .loss_factor = a.material.loss_factor};
  if (text == "all") return sound;
  char rest = 0;
  if (std::sscanf(text.c_str(), "%d%c", &sound.modes, &rest) != 1 || sound.modes < 1)
    throw InvalidArgument("--sound=" + text + ": expected a number of modes, such as --sound=200, or --sound alone");
  return sound;
}

LoadKind load_of(const std::string& text) {
  return text == "static" ? LoadKind::kStatic : text == "resonant" ? LoadKind::kResonant : LoadKind::kSudden;
}

}  // namespace

void declare_options(CLI::App& app, PrecomputeArguments& a) {
  app.add_option("MESH", a.mesh,
                 "tetrahedra (Gmsh .msh, MEDIT .mesh, TetGen .node/.ele, VTK legacy .vtk) or a surface "
                 "(OBJ, STL, PLY, OFF, glTF, 3DS, ...), which is filled with tetrahedra first");
  app.add_option("-o,--output", a.output, "asset to write")->type_name("ASSET.glb");
  declare_material_options(app, a);
  declare_mode_options(app, a);
  declare_slice_options(app, a);
  declare_geometry_options(app, a);
  declare_assembly_options(app, a);
  declare_farm_options(app, a.farm);
}

double frequency_error_of(const PrecomputeArguments& a) {
  const std::string& text = a.modal.frequency_error;
  if (text.empty()) return 0.0;
  double percent = 0.0;
  char sign = 0, rest = 0;
  if (std::sscanf(text.c_str(), "%lf %c %c", &percent, &sign, &rest) != 2 || sign != '%' || !(percent > 0.0) ||
      !std::isfinite(percent))
    throw InvalidArgument("--frequency-error " + text + ": expected per cent above 0, such as 1%");
  return 0.01 * percent;
}

AskedBake asked_bake(Program& program, const PrecomputeArguments& a) {
  AskedBake asked;
  BakeOptions& o = asked.options;
  read_materials(program, a, asked);
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
  o.sound = sound_of(a);
  o.collision_triangles = a.geometry.collision_triangles;
  o.volume_block = a.response.volume_block;
  o.validate();
  a.geometry.tets.validate();
  (void)frequency_error_of(a);
  return asked;
}

void choose_elements(const PrecomputeArguments& a, bool made_here, bool has_mid_edge_nodes, BakeOptions& options) {
  if (a.modal.elements.empty() && made_here) options.elements = Elements::kQuadratic;
  const bool quadratic =
      options.elements == Elements::kQuadratic || (options.elements == Elements::kAsGiven && has_mid_edge_nodes);
  if (a.modal.mass.empty() && quadratic) options.analysis.mass = MassKind::kConsistent;
}

void read_slices_of(Program& program, const PrecomputeArguments& a, bool modes_given, BakeOptions& options) {
  if (a.slice.of != 1 && a.slice.band.empty()) throw InvalidArgument("--of is for --slice, which is not given");
  if (!a.slice.band.empty() && !a.slice.merge.empty()) throw InvalidArgument("--slice and --merge exclude each other");
  if (a.slice.by_processes() && !a.slice.merge.empty())
    throw InvalidArgument("--engine and --merge exclude each other");
  if (a.slice.bodies && (a.slice.by_processes() || !a.slice.band.empty() || !a.slice.merge.empty()))
    throw InvalidArgument("--bodies excludes --engine, --slice and --merge");
  if (!a.slice.by_processes() && a.slice.processes != 1)
    throw InvalidArgument("--processes is for --engine slepc and lobpcg, which are not given");
  std::map<std::string, int> modes;  // of each body
  for (const std::string& file : a.slice.merge) {
    program.add_input(file);
    for (SpectrumSlice& slice : read_slices(file)) {
      modes[slice.problem] += slice.modes();
      options.analysis.slices.push_back(std::move(slice));
    }
  }
  if (modes_given) return;
  for (const auto& [problem, count] : modes)
    options.analysis.modes = options.limits.max_modes = std::max(options.analysis.modes, count);
}

void check_assembly(const PrecomputeArguments& a) {
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
  if (is_one && !(a.slice.band.empty() && a.slice.merge.empty() && !a.slice.by_processes() && !a.slice.bodies))
    throw InvalidArgument("--slice, --merge, --engine and --bodies are for single meshes, not for assemblies");
  if (is_one && !a.modal.frequency_error.empty())
    throw InvalidArgument("--frequency-error is for single surfaces, not for assemblies");
  if (a.assembly.options.free && !a.assembly.options.ground.empty())
    throw InvalidArgument("--ground and --no-ground exclude each other");
}

}  // namespace limber::tools
