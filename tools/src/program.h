/// @file program.h
/// Common parts of limber's command-line programs: options, errors, exit codes, reports, output files, progress.
///
///   int main(int argc, char** argv) {
///     Program program("limber-inspect", "Tells what is inside an asset.");
///     std::string asset;
///     program.options().add_option("ASSET", asset, "asset file (GLB)")->required();
///     return program.run(argc, argv, [&] { inspect(program, asset); });
///   }
///
/// Exit codes: 0 good; 1 failed work (InputError, ComputationError, out of memory, a full disk); 2 wrong usage
/// (options, InvalidArgument). An error is one line on stderr. Results go to stdout.
/// A program that declares options includes <CLI/CLI.hpp>, one that fills a report <nlohmann/json.hpp>.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "limber/core/file.h"
#include "limber/core/types.h"
#include "progress.h"

namespace CLI {
class App;
class ParseError;
class Validator;
}  // namespace CLI

namespace limber::tools {

class Program {
 public:
  /// Declares --help, --version and --report FILE.json.
  /// @param name of the executable. @param purpose one or two sentences for --help
  Program(std::string name, const std::string& purpose);
  ~Program();
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  /// The program declares its own options here; give each value's unit as its type_name().
  CLI::App& options() { return *options_; }

  /// Parses, works, then writes the report and lets every output file appear. @return the exit code
  int run(int argc, const char* const* argv, const std::function<void()>& work);

  // For use by the work ----------------------------------------------------------------------------------------------
  /// "limber-inspect 0.1.0"
  std::string name_and_version() const;

  /// Text for people on stdout, there at once.
  void print(std::string_view text);

  /// Tells of a file that the work reads: no output may take its place.
  void add_input(const std::filesystem::path& path) { input_paths_.push_back(path); }

  /// Bytes are written beside `path` now; the file appears when all the work has succeeded, together with the others.
  /// @throws InvalidArgument if two outputs of one run have the same path, or one is an input; InputError as
  /// OutputFiles::add()
  void write_file(const std::filesystem::path& path, std::string_view bytes);

  /// The machine-readable report, keys in the order they are set; starts with "program" and "version". Values that
  /// differ between equal runs (times) belong under the key "seconds". "warnings" is added at the end.
  nlohmann::ordered_json& report() { return *report_; }

  /// Remarks: each becomes a line "NAME: warning: …" on stderr when the work is done, and stands in the report.
  Warnings& warnings() { return warnings_; }

  Progress& progress() { return progress_; }

 private:
  int fail(int code, std::string message);
  int refuse_usage(const CLI::ParseError& error);
  void finish();

  std::string name_;
  std::unique_ptr<CLI::App> options_;
  std::string report_path_;
  std::unique_ptr<nlohmann::ordered_json> report_;
  Warnings warnings_;
  Progress progress_;
  OutputFiles outputs_;
  std::vector<std::filesystem::path> input_paths_, output_paths_;
};

/// Validators for options: a finite number > 0, ≥ 0, > 1, between 0 and 1, or from low to high. (CLI11 reads "nan" and
/// "inf" as numbers.)
CLI::Validator positive_number();
CLI::Validator non_negative_number();
CLI::Validator number_above_one();
CLI::Validator proper_fraction();
CLI::Validator number_between(double low, double high);

}  // namespace limber::tools
