/// @file joint_scores.h
/// Detected joints against known ones.
#pragma once

#include <string>
#include <vector>

#include "assemblies.h"
#include "limber/articulation/detect_joints.h"

namespace limber::assemblies {

struct JointScore {
  std::string name;         ///< "a – b"
  int truth = 0;            ///< as int of JointType
  int found = 0;            ///< the same; 6: none
  bool pitch_right = true;  ///< a screw's, within 2 %; no pitch where there is none
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

Score scored(const MadeAssembly& made, const DetectionOptions& options, Jobs& jobs);

struct VariantClass {
  std::string name;
  std::vector<Variant> variants;
  double axis_tolerance = 0.5;  ///< degrees
  bool with_balls = true;
};

/// The variants that accuracy is reported for.
std::vector<VariantClass> variant_classes();

}  // namespace limber::assemblies
