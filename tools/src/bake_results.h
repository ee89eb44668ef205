/// @file bake_results.h
/// Results of many bakes: one JSON object a line (docs/large-bakes.md), and a page that shows them.
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace limber::tools {

class Program;

/// Lines of results, each added to a file by one write, so that processes may share it.
class BakeResults {
 public:
  /// @param path of the file; empty: lines are printed. @throws InputError, as add() does
  BakeResults(Program& program, std::string path);
  BakeResults(const BakeResults&) = delete;
  BakeResults& operator=(const BakeResults&) = delete;
  ~BakeResults();

  void add(const nlohmann::ordered_json& result);

 private:
  [[noreturn]] void refuse() const;

  Program& program_;
  std::string path_;
  int file_ = -1;
};

/// Whether the asset is there.
bool is_good(const nlohmann::ordered_json& result);

/// The last result of each output, by its name. A line that is no object with an output is none: the end of a run may
/// have cut it off. A file that is not there or empty has none.
std::map<std::string, nlohmann::ordered_json> read_results(const std::filesystem::path& file);

/// Writes one page of its own: a table of all outputs with a picture of each asset's first mode, and failures by what
/// they say. @throws InputError, InvalidArgument as Program::write_file()
void write_overview(Program& program, const std::vector<std::string>& results, const std::string& page);

}  // namespace limber::tools
