// limber-precompute: a mesh in, an asset out.

#include <fmt/format.h>
#include <sys/resource.h>
#include <CLI/CLI.hpp>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "assembly_baking.h"
#include "bake_results.h"
#include "limber/core/error.h"
#include "limber/jobs_tbb/tbb_jobs.h"
#include "limber/model/sha256.h"
#include "precompute_arguments.h"
#include "precompute_input.h"
#include "precompute_report.h"
#include "program.h"
#include "slepc_engine.h"

namespace limber::tools {
namespace {

namespace fs = std::filesystem;

void print_materials(Program& program) {
  for (const MaterialPreset& m : material_presets())
    program.print(fmt::format("{:<12} E {:>8.3g} Pa  nu {:>5.3g}  rho {:>6.5g} kg/m^3  {}{}\n", m.name,
                              m.material.youngs_modulus, m.material.poisson_ratio, m.material.density, m.source,
                              m.material.loss_factor > 0.0 ? fmt::format("; loss factor of sound {:.2g}, {}",
                                                                         m.material.loss_factor, m.loss_source)
                                                           : std::string()));
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

Provenance provenance_of(const Program& program, const PrecomputeArguments& a, const CLI::App& app) {
  Provenance p;
  p.tool = program.name_and_version();
  p.input = fs::path(a.mesh).filename().string();
  p.input_hash = sha256_hex(read_file(a.mesh));
  p.options = options_line(app);
  return p;
}

double peak_memory_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

/// Mass of the surface as given, beside that of its tets, where it is of one material.
void add_surface_mass(nlohmann::ordered_json& report, const BakeOptions& options) {
  const MaterialTable& materials = options.materials;
  const auto material = materials.find("*");
  if (!report.contains("surface") || materials.size() != 1 || material == materials.end() || !options.regions.empty())
    return;
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

void precompute_assembly(Program& program, const PrecomputeArguments& a, const BakeOptions& options) {
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

/// The modes of a band, into a file of their own.
void write_slices(Program& program, const PrecomputeArguments& a, std::vector<SpectrumSlice> slices) {
  nlohmann::ordered_json bodies = nlohmann::ordered_json::array();
  for (SpectrumSlice& slice : slices) {
    slice.of = a.slice.of;
    bodies.push_back({{"nodes", slice.nodes}, {"below_low", slice.below_low}, {"below_high", slice.below_high}});
    program.print(fmt::format("{} to {} Hz: {} modes, {} eigenvalues below, {} below the upper end\n", slice.band.low,
                              slice.band.high, slice.modes(), slice.below_low, slice.below_high));
  }
  program.write_file(a.output, slice_bytes(slices));
  program.report()["slices"] = std::move(bodies);
  program.report()["peak_memory_bytes"] = peak_memory_bytes();
}

void precompute(Program& program, const PrecomputeArguments& a) {
  if (a.list_materials) return print_materials(program);
  if (!a.farm.manifest.empty()) {
    if (!a.mesh.empty()) throw InvalidArgument("MESH and --manifest exclude each other");
    return bake_many(program, a.farm, a.output);
  }
  if (!a.farm.summaries.empty()) {
    if (!a.mesh.empty() || a.output.empty())
      throw InvalidArgument("--summary RESULTS.jsonl --output PAGE.html: both are needed, and no MESH");
    return write_overview(program, a.farm.summaries, a.output);
  }
  if (a.mesh.empty() || a.output.empty()) throw InvalidArgument("MESH and --output are both needed; see --help");
  check_assembly(a);
  EigenLauncher launcher;
  if (a.slice.by_processes()) launcher = find_eigen_launcher();
  AskedBake asked = asked_bake(program, a);
  BakeOptions& options = asked.options;
  read_slices_of(program, a, program.options().count("--modes") > 0, options);
  if (a.assembly.auto_joints || !a.assembly.options.joints_file.empty()) {
    if (!options.regions.empty())
      throw InvalidArgument("--materials: regions by shapes are for single bodies, not for assemblies");
    choose_elements(a, false, false, options);
    return precompute_assembly(program, a, options);
  }
  nlohmann::ordered_json seconds;
  Stopwatch stopwatch(seconds);

  for (const std::string& input : {a.mesh, a.material.file, a.geometry.render_surface, a.geometry.collision_surface})
    if (!input.empty()) program.add_input(input);
  program.progress().stage("reading");
  BakeInput input = read_input(program, a, asked, stopwatch);
  input.provenance = provenance_of(program, a, program.options());
  choose_elements(a, program.report().contains("surface"), input.mesh.has_mid_edge_nodes(), options);

  program.progress().stage("modes");
  TbbJobs jobs;
  std::string slices;  // of limber-eigen
  if (a.slice.bodies || a.slice.by_processes()) {
    const std::string bodies = bake_eigenproblems(input, options, program.warnings(), jobs);
    if (a.slice.bodies) return program.write_file(a.output, bodies);
    slices = stopwatch.time("eigen", [&] { return run_limber_eigen(launcher, program, a, bodies); });
    options.analysis.slices = read_slices(slices);
    if (!a.slice.band.empty()) {
      write_slices(program, a, std::move(options.analysis.slices));
      fs::remove(slices);
      return;
    }
  }
  if (!a.slice.band.empty())
    return write_slices(program, a,
                        bake_slices(input, options, {a.slice.band[0], a.slice.band[1]}, program.warnings(), jobs));
  const BakeResult result = bake(input, options, program.warnings(), jobs);
  program.progress().stage("writing");
  const std::string bytes = stopwatch.time("encode", [&] { return asset_bytes(result.asset); });
  program.write_file(a.output, bytes);

  add_bake(program.report(), result.bodies);
  warn_of_stiff_elements(result.bodies, program.warnings());
  add_bake_seconds(seconds, result.bodies);
  add_surface_mass(program.report(), options);
  program.report()["asset_bytes"] = bytes.size();
  program.report()["peak_memory_bytes"] = peak_memory_bytes();
  program.print(bake_summary(result.bodies));
  program.print(stage_line(seconds));
  program.report()["seconds"] = std::move(seconds);
  program.print(fmt::format("{}: {:.2f} MB\n", a.output, 1e-6 * static_cast<double>(bytes.size())));
  if (!slices.empty()) fs::remove(slices);
}

}  // namespace
}  // namespace limber::tools

int main(int argc, char** argv) {
  using namespace limber::tools;
  Program program("limber-precompute",
                  "Bakes a mesh into an asset: its vibration modes by finite elements, those of them that a scene "
                  "can show, and the surfaces that move with them. Lengths in metres.");
  PrecomputeArguments arguments;
  declare_options(program.options(), arguments);
  return program.run(argc, argv, [&] { precompute(program, arguments); });
}
