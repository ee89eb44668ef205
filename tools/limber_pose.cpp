// limber-pose: poses a jointed model by handles, frame by frame.

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "limber/articulation/joints_file.h"
#include "limber/core/error.h"
#include "limber/mesh/write_mesh.h"
#include "limber/mesh_assimp/read_motion_clip.h"
#include "limber/mesh_assimp/read_surface_mesh.h"
#include "limber/model/morph_targets.h"
#include "limber/posing/handles_file.h"
#include "limber/posing/pose_recording.h"
#include "limber/posing/posed_model.h"
#include "limber/posing/retarget.h"
#if LIMBER_HAS_POSING_PENALTY
#include "limber/posing_penalty/penalty_poses.h"
#endif
#include "program.h"

namespace limber::tools {
namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::string model, joints, handles, clip, mapping, output, obj, rest;
  double scale = 1.0;
  PosingOptions options;
  bool penalty = false;
};

void declare(CLI::App& options, Arguments& a) {
  options.add_option("MODEL", a.model, "surface of all parts: OBJ, STL, PLY, glTF, OFF, 3DS, ...")->required();
  options.add_option("--joints", a.joints, "joints file of the model, as limber-joints writes it")
      ->type_name("JOINTS.json")
      ->required();
  options.add_option("--handles", a.handles, "what is pinned, soft and pulled, frame by frame")
      ->type_name("HANDLES.json");
  options.add_option("--clip", a.clip, "recorded motion that drives the model instead, with --mapping")
      ->type_name("FILE.bvh");
  options.add_option("--mapping", a.mapping, "which points of the model ride on which joints of the clip")
      ->type_name("MAPPING.json");
  options.add_option("-o,--output", a.output, "write the poses as an animation for any glTF viewer")
      ->type_name("FILE.glb");
  options.add_option("--obj", a.obj, "write the surface of each frame: STEM_0000.obj, STEM_0001.obj, ...")
      ->type_name("STEM");
  options.add_option("--rest", a.rest, "write the last pose as a model to bake: STEM.obj and STEM.joints.json")
      ->type_name("STEM");
  options.add_option("--scale", a.scale, "metres per unit of the model, for the GLB")
      ->type_name("M")
      ->check(positive_number())
      ->capture_default_str();
  options
      .add_option("--handle-stiffness", a.options.handle_stiffness, "of handles, in material stiffness times diagonal")
      ->type_name("K")
      ->check(positive_number())
      ->capture_default_str();
  options
      .add_option("--tolerance", a.options.tolerance,
                  "a pose is found when a step moves nothing further; of the diagonal")
      ->type_name("PART")
      ->check(positive_number())
      ->capture_default_str();
  options.add_option("--iterations", a.options.max_iterations, "most of one frame")
      ->type_name("N")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  options.add_flag_callback(
      "--unweighted-strain", [&a] { a.options.strain = StrainWeights::kUnweighted; },
      "the strain energy without weights of volume, as in the paper");
  options.add_flag_callback(
      "--penalty", [&a] { a.penalty = true; },
      "rigidity, joints and limits as energies with large weights, as in the paper, instead of constraints");
}

/// Null: the session's own.
std::shared_ptr<const PoseMethod> method_of(const Arguments& a) {
  if (!a.penalty) return nullptr;
#if LIMBER_HAS_POSING_PENALTY
  return penalty_poses();
#else
  throw InputError("--penalty: this build of limber has no limber::posing_penalty, expected one with " +
                   std::string("LIMBER_BUILD_PAPERS=ON"));
#endif
}

Json json_of(const PoseResult& r, double time) {
  return {{"time", time},
          {"status", to_string(r.status)},
          {"iterations", r.iterations},
          {"energy", r.energy},
          {"handle_error", r.handle_error},
          {"joint_error", r.joint_error},
          {"limit_violation", r.limit_violation}};
}

/// The pulled points, and the file that errors about them name.
struct Pulls {
  HandlesFile handles;
  std::string name;
};

std::string in_quotes(const std::string& path) { return "\"" + std::filesystem::path(path).filename().string() + "\""; }

Pulls read_pulls(const Arguments& a) {
  if (a.clip.empty() != a.mapping.empty() || a.clip.empty() == a.handles.empty())
    throw InvalidArgument("expected either --handles or both --clip and --mapping; see --help");
  if (!a.handles.empty()) return {read_handles(a.handles), in_quotes(a.handles)};
  const std::string name = in_quotes(a.mapping);
  const MappingFile mapping = read_mapping(a.mapping);
  return {retarget(read_motion_clip(a.clip), mapping, name), name};
}

void pose(Program& program, const Arguments& a) {
  if (a.output.empty() && a.obj.empty() && a.rest.empty())
    throw InvalidArgument("nothing to do: one of --output, --obj and --rest is needed; see --help");
  for (const std::string& file : {a.model, a.joints, a.handles, a.clip, a.mapping})
    if (!file.empty()) program.add_input(file);
  program.progress().stage("reading");
  const auto [handles, handles_name] = read_pulls(a);
  const GroupedSurface surface = read_any_grouped_surface(a.model, program.warnings());
  const JointsFile joints = read_joints(a.joints);
  PosingSession session(jointed_model(surface, joints, in_quotes(a.joints)), a.options, method_of(a));
  const std::vector<PoseHandle> ids = apply_handles(handles, handles_name, session);

  PoseRecording recording(session, a.scale);
  std::vector<Vec3> positions(session.model().surface.vertices.size());
  Json& report = program.report();
  report["parts"] = session.model().parts.size();
  report["joints"] = session.model().joints.size();
  report["cells"] = session.cells().size();
  report["frames"] = Json::array();
  std::size_t converged = 0, away = 0;
  double seconds = 0.0;
  program.progress().stage("posing");
  for (std::size_t f = 0; f < handles.frames.size(); ++f) {
    const HandlesFile::Frame& frame = handles.frames[f];
    for (const auto& [handle, target] : frame.targets) session.move_handle(ids[handle], target);
    const auto start = std::chrono::steady_clock::now();
    const PoseResult result = session.solve();
    seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (result.status == PoseResult::Status::kInfeasible)
      throw ComputationError(
          fmt::format("{} frames[{}]: joints, limits and pins contradict each other", handles_name, f));
    away += result.status == PoseResult::Status::kLocalMinimum ? 1 : 0;
    converged += result.status == PoseResult::Status::kConverged || result.status == PoseResult::Status::kLocalMinimum;
    report["frames"].push_back(json_of(result, frame.time));
    recording.add(frame.time, session);
    if (!a.obj.empty()) {
      session.reconstruct(positions);
      program.write_file(fmt::format("{}_{:04}.obj", a.obj, f),
                         obj_text({.vertices = positions, .triangles = session.model().surface.triangles}));
    }
    program.progress().fraction(static_cast<double>(f + 1) / static_cast<double>(handles.frames.size()));
  }
  if (!a.output.empty()) program.write_file(a.output, recording.glb());
  if (!a.rest.empty()) {
    const JointedModel rest = posed_model(session, program.warnings());
    program.write_file(a.rest + ".obj", obj_text(rest.surface));
    program.write_file(a.rest + ".joints.json", joints_text(joints_file(rest)));
  }
  if (recording.most_targets() > static_cast<std::size_t>(kMaxMorphTargets))
    program.warnings().push_back(
        fmt::format("A part that bends has {} morph targets, one a frame, but many viewers hold at most {}.",
                    recording.most_targets(), kMaxMorphTargets));
  report["seconds"] = {{"posing", seconds}};
  program.print(fmt::format("{} parts, {} joints, {} cells; {} frames, {} converged{}\n", session.model().parts.size(),
                            session.model().joints.size(), session.cells().size(), handles.frames.size(), converged,
                            away > 0 ? fmt::format(", a handle out of reach in {}", away) : ""));
}

}  // namespace
}  // namespace limber::tools

int main(int argc, char** argv) {
  using namespace limber::tools;
  Program program(
      "limber-pose",
      "Poses a jointed model: pulls on points of its parts, which turn in their joints within their limits, and "
      "bend where they are soft. Lengths in the model's own unit, times in seconds.");
  Arguments arguments;
  declare(program.options(), arguments);
  return program.run(argc, argv, [&] { pose(program, arguments); });
}
