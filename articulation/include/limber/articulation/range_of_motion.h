/// @file limber/articulation/range_of_motion.h
/// How far each joint of an assembly goes before parts collide: its limits, along each of its freedoms.
///
/// What moves with component b, and what stays with a: the joints make a graph of the components. In a tree, taking the
/// joint away leaves two sides: b's moves, a's stays, and so does every component without a joint. In a closed chain
/// (piston, rod and crank) the rest of the chain moves in ways that one joint alone does not tell: it is left out,
/// with all that hangs on it. Components that fixed joints hold together count as one.
///
/// Each freedom is tried on its own, the others at 0: revolute and cylindrical, rotation about x; cylindrical and
/// prismatic, translation along x; planar, translations along x and y, rotation about z; a screw, rotation with its
/// advance; a ball, rotations about x, y and z (the three Euler angles, each alone) and swings of x about axes across
/// it in every direction, the least of which is the cone. See limber/articulation/free_motion.h for how contacts are
/// found.
///
/// A freedom narrower than a threshold is none: cylindrical becomes revolute or prismatic, a planar joint with one
/// translation left prismatic, with rotation alone revolute, and what is left without a freedom is fixed.
///
/// Source: [X09] 3.3.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "limber/articulation/assembly.h"
#include "limber/articulation/detect_joints.h"
#include "limber/articulation/free_motion.h"
#include "limber/core/jobs.h"

namespace limber {

struct RangeOptions {
  FreeMotionOptions motion{};
  double min_rotation = 0.0349;   ///< rad (2°); a rotation of less is none; ≥ 0
  double min_translation = 2e-3;  ///< of the smaller of the two components' diagonals; ≥ 0
  int cone_directions = 12;       ///< swings tried for a ball's cone, before the least is refined; 4 … 360
  /// Called from the calling thread with the part done (0 … 1, ascending); may be empty.
  std::function<void(double)> progress{};
  void validate() const;  ///< @throws InvalidArgument naming the field
};

/// What moves and what stays when one joint is moved: components, ascending.
struct JointSides {
  std::vector<Index> moving, fixed;
  std::vector<Index> left_out;  ///< the rest of a closed chain
};
/// @param components how many there are. @param joint of `joints`. @throws InvalidArgument if an index is out of range
JointSides joint_sides(Index components, const std::vector<DetectedJoint>& joints, std::size_t joint);

/// One freedom of a joint, as it was tried.
struct FreedomRange {
  std::string freedom;  ///< "rotation about x", "translation along y", …
  FreeMotion motion;    ///< MotionStop::body: a component
};

struct RangeOfMotion {
  JointSpec joint;                     ///< with limits; the type with fewer freedoms where some are too narrow
  std::vector<FreedomRange> freedoms;  ///< in the order of JointSpec's table; not the swings of a cone
  std::vector<std::string> reasons;    ///< sentences: what stops each freedom, what became of it
};

/// @throws InvalidArgument if `joint` is out of range or an option is
RangeOfMotion range_of_motion(const Assembly& assembly, const std::vector<DetectedJoint>& joints, std::size_t joint,
                              const RangeOptions& options = {});

/// The same for all joints, each with the others as they came: parallel over joints, the same bits for any thread
/// count.
std::vector<RangeOfMotion> ranges_of_motion(const Assembly& assembly, const std::vector<DetectedJoint>& joints,
                                            const RangeOptions& options = {}, Jobs& jobs = serial_jobs());

/// The joint without the freedoms that are too narrow. @param min_translation length. @param reasons gets a sentence
/// for each freedom that goes
JointSpec without_narrow_freedoms(JointSpec joint, double min_rotation, double min_translation,
                                  std::vector<std::string>& reasons);

}  // namespace limber
