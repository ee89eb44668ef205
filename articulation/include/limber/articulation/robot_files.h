/// @file limber/articulation/robot_files.h
/// An assembly with its joints in the formats of others: URDF, MJCF, and a GLB to look at.
///
/// Lengths become metres. All bodies keep the input's axes; a body's own origin is that of the joint to its parent (of
/// a root: the input's origin), so every coordinate is 0 in the pose as read.
///
/// Both robot formats are trees. The tree has as root the first component of each connected set, and leaves out of a
/// closed chain the joint that is easiest to close elsewhere: fixed, then ball, then revolute. MJCF has
/// it as an equality constraint, URDF as a comment. Sets that no joint connects are fixed to the world.
///
/// Joints of more than one freedom, where a format has none for them:
///
///   type         URDF (massless links between)        MJCF (joints of one body)
///   ball         three revolutes: x, y, z             ball; with limits, hinges x, y, z
///   cylindrical  prismatic and revolute along x       slide and hinge along x
///   screw        the same, the second a mimic         the same, coupled by an equality
///   planar       prismatic x, prismatic y, revolute z slide x, slide y, hinge z
///
/// A ball's Euler limits are taken as they are; its cone is not a limit either format knows, and is mentioned only. An
/// open end beside a closed one is written as a number a thousand times the model's size, for which both formats ask.
/// If the tree runs against a joint (its parent is b), order and axes are reversed, so the coordinates stay the
/// same.
///
/// Even couplings are mimics in URDF, each of the first axis of its set, and equalities of joints in MJCF. One whose
/// joint is not in the tree, or whose ratio changes on the way, is left out with a warning.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "limber/articulation/assembly.h"
#include "limber/articulation/detect_joints.h"

namespace limber {

struct RobotOptions {
  std::string name = "model";                 ///< of the robot
  std::string mesh_folder = "meshes";         ///< relative to the file; where the caller puts `meshes`
  double density = 1000.0;                    ///< kg/m³, of all parts; > 0
  double metres_per_unit = 1.0;               ///< of the input's length unit; > 0
  std::vector<JointCoupling> couplings = {};  ///< of gears and the like: joint_couplings()
};

struct RobotFile {
  std::string text;                                         ///< the URDF or MJCF document
  std::vector<std::pair<std::string, std::string>> meshes;  ///< name in mesh_folder, bytes (binary STL, metres)
  Warnings warnings;
};

/// Mass and inertia are those of the solid that a closed component bounds; of an open one, of a tenth of its box.
/// @throws InvalidArgument if an option is out of range or a joint is wrong (see JointSpec::validate())
RobotFile urdf_file(const Assembly& assembly, const std::vector<DetectedJoint>& joints,
                    const RobotOptions& options = {});
RobotFile mjcf_file(const Assembly& assembly, const std::vector<DetectedJoint>& joints,
                    const RobotOptions& options = {});

/// A picture for any glTF viewer: each component a node of its own colour, each joint an arrow along its axis (ball:
/// three) coloured by type. Nodes carry names and extras. @return the bytes of a GLB. @throws InvalidArgument as above
std::string assembly_glb(const Assembly& assembly, const std::vector<DetectedJoint>& joints,
                         double metres_per_unit = 1.0);

}  // namespace limber
