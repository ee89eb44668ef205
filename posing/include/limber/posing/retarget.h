/// @file limber/posing/retarget.h
/// Recorded motion drives a jointed model: points of parts ride on the joints of a skeleton (docs/formats/mapping.md).
///
/// Each point belongs to a joint of the clip. The clip's skeleton at rest is laid onto the model by the rotation,
/// translation and scale that bring its joints nearest to their points (least squares; Umeyama 1991). A point is then
/// carried by its joint as if it were fixed to it, whatever the model's proportions are, and pulled there: joints and
/// limits of the model hold, limbs may be rigid or soft.
#pragma once

#include "limber/mesh/motion_clip.h"
#include "limber/posing/handles_file.h"

namespace limber {

struct MappingFile {
  struct Point {
    std::string joint{}, part{};
    Vec3 point = Vec3::Zero();  ///< of the part at rest, in the model's unit and frame
  };
  PartDivision division{};
  std::vector<Point> points{};  ///< three or more, not on one line
  double frame_rate = 30.0;     ///< of the poses, frames per second; > 0
  double begin = 0.0;           ///< of the clip, s; ≥ 0
  double end = 1e9;             ///< s; the clip's end if later
  bool travels = true;          ///< whether the root moves through space; it begins where it is at rest
};

/// @param name shown in messages. @throws InputError in one line: file, place, what was seen, what was expected
MappingFile parse_mapping(std::string_view text, const std::string& name);
MappingFile read_mapping(const std::filesystem::path& path);

/// The clip as targets of handles, one per point; between its frames by the shortest turn. @param name of the mapping
/// @throws InputError naming a joint that the clip has not (and the nearest that it has), points on one line, or times
/// outside it
HandlesFile retarget(const MotionClip& clip, const MappingFile& mapping, const std::string& name);

}  // namespace limber
