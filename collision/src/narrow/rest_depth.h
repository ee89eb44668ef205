// Where a point inside a deformed body is to leave it, told in the body's rest shape.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "limber/mesh/tet_locator.h"
#include "limber/model/modal_model.h"
#include "limber/model/skin_pose.h"
#include "narrow/surface_contacts.h"

namespace limber::internal {

// A node of the volume in one state, body frame: rest + Σ z_i w_i, or where the skin has it.
// @param skin at z; null: none
Vec3 deformed_node(const ModalVolume& volume, std::span<const double> z, const SkinPose* skin, Index node);

// What does not change: the model, and which tetrahedron of its rest shape holds a point.
class RestDepth {
 public:
  explicit RestDepth(std::shared_ptr<const ModalModel> model);
  const ModalVolume& volume() const { return *model_->data().volume_block; }
  const TetLocator& locator() const { return locator_; }
  const std::shared_ptr<const ModalModel>& model() const { return model_; }

 private:
  std::shared_ptr<const ModalModel> model_;
  TetLocator locator_;
};

// For one body in one state.
class RestDepthRule final : public OverlapRule, public SelfOverlapRule {
 public:
  // All are used until the next bind(). @param X_PB pose of the body in the pair's frame
  void bind(const RestDepth& rest, DeformedSurface& deformed, const RigidTransform& X_PB);
  bool exit(PairSurface& surface, const Vec3& p, const PairSurface::Nearest& nearest, Exit& exit) override;
  // It is where another point of the body is as well: the one found from the part that it is near.
  bool exit_of(Index v, PairSurface& surface, const FeatureSide& near, Exit& exit) override;

 private:
  struct Place {
    Vec3 rest;  // where the material point is at rest, body frame
    Mat3 F;     // deformation gradient there
  };
  void bind_rest(PairSurface& surface);
  bool find_at_rest(PairSurface& surface, const Vec3& p, Index triangle, const std::array<double, 3>& weight,
                    Place& place, PairSurface::Nearest& rest);
  bool carry_back(const Vec3& p_B, const Vec3& first_guess, Place& place) const;
  void lead_out(PairSurface& surface, const Place& place, const PairSurface::Nearest& rest, Exit& exit) const;

  const RestDepth* rest_ = nullptr;
  DeformedSurface* deformed_ = nullptr;
  RigidTransform X_PB_{};
  std::vector<double> zeros_;
  DeformedSurface at_rest_;
  PairSurface rest_surface_;
  bool rest_is_bound_ = false;
};

}  // namespace limber::internal
