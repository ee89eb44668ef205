/// @file limber/view/page_pose.h
/// A jointed model as the page poses it: points are pulled, joints edited, parts made rigid or soft, all of it undone.
/// The page compiles this to WebAssembly (view/engine); it works natively too. It drives a PosingSession
/// (limber/posing/posing_session.h); lengths are in the model's unit.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "limber/posing/posing_session.h"

namespace limber {

/// The first point of the posed model that a ray meets.
struct PoseHit {
  Index part = -1;              ///< −1: none
  Vec3 at_rest = Vec3::Zero();  ///< the same point of the model at rest
  Vec3 point = Vec3::Zero();    ///< where it is
  double distance = 0.0;
};

/// A line drawn across the picture.
struct PoseStroke {
  Vec3 eye = Vec3::Zero();
  Vec3 from = Vec3::UnitX(), to = Vec3::UnitY();  ///< directions from the eye to its ends
};

class PagePose {
 public:
  /// The first part is pinned, all are rigid.
  /// @param model a surface. @param joints its joints file @throws InputError
  PagePose(const std::filesystem::path& model, const std::filesystem::path& joints);
  ~PagePose();

  /// Parts (name, triangles, rigid or soft, pinned) and joints (as the joints file has them) as they are now, JSON.
  /// Names are text of the files: nothing that may become markup.
  std::string description() const;
  std::span<const std::uint32_t> triangles() const;  ///< 3 T, part by part
  std::span<const float> positions();                ///< 3 V
  /// Per joint: origin and axis where it stands, coordinates (3).
  std::span<const double> joint_frames();
  /// Per handle: its point and its target.
  std::span<const double> handles();

  PoseHit cast_ray(const Vec3& from, const Vec3& direction) const;
  /// Grips a point: a new handle, which stays when it is let go. @return whether there was one to grip
  bool grab(const PoseHit& hit);
  /// Takes a handle again. @param handle in the order of handles() @throws InvalidArgument
  void take(int handle);
  void drag_to(const Vec3& target);
  void let_go();
  /// The one that is held, or was last; or all.
  void remove_handle();
  void remove_handles();

  /// Written to the files too. @throws InvalidArgument for an empty name, or another part's
  void set_name(Index part, const std::string& name);
  void set_pinned(Index part, bool pinned);
  /// Soft: a grid of cells a tenth of its diagonal wide.
  void set_soft(Index part, bool soft);
  /// @param told JSON, `type` and `limits` of the joints file. Another type keeps origin and axis
  /// @throws InputError naming the member
  void set_joint(Index joint, std::string_view told);
  /// Cuts a part in two, right across: what is beyond the cut, less of it by area, becomes the last part, on a ball (a
  /// virtual joint [X09 4.4]). The pose stays. @throws InvalidArgument where the stroke does not go right across the
  /// part
  void cut(Index part, const PoseStroke& stroke);
  /// @return false where there is nothing to take back
  bool undo();
  void reset();

  /// Some iterations towards the pose. @return whether it is found; else go on
  PoseResult solve();
  /// The session itself, for those who want more of it.
  const PosingSession& session() const;

  /// The pose as a model of its own, and its joints file (limber/posing/posed_model.h).
  std::string model_text() const;
  std::string joints_text() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
