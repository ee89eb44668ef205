// joint_accuracy: how often joints are read right, and how well.
//   run:  build/benchmark/bin/joint_accuracy --large          (time for 50 parts of together 500,000 triangles)
//         build/benchmark/bin/joint_accuracy [--method fixed-ratio] [--contacts hulls] [--only ASSEMBLY] [--class TEXT] [--verbose]
//         build/benchmark/bin/joint_accuracy --limits [--only ASSEMBLY] [--class TEXT] [--verbose]
//         build/benchmark/bin/joint_accuracy --change [--only ASSEMBLY]
//   see:  type accuracy and axis and origin errors per class of variants, for the assemblies that thresholds were chosen
//         on and for the held-out ones; the confusion matrix; every failure with --verbose. With --limits instead: the
//         ranges of motion of all joints whose type was read right and whose range is known on paper. With --change: by
//         how much axes turn when the same parts are moved, scaled or reordered
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <functional>
#include <map>
#include <numbers>

#include "assemblies.h"
#include "grouped_parts.h"
#include "joint_scores.h"
#include "limber/articulation/detect_joints.h"
#include "limber/articulation/range_of_motion.h"
#include "limber/jobs_tbb/tbb_jobs.h"
#include "shells.h"

namespace limber::assemblies {
namespace {

const char* kColumns[] = {"ball", "revolute", "cylindrical", "prismatic", "planar", "fixed", "none"};

struct Totals {
  int joints = 0, right = 0, judged = 0, false_joints = 0, axis_late = 0, origin_late = 0;
  std::vector<double> axis, origin;
};

double percentile(std::vector<double> v, double p) {
  if (v.empty()) return 0.0;
  std::sort(v.begin(), v.end());
  return v[static_cast<std::size_t>(p * static_cast<double>(v.size() - 1))];
}

void print(const std::string& name, const Totals& t) {
  std::printf("%-34s %5d %7.2f %7d %9.4f %9.4f %10.2e %10.2e\n", name.c_str(), t.joints,
              t.joints ? 100.0 * t.right / t.joints : 100.0, t.false_joints, percentile(t.axis, 0.5),
              percentile(t.axis, 1.0), percentile(t.origin, 0.5), percentile(t.origin, 1.0));
}

int run(const DetectionOptions& options, bool verbose, const std::string& only, const std::string& group_text) {
  TbbJobs jobs;
  std::map<std::pair<int, int>, int> confusion;
  for (const auto* names : {&tuning_names(), &held_out_names()}) {
    std::printf("%s\n%-34s %5s %7s %7s %9s %9s %10s %10s\n", names == &tuning_names() ? "tuning" : "held out",
                "variants", "n", "right%", "false", "axis50", "axis100", "origin50", "origin100");
    for (const VariantClass& group : variant_classes()) {
      if (group.name.find(group_text) == std::string::npos) continue;
      Totals totals;
      for (const std::string& name : *names) {
        if (!only.empty() && only != name) continue;
        for (const Variant& variant : group.variants) {
          const MadeAssembly made = make(name, variant);
          const Score score = scored(made, options, jobs);
          for (const JointScore& j : score.joints) {
            if (!group.with_balls && j.truth == static_cast<int>(JointType::kBall)) continue;
            ++totals.joints;
            ++confusion[{j.truth, j.found}];
            totals.right += j.right() ? 1 : 0;
            if (j.right()) totals.axis.push_back(j.axis_error), totals.origin.push_back(j.origin_error);
            if (verbose && (!j.right() || j.axis_error > group.axis_tolerance || j.origin_error > 1e-3))
              std::printf(
                  "    %-14s %-28s %s: %s read as %s (%.2f), axis %.3f deg, origin %.1e, pitch off by %.1f %%; %s\n",
                  name.c_str(), group.name.c_str(), j.name.c_str(), kColumns[j.truth], kColumns[j.found], j.confidence,
                  j.axis_error, j.origin_error, 100.0 * j.pitch_error, j.reason.c_str());
          }
          for (const std::string& extra : score.extra) {
            ++totals.false_joints;
            if (verbose) std::printf("    %-14s %-28s extra: %s\n", name.c_str(), group.name.c_str(), extra.c_str());
          }
          confusion[{6, 6}] += 0;
        }
      }
      print(group.name, totals);
      std::fflush(stdout);
    }
  }
  std::printf("\n%-12s", "true \\ read");
  for (const char* c : kColumns) std::printf(" %11s", c);
  std::printf("\n");
  for (int i = 0; i < 6; ++i) {
    std::printf("%-12s", kColumns[i]);
    for (int j = 0; j < 7; ++j) std::printf(" %11d", confusion[{i, j}]);
    std::printf("\n");
  }
  return 0;
}

struct RangeTotals {
  int all = 0, right = 0;
  double degrees = 0.0, thousandths = 0.0;  ///< worst of those whose ends match
};

/// Per class of variants: how many ranges are right within 1 degree or a thousandth of the diagonal.
int run_limits(const DetectionOptions& options, const RangeOptions& ranges, bool verbose, const std::string& only,
               const std::string& group_text) {
  TbbJobs jobs;
  for (const auto* names : {&tuning_names(), &held_out_names()}) {
    std::printf("%s\n%-34s %5s %6s %9s %12s\n", names == &tuning_names() ? "tuning" : "held out", "variants", "n",
                "right", "worst deg", "worst 1e-3 d");
    for (const VariantClass& group : range_variant_classes()) {
      if (group.name.find(group_text) == std::string::npos) continue;
      RangeTotals totals;
      for (const std::string& name : *names) {
        if (!only.empty() && only != name) continue;
        for (const Variant& variant : group.variants)
          for (const RangeScore& r : scored_ranges(make(name, variant), options, jobs, ranges)) {
            if (!group.with_balls && r.type == static_cast<int>(JointType::kBall)) continue;
            ++totals.all;
            totals.right += r.right() ? 1 : 0;
            double& worst = r.angle ? totals.degrees : totals.thousandths;
            if (r.same_type && r.ends_match) worst = std::max(worst, r.error);
            if (verbose && !r.right())
              std::printf("    %-14s n %d gap %.3f phase %.1f  %s, %s: %s\n", name.c_str(), variant.segments,
                          variant.clearance, variant.phase, r.joint.c_str(), r.freedom.c_str(), r.found.c_str());
          }
      }
      std::printf("%-34s %5d %6d %9.4f %12.4f\n", group.name.c_str(), totals.all, totals.right, totals.degrees,
                  totals.thousandths);
      std::fflush(stdout);
    }
  }
  return 0;
}

/// Changes of types and axes by moving, scaling and reordering: against the unmoved variant, and
/// not against the truth.
int run_change(const DetectionOptions& options, const std::string& only) {
  TbbJobs jobs;
  struct Kind {
    const char* name;
    std::function<void(Variant&)> change;
  };
  const Mat3 rotation = Eigen::AngleAxisd(2.1, Vec3(0.3, -0.8, 0.5).normalized()).toRotationMatrix();
  const std::vector<Kind> kinds = {
      {"rotated and shifted", [&](Variant& v) { v.rotation = rotation, v.translation = Vec3(3, 6, -3); }},
      {"scaled by 1e-3", [](Variant& v) { v.scale = 1e-3; }},
      {"scaled by 1e3", [](Variant& v) { v.scale = 1e3; }},
      {"parts swapped", [](Variant& v) { v.swapped = true; }},
      {"faces shuffled", [](Variant& v) { v.shuffled = true; }}};
  std::printf("%-22s %6s %8s %10s %14s  %s\n", "change", "joints", "types", "> 0.05 deg", "axis turns deg", "where");
  for (const Kind& kind : kinds) {
    Change all;
    for (const auto* names : {&tuning_names(), &held_out_names()})
      for (const std::string& name : *names) {
        if (!only.empty() && only != name) continue;
        for (const int segments : {16, 32})
          for (const double clearance : {0.0, 0.005, 0.02}) {
            Variant still{.segments = segments, .clearance = clearance}, moved = still;
            kind.change(moved);
            const Change here = change_of_joints(make(name, still), make(name, moved), moved.rotation, options, jobs);
            all.joints += here.joints;
            all.types += here.types;
            all.turned += here.turned;
            if (here.axis > all.axis) all.axis = here.axis, all.worst = name + ": " + here.worst;
          }
      }
    std::printf("%-22s %6d %8d %10d %14.5f  %s\n", kind.name, all.joints, all.types, all.turned, all.axis,
                all.worst.c_str());
    std::fflush(stdout);
  }
  return 0;
}

/// 25 shafts with flanges in their sleeves, in a square.
GroupedSurface many_hinges(int segments) {
  GroupedSurface out;
  const Shell sleeve = lathe({{1.01, -1}, {2, -1}, {2, 1}, {1.01, 1}}, segments, 0.5);
  const Shell shaft =
      lathe({{0, -2}, {1.5, -2}, {1.5, -1.01}, {1, -1.01}, {1, 1.01}, {1.5, 1.01}, {1.5, 2}, {0, 2}}, segments);
  for (int i = 0; i < 25; ++i)
    for (const Shell* shell : {&sleeve, &shaft})
      append_group(shell->placed(Mat3::Identity(), Vec3(4.2 * (i % 5), 4.2 * (i / 5), 0)), "", out);
  return out;
}

int time_large() {
  const GroupedSurface input = many_hinges(1000);
  TbbJobs jobs;
  const auto begin = std::chrono::steady_clock::now();
  const std::clock_t cpu = std::clock();
  const Assembly assembly = find_components(input);
  const auto joints = detect_joints(assembly, {}, jobs);
  const std::clock_t detected = std::clock();
  const auto ranges = ranges_of_motion(assembly, joints, {}, jobs);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  const auto right = std::count_if(joints.begin(), joints.end(),
                                   [](const DetectedJoint& j) { return j.joint.type == JointType::kRevolute; });
  const auto endless = std::count_if(ranges.begin(), ranges.end(),
                                     [](const RangeOfMotion& r) { return r.joint.limits.rotation.open(); });
  const auto processor = [](std::clock_t from, std::clock_t to) {
    return static_cast<double>(to - from) / CLOCKS_PER_SEC;
  };
  std::printf("%zu triangles, %zu components: %zu joints, %td of them revolute, %td of them without an end\n",
              input.surface.triangles.size(), assembly.components.size(), joints.size(), right, endless);
  std::printf("%.2f s; processor time: %.2f s for components and joints, %.2f s for ranges of motion\n",
              seconds.count(), processor(cpu, detected), processor(detected, std::clock()));
  return 0;
}

}  // namespace
}  // namespace limber::assemblies

int main(int argc, char** argv) {
  limber::DetectionOptions options;
  limber::RangeOptions ranges;
  bool verbose = false, limits = false, change = false;
  std::string only, group_text;
  for (int i = 1; i < argc; ++i) {
    const std::string_view arg = argv[i];
    if (arg == "--large") return limber::assemblies::time_large();
    if (arg == "--verbose")
      verbose = true;
    else if (arg == "--limits")
      limits = true;
    else if (arg == "--change")
      change = true;
    else if (arg == "--method" && i + 1 < argc && std::string_view(argv[i + 1]) == "fixed-ratio")
      options.slippage.method = limber::SlippageMethod::kFixedRatio, ++i;
    else if (arg == "--contacts" && i + 1 < argc && std::string_view(argv[i + 1]) == "hulls")
      options.contact.method = limber::ContactSearch::kHulls, ++i;
    else if (arg == "--only" && i + 1 < argc)
      only = argv[++i];
    else if (arg == "--class" && i + 1 < argc)
      group_text = argv[++i];
    else
      return std::fprintf(stderr,
                          "joint_accuracy: seen \"%s\", expected --limits, --change, --verbose, --only ASSEMBLY, "
                          "--class TEXT, "
                          "--contacts NAME or --method NAME\n",
                          argv[i]),
             2;
  }
  if (change) return limber::assemblies::run_change(options, only);
  if (limits) return limber::assemblies::run_limits(options, ranges, verbose, only, group_text);
  return limber::assemblies::run(options, verbose, only, group_text);
}
