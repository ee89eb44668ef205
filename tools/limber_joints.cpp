// limber-joints: the components and joints of an assembly, from its geometry alone.

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <set>

#include "limber/articulation/detect_joints.h"
#include "limber/articulation/joints_file.h"
#include "limber/articulation/range_of_motion.h"
#include "limber/articulation/robot_files.h"
#include "limber/core/error.h"
#include "limber/jobs_tbb/tbb_jobs.h"
#include "limber/mesh_assimp/read_surface_mesh.h"
#include "program.h"

namespace limber::tools {
namespace {

using Json = nlohmann::ordered_json;

/// Paths; empty: none.
struct Files {
  std::string model, output, keep, urdf, mjcf, glb;
};

struct Arguments {
  Files files;
  std::string components = "connectivity", contacts = "nearest", method = "default", unit = "m";
  std::vector<std::string> merge;
  double scale = 0.0, density = 1000.0, min_confidence = 0.0, overlap = 0.0;
  bool explain = false, no_limits = false;
  DetectionOptions detection;
  std::optional<double> hull_growth;
  RangeOptions range;
};

/// Metres in the units that --unit takes.
constexpr std::array<std::pair<std::string_view, double>, 5> kUnits{
    {{"m", 1.0}, {"cm", 0.01}, {"mm", 0.001}, {"in", 0.0254}, {"ft", 0.3048}}};

double metres_per_unit(const Arguments& a) {
  if (a.scale > 0.0) return a.scale;
  for (const auto& [name, metres] : kUnits)
    if (name == a.unit) return metres;
  return 1.0;
}

void declare_files(CLI::App& options, Arguments& a) {
  options.add_option("MODEL", a.files.model, "surface of all parts: OBJ, STL, PLY, glTF, OFF, 3DS, ...")->required();
  options.add_option("-o,--output", a.files.output, "joints file to write")->type_name("JOINTS.json");
  options
      .add_option("--keep", a.files.keep,
                  "joints file whose merges, names, types, axes and limits stay; may be the output")
      ->type_name("JOINTS.json");
  options.add_option("--urdf", a.files.urdf, "write a URDF, with its meshes (STL) in FILE_meshes/ beside it")
      ->type_name("FILE.urdf");
  options.add_option("--mjcf", a.files.mjcf, "write an MJCF for MuJoCo, the same way")->type_name("FILE.xml");
  options.add_option("--glb", a.files.glb, "write parts and axes as a scene for any glTF viewer")
      ->type_name("FILE.glb");
  options.add_flag("--explain", a.explain, "print why each joint is what it is, and what else it may be");
}

void declare_units(CLI::App& options, Arguments& a) {
  std::vector<std::string> units;
  units.reserve(std::size(kUnits));
  for (const auto& [name, unused] : kUnits) units.emplace_back(name);
  auto* unit = options.add_option("--unit", a.unit, "the model's unit of length, for URDF, MJCF and GLB")
                   ->check(CLI::IsMember(units));
  options.add_option("--scale", a.scale, "the same as a number")
      ->type_name("M_PER_UNIT")
      ->check(positive_number())
      ->excludes(unit);
  options.add_option("--density", a.density, "of all parts, for URDF and MJCF")
      ->type_name("KG_M3")
      ->check(positive_number())
      ->capture_default_str();
}

void declare_detection(CLI::App& options, Arguments& a) {
  options
      .add_option("--components", a.components,
                  "what makes a component: triangles that share vertices, or names in the file")
      ->check(CLI::IsMember({"connectivity", "groups", "materials"}))
      ->capture_default_str();
  options.add_option("--merge", a.merge, "components that are one part, by name; repeatable")->type_name("A,B,...");
  options
      .add_option(
          "--contacts", a.contacts,
          "how contacts are found: by a cluster of the smallest gaps, or as in [X09] in the hulls of convex pieces")
      ->check(CLI::IsMember({"nearest", "hulls"}))
      ->capture_default_str();
  options
      .add_option("--growth", a.hull_growth,
                  "of hulls, for --contacts hulls, at most --search; default: 0.01, or --search if that is less")
      ->type_name("PART_OF_DIAGONAL")
      ->check(positive_number());
  options.add_option("--method", a.method, "\"paper\": slippage by one fixed ratio of eigenvalues, as in [X09]")
      ->check(CLI::IsMember({"default", "paper"}))
      ->capture_default_str();
  options.add_option("--samples", a.detection.contact.samples, "points on each side of a contact, 100 to 100000")
      ->type_name("N")
      ->check(CLI::Range(100, 100000))
      ->capture_default_str();
  options.add_option("--search", a.detection.contact.search, "largest gap of a contact")
      ->type_name("PART_OF_DIAGONAL")
      ->check(positive_number())
      ->capture_default_str();
  options.add_option("--threshold", a.detection.slippage.threshold, "largest slippage of a freedom, below 1")
      ->type_name("MU")
      ->check(proper_fraction())
      ->capture_default_str();
  options.add_option("--ratio", a.detection.slippage.ratio, "of eigenvalues, more than 1; for --method paper")
      ->type_name("G")
      ->check(number_above_one())
      ->capture_default_str();
  options.add_option("--min-confidence", a.min_confidence, "leave out joints below, 0 to 1")
      ->type_name("C")
      ->check(CLI::Range(0.0, 1.0));
}

void declare_limits(CLI::App& options, Arguments& a) {
  options.add_flag("--no-limits", a.no_limits, "do not look for the ranges of motion");
  options
      .add_option("--overlap", a.overlap,
                  "tolerate parts that overlap as read by this much; default: 2 % of the smaller part")
      ->type_name("LENGTH")
      ->check(non_negative_number());
  options.add_option("--min-rotation", a.range.min_rotation, "a rotation of less is none")
      ->type_name("RAD")
      ->check(non_negative_number())
      ->capture_default_str();
  options
      .add_option("--min-translation", a.range.min_translation,
                  "a translation of less is none, part of the smaller part's diagonal")
      ->type_name("PART_OF_DIAGONAL")
      ->check(non_negative_number())
      ->capture_default_str();
}

/// Times of stages, s.
class Stopwatch {
 public:
  template <class Work>
  auto time(const std::string& stage, Work&& work) {
    const auto start = std::chrono::steady_clock::now();
    auto result = work();
    seconds_[stage] = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return result;
  }
  const Json& seconds() const { return seconds_; }

 private:
  Json seconds_ = Json::object();
};

std::vector<std::string> split(const std::string& list) {
  std::vector<std::string> names;
  std::size_t start = 0;
  for (std::size_t comma = list.find(','); comma != std::string::npos; comma = list.find(',', start)) {
    names.push_back(list.substr(start, comma - start));
    start = comma + 1;
  }
  names.push_back(list.substr(start));
  return names;
}

ComponentOptions component_options(const Arguments& a) {
  ComponentOptions options;
  if (a.components == "groups") options.rule = ComponentRule::kGroups;
  if (a.components == "materials") options.rule = ComponentRule::kMaterials;
  for (const std::string& list : a.merge) {
    options.merge.push_back(split(list));
    if (options.merge.back().size() < 2)
      throw InvalidArgument("--merge \"" + list + "\": expected two names or more with commas between");
  }
  return options;
}

/// State of the program's work.
struct Work {
  GroupedSurface surface;
  JointsFile kept;
  Assembly assembly;
  std::vector<DetectedJoint> joints;
  std::vector<bool> limits_kept;      ///< per joint: the kept file's limits stand
  std::vector<RangeOfMotion> ranges;  ///< per joint; empty with --no-limits
  std::vector<JointCoupling> couplings, chain_couplings;
};

Assembly take_apart(const Arguments& a, const Work& work) {
  ComponentOptions options = component_options(a);
  Assembly assembly = find_components(work.surface, options);
  if (a.files.keep.empty()) return assembly;
  const ComponentOptions kept = kept_components(assembly, work.kept, "\"" + a.files.keep + "\"");
  if (kept.merge.empty() && kept.rename.empty()) return assembly;
  options.merge.insert(options.merge.end(), kept.merge.begin(), kept.merge.end());
  options.rename = kept.rename;
  return find_components(work.surface, options);
}

/// Detection's part of the percentage shown over detection and limits, which never falls.
constexpr double kDetectionShare = 0.3;

DetectionOptions detection_options(const Arguments& a, Program& program) {
  DetectionOptions options = a.detection;
  options.min_confidence = a.min_confidence;
  if (a.method == "paper") options.slippage.method = SlippageMethod::kFixedRatio;
  if (a.contacts == "hulls") options.contact.method = ContactSearch::kHulls;
  if (a.hull_growth) options.contact.hull_growth = *a.hull_growth;
  if (options.contact.hull_growth > options.contact.search) {
    if (a.hull_growth)
      throw InvalidArgument(
          fmt::format("--growth {} is more than --search {}: hulls must not grow beyond what is searched",
                      *a.hull_growth, options.contact.search));
    options.contact.hull_growth = options.contact.search;
  }
  const double share = a.no_limits ? 1.0 : kDetectionShare;
  options.progress = [&program, share, stage = std::string()](double done, std::string_view what) mutable {
    if (stage != what) program.progress().stage(stage = what);
    program.progress().fraction(share * done);
  };
  return options;
}

void find_limits(const Arguments& a, Program& program, Jobs& jobs, Work& work) {
  RangeOptions options = a.range;
  options.motion.largest_overlap = a.overlap;
  options.progress = [&program](double done) {
    program.progress().fraction(kDetectionShare + (1.0 - kDetectionShare) * done);
  };
  program.progress().stage("limits");
  options.progress(0.0);
  work.ranges = ranges_of_motion(work.assembly, work.joints, options, jobs);
  for (std::size_t j = 0; j < work.joints.size(); ++j) {
    if (work.limits_kept[j]) continue;
    DetectedJoint& joint = work.joints[j];
    joint.joint = work.ranges[j].joint;
    joint.reasons.insert(joint.reasons.end(), work.ranges[j].reasons.begin(), work.ranges[j].reasons.end());
  }
  work.couplings = joint_couplings(work.ranges);
}

// Text for people -----------------------------------------------------------------------------------------------------

std::string end_text(double value, bool angle) {
  if (!std::isfinite(value)) return "open";
  return angle ? fmt::format("{:.1f}°", value * 180.0 / std::numbers::pi) : fmt::format("{:.4g}", value);
}

std::string interval_text(const Interval& i, bool angle) {
  if (i.open()) return "free";
  return fmt::format("{} to {}", end_text(i.low, angle), end_text(i.high, angle));
}

std::string limits_text(const JointSpec& joint) {
  const JointLimits& l = joint.limits;
  switch (joint.type) {
    case JointType::kBall:
      return std::isfinite(l.cone) ? "cone " + end_text(l.cone, true) : "free";
    case JointType::kRevolute:
      return interval_text(l.rotation, true);
    case JointType::kPrismatic:
      return interval_text(l.translation[0], false);
    case JointType::kCylindrical:
      return interval_text(l.rotation, true) + ", " + interval_text(l.translation[0], false);
    case JointType::kPlanar:
      return fmt::format("{}, {}, {}", interval_text(l.translation[0], false), interval_text(l.translation[1], false),
                         interval_text(l.rotation, true));
    case JointType::kFixed:
      break;
  }
  return "";
}

std::string point_text(const Vec3& p) { return fmt::format("({:.6g}, {:.6g}, {:.6g})", p.x(), p.y(), p.z()); }

std::string kind_text(const JointSpec& joint) {
  if (joint.pitch == 0.0) return std::string(to_string(joint.type));
  return fmt::format("{} with pitch {:.4g} per rad", to_string(joint.type), joint.pitch);
}

std::string coupling_text(const JointCoupling& c) {
  if (!c.even) return fmt::format(", moved by joint {} ({:.4g} as drawn)", c.first.joint, c.ratio);
  return fmt::format(", {} times joint {}", ratio_text(c), c.first.joint);
}

std::string joint_text(const Work& work, std::size_t number, bool explain, bool limits) {
  const DetectedJoint& j = work.joints[number];
  const auto name = [&](Index c) { return work.assembly.components[static_cast<std::size_t>(c)].name; };
  std::string range = limits ? limits_text(j.joint) : "";
  for (const auto* couplings : {&work.couplings, &work.chain_couplings})
    for (const JointCoupling& c : *couplings)
      if (c.second.joint == number) range += coupling_text(c);
  std::string text = fmt::format("{:>4}  {:<12} {:.2f}  \"{}\" - \"{}\"{}\n", number, to_string(j.joint.type),
                                 j.confidence, name(j.a), name(j.b), range.empty() ? "" : ": " + range);
  if (!explain) return text;
  const int column = j.joint.type == JointType::kPlanar ? 2 : 0;
  text += fmt::format("      {} at {}, axis {}\n", kind_text(j.joint), point_text(j.joint.frame.origin),
                      point_text(j.joint.frame.axes.col(column)));
  for (const std::string& reason : j.reasons) text += "      " + reason + "\n";
  for (const JointHypothesis& h : j.other_hypotheses)
    text += fmt::format("      or {} ({:.2f}): {}\n", kind_text(h.joint), h.confidence, h.reason);
  return text;
}

std::string summary(const Work& work, const Kinematics& k) {
  return fmt::format("{} components, {} triangles; {} joints, {} closed chains, {} separate groups, mobility {}\n",
                     work.assembly.components.size(), work.assembly.source.triangles.size(), work.joints.size(),
                     k.loops, k.groups, k.mobility);
}

// Report --------------------------------------------------------------------------------------------------------------

Json end_json(double x) { return std::isfinite(x) ? Json(x) : Json(); }
Json interval_json(const Interval& i) { return Json::array({end_json(i.low), end_json(i.high)}); }

Json freedom_json(const FreedomRange& f) {
  Json others = Json::array();
  for (const Interval& i : f.motion.others) others.push_back(interval_json(i));
  const auto stop = [](const MotionStop& s) { return s.body < 0 ? Json() : Json(s.body); };
  Json coupled = Json::array();
  for (const CoupledFreedom& c : f.coupled)
    coupled.push_back({{"joint", c.joint},
                       {"freedom", c.freedom},
                       {"ratio", c.ratio.low <= c.ratio.high ? interval_json(c.ratio) : Json()}});
  return {{"freedom", f.freedom},
          {"reachable", interval_json(f.motion.reachable)},
          {"others", others},
          {"stopped_by", Json::array({stop(f.motion.low), stop(f.motion.high)})},
          {"tolerance", f.motion.tolerance},
          {"overlapping", f.motion.overlapping},
          {"coupled", coupled}};
}

void fill_report(Json& report, const Work& work, const Kinematics& k) {
  report["triangles"] = work.assembly.source.triangles.size();
  report["diagonal"] = work.assembly.diagonal;
  report["components"] = Json::array();
  for (const Component& c : work.assembly.components)
    report["components"].push_back(
        {{"name", c.name}, {"triangles", c.triangles.size()}, {"closed", c.closed}, {"capped", !c.caps.empty()}});
  report["proposals"] = Json::array();
  for (const MergeProposal& p : work.assembly.proposals)
    report["proposals"].push_back({{"components", p.components}, {"reason", p.reason}});
  report["joints"] = Json::array();
  for (std::size_t i = 0; i < work.joints.size(); ++i) {
    const DetectedJoint& j = work.joints[i];
    Json entry{{"a", j.a}, {"b", j.b}, {"type", to_string(j.joint.type)}, {"confidence", j.confidence}, {"gap", j.gap}};
    entry["freedoms"] = Json::array();
    if (!work.ranges.empty())
      for (const FreedomRange& f : work.ranges[i].freedoms) entry["freedoms"].push_back(freedom_json(f));
    report["joints"].push_back(std::move(entry));
  }
  report["kinematics"] = {{"loops", k.loops}, {"groups", k.groups}, {"mobility", k.mobility}, {"kutzbach", k.kutzbach}};
}

// Files ---------------------------------------------------------------------------------------------------------------

/// A robot description and its meshes, in a folder beside it. Both formats of one stem share the folder.
void write_robot(Program& program, const Arguments& a, const Work& work, const std::string& path, auto&& format,
                 std::set<std::filesystem::path>& written) {
  namespace fs = std::filesystem;
  const fs::path file(path), folder = file.parent_path() / (file.stem().string() + "_meshes");
  const RobotFile robot = format(work.assembly, work.joints,
                                 RobotOptions{.name = file.stem().string(),
                                              .mesh_folder = folder.filename().string(),
                                              .density = a.density,
                                              .metres_per_unit = metres_per_unit(a),
                                              .couplings = work.couplings});
  program.write_file(file, robot.text);
  for (const std::string& warning : robot.warnings)  // both formats tell of the same masses
    if (auto& told = program.warnings(); std::find(told.begin(), told.end(), warning) == told.end())
      told.push_back(warning);
  if (!written.insert(folder).second) return;
  std::error_code error;
  fs::create_directory(folder, error);
  if (error) throw InputError("\"" + folder.string() + "\": cannot make the folder: " + error.message());
  for (const auto& [name, bytes] : robot.meshes) program.write_file(folder / name, bytes);
}

void write_files(Program& program, const Arguments& a, const Work& work) {
  program.progress().stage("writing");
  if (!a.files.output.empty()) {
    JointsFile file = joints_file(work.assembly, work.joints);
    for (std::size_t j = 0; j < file.joints.size(); ++j)
      file.joints[j].limits_known = !a.no_limits || work.limits_kept[j];
    program.write_file(a.files.output, joints_text(file));
  }
  if (!a.files.glb.empty())
    program.write_file(a.files.glb, assembly_glb(work.assembly, work.joints, metres_per_unit(a)));
  std::set<std::filesystem::path> folders;
  if (!a.files.urdf.empty()) write_robot(program, a, work, a.files.urdf, urdf_file, folders);
  if (!a.files.mjcf.empty()) write_robot(program, a, work, a.files.mjcf, mjcf_file, folders);
}

void find_joints(Program& program, const Arguments& a) {
  if (a.files.output.empty() && a.files.urdf.empty() && a.files.mjcf.empty() && a.files.glb.empty() && !a.explain)
    throw InvalidArgument("nothing to do: one of --output, --explain, --urdf, --mjcf and --glb is needed; see --help");
  TbbJobs jobs;
  Stopwatch stopwatch;
  Work work;
  program.add_input(a.files.model);
  program.progress().stage("reading");
  work.surface = stopwatch.time("read", [&] { return read_any_grouped_surface(a.files.model, program.warnings()); });
  if (!a.files.keep.empty()) work.kept = read_joints(a.files.keep);
  program.progress().stage("components");
  work.assembly = stopwatch.time("components", [&] { return take_apart(a, work); });
  work.joints =
      stopwatch.time("detect", [&] { return detect_joints(work.assembly, detection_options(a, program), jobs); });
  work.limits_kept.assign(work.joints.size(), false);
  if (!a.files.keep.empty())
    work.limits_kept = keep_joints(work.assembly, work.kept, "\"" + a.files.keep + "\"", work.joints);
  if (!a.no_limits)
    stopwatch.time("limits", [&] {
      find_limits(a, program, jobs, work);
      return 0;
    });
  work.chain_couplings = chain_couplings(work.assembly, work.joints);
  write_files(program, a, work);

  const Kinematics kinematics = overall_kinematics(work.assembly, work.joints, work.couplings);
  fill_report(program.report(), work, kinematics);
  program.report()["seconds"] = stopwatch.seconds();
  program.print(summary(work, kinematics));
  for (std::size_t j = 0; j < work.joints.size(); ++j) program.print(joint_text(work, j, a.explain, !a.no_limits));
  for (const MergeProposal& p : work.assembly.proposals) program.print("one part? " + p.reason + "\n");
}

}  // namespace
}  // namespace limber::tools

int main(int argc, char** argv) {
  using namespace limber::tools;
  Program program("limber-joints",
                  "Finds the components of an assembly, the joints between them and how far they go, from its geometry "
                  "alone. Lengths in the model's own unit, angles in degrees where printed and radians in files.");
  Arguments arguments;
  declare_files(program.options(), arguments);
  declare_detection(program.options(), arguments);
  declare_limits(program.options(), arguments);
  declare_units(program.options(), arguments);
  return program.run(argc, argv, [&] { find_joints(program, arguments); });
}
