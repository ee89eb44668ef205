/// @file limber/articulation/detect_joints.h
/// Joints of an assembly from its geometry alone [X09 3.1, 3.2].
///
///   Warnings warnings;
///   const Assembly assembly = find_components(read_grouped_surface("lamp.obj", warnings));
///   const std::vector<DetectedJoint> joints = detect_joints(assembly, {.min_confidence = 0.3});
///
/// For each pair of components that come near each other: the contacts (contact_region.h), and for all contacts of the
/// pair together the type of joint that fits best (slippage.h). At most one joint for a pair. Contacts that hold
/// nothing, such as two balls that touch at a point, give none.
///
/// Types are those of [X09] Table 1 and the screw. Geometry does not tell everything: a peg in a blind hole looks like
/// a drawer at its stop, a puck on a table like the flange of a bearing that is not drawn, and bolts or glue are not
/// seen. DetectedJoint::other_hypotheses holds the other candidates.
///
/// Limits stay open; range_of_motion.h finds them. Lengths are in the input's own unit, angles in rad; position,
/// attitude, scale and the order of parts and faces change no type. The same bits for any thread count.
///
/// Use: docs/joints.md. Method: docs/derivations/slippage.md. How often it is right: docs/reports/joints.md.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "limber/articulation/assembly.h"
#include "limber/articulation/contact_region.h"
#include "limber/articulation/slippage.h"
#include "limber/core/jobs.h"
#include "limber/model/joint_spec.h"

namespace limber {

/// A box along given axes: what a joint influences is the one around its contact points [X09 4.1].
struct OrientedBox {
  JointFrame frame;                  ///< centre and axes
  Vec3 half_extents = Vec3::Zero();  ///< along the axes, ≥ 0
};

/// A joint that the geometry implies. Component b moves, a stays (a < b); angles and lengths are 0 as read.
///
/// The frame is right-handed: principal axes of the contact points, turned to agree with the detected axes [X09 3.2].
/// Origin: the centre of a ball; the middle of the contact on the axis of a revolute, cylindrical or prismatic joint;
/// the centroid of the contact for planar (on the plane) and fixed. An axis points to where its largest coordinate is >
/// 0.
struct DetectedJoint {
  Index a = 0, b = 0;
  JointSpec joint;                   ///< limits open: limber/articulation/range_of_motion.h finds them
  double confidence = 0.0;           ///< 0 … 1
  std::vector<std::string> reasons;  ///< sentences: contact found, motions that slip, what spoke against others
  std::vector<JointHypothesis> other_hypotheses;  ///< best first
  OrientedBox influence;
  std::vector<Vec3> contact_points;  ///< on both surfaces, input frame
  double gap = 0.0;                  ///< median distance of the surfaces
};

struct DetectionOptions {
  ContactRegionOptions contact = {};
  SlippageOptions slippage = {};
  double min_confidence = 0.0;  ///< joints below are left out; 0 … 1
  /// Called from the calling thread with the part done (0 … 1, ascending) and what is being done; may be empty.
  std::function<void(double, std::string_view)> progress = {};
  void validate() const;  ///< @throws InvalidArgument naming the field
};

/// Joints of all pairs, ordered by (a, b); at most one per pair. Contacts that hold nothing (two beads that touch at a
/// point) give none. The same bits for any thread count.
std::vector<DetectedJoint> detect_joints(const Assembly& assembly, const DetectionOptions& options = {},
                                         Jobs& jobs = serial_jobs());

/// The turn about x of a joint, or the slide along it.
struct JointAxis {
  std::size_t joint = 0;
  bool turns = true;
};

/// Two axes that go along with each other, as those of gears that mesh. ranges_of_motion() finds them.
struct JointCoupling {
  JointAxis first, second;
  double ratio = 0.0;  ///< of the second's speed to the first's, as read; lengths in the input's unit
  bool even = true;    ///< the same ratio over the whole range
};

/// How the joints act together.
struct Kinematics {
  Index loops = 0;     ///< independent closed chains: joints − components + groups
  Index groups = 0;    ///< sets of components connected by joints; a lone component is one
  Index mobility = 0;  ///< motions of all components less 6 per group, by the rank of the joints' constraints as read
  Index kutzbach = 0;  ///< Σ freedoms − 6 loops − couplings: what counting alone says; may be negative
};
/// @throws InvalidArgument if a coupling names an axis that its joint has not
Kinematics overall_kinematics(const Assembly& assembly, const std::vector<DetectedJoint>& joints,
                              std::span<const JointCoupling> couplings = {});

/// Axes in closed chains that go along with each other, as a crank's with its slider's: each with the first of its
/// chain that moves, and the ratio of their speeds as read, which changes on the way (`even` is false). An axis that
/// the chain holds is in none. Chains of more than 200 parts are left out.
std::vector<JointCoupling> chain_couplings(const Assembly& assembly, const std::vector<DetectedJoint>& joints);

/// Whether the joint turns about x, or slides along it, by a coordinate of its own; a screw turns.
bool has_axis(const JointSpec& joint, bool turns);

}  // namespace limber
