/// @file limber/posing/posing_session.h
/// Direct manipulation of a jointed model: pull on points, and parts turn in their joints and bend [X09 4].
///
///   PosingSession lamp(jointed_model(assembly, joints), {.tolerance = 1e-8});
///   lamp.set_pinned(lamp.model().part_named("base"), true);
///   const PoseHandle hand = lamp.add_handle(lamp.model().part_named("shade"), tip);
///   lamp.move_handle(hand, target);
///   const PoseResult result = lamp.solve();
///   lamp.reconstruct(positions);
///
/// Every change keeps the pose: nothing starts over when a joint becomes another or a rigid part soft. Lengths are in
/// the model's own unit and frame, angles in rad. Not thread-safe; several sessions may run at the same time.
///
/// A pose minimises the strain of deformable parts, ½ Σ w |T_a x − T_b x|² over what neighbouring cells share, and
/// ½ k |y − target|² of every handle's point y; subject to joints, limits and pins. Derivation:
/// docs/derivations/posing.md.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "limber/core/rigid_transform.h"
#include "limber/posing/cells.h"
#include "limber/posing/jointed_model.h"
#include "limber/posing/pose_method.h"
#include "limber/posing/posing_options.h"

namespace limber {

/// Names a handle for as long as it is there; never used again after.
struct PoseHandle {
  Index number = -1;
  friend bool operator==(PoseHandle, PoseHandle) = default;
};

/// A cell as it stands: x at rest is at rotation · (x − centre) + place. Orthonormal but where a PoseMethod finds
/// poses.
struct PosedCell {
  Index part = 0;
  Index body = 0;  ///< cells of equal number share their transformation
  Cell rest{};
  Mat3 axes = Mat3::Identity();  ///< of the cell at rest
  Mat3 rotation = Mat3::Identity();
  Vec3 place = Vec3::Zero();  ///< of the cell's centre
};

/// A joint's coordinates as it stands, as its limits count them: rotation, then translations; a ball: its cone angle.
struct PosedJoint {
  std::vector<double> coordinates{};  ///< rad, length; empty for fixed
  double error = 0.0;                 ///< how far the joint is from holding: rad, of the model's diagonal
  JointFrame frame{};                 ///< where it stands: the origin with b, the axes with a
  double turn = 0.0;                  ///< of b relative to a since rest, 0 … π rad
};

class PosingSession {
 public:
  /// All parts rigid, nothing pinned, no handle. @param method finds the poses; null: the session itself, as above
  /// @throws InvalidArgument from model.validate() and options.validate()
  explicit PosingSession(JointedModel model, const PosingOptions& options = {},
                         std::shared_ptr<const PoseMethod> method = nullptr);
  ~PosingSession();
  PosingSession(PosingSession&&) noexcept;
  PosingSession& operator=(PosingSession&&) noexcept;

  /// The model with its joints as they are now.
  const JointedModel& model() const;
  const PosingOptions& options() const;

  // Changes. Each can be undone. All throw InvalidArgument for a part, joint or handle that is not there.

  /// Grips the point of a part that is at `point` at rest. Its target is where it is now.
  /// @throws InvalidArgument if `point` is not finite or further from the part's surface than a tenth of its diagonal
  PoseHandle add_handle(Index part, const Vec3& point);
  /// Moves of one handle that follow each other are undone together. @throws InvalidArgument if it is not finite
  void move_handle(PoseHandle handle, const Vec3& target);
  void remove_handle(PoseHandle handle);
  /// True if the handle exists: not after it was removed, or taken back.
  bool contains(PoseHandle handle) const;
  /// A handle's point, and its target.
  Vec3 handle_point(PoseHandle handle) const;
  Vec3 handle_target(PoseHandle handle) const;

  /// A pinned part stays where it stands now.
  void set_pinned(Index part, bool pinned);
  bool pinned(Index part) const;
  /// Makes a part rigid or deformable, finer or stiffer. It keeps its shape as far as the new cells can show it.
  void set_part(Index part, const PartOptions& options);
  PartOptions part_options(Index part) const;
  /// Another type, frame or other limits. If the pose does not meet them, the next solve() first puts it there.
  void set_joint(Index joint, const JointSpec& spec);

  /// The model in other parts, or with other names, and with more joints behind those there were; its vertices, too, go
  /// on behind those there were. Options go over to all pieces of a part, a pin to its first, handles to the nearest.
  /// @param was per part the one that it is, or is a piece of @throws InvalidArgument from model.validate() too
  void set_model(JointedModel model, std::span<const Index> was);

  /// Takes back the last change, pose included. @return false if there is none
  bool undo();
  /// What was changed so far is not taken back any more.
  void forget_changes();

  // Poses

  /// Finds the pose, from the one there is. Never to a worse one: joints and limits hold (PoseResult::Status says where
  /// they cannot), and the energy is no higher.
  PoseResult solve();
  /// Back to rest; handles stay where their targets are.
  void reset_pose();

  std::vector<PosedCell> cells() const;
  PosedJoint joint(Index joint) const;
  /// How a part has moved from rest, if all of it moves as one: rigid, and no piece of another part.
  std::optional<RigidTransform> motion(Index part) const;

  /// Positions of the model's vertices. @param positions one per vertex. @throws InvalidArgument if there are not
  void reconstruct(std::span<Vec3> positions) const;
  /// The same with unit normals, area-weighted over the triangles around each vertex.
  void reconstruct(std::span<Vec3> positions, std::span<Vec3> normals) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
