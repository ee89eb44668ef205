#include "bake_farm.h"

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <list>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "bake_manifest.h"
#include "bake_results.h"
#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/model/sha256.h"
#include "precompute_report.h"
#include "program.h"
#include "slepc_engine.h"

namespace limber::tools {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// How often processes are looked at: far shorter than the shortest bake.
constexpr std::chrono::milliseconds kBetweenLooks{5};
constexpr const char* kReport = "report.json";

/// The bytes of a file with this hash; none: it is not there, or has others.
std::optional<std::string> bytes_with(const fs::path& file, const std::string& hash) {
  std::error_code failed;
  if (fs::file_size(file, failed) == 0 || failed) return std::nullopt;
  std::string bytes = read_file(file);
  if (sha256_hex(bytes) != hash) return std::nullopt;
  return bytes;
}

/// Assets by what decides their bytes. An asset is there once the line that tells its hash is.
class Cache {
 public:
  explicit Cache(const std::string& folder) : folder_(folder) {
    if (!folder_.empty()) fs::create_directories(folder_);
  }
  bool is_used() const { return !folder_.empty(); }

  /// Writes the output if there is such an asset. @return its result; none: there is none, or it is damaged
  std::optional<Json> take(const std::string& key, const fs::path& output) const {
    const fs::path told = path(key, ".json");
    if (!fs::exists(told)) return std::nullopt;
    Json result = Json::parse(read_file(told), nullptr, false);
    if (result.is_discarded() || !result.contains("output_hash")) return std::nullopt;
    const auto asset = bytes_with(path(key, ".glb"), result["output_hash"].get<std::string>());
    if (!asset) return std::nullopt;
    write_file(output, *asset);
    return result;
  }
  void put(const std::string& key, const std::string& asset, const Json& result) const {
    fs::create_directories(path(key, "").parent_path());
    write_file(path(key, ".glb"), asset);
    write_file(path(key, ".json"), result.dump());
  }

 private:
  /// In 256 folders.
  fs::path path(const std::string& key, const char* extension) const {
    return folder_ / key.substr(0, 2) / (key + extension);
  }
  fs::path folder_;
};

/// What the report of a bake says that a table of many needs.
void add_report(Json& result, const Json& report) {
  for (const char* key : {"nodes", "tets", "asset_bytes"})
    if (report.contains(key)) result[key] = report[key];
  if (report.contains("kept")) result["modes"] = report["kept"].size();
  if (report.contains("frequencies_hz") && !report["frequencies_hz"].empty())
    result["lowest_hz"] = report["frequencies_hz"][0];
  if (report.contains("frequency_errors")) {
    double largest = 0.0;
    for (std::size_t i = 0; i < std::min<std::size_t>(kModesTold, report["frequency_errors"].size()); ++i)
      if (const Json& error = report["frequency_errors"][i]; error.is_number())
        largest = std::max(largest, std::abs(error.get<double>()));
    result["frequency_error"] = largest;
  }
  result["warnings"] = report.value("warnings", Json::array());
}

class Farm {
 public:
  Farm(Program& program, const FarmArguments& a)
      : program_(program),
        arguments_(a),
        results_(program, a.results),
        cache_(a.cache),
        program_hash_(sha256_hex(read_file("/proc/self/exe"))) {
    if (const auto eigen = limber_eigen_file(); std::filesystem::exists(eigen))
      program_hash_ += sha256_hex(read_file(eigen));
    if (arguments_.resume) done_ = read_results(a.results);
  }

  void run(const std::vector<BakeJob>& jobs) {
    began_ = std::chrono::steady_clock::now();
    counts_.total = jobs.size();
    std::size_t next = 0;
    while (next < jobs.size() || !running_.empty()) {
      while (next < jobs.size() && running_.size() < static_cast<std::size_t>(arguments_.at_once)) begin(jobs[next++]);
      look();
      if (!running_.empty()) std::this_thread::sleep_for(kBetweenLooks);
    }
  }
  std::size_t failed() const { return counts_.failed; }
  std::string summary() const {
    return fmt::format("{} jobs: {} baked, {} from the cache, {} done before, {} failed\n", counts_.total,
                       counts_.baked, counts_.cached, counts_.skipped, counts_.failed);
  }

 private:
  /// A job and a folder beside its output, in which all is written: the end of a process leaves nothing half done.
  struct Running {
    const BakeJob* job;
    std::string key;
    fs::path folder, asset;
    JobProcess process;
  };

  /// Takes it as done, or starts it.
  void begin(const BakeJob& job) {
    std::string key;
    or_fail(job, key, [&] {
      key = key_of(job, program_hash_);
      if (is_done(job, key)) {
        ++counts_.skipped;
        return tell_progress();
      }
      fs::create_directories(job.output.parent_path());
      if (cache_.is_used() && writes_asset_alone(job))
        if (std::optional<Json> found = cache_.take(key, job.output)) return end_cached(job, std::move(*found));
      start(job, key);
    });
  }

  /// What goes wrong with one job, such as a folder that cannot be written to, fails that one alone.
  template <class Work>
  void or_fail(const BakeJob& job, const std::string& key, const Work& work) {
    try {
      work();
    } catch (const fs::filesystem_error& e) {
      end_failed(job, key, "failed", e.what());
    } catch (const Error& e) {
      end_failed(job, key, "failed", e.what());
    }
  }

  void start(const BakeJob& job, const std::string& key) {
    const fs::path folder = job.output.parent_path() / fmt::format(".limber-{}-{}", getpid(), job.number);
    fs::create_directories(folder);
    // A scene names the asset by where it is.
    const fs::path asset = writes_asset_alone(job) ? folder / job.output.filename() : job.output;
    std::vector<std::string> arguments = arguments_of(job, asset);
    arguments.insert(arguments.end(), {"--report", (folder / kReport).string()});
    JobProcess process("/proc/self/exe", arguments, folder / "stderr",
                       {.seconds = arguments_.seconds, .bytes = 1e6 * arguments_.megabytes});
    running_.push_back({&job, key, folder, asset, std::move(process)});
  }

  bool is_done(const BakeJob& job, const std::string& key) const {
    const auto found = done_.find(job.output.string());
    return found != done_.end() && is_good(found->second) && found->second.value("key", "") == key &&
           bytes_with(job.output, found->second.value("output_hash", "")).has_value();
  }

  void look() {
    for (auto running = running_.begin(); running != running_.end();) {
      const std::optional<JobEnd> end = running->process.poll();
      if (!end) {
        ++running;
        continue;
      }
      or_fail(*running->job, running->key, [&] { end_job(*running, *end); });
      std::error_code ignored;
      fs::remove_all(running->folder, ignored);
      running = running_.erase(running);
    }
  }

  void end_job(const Running& running, const JobEnd& end) {
    const BakeJob& job = *running.job;
    if (end.over_time)
      return end_failed(job, running.key, "over time", fmt::format("took more than {} s", arguments_.seconds), &end);
    if (end.signal != 0)
      return end_failed(job, running.key, "broke down", fmt::format("ended by signal {}", end.signal), &end);
    if (end.exit_code != 0) return end_failed(job, running.key, "failed", end.message, &end);
    if (running.asset != job.output) fs::rename(running.asset, job.output);
    const std::string asset = read_file(job.output);
    Json result = begun_result(job, "baked");
    const Json report = Json::parse(read_file(running.folder / kReport));
    add_report(result, report);
    result["key"] = running.key;
    result["output_hash"] = sha256_hex(asset);
    result["peak_memory_bytes"] = end.peak_memory;
    result["seconds"] = report.value("seconds", Json::object());
    result["seconds"]["total"] = end.seconds;
    if (cache_.is_used() && writes_asset_alone(job)) cache_.put(running.key, asset, result);
    results_.add(result);
    ++counts_.baked;
    tell_progress();
  }

  void end_cached(const BakeJob& job, Json result) {
    Json now = begun_result(job, "cached");
    for (const auto& [key, value] : result.items())
      if (!now.contains(key)) now[key] = value;
    ++counts_.cached;
    results_.add(now);
    tell_progress();
  }

  void end_failed(const BakeJob& job, const std::string& key, const char* status, std::string message,
                  const JobEnd* end = nullptr) {
    constexpr std::string_view kProgram = "limber-precompute: ";
    if (message.starts_with(kProgram)) message.erase(0, kProgram.size());
    Json result = begun_result(job, status);
    result["message"] = message;
    result["key"] = key;
    if (end != nullptr) {
      result["peak_memory_bytes"] = end->peak_memory;
      result["seconds"]["total"] = end->seconds;
    }
    ++counts_.failed;
    results_.add(result);
    tell_progress();
  }

  static Json begun_result(const BakeJob& job, const char* status) {
    return {{"job", job.number}, {"status", status}, {"mesh", job.mesh.string()}, {"output", job.output.string()}};
  }

  void tell_progress() {
    const std::size_t ended = counts_.baked + counts_.cached + counts_.skipped + counts_.failed;
    const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - began_;
    const double left = passed.count() / static_cast<double>(ended) * static_cast<double>(counts_.total - ended);
    program_.progress().stage(
        fmt::format("{} of {} jobs, {} failed, about {:.0f} s left", ended, counts_.total, counts_.failed, left));
    program_.progress().fraction(static_cast<double>(ended) / static_cast<double>(counts_.total));
  }

  Program& program_;
  const FarmArguments& arguments_;
  BakeResults results_;
  Cache cache_;
  std::string program_hash_;
  std::map<std::string, Json> done_;
  std::list<Running> running_;
  std::chrono::steady_clock::time_point began_;
  struct Counts {
    std::size_t total = 0, baked = 0, cached = 0, skipped = 0, failed = 0;
  } counts_;
};

std::vector<BakeJob> jobs_of(Program& program, const FarmArguments& a, const std::string& outputs) {
  const std::vector<GivenOption> common = options_of_jobs(program.options());
  std::vector<BakeJob> jobs;
  if (is_pattern(a.manifest)) {
    if (outputs.empty()) throw InvalidArgument("--manifest PATTERN: --output is missing, the folder of the assets");
    jobs = jobs_of_pattern(a.manifest, outputs, common);
  } else {
    if (!outputs.empty()) throw InvalidArgument("--output: a manifest names the outputs itself");
    jobs = read_manifest(a.manifest, program.options(), common);
  }
  if (!a.shard.empty()) return shard_of(std::move(jobs), a.shard);
  if (a.job == 0) return jobs;
  if (a.job > static_cast<Index>(jobs.size()))
    throw InvalidArgument(fmt::format("--job {}: {} has {} jobs", a.job, a.manifest, jobs.size()));
  return {jobs[static_cast<std::size_t>(a.job) - 1]};
}

}  // namespace

void declare_farm_options(CLI::App& app, FarmArguments& a) {
  const auto option = [&](const char* name, auto& value, const char* what) {
    return app.add_option(name, value, what)->group(kFarmOptions);
  };
  option("--manifest", a.manifest,
         "many bakes, each in a process of its own: a file with one {\"mesh\", \"output\", \"options\"} a line, "
         "or a pattern such as 'meshes/*.obj' with a folder as --output; other options given here hold for all")
      ->type_name("FILE.jsonl|PATTERN");
  const auto farm_option = [&](const char* name, auto& value, const char* what) {
    return option(name, value, what)->needs("--manifest");
  };
  farm_option("--shard", a.shard, "the I-th of N parts of the jobs")->type_name("I/N");
  farm_option("--job", a.job, "this job alone, from 1")
      ->type_name("K")
      ->check(CLI::PositiveNumber)
      ->excludes("--shard");
  farm_option("--results", a.results, "a line of JSON for each job is added here; default: printed")
      ->type_name("FILE.jsonl");
  app.add_flag(
         "--resume", a.resume,
         "leave out jobs whose output --results tells of, made by this program from the same contents and options")
      ->group(kFarmOptions)
      ->needs("--results");
  farm_option("--cache", a.cache, "take and keep assets here, by what decides their bytes; many processes may share it")
      ->type_name("FOLDER");
  farm_option("--seconds-a-job", a.seconds, "end a job that takes longer")->type_name("S")->check(positive_number());
  farm_option("--megabytes-a-job", a.megabytes, "memory that a job may ask for")
      ->type_name("MB")
      ->check(positive_number());
  farm_option("--at-once", a.at_once, "processes")->type_name("N")->check(CLI::Range(1, 1024))->capture_default_str();
  option("--summary", a.summaries, "without --manifest: write one page about these results to --output; repeatable")
      ->type_name("RESULTS.jsonl")
      ->allow_extra_args(false)
      ->excludes("--manifest");
}

void bake_many(Program& program, const FarmArguments& a, const std::string& outputs) {
  const std::vector<BakeJob> jobs = jobs_of(program, a, outputs);
  Farm farm(program, a);
  farm.run(jobs);
  if (!a.results.empty()) program.print(farm.summary());
  if (farm.failed() > 0)
    throw ComputationError(fmt::format("{} of {} jobs failed{}", farm.failed(), jobs.size(),
                                       a.results.empty() ? "" : "; see " + a.results));
}

}  // namespace limber::tools
