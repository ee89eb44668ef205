/// A glTF 2.0 file, text or binary: its JSON, its buffers, and numbers by accessor. Private to the module.
#pragma once

#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/mesh_file.h"
#include "limber/internal/strict_json.h"

namespace limber::internal {

/// Numbers of items that JSON may name.
inline constexpr std::int64_t kMostItems = std::numeric_limits<Index>::max();

class GltfFile {
 public:
  /// Buffers that are files lie beside `path`. @throws InputError, also for other versions of glTF and for extensions
  /// that are required and not read
  GltfFile(const std::filesystem::path& path, const FileBytes& file);

  const std::string& name() const { return name_; }
  JsonObject root() const { return {json_, name_}; }
  /// How many items a list of the file's top level has.
  std::size_t count(const char* list) const;
  /// One of them. @throws InputError if there are not so many
  JsonObject item(const char* list, std::size_t i) const;

  /// The numbers of an accessor, element by element; normalised whole numbers as those from −1 to 1 that they stand
  /// for.
  /// @param type "SCALAR", "VEC3", "VEC4" or "MAT4"
  std::vector<double> numbers(std::size_t accessor, std::string_view type);

 private:
  struct Stretch {
    const char* data;
    std::size_t bytes;
  };

  void take_container(std::string_view bytes);
  void check_version() const;
  void check_extensions() const;
  const std::string& buffer(std::size_t i);
  std::string read_buffer(const JsonObject& buffer, std::size_t i) const;
  Stretch view(const JsonObject& user, const char* key);
  void overwrite_sparse(const JsonObject& accessor, const JsonObject& sparse, std::vector<double>& numbers,
                        std::size_t components);

  std::filesystem::path path_;
  std::string name_;
  std::string_view binary_;  // of a GLB file
  nlohmann::json json_;
  std::vector<std::optional<std::string>> buffers_;  // as they are asked for
};

}  // namespace limber::internal
