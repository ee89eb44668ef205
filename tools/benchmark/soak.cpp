// limber-benchmark soak: hands that drag bodies about at random for hours, every step held to laws.
#include <fmt/format.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "benchmarks.h"
#include "growing_table.h"
#include "limber/core/error.h"
#include "program.h"
#include "scene_cost.h"
#include "soak_scene.h"

namespace limber::tools {
namespace {

using limber::testing::kSoakLaws;
using limber::testing::SoakBodies;
using limber::testing::SoakLaw;
using limber::testing::SoakScene;
using limber::testing::SoakShares;
using limber::testing::SoakStep;
using Json = nlohmann::ordered_json;

struct SoakArguments {
  int steps = 100'000, substeps = SmallSteps{}.substeps;
  std::string solver = "game";
  std::vector<unsigned> seeds{1, 2, 3};
  std::string csv;
  bool check = false;
};

constexpr double kMostWorst = 5.0;    // medians
constexpr double kMostGrowth = 0.01;  // of the resident memory
constexpr int kTold = 3;              // steps told on the way, of each law and seed
constexpr int kStages = 200;          // looks at the progress

/// What a law did over a run.
struct LawTally {
  long broken = 0;
  int first = -1, worst_at = -1;  // steps, from 0
  double worst = 0.0;             // the largest share of the law, 1 where it is met just so
};

struct SoakRow {
  unsigned seed = 0;
  int steps = 0;
  std::array<LawTally, kSoakLaws> laws{};
  long unsolved = 0;
  double median = 0.0, p99 = 0.0, worst = 0.0;  // s
  int slowest = 0;
  double warm_bytes = 0.0, end_bytes = 0.0;

  bool is_slow() const { return worst > kMostWorst * median; }
  bool grows() const { return end_bytes > (1.0 + kMostGrowth) * warm_bytes; }
  bool is_lawful() const {
    return std::ranges::all_of(laws, [](const LawTally& law) { return law.broken == 0; });
  }
  bool is_good() const { return is_lawful() && !is_slow() && !grows(); }
};

/// Resident memory of this process, bytes; 0 where /proc does not tell.
double resident_bytes() {
  long all = 0, resident = 0;
  if (std::FILE* file = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(file, "%ld %ld", &all, &resident) != 2) resident = 0;
    std::fclose(file);
  }
  return static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE));
}

/// Plays one seed and tells what breaks a law as it does.
class SoakRun {
 public:
  SoakRun(Program& program, GrowingTable& csv, const SoakBodies& bodies, unsigned seed, int steps,
          const ContactOptions& options)
      : program_(program), csv_(csv), scene_(bodies, seed, options), times_(static_cast<std::size_t>(steps), 0.0) {
    row_.seed = seed, row_.steps = steps;
  }
  SoakRow play() {
    const int warm = row_.steps / 10, stage = std::max(1, row_.steps / kStages);
    for (int i = 0; i < row_.steps; ++i) {
      if (i % stage == 0) program_.progress().stage(fmt::format("seed {}: step {} of {}", row_.seed, i, row_.steps));
      if (i == warm) row_.warm_bytes = resident_bytes();
      judge(i, scene_.step());
      times_[static_cast<std::size_t>(i)] = scene_.seconds();
      row_.unsolved += scene_.world().constraint_report().solved ? 0 : 1;
    }
    row_.end_bytes = resident_bytes();
    row_.slowest = static_cast<int>(std::ranges::max_element(times_) - times_.begin());
    row_.median = quantile(times_, 0.5), row_.p99 = quantile(times_, 0.99), row_.worst = quantile(times_, 1.0);
    return row_;
  }

 private:
  void judge(int number, const SoakStep& step) {
    const SoakShares shares = testing::shares_of_laws(step);
    for (std::size_t i = 0; i < kSoakLaws; ++i) {
      LawTally& law = row_.laws[i];
      const double share = shares.by_law[i];
      if (share > law.worst || law.worst_at < 0) law.worst = share, law.worst_at = number;
      if (share <= 1.0) continue;
      if (law.broken++ == 0) law.first = number;
      if (law.broken <= kTold)
        program_.print(fmt::format("  seed {}, step {}: {} by {:.3g} of what it may\n", row_.seed, number,
                                   testing::name(static_cast<SoakLaw>(i)), share));
      csv_.add(fmt::format("{},{},{},{:.6g}", row_.seed, number, testing::name(static_cast<SoakLaw>(i)), share));
    }
  }

  Program& program_;
  GrowingTable& csv_;
  SoakScene scene_;
  std::vector<double> times_;
  SoakRow row_;
};

std::string soak_head() {
  std::string out = fmt::format("{:<5} {:>8}", "seed", "steps");
  for (int i = 0; i < kSoakLaws; ++i) out += fmt::format(" {:>18}", testing::name(static_cast<SoakLaw>(i)));
  return out + fmt::format(" {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {}\n", "unsolved", "p50 ms", "p99 ms", "worst",
                           "of step", "MB warm", "MB end", " verdict");
}

/// A law's column: steps that broke it, the first of them, and the largest share.
std::string text_of(const LawTally& law) {
  if (law.broken == 0) return fmt::format("{:>18}", fmt::format("0 ({:.2g})", law.worst));
  return fmt::format("{:>18}", fmt::format("{} @{} ({:.2g})", law.broken, law.first, law.worst));
}

std::string text_of(const SoakRow& row) {
  std::string out = fmt::format("{:<5} {:>8}", row.seed, row.steps);
  for (const LawTally& law : row.laws) out += " " + text_of(law);
  std::string verdict = row.is_lawful() ? "" : " breaks laws";
  if (row.is_slow()) verdict += " slow";
  if (row.grows()) verdict += " grows";
  if (row.is_good()) verdict = " good";
  return out + fmt::format(" {:>8} {:>8.3f} {:>8.3f} {:>8.3f} {:>8} {:>8.2f} {:>8.2f} {}\n", row.unsolved,
                           1e3 * row.median, 1e3 * row.p99, 1e3 * row.worst, row.slowest, 1e-6 * row.warm_bytes,
                           1e-6 * row.end_bytes, verdict);
}

Json json_of(const SoakRow& row) {
  Json out{{"seed", row.seed}, {"steps", row.steps}, {"unsolved", row.unsolved}};
  for (std::size_t i = 0; i < kSoakLaws; ++i) {
    const LawTally& law = row.laws[i];
    out["laws"][testing::name(static_cast<SoakLaw>(i))] = {
        {"broken", law.broken}, {"first", law.first}, {"worst", law.worst}, {"worst_at", law.worst_at}};
  }
  return out;
}

Json times_of(const SoakRow& row) {
  return {{"seed", row.seed},          {"step_median", row.median}, {"step_p99", row.p99},
          {"step_worst", row.worst},   {"slowest", row.slowest},    {"warm_bytes", row.warm_bytes},
          {"end_bytes", row.end_bytes}};
}

void benchmark_soak(Program& program, const SoakArguments& a) {
  GrowingTable csv(a.csv, "seed,step,law,share");
  program.progress().stage("baking");
  const SoakBodies bodies = testing::bake_soak_bodies();
  Json& report = program.report();
  report["benchmark"] = "soak";
  report["solver"] = a.solver;
  ContactOptions options;
  options.solver = a.solver == "game" ? ContactSolver::kGame : ContactSolver::kExact;
  options.small_steps.substeps = a.substeps;
  program.print(
      "15 bodies, two hands; of each law: steps that broke it @ the first (the largest share of what it allows)\n");
  bool all_good = true;
  for (const unsigned seed : a.seeds) {
    const SoakRow row = SoakRun(program, csv, bodies, seed, a.steps, options).play();
    program.print((seed == a.seeds.front() ? soak_head() : "") + text_of(row));
    report["seeds"].push_back(json_of(row));
    report["seconds"]["seeds"].push_back(times_of(row));
    all_good = all_good && row.is_good();
  }
  if (a.check && !all_good) throw ComputationError("soak: some steps broke laws, see the table");
  csv.finish(program);
}

}  // namespace

std::function<void(Program&)> add_soak(CLI::App& programs) {
  const auto a = std::make_shared<SoakArguments>();
  CLI::App* app = programs.add_subcommand(
      "soak", "hands that drag flexible and rigid bodies about at random; every step held to laws");
  app->add_option("--steps", a->steps, "of 1/60 s, of each seed")
      ->type_name("N")
      ->check(CLI::Range(10, 100'000'000))
      ->capture_default_str();
  app->add_option("--seed", a->seeds, "runs, by the seed of what the hands do")
      ->type_name("N,...")
      ->delimiter(',')
      ->capture_default_str();
  app->add_option("--solver", a->solver, "who answers contacts, hands and joints: game, exact")
      ->type_name("NAME")
      ->check(CLI::IsMember({"game", "exact"}))
      ->capture_default_str();
  app->add_option("--substeps", a->substeps, "of game")
      ->type_name("N")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app->add_flag("--check", a->check, "fail where a step breaks a law, one takes five medians, or memory grows");
  app->add_option("--csv", a->csv, "write every breach; rows stand in FILE.csv.part as they come")
      ->type_name("FILE.csv");
  return [a, app](Program& program) {
    if (app->parsed()) benchmark_soak(program, *a);
  };
}

}  // namespace limber::tools
