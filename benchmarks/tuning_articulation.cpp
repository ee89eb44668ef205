// tuning_articulation: which numbers of articulation/src/tuning.h matter.
//   run:  build/benchmark/bin/tuning_articulation [--only TEXT…]
//   see:  a row for each number whose name holds a TEXT: what moves in the drawn assemblies when it is halved and doubled.
//         Angles are halved and doubled where a cosine stands for them, shares stay below 1, and of factors above 1 the
//         excess is halved and doubled. "same bits": no digit of any result changes; "same score": digits do, but no
//         count, and no worst error by more than a tenth. Times are of the processor, of one run, and good to a tenth.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <functional>
#include <numbers>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "assemblies.h"
#include "joint_scores.h"
#include "limber/articulation/detect_joints.h"
#include "limber/articulation/range_of_motion.h"
#include "limber/jobs_tbb/tbb_jobs.h"
#include "scoped_value.h"
#include "tuning.h"

namespace limber::assemblies {
namespace {

using internal::Tuning;

/// All that is varied.
struct Numbers {
  Tuning tuning{};
  DetectionOptions detection{.contact = {.samples = 1500}};  ///< as in the tests of detection
  RangeOptions ranges{};
};

/// How a number is halved and doubled.
enum class Kind { kPlain, kShare, kCosine, kFactor };
/// The score that judges it.
enum class Concern { kJoints, kHulls, kRatio, kChains, kRanges };

struct Number {
  std::string name;
  Kind kind;
  Concern concern;
  std::variant<double*, std::size_t*, int*> value;
};

double scaled(double value, Kind kind, double by) {
  switch (kind) {
    case Kind::kPlain:
      break;
    case Kind::kShare:
      return std::min(by * value, 1.0);
    case Kind::kCosine:
      return std::copysign(1.0, value) * std::cos(std::min(by * std::acos(std::abs(value)), std::numbers::pi / 2.0));
    case Kind::kFactor:
      return 1.0 + by * (value - 1.0);
  }
  return by * value;
}

void scale(const Number& number, double by) {
  if (const auto* real = std::get_if<double*>(&number.value)) **real = scaled(**real, number.kind, by);
  const auto whole = [by](auto& value) {
    using Whole = std::remove_reference_t<decltype(value)>;
    value = std::max<Whole>(static_cast<Whole>(by * static_cast<double>(value)), 1);
  };
  if (const auto* count = std::get_if<std::size_t*>(&number.value)) whole(**count);
  if (const auto* count = std::get_if<int*>(&number.value)) whole(**count);
}

double value_of(const Number& number) {
  return std::visit([](const auto* value) { return static_cast<double>(*value); }, number.value);
}

/// The numbers of the sheet, in its order. A test below holds them against the sheet's size.
std::vector<Number> sheet_of(Tuning& tuning) {
  using enum Kind;
  using enum Concern;
  auto& p = tuning.parts;
  auto& c = tuning.contacts;
  auto& t = tuning.types;
  auto& r = tuning.ranges;
  return {{"parts.soup_fold", kPlain, kJoints, &p.soup_fold},
          {"parts.largest_hole", kShare, kJoints, &p.largest_hole},
          {"parts.all_holes", kShare, kJoints, &p.all_holes},
          {"contacts.sampling.same_length", kPlain, kJoints, &c.sampling.same_length},
          {"contacts.sampling.first_look", kPlain, kJoints, &c.sampling.first_look},
          {"contacts.sampling.matters", kShare, kJoints, &c.sampling.matters},
          {"contacts.sampling.surplus_pieces", kPlain, kJoints, &c.sampling.surplus_pieces},
          {"contacts.sampling.own_point", kShare, kJoints, &c.sampling.own_point},
          {"contacts.sampling.loose_facing", kCosine, kJoints, &c.sampling.loose_facing},
          {"contacts.sampling.facet_facing", kCosine, kJoints, &c.sampling.facet_facing},
          {"contacts.sampling.across", kCosine, kJoints, &c.sampling.across},
          {"contacts.sampling.shortest_way", kPlain, kJoints, &c.sampling.shortest_way},
          {"contacts.sampling.fewest_samples", kPlain, kJoints, &c.sampling.fewest_samples},
          {"contacts.sampling.coarse_divisor", kPlain, kJoints, &c.sampling.coarse_divisor},
          {"contacts.sampling.coarse_fewest", kPlain, kJoints, &c.sampling.coarse_fewest},
          {"contacts.sampling.fine_reach", kFactor, kJoints, &c.sampling.fine_reach},
          {"contacts.cluster.cluster_start", kPlain, kJoints, &c.cluster.cluster_start},
          {"contacts.cluster.cluster_gaps", kPlain, kJoints, &c.cluster.cluster_gaps},
          {"contacts.cluster.cluster_chords", kPlain, kJoints, &c.cluster.cluster_chords},
          {"contacts.cluster.cluster_least", kPlain, kJoints, &c.cluster.cluster_least},
          {"contacts.cluster.rough", kPlain, kJoints, &c.cluster.rough},
          {"contacts.left_out.askew_share", kShare, kJoints, &c.left_out.askew_share},
          {"contacts.left_out.askew_times", kPlain, kJoints, &c.left_out.askew_times},
          {"contacts.left_out.askew_always", kPlain, kJoints, &c.left_out.askew_always},
          {"contacts.left_out.stray_flat", kShare, kJoints, &c.left_out.stray_flat},
          {"contacts.left_out.wider_guides", kShare, kJoints, &c.left_out.wider_guides},
          {"contacts.left_out.wider_area", kPlain, kJoints, &c.left_out.wider_area},
          {"contacts.left_out.most_spread", kPlain, kJoints, &c.left_out.most_spread},
          {"contacts.rough.flat_thickness", kPlain, kJoints, &c.rough.flat_thickness},
          {"contacts.rough.quieter", kShare, kJoints, &c.rough.quieter},
          {"contacts.rough.cells", kPlain, kJoints, &c.rough.cells},
          {"contacts.rough.patches", kPlain, kJoints, &c.rough.patches},
          {"contacts.rough.fewest_in_patch", kPlain, kJoints, &c.rough.fewest_in_patch},
          {"contacts.rough.same_side", kCosine, kJoints, &c.rough.same_side},
          {"contacts.inside.one_way", kShare, kJoints, &c.inside.one_way},
          {"contacts.inside.hull_compared", kPlain, kHulls, &c.inside.hull_compared},
          {"contacts.inside.hull_steps", kPlain, kHulls, &c.inside.hull_steps},
          {"types.weights.similar", kCosine, kJoints, &t.weights.similar},
          {"types.weights.similar_floor", kShare, kJoints, &t.weights.similar_floor},
          {"types.weights.similar_compared", kPlain, kJoints, &t.weights.similar_compared},
          {"types.fits.axis_rounds", kPlain, kJoints, &t.fits.axis_rounds},
          {"types.fits.least_turn", kPlain, kJoints, &t.fits.least_turn},
          {"types.fits.screw_least_turn", kPlain, kJoints, &t.fits.screw_least_turn},
          {"types.fits.pitch_rounds", kPlain, kJoints, &t.fits.pitch_rounds},
          {"types.fits.pitch_compared", kPlain, kJoints, &t.fits.pitch_compared},
          {"types.fits.pitch_fewest", kPlain, kJoints, &t.fits.pitch_fewest},
          {"types.fits.pitch_alike", kCosine, kJoints, &t.fits.pitch_alike},
          {"types.fits.pitch_nearest", kPlain, kJoints, &t.fits.pitch_nearest},
          {"types.fits.pitch_change", kPlain, kJoints, &t.fits.pitch_change},
          {"types.judging.tail", kPlain, kJoints, &t.judging.tail},
          {"types.judging.far_centre", kPlain, kJoints, &t.judging.far_centre},
          {"types.judging.far_axis", kPlain, kJoints, &t.judging.far_axis},
          {"types.judging.ruled_out", kPlain, kJoints, &t.judging.ruled_out},
          {"types.judging.screw_clearly", kPlain, kJoints, &t.judging.screw_clearly},
          {"types.judging.screw_least", kPlain, kJoints, &t.judging.screw_least},
          {"types.judging.screw_over_plain", kPlain, kJoints, &t.judging.screw_over_plain},
          {"types.judging.ratio_turns", kPlain, kRatio, &t.judging.ratio_turns},
          {"types.others.stop_compared", kPlain, kJoints, &t.others.stop_compared},
          {"types.others.stop_alike", kCosine, kJoints, &t.others.stop_alike},
          {"types.others.stop_against", kPlain, kJoints, &t.others.stop_against},
          {"types.others.stop_least", kPlain, kJoints, &t.others.stop_least},
          {"types.others.stop_along", kCosine, kJoints, &t.others.stop_along},
          {"types.others.stop_fewest", kPlain, kJoints, &t.others.stop_fewest},
          {"types.others.stop_share", kShare, kJoints, &t.others.stop_share},
          {"types.others.round_moments", kPlain, kJoints, &t.others.round_moments},
          {"types.others.round_radii", kShare, kJoints, &t.others.round_radii},
          {"types.others.round_sectors", kPlain, kJoints, &t.others.round_sectors},
          {"types.others.round_share", kShare, kJoints, &t.others.round_share},
          {"types.others.worth_telling", kPlain, kJoints, &t.others.worth_telling},
          {"types.line.compared", kPlain, kJoints, &t.line.compared},
          {"types.line.paired", kPlain, kJoints, &t.line.paired},
          {"types.line.off", kPlain, kJoints, &t.line.off},
          {"types.line.least_turn", kPlain, kJoints, &t.line.least_turn},
          {"types.line.near", kPlain, kJoints, &t.line.near},
          {"types.line.one_way", kCosine, kJoints, &t.line.one_way},
          {"types.frames.frame_aligned", kCosine, kJoints, &t.frames.frame_aligned},
          {"types.frames.frame_across", kPlain, kJoints, &t.frames.frame_across},
          {"types.frames.independent", kPlain, kChains, &t.frames.independent},
          {"types.frames.dense_columns", kPlain, kChains, &t.frames.dense_columns},
          {"ranges.limits.tolerance", kPlain, kRanges, &r.limits.tolerance},
          {"ranges.limits.largest_overlap", kPlain, kRanges, &r.limits.largest_overlap},
          {"ranges.limits.nudge", kPlain, kRanges, &r.limits.nudge},
          {"ranges.limits.nearest_pairs", kPlain, kRanges, &r.limits.nearest_pairs},
          {"ranges.limits.pairs_growth", kPlain, kRanges, &r.limits.pairs_growth},
          {"ranges.limits.contact_margin", kPlain, kRanges, &r.limits.contact_margin},
          {"ranges.limits.cone_refinements", kPlain, kRanges, &r.limits.cone_refinements},
          {"ranges.against.slope", kPlain, kRanges, &r.against.slope},
          {"ranges.against.one_sided", kPlain, kRanges, &r.against.one_sided},
          {"ranges.against.curve_turn", kPlain, kRanges, &r.against.curve_turn},
          {"ranges.against.overlap_growth", kFactor, kRanges, &r.against.overlap_growth}};
}

/// Public options of detection and ranges.
std::vector<Number> options_of(Numbers& n) {
  using enum Kind;
  using enum Concern;
  auto& contact = n.detection.contact;
  return {{"ContactRegionOptions::samples", kPlain, kJoints, &contact.samples},
          {"ContactRegionOptions::facing_cosine", kCosine, kJoints, &contact.facing_cosine},
          {"ContactRegionOptions::crease_angle", kPlain, kJoints, &contact.crease_angle},
          {"ContactRegionOptions::search", kPlain, kJoints, &contact.search},
          {"ContactRegionOptions::largest_gap", kPlain, kJoints, &contact.largest_gap},
          {"ContactRegionOptions::hull_growth", kPlain, kHulls, &contact.hull_growth},
          {"ContactRegionOptions::concavity", kPlain, kHulls, &contact.concavity},
          {"SlippageOptions::threshold", kPlain, kJoints, &n.detection.slippage.threshold},
          {"SlippageOptions::ratio", kPlain, kRatio, &n.detection.slippage.ratio},
          {"FreeMotionOptions::crease_angle", kPlain, kRanges, &n.ranges.motion.crease_angle},
          {"RangeOptions::min_rotation", kPlain, kRanges, &n.ranges.min_rotation},
          {"RangeOptions::min_translation", kPlain, kRanges, &n.ranges.min_translation},
          {"RangeOptions::cone_directions", kPlain, kRanges, &n.ranges.cone_directions}};
}

struct Setting {
  const char* name;
  Variant variant;
};

std::vector<Setting> settings() {
  return {{"coarse", {.segments = 16, .clearance = 0.0}},
          {"fine", {.segments = 32, .clearance = 0.005}},
          {"noisy", {.segments = 32, .clearance = 0.02, .jitter = 1e-3}},
          {"soup", {.segments = 32, .clearance = -0.005, .soup = true}}};
}

/// An assembly as drawn, and its joints with all numbers as they are.
struct Drawn {
  MadeAssembly made;
  Assembly assembly;
  std::vector<DetectedJoint> joints;
};

/// Assemblies of a setting, drawn once.
std::vector<Drawn> drawn(const Setting& setting, const DetectionOptions& options, Jobs& jobs) {
  std::vector<Drawn> out;
  for (const auto* names : {&tuning_names(), &held_out_names()})
    for (const std::string& name : *names) {
      Drawn& d = out.emplace_back(make(name, setting.variant));
      d.assembly = taken_apart(d.made);
      d.joints = detect_joints(d.assembly, options, jobs);
    }
  return out;
}

/// Counts over the assemblies of one setting.
struct Outcome {
  int all = 0, right = 0, extra = 0;
  double worst_angle = 0.0, worst_length = 0.0;  ///< degrees; 1e-3 of the diagonal
};

struct Outcomes {
  std::vector<Outcome> of;  ///< settings
  std::uint64_t bits = 0;   ///< a hash of all results
  double seconds = 0.0;     ///< of processor time

  void mix(double value) {
    bits = (bits ^ std::bit_cast<std::uint64_t>(value)) * 0x9e3779b97f4a7c15u, bits ^= bits >> 29;
  }
};

void add_joints(const MadeAssembly& made, const DetectionOptions& options, Jobs& jobs, Outcome& out, Outcomes& all) {
  const Score score = scored(made, options, jobs);
  out.extra += static_cast<int>(score.extra.size());
  all.mix(static_cast<double>(score.extra.size()));
  for (const JointScore& j : score.joints) {
    ++out.all;
    out.right += j.right() ? 1 : 0;
    for (const double value : {static_cast<double>(j.found), j.confidence, j.axis_error, j.origin_error, j.pitch_error})
      all.mix(value);
    if (!j.right()) continue;
    out.worst_angle = std::max(out.worst_angle, j.axis_error);
    out.worst_length = std::max(out.worst_length, 1e3 * j.origin_error);
  }
}

void add_ranges(const Drawn& drawn, const RangeOptions& options, Jobs& jobs, Outcome& out, Outcomes& all) {
  if (std::none_of(drawn.made.joints.begin(), drawn.made.joints.end(), [](const auto& j) { return !j.ranges.empty(); }))
    return;
  for (const RangeScore& r : scored_ranges(drawn.made, drawn.assembly, drawn.joints, jobs, options)) {
    ++out.all;
    out.right += r.right() ? 1 : 0;
    all.mix(r.error);
    all.mix(r.ends_match);
    if (!r.right()) continue;
    double& worst = r.angle ? out.worst_angle : out.worst_length;
    worst = std::max(worst, r.error);
  }
}

/// The sum of mobilities takes the place of the count of joints read right.
void add_chains(const Drawn& drawn, Outcome& out, Outcomes& all) {
  const Index mobility = overall_kinematics(drawn.assembly, drawn.joints).mobility;
  ++out.all;
  out.right += static_cast<int>(mobility);
  all.mix(static_cast<double>(mobility));
}

/// In how many of the settings, the first ones, a concern is measured.
std::size_t settings_of(Concern concern) { return concern == Concern::kJoints ? settings().size() : 2; }

/// @param all_drawn in the order of settings()
Outcomes measure(Numbers n, Concern concern, const std::vector<std::vector<Drawn>>& all_drawn, Jobs& jobs) {
  const testing::ScopedValue tuned(internal::tuning_in_use, n.tuning);
  if (concern == Concern::kHulls) n.detection.contact.method = decltype(n.detection.contact.method)::kHulls;
  if (concern == Concern::kRatio) n.detection.slippage.method = SlippageMethod::kFixedRatio;
  Outcomes all;
  all.of.resize(settings().size());
  const std::clock_t begin = std::clock();
  for (std::size_t s = 0; s < settings_of(concern); ++s)
    for (const Drawn& d : all_drawn[s])
      if (concern == Concern::kRanges)
        add_ranges(d, n.ranges, jobs, all.of[s], all);
      else if (concern == Concern::kChains)
        add_chains(d, all.of[s], all);
      else
        add_joints(d.made, n.detection, jobs, all.of[s], all);
  all.seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  return all;
}

std::string change_text(const char* format, auto before, auto after) {
  char text[80];
  std::snprintf(text, sizeof text, format, before, after);
  return text;
}

/// The effect of one change, in words.
std::string moved(const Outcomes& before, const Outcomes& after) {
  std::string out;
  const auto differs = [](double x, double y, double least) {
    return std::max(x, y) > least && std::abs(x - y) > 0.1 * std::max(x, y);
  };
  for (std::size_t s = 0; s < settings().size(); ++s) {
    const Outcome &x = before.of[s], &y = after.of[s];
    std::string here;
    if (x.right != y.right) here += change_text(" right %d → %d", x.right, y.right);
    if (x.extra != y.extra) here += change_text(" extra %d → %d", x.extra, y.extra);
    if (differs(x.worst_angle, y.worst_angle, 1e-3))
      here += change_text(" angle %.2g → %.2g°", x.worst_angle, y.worst_angle);
    if (differs(x.worst_length, y.worst_length, 1e-3))
      here += change_text(" length %.2g → %.2g", x.worst_length, y.worst_length);
    if (!here.empty()) out += (out.empty() ? "" : "; ") + std::string(settings()[s].name) + ":" + here;
  }
  if (out.empty()) out = before.bits == after.bits ? "same bits" : "same score";
  if (std::abs(after.seconds / before.seconds - 1.0) > 0.2)
    out += change_text(" (time × %.*f)", 2, after.seconds / before.seconds);
  return out;
}

/// @param only parts of the names that are asked for; none: all
int run(std::span<const std::string_view> only) {
  Numbers n;
  std::vector<Number> numbers = sheet_of(n.tuning);
  if (8 * numbers.size() != sizeof(Tuning))
    return std::fprintf(stderr, "tuning_articulation: %zu numbers listed, the sheet has %zu\n", numbers.size(),
                        sizeof(Tuning) / 8),
           1;
  for (const Number& option : options_of(n)) numbers.push_back(option);
  std::erase_if(numbers, [&](const Number& number) {
    return !only.empty() && std::none_of(only.begin(), only.end(), [&](std::string_view text) {
      return number.name.find(text) != std::string::npos;
    });
  });
  TbbJobs jobs;
  std::vector<std::vector<Drawn>> all_drawn;
  const bool joints =
      std::any_of(numbers.begin(), numbers.end(), [](const Number& x) { return x.concern == Concern::kJoints; });
  for (std::size_t s = 0; s < settings_of(joints ? Concern::kJoints : Concern::kRanges); ++s)
    all_drawn.push_back(drawn(settings()[s], n.detection, jobs));
  std::vector<Outcomes> base;
  for (const Concern concern :
       {Concern::kJoints, Concern::kHulls, Concern::kRatio, Concern::kChains, Concern::kRanges}) {
    static const char* const kNames[] = {"joints", "joints by hulls", "joints by the fixed ratio",
                                         "sums of mobilities (over assemblies)", "ranges"};
    base.emplace_back();
    if (std::none_of(numbers.begin(), numbers.end(), [&](const Number& x) { return x.concern == concern; })) continue;
    base.back() = measure(n, concern, all_drawn, jobs);
    std::printf("%s, %.1f s:", kNames[static_cast<int>(concern)], base.back().seconds);
    for (std::size_t s = 0; s < settings().size(); ++s)
      if (const Outcome& o = base.back().of[s]; o.all > 0)
        std::printf(" %s %d right of %d, %d extra, worst %.2g° and %.2g;", settings()[s].name, o.right, o.all, o.extra,
                    o.worst_angle, o.worst_length);
    std::printf("\n");
  }
  std::printf("\n| number | value | at half | at double |\n|---|---|---|---|\n");
  const Numbers unchanged = n;
  for (const Number& number : numbers) {
    const Outcomes& before = base[static_cast<std::size_t>(number.concern)];
    std::printf("| %s | %.4g", number.name.c_str(), value_of(number));
    for (const double by : {0.5, 2.0}) {
      scale(number, by);
      std::printf(" | %s", moved(before, measure(n, number.concern, all_drawn, jobs)).c_str());
      n = unchanged;
    }
    std::printf(" |\n");
    std::fflush(stdout);
  }
  return 0;
}

}  // namespace
}  // namespace limber::assemblies

int main(int argc, char** argv) {
  const std::vector<std::string_view> words(argv + 1, argv + argc);
  if (words.empty()) return limber::assemblies::run({});
  if (words.size() > 1 && words[0] == "--only") return limber::assemblies::run(std::span(words).subspan(1));
  return std::fprintf(stderr, "tuning_articulation: expected --only TEXT…, or nothing\n"), 2;
}
