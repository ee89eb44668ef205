/// @file machine_reading.h
/// Machines of a scene (limber/machine/machine.h) as bodies, joints and pairs.
#pragma once

#include <filesystem>

#include "limber/internal/strict_json.h"
#include "limber/scene/scene_file.h"

namespace limber::internal {

/// A grid of copies: count along x, y, z and the distances between them. One where it is not given.
struct Grid {
  std::array<Index, 3> count{1, 1, 1};
  Vec3 spacing = Vec3::Zero();

  bool one() const { return count[0] == 1 && count[1] == 1 && count[2] == 1; }
  /// Visits (number, shift) of every copy, along x first.
  template <class F>
  void for_each(F&& visit) const {
    int i = 0;
    for (Index z = 0; z < count[2]; ++z)
      for (Index y = 0; y < count[1]; ++y)
        for (Index x = 0; x < count[0]; ++x) visit(i++, Vec3(Vec3(x, y, z).cwiseProduct(spacing)));
  }
};
Grid read_grid(const JsonObject& o);

std::string known_asset(const JsonObject& o, const Scene& scene);

/// The member `machines`, if it is there. Reads the assets that it names.
void read_machines(const JsonObject& o, const std::filesystem::path& folder, Scene& scene);

}  // namespace limber::internal
