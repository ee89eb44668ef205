#include "bake_manifest.h"

#include <fmt/format.h>
#include <fnmatch.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <charconv>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/internal/strict_json.h"
#include "limber/model/sha256.h"

namespace limber::tools {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// Options whose values are names of files that are read; one whose file is written; and files that belong to a mesh.
constexpr std::array kFiles = {"--materials", "--render-surface", "--collision-surface", "--joints"};
constexpr const char* kScene = "--scene";
constexpr std::array kBeside = {".node", ".ele", ".face", ".mtl", ".bin"};
/// Options that a job does not have, or that a line gives by a key of its own.
constexpr std::array kNotOfAJob = {"--help", "--version", "--report", "--output", "--list-materials"};

bool is_one_of(const auto& names, const std::string& name) { return std::ranges::find(names, name) != names.end(); }
bool is_of_jobs(const CLI::Option& option) {
  const std::string name = option.get_name();
  return name.starts_with("--") && option.get_group() != kFarmOptions && !is_one_of(kNotOfAJob, name);
}
bool names_file(const std::string& option) { return is_one_of(kFiles, option) || option == kScene; }

/// A line of the manifest, for messages and for relative names.
struct Line {
  const fs::path& manifest;
  Index number;

  [[noreturn]] void refuse(const std::string& why) const {
    throw InputError(fmt::format("{}: line {}: {}", manifest.string(), number, why));
  }
  fs::path file(const Json& json, const char* key) const {
    if (!json.contains(key) || !json[key].is_string() || json[key].get<std::string>().empty())
      refuse(
          fmt::format("\"{}\" is missing or no name of a file, expected {{\"mesh\": \"a.obj\", \"output\": \"a.glb\", "
                      "\"options\": {{...}}}}",
                      key));
    return absolute(json[key].get<std::string>());
  }
  fs::path absolute(const std::string& name) const {
    return (fs::absolute(manifest).parent_path() / name).lexically_normal();
  }
};

std::vector<std::string> names_of_options(const CLI::App& known) {
  std::vector<std::string> names;
  for (const CLI::Option* option : known.get_options())
    if (is_of_jobs(*option)) names.push_back(option->get_name().substr(2));
  return names;
}

void add_value(const Line& line, const std::string& name, const Json& value, std::vector<GivenOption>& to) {
  if (value.is_string()) {
    const auto text = value.get<std::string>();
    to.push_back({name, names_file(name) ? line.absolute(text).string() : text});
  } else if (value.is_number()) {
    to.push_back({name, value.dump()});
  } else if (value.is_boolean()) {
    if (value.get<bool>()) to.push_back({name, ""});
  } else {
    line.refuse(fmt::format("option \"{}\" is {}, expected a text, a number, true, or a list of these", name.substr(2),
                            value.dump()));
  }
}

std::vector<GivenOption> options_of(const Line& line, const Json& json, const std::vector<std::string>& known) {
  std::vector<GivenOption> options;
  if (!json.contains("options")) return options;
  if (!json["options"].is_object()) line.refuse("\"options\" is no object, expected {\"material\": \"steel\", ...}");
  for (const auto& [key, value] : json["options"].items()) {
    if (!is_one_of(known, key))
      line.refuse(
          fmt::format("the option \"{}\" is unknown; did you mean \"{}\"?", key, internal::nearest_word(key, known)));
    if (!value.is_array()) {
      add_value(line, "--" + key, value, options);
      continue;
    }
    for (const Json& one : value) add_value(line, "--" + key, one, options);
  }
  return options;
}

/// A job's own options, and those common ones that it does not give itself.
std::vector<GivenOption> with_common(std::vector<GivenOption> own, const std::vector<GivenOption>& common) {
  std::vector<GivenOption> all;
  for (const GivenOption& option : common)
    if (std::ranges::find(own, option.name, &GivenOption::name) == own.end()) all.push_back(option);
  all.insert(all.end(), std::make_move_iterator(own.begin()), std::make_move_iterator(own.end()));
  return all;
}

Json parsed(const Line& line, const std::string& text) {
  try {
    Json json = Json::parse(text);
    if (!json.is_object()) line.refuse("no JSON object, expected {\"mesh\": ..., \"output\": ...}");
    for (const auto& [key, value] : json.items())
      if (key != "mesh" && key != "output" && key != "options")
        line.refuse(fmt::format("the key \"{}\" is unknown, expected mesh, output or options", key));
    return json;
  } catch (const Json::parse_error&) {
    line.refuse("no JSON; a manifest has one object a line");
  }
}

}  // namespace

std::vector<BakeJob> read_manifest(const fs::path& manifest, const CLI::App& known,
                                   const std::vector<GivenOption>& common) {
  const std::vector<std::string> names = names_of_options(known);
  std::istringstream lines(read_file(manifest));
  std::map<fs::path, Index> outputs;  // and the line that has it
  std::vector<BakeJob> jobs;
  Line line{manifest, 0};
  for (std::string text; std::getline(lines, text);) {
    ++line.number;
    if (text.find_first_not_of(" \t\r") == std::string::npos) continue;
    const Json json = parsed(line, text);
    BakeJob job{.number = static_cast<Index>(jobs.size()) + 1,
                .mesh = line.file(json, "mesh"),
                .output = line.file(json, "output"),
                .options = with_common(options_of(line, json, names), common)};
    if (const auto [first, is_new] = outputs.emplace(job.output, line.number); !is_new)
      line.refuse(fmt::format("the output \"{}\" is that of line {} too", job.output.string(), first->second));
    jobs.push_back(std::move(job));
  }
  if (jobs.empty()) throw InputError(manifest.string() + ": has no jobs");
  return jobs;
}

bool is_pattern(const fs::path& path) { return path.filename().string().find_first_of("*?[") != std::string::npos; }

std::vector<BakeJob> jobs_of_pattern(const fs::path& pattern, const fs::path& outputs,
                                     const std::vector<GivenOption>& common) {
  const fs::path folder = fs::absolute(pattern).parent_path();
  if (!fs::is_directory(folder)) throw InputError(folder.string() + ": is no folder");
  std::vector<fs::path> meshes;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.is_regular_file() && fnmatch(pattern.filename().c_str(), entry.path().filename().c_str(), 0) == 0)
      meshes.push_back(entry.path());
  std::ranges::sort(meshes);
  if (meshes.empty()) throw InputError(pattern.string() + ": no file matches");
  std::map<fs::path, fs::path> by_output;
  std::vector<BakeJob> jobs;
  for (const fs::path& mesh : meshes) {
    const fs::path output = fs::absolute(outputs / mesh.stem()).lexically_normal().concat(".glb");
    if (const auto [first, is_new] = by_output.emplace(output, mesh); !is_new)
      throw InputError(
          fmt::format("{} and {} would both be baked to {}", first->second.string(), mesh.string(), output.string()));
    jobs.push_back({static_cast<Index>(jobs.size()) + 1, mesh, output, common});
  }
  return jobs;
}

std::vector<BakeJob> shard_of(std::vector<BakeJob> jobs, const std::string& text) {
  std::size_t shard = 0, of = 0;
  const char *at = text.data(), *end = at + text.size();
  const auto slash = std::from_chars(at, end, shard);
  const auto last = slash.ptr < end ? std::from_chars(slash.ptr + 1, end, of) : slash;
  if (slash.ec != std::errc() || *slash.ptr != '/' || last.ec != std::errc() || last.ptr != end || shard < 1 ||
      shard > of)
    throw InvalidArgument(fmt::format("--shard {}: expected I/N with I from 1 to N, such as 3/8", text));
  std::vector<BakeJob> part;
  for (std::size_t i = shard - 1; i < jobs.size(); i += of) part.push_back(std::move(jobs[i]));
  return part;
}

std::vector<fs::path> files_read_by(const BakeJob& job) {
  std::vector<fs::path> files{job.mesh};
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(job.mesh.parent_path(), ignored)) {
    const fs::path& beside = entry.path();
    if (beside.stem() == job.mesh.stem() && is_one_of(kBeside, beside.extension().string())) files.push_back(beside);
  }
  for (const GivenOption& option : job.options)
    if (is_one_of(kFiles, option.name)) files.emplace_back(option.value);
  std::ranges::sort(files);
  files.erase(std::unique(files.begin(), files.end()), files.end());
  return files;
}

std::string key_of(const BakeJob& job, const std::string& program_hash) {
  Sha256 hash;
  hash.update(program_hash);
  for (const GivenOption& option : job.options) {
    const std::string value = names_file(option.name) ? fs::path(option.value).filename().string() : option.value;
    hash.update(option.name + "=" + value + "\n");
  }
  // An asset tells the name of what it was made from.
  for (const fs::path& file : files_read_by(job)) {
    hash.update(file.filename().string() + "\n");
    hash.update(sha256_hex(read_file(file)));
  }
  return hash.hex();
}

bool writes_asset_alone(const BakeJob& job) {
  return std::ranges::find(job.options, kScene, &GivenOption::name) == job.options.end();
}

std::vector<GivenOption> options_of_jobs(const CLI::App& given) {
  std::vector<GivenOption> options;
  for (const CLI::Option* option : given.get_options()) {
    const std::string name = option->get_name();
    if (option->count() == 0 || !is_of_jobs(*option)) continue;
    const bool is_flag = option->get_items_expected_max() == 0;
    if (option->get_items_expected_min() > 1) {  // one value of several numbers
      options.push_back({name, CLI::detail::join(option->results(), ",")});
      continue;
    }
    for (const std::string& value : option->results())
      options.push_back({name, is_flag && value == "true" ? ""
                               : names_file(name)         ? fs::absolute(value).string()
                                                          : value});
  }
  return options;
}

std::vector<std::string> arguments_of(const BakeJob& job, const fs::path& output) {
  std::vector<std::string> arguments{job.mesh.string(), "--output", output.string()};
  for (const GivenOption& option : job.options)
    arguments.push_back(option.value.empty() ? option.name : option.name + "=" + option.value);
  return arguments;
}

}  // namespace limber::tools
