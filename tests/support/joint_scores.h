/// @file joint_scores.h
/// Detected joints against known ones.
#pragma once

#include <string>
#include <vector>

#include "assemblies.h"
#include "limber/articulation/detect_joints.h"
#include "limber/articulation/range_of_motion.h"

namespace limber::assemblies {

struct JointScore {
  std::string name;          ///< "a – b"
  int truth = 0;             ///< as int of JointType
  int found = 0;             ///< the same; 6: none
  bool pitch_right = true;   ///< a screw's, within 2 %; no pitch where there is none
  double pitch_error = 0.0;  ///< of the true pitch
  double confidence = 0.0;
  double axis_error = 0.0;    ///< degrees; 0 for ball and fixed
  double origin_error = 0.0;  ///< of the assembly's diagonal: ball: distance; revolute, cylindrical: from the axis;
                              ///< planar: along the normal
  std::string reason;
  bool right() const { return truth == found && pitch_right; }
};

struct Score {
  std::vector<JointScore> joints;
  std::vector<std::string> extra;  ///< joints where there are none
};

/// The components of a drawn assembly: by groups where parts are drawn as several shells.
Assembly taken_apart(const MadeAssembly& made);

Score scored(const MadeAssembly& made, const DetectionOptions& options, Jobs& jobs);

/// What moving, scaling or reordering an assembly changes in the joints that are found.
struct Change {
  int joints = 0;     ///< of the unmoved assembly
  int types = 0;      ///< of these come out as another type, or not at all
  int turned = 0;     ///< axes that turn by more than `kMostTurn`
  double axis = 0.0;  ///< degrees, the most by which an axis (planar: the normal) turns beyond the motion itself
  std::string worst;  ///< the joint of that axis
  static constexpr double kMostTurn = 0.05;  ///< degrees
};
/// @param moved the same parts as `still` but for pose, scale and order
Change change_of_joints(const MadeAssembly& still, const MadeAssembly& moved, const Mat3& rotation,
                        const DetectionOptions& options, Jobs& jobs);

/// One freedom of a joint that was read right, and whose range is known.
struct RangeScore {
  std::string joint, freedom;
  int type = 0;            ///< as int of JointType
  bool same_type = true;   ///< the limits made no other type of it
  bool ends_match = true;  ///< open ends are open and stops are stops
  bool angle = true;       ///< error in degrees; otherwise in thousandths of the assembly's diagonal
  double error = 0.0;      ///< of the worse end that stops
  std::string found;       ///< in words
  bool right() const { return same_type && ends_match && error <= 1.0; }
};

/// Ranges of motion against those known on paper, for the joints whose type was read right.
std::vector<RangeScore> scored_ranges(const MadeAssembly& made, const DetectionOptions& options, Jobs& jobs,
                                      const RangeOptions& ranges = {});
/// The same for joints that were found before.
std::vector<RangeScore> scored_ranges(const MadeAssembly& made, const Assembly& assembly,
                                      const std::vector<DetectedJoint>& joints, Jobs& jobs,
                                      const RangeOptions& ranges = {});

struct VariantClass {
  std::string name;
  std::vector<Variant> variants;
  double axis_tolerance = 0.5;  ///< degrees
  bool with_balls = true;
};

/// The variants that accuracy is reported for.
std::vector<VariantClass> variant_classes();

/// Those that ranges of motion are reported for: fewer, since a ball takes some twenty paths.
std::vector<VariantClass> range_variant_classes();

}  // namespace limber::assemblies
