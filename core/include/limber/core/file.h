/// @file limber/core/file.h
/// Whole files in, whole files out. An output file appears complete or not at all.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace limber {

/// Reads a whole file. @throws InputError (one line, naming the file) if it is missing, a directory, unreadable, empty,
/// not a regular file, or larger than max_bytes.
std::string read_file(const std::filesystem::path& path, std::uint64_t max_bytes = std::uint64_t{8} << 30);

/// Writes bytes beside `path` (same folder) and renames: a reader never sees half a file, and a failure (full disk, no
/// permission) leaves what was there before and no temporary. Devices and pipes are refused: they would be replaced.
/// @throws InputError naming the file and the system's reason.
void write_file(const std::filesystem::path& path, std::string_view bytes);

/// Several output files that appear together: bytes are written beside their names by add(), and all renamed by
/// commit(). Destroyed without commit(), it removes what it wrote.
class OutputFiles {
 public:
  OutputFiles() = default;
  ~OutputFiles();
  OutputFiles(const OutputFiles&) = delete;
  OutputFiles& operator=(const OutputFiles&) = delete;

  /// @throws InputError naming the file and the system's reason
  void add(const std::filesystem::path& path, std::string_view bytes);
  /// @throws InputError, like add()
  void commit();

 private:
  struct Pending {
    std::filesystem::path temporary, final;
  };
  std::vector<Pending> pending_;
};

}  // namespace limber
