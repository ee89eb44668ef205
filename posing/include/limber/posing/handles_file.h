/// @file limber/posing/handles_file.h
/// The handles file: what of a model is pulled where, frame by frame (docs/formats/handles.md). Read by limber-pose.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "limber/posing/posing_session.h"

namespace limber {

/// Parts of a model that stay, and parts that bend.
struct PartDivision {
  std::vector<std::string> pinned{};
  std::vector<std::pair<std::string, PartOptions>> parts{};
};

struct HandlesFile {
  struct Handle {
    std::string name{}, part{};
    Vec3 point = Vec3::Zero();  ///< at rest, in the model's unit and frame
  };
  struct Frame {
    double time = 0.0;                                    ///< s; ascending from frame to frame
    std::vector<std::pair<std::size_t, Vec3>> targets{};  ///< of handles, by number; the others' stay
  };
  PartDivision division{};
  std::vector<Handle> handles{};
  std::vector<Frame> frames{};  ///< at least one
};

/// @param name shown in messages. @throws InputError in one line: file, place, what was seen, what was expected
HandlesFile parse_handles(std::string_view text, const std::string& name);
HandlesFile read_handles(const std::filesystem::path& path);

/// Sets parts, pins and handles of a session as the file says. @return the handles, in the file's order
/// @throws InputError naming the place in the file: a part that is not there, a point that is on no surface
std::vector<PoseHandle> apply_handles(const HandlesFile& file, const std::string& name, PosingSession& session);

}  // namespace limber
