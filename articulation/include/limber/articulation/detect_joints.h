/// @file limber/articulation/detect_joints.h
/// Joints of an assembly from its geometry alone: contacts, the motions they allow, and [X09] Table 1.
#pragma once

#include <functional>
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
  std::vector<JointHypothesis> alternatives;  ///< other readings, best first
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

/// How the joints act together.
struct Kinematics {
  Index loops = 0;     ///< independent closed chains: joints − components + groups
  Index groups = 0;    ///< sets of components connected by joints; a lone component is one
  Index mobility = 0;  ///< motions of all components less 6 per group, by the rank of the joints' constraints as read
  Index kutzbach = 0;  ///< Σ freedoms − 6 loops: what counting alone says; may be negative
};
Kinematics overall_kinematics(const Assembly& assembly, const std::vector<DetectedJoint>& joints);

}  // namespace limber
