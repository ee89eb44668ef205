/// @file soak_scene.h
/// Fifteen flexible and rigid bodies in a pit, some of them jointed, and two hands that drag them about at random.
#pragma once

#include <optional>
#include <random>
#include <vector>

#include "limber/collision/contact_finder.h"
#include "limber/engine/world.h"
#include "soak_bodies.h"
#include "soak_laws.h"

namespace limber::testing {

/// Boxes, bars, bricks, balls and a capsule lie loose; three bars hang from the world on a hinge, a ball joint and a
/// hinge with limits. A hand takes a body by a point of its surface, leads it from place to place at up to 1.5 m/s,
/// lets go and takes another; it is a spring, or exact up to its largest force. The same seed makes the same run.
class SoakScene {
 public:
  SoakScene(const SoakBodies& bodies, unsigned seed, const ContactOptions& options = {});

  /// Tells the hands what to do, steps the world, and looks.
  /// @return valid until the next call
  const SoakStep& step();
  double seconds() const { return seconds_; }  ///< that the last step of the world took this thread
  const World& world() const { return world_; }

 private:
  struct Hand {
    std::optional<HandleId> handle{};
    BodyId body{};
    SurfacePoint at{};
    double max_force = 0.0;
    int left = 0;  // steps until it lets go, or takes hold
    Vec3 target = Vec3::Zero(), goal = Vec3::Zero();
  };

  struct Indented {
    BodyId id{};
    std::vector<SurfacePoint> vertices;
  };

  void make_pit();
  void add_loose(const SoakBodies& bodies);
  void hang_chain(const SoakBodies& bodies);
  BodyId add(std::shared_ptr<const ModalModel> model, const Vec3& at, std::shared_ptr<const Shape> shape = {});
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  int whole(int low, int high) { return std::uniform_int_distribution<int>(low, high)(random_); }
  void guide(Hand& hand);
  void take_hold(Hand& hand);
  void see_hands();
  void see_indentations();
  bool all_finite() const;
  double energy() const;

  ContactFinder finder_;
  World world_;
  std::mt19937 random_;
  std::vector<BodyId> bodies_;
  std::vector<JointId> joints_;
  std::vector<Hand> hands_;
  std::vector<SeenIndentation> indentations_;
  std::vector<Indented> indented_;  // of `indentations_`
  std::vector<SeenHand> seen_hands_;
  SoakStep seen_;
  double seconds_ = 0.0;
};

}  // namespace limber::testing
