/// @file assemblies.h
/// Assemblies with known joints, drawn by formulae: what joint detection is judged by (README.md beside this file).
///
/// Every assembly exists in variants: more or fewer segments, clearance, overlap, noise, soup, open shells, any pose
/// and scale. A clearance is the gap on each side of a bearing as a fraction of the joint's diameter (of a plate's
/// width, for planar and prismatic joints).
#pragma once

#include <string>
#include <vector>

#include "limber/mesh/grouped_surface.h"
#include "limber/model/joint_spec.h"

namespace limber::assemblies {

struct Variant {
  int segments = 32;       ///< of a full circle; a multiple of 8
  double clearance = 0.0;  ///< of the joint's diameter; negative: the parts overlap
  double jitter = 0.0;     ///< RMS displacement of the vertices, of each part's diagonal
  double phase = 0.5;      ///< of a segment, by which shafts are turned against their holes
  bool soup = false;       ///< no two triangles share a vertex
  bool open = false;       ///< surfaces that bear nothing are missing
  bool swapped = false;    ///< parts in reverse order
  bool shuffled = false;   ///< faces in random order within each part
  double scale = 1.0;
  Mat3 rotation = Mat3::Identity();
  Vec3 translation = Vec3::Zero();  ///< after scaling
  unsigned seed = 1;
};

/// How far one freedom of a joint goes, for the parts as they are drawn, facets included: b's motion relative to a,
/// with the others at 0 and the rest of the assembly as limber/articulation/range_of_motion.h moves it.
struct TrueRange {
  enum class Freedom { kRotation, kTranslation, kCone };
  Freedom freedom = Freedom::kRotation;
  Vec3 along = Vec3::UnitZ();  ///< about or along which; without meaning for a cone
  Interval range;              ///< rad, length; a cone: [0, half angle]
};

struct TrueJoint {
  std::string a, b;
  JointType type = JointType::kFixed;
  Vec3 origin = Vec3::Zero();  ///< centre; any point of the axis; planar: midway between the surfaces
  Vec3 axis = Vec3::UnitZ();   ///< any of the two senses; planar: the normal; without meaning for ball and fixed
  double pitch = 0.0;
  std::vector<TrueRange> ranges{};  ///< those known on paper
};

struct MadeAssembly {
  GroupedSurface surface;
  std::vector<TrueJoint> joints;
  bool compound = false;  ///< parts are drawn as several shells: take them apart by group
  double diagonal = 0.0;  ///< of the bounding box
};

/// Those that thresholds were chosen on or the method was changed for, and those that only judge.
const std::vector<std::string>& tuning_names();
const std::vector<std::string>& held_out_names();

/// @throws InvalidArgument if there is no such assembly
MadeAssembly make(const std::string& name, const Variant& variant = {});

}  // namespace limber::assemblies
