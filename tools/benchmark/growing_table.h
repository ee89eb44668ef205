/// @file growing_table.h
/// A table that a long benchmark writes as it goes.
#pragma once

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

namespace limber::tools {

class Program;

/// Rows stand in FILE.part as soon as they are told, so that a run that is stopped or fails leaves what it has.
/// finish() makes FILE of it, whole with the program's other files.
class GrowingTable {
 public:
  /// @param path none: nothing is written
  /// @throws InputError, as does add(), with the file's name and the system's reason
  GrowingTable(const std::filesystem::path& path, std::string_view head);
  void add(std::string_view row);  ///< without its end of line
  void finish(Program& program);

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::filesystem::path path_, part_;
  std::unique_ptr<std::FILE, Close> file_;
  std::string text_;
};

}  // namespace limber::tools
