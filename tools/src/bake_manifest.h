/// @file bake_manifest.h
/// Many bakes: what each of them reads, writes and is told (docs/large-bakes.md).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "limber/core/types.h"

namespace CLI {
class App;
}

namespace limber::tools {

/// The group of options of a whole run in --help; jobs have the others.
inline constexpr const char* kFarmOptions = "Many bakes";

/// An option as on a command line.
struct GivenOption {
  std::string name;   ///< with its dashes
  std::string value;  ///< empty: a flag
};

/// One bake by a process of its own.
struct BakeJob {
  Index number = 0;  ///< in the manifest, from 1
  std::filesystem::path mesh, output;
  std::vector<GivenOption> options;  ///< names of files in them are absolute
};

/// Jobs of a manifest, one a line: {"mesh": "a.obj", "output": "a.glb", "options": {"material": "steel", "modes": 32,
/// "keep-all": true, "fix": ["group:foot", "group:hand"]}}. Names of files count from the manifest's folder.
/// @param known the program's options; @param common options of all jobs, which a job's own replace
/// @throws InputError that names the line: it is no JSON, has other keys, an unknown option, or an output that another
/// line has
std::vector<BakeJob> read_manifest(const std::filesystem::path& manifest, const CLI::App& known,
                                   const std::vector<GivenOption>& common);

/// Jobs of the files of a folder whose names match a pattern, such as meshes/*.obj, by name; assets go to `outputs`.
/// @throws InputError if no file does, or two assets would have one name
std::vector<BakeJob> jobs_of_pattern(const std::filesystem::path& pattern, const std::filesystem::path& outputs,
                                     const std::vector<GivenOption>& common);

/// Whether it names many files.
bool is_pattern(const std::filesystem::path& path);

/// The I-th of N parts of the jobs, from "I/N": each N-th one from the I-th on. @throws InvalidArgument if there is
/// none
std::vector<BakeJob> shard_of(std::vector<BakeJob> jobs, const std::string& text);

/// The files that a job reads: its mesh, those beside it that belong to it by name (.node, .ele, .face, .mtl, .bin),
/// and those that its options name. Sorted.
std::vector<std::filesystem::path> files_read_by(const BakeJob& job);

/// What decides the bytes of the asset: contents of files, options, and the programs themselves (hashes of their
/// files).
std::string key_of(const BakeJob& job, const std::string& program_hash);

/// Whether the asset is all that it writes.
bool writes_asset_alone(const BakeJob& job);

/// The options that were given and are those of jobs. Names of files become absolute.
std::vector<GivenOption> options_of_jobs(const CLI::App& given);

/// The arguments of limber-precompute for it. @param output where the asset goes
std::vector<std::string> arguments_of(const BakeJob& job, const std::filesystem::path& output);

}  // namespace limber::tools
