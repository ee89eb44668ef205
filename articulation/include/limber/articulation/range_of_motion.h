/// @file limber/articulation/range_of_motion.h
/// How far each joint of an assembly goes before components collide: its limits, along each of its freedoms [X09 3.3].
///
///   std::vector<RangeOfMotion> ranges = ranges_of_motion(assembly, joints);
///   for (std::size_t j = 0; j < joints.size(); ++j) joints[j].joint = ranges[j].joint;   // with limits
///
/// With component b of a joint moves b's side of the graph of joints; a's side stays, and so does every component
/// without a joint. Components that fixed joints hold together count as one. In a closed chain (piston, rod, crank) the
/// rest of the chain is left out, since one joint alone does not tell how it moves.
///
/// Each freedom is tried on its own, the others at 0: rotation about x (revolute, cylindrical), translation along x
/// (prismatic, cylindrical), translations along x and y and rotation about z (planar), rotation with its advance
/// (screw), rotations about x, y, z and swings of x in every direction, the least of which is the cone (ball). Motions
/// of several freedoms at once may end earlier. free_motion.h says what stops a motion.
///
/// Gears, racks and the like stop each other within their play. Where two parts, each with a rotation, translation or
/// screw of its own, do so, either is followed while the other goes along, and FreedomRange::coupled tells the ratio.
/// joint_couplings() gathers them for overall_kinematics() and robot files.
///
/// A freedom narrower than `min_rotation` or `min_translation` is none, and the joint becomes the type that is left:
/// cylindrical revolute or prismatic, planar prismatic or revolute, ball revolute, any of them fixed.
///
/// Use: docs/range-of-motion.md. How well: docs/reports/joints.md.
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

/// The components that move and those that stay when one joint is moved, ascending.
struct JointSides {
  std::vector<Index> moving, fixed;
  std::vector<Index> left_out;  ///< the rest of a closed chain
};
/// @param components how many there are. @param joint of `joints`. @throws InvalidArgument if an index is out of range
JointSides joint_sides(Index components, const std::vector<DetectedJoint>& joints, std::size_t joint);

/// A freedom of another joint that goes along, as the teeth of two gears let each other move.
struct CoupledFreedom {
  std::size_t joint = 0;    ///< the other
  std::size_t freedom = 0;  ///< of its RangeOfMotion::freedoms
  /// Of its t to this one's: all at which both run evenly without contact over the whole range. low > high: at none; it
  /// changes on the way, as with a cam
  Interval ratio;
  double as_read = 0.0;  ///< that of the speeds at the start
};

/// One freedom of a joint, as it was tried.
struct FreedomRange {
  std::string freedom;                  ///< "rotation about x", "translation along y", …
  FreeMotion motion;                    ///< MotionStop::body: a component
  std::vector<CoupledFreedom> coupled;  ///< what goes along; mostly empty
};

struct RangeOfMotion {
  JointSpec joint;                     ///< with limits; the type with fewer freedoms where some are too narrow
  std::vector<FreedomRange> freedoms;  ///< in the order of JointSpec's table; not the swings of a cone
  std::vector<std::string> reasons;    ///< sentences: what stops each freedom, what became of it
};

/// One of ranges_of_motion(), which it takes as long as: joints that engage depend on each other.
/// @throws InvalidArgument if `joint` is out of range or an option is
RangeOfMotion range_of_motion(const Assembly& assembly, const std::vector<DetectedJoint>& joints, std::size_t joint,
                              const RangeOptions& options = {});

/// The same for all joints, each with the others as they came: parallel over joints, the same bits for any thread
/// count.
std::vector<RangeOfMotion> ranges_of_motion(const Assembly& assembly, const std::vector<DetectedJoint>& joints,
                                            const RangeOptions& options = {}, Jobs& jobs = serial_jobs());

/// The couplings among ranges, each pair of axes once. The ratio is one at which both run evenly whichever leads: of
/// two turns the simplest fraction, else the middle.
std::vector<JointCoupling> joint_couplings(const std::vector<RangeOfMotion>& ranges);

/// "-0.6667 (-2/3)": a ratio in digits, and the fraction that it stands for between two turns.
std::string ratio_text(const JointCoupling& coupling);

/// The joint without the freedoms that are too narrow. @param min_translation length. @param reasons gets a sentence
/// for each freedom that goes
JointSpec without_narrow_freedoms(JointSpec joint, double min_rotation, double min_translation,
                                  std::vector<std::string>& reasons);

}  // namespace limber
