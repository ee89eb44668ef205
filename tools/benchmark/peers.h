/// @file peers.h
/// The same work in other engines: piles of rigid bodies in Box3D, Bullet and MuJoCo, and Bullet's reduced deformable
/// body on limber's own modes. Built only where the engines are found; for limber-benchmark alone.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "limber/core/rigid_transform.h"
#include "limber/core/types.h"
#include "limber/model/shape.h"

namespace limber::tools {

/// Boxes, balls and capsules above planes, all of one coefficient of friction, without rolling resistance.
struct RigidPile {
  struct Body {
    std::shared_ptr<const Shape> shape;
    RigidTransform pose;
    double mass = 0.0;            ///< kg
    Vec3 inertia = Vec3::Zero();  ///< principal, about the body's own axes, kg·m²
  };
  struct Plane {
    Vec3 normal = Vec3::UnitZ();
    double offset = 0.0;  ///< normal · x ≥ offset is free
  };
  std::vector<Body> bodies;
  std::vector<Plane> planes;
  double friction = 0.5, step = 1.0 / 60.0;  ///< step in s
  Vec3 gravity = {0.0, 0.0, -9.80665};       ///< m/s²
};

/// Cost and result of one step.
struct PileStep {
  double seconds = 0.0;  ///< of this thread
  int contacts = 0;
  double deepest = 0.0;  ///< overlap, m
};

/// Motion of a body, in the world.
struct PileMotion {
  RigidTransform pose{};
  Vec3 velocity = Vec3::Zero();          ///< of the body origin, m/s
  Vec3 angular_velocity = Vec3::Zero();  ///< rad/s
};

/// A pile in one engine. Nothing sleeps.
class PileEngine {
 public:
  virtual ~PileEngine() = default;
  virtual PileStep step() = 0;
  virtual PileMotion motion(std::size_t body) const = 0;
};

/// Nodes with lumped masses and modes that are orthonormal in them.
struct ReducedBody {
  std::vector<Vec3> nodes;               ///< about the centre of mass, m
  std::vector<double> masses;            ///< kg
  std::vector<Triangle> triangles;       ///< of the surface
  std::vector<Tet> tets;                 ///< none: the surface alone
  std::vector<double> eigenvalues;       ///< rad²/s²
  std::vector<std::vector<Vec3>> modes;  ///< one displacement a node, kg^−½
};

/// Copies of one body in a row, far enough apart.
struct ReducedRun {
  int bodies = 1, steps = 100;
  double step = 1.0 / 240.0;  ///< s
  bool on_ground = false;     ///< begins `above` the plane z = 0, under gravity; else flies without
  double damping = 0.0;       ///< stiffness-proportional, s
};
struct ReducedCost {
  double seconds = 0.0;   ///< a step of all bodies, median of the last half
  double contacts = 0.0;  ///< of a body, mean of the last half
  bool is_finite = true;
};

#if LIMBER_HAS_BOX3D
std::unique_ptr<PileEngine> box3d_pile(const RigidPile& pile);
#endif
#if LIMBER_HAS_BULLET
std::unique_ptr<PileEngine> bullet_pile(const RigidPile& pile);
ReducedCost run_bullet(const ReducedBody& body, const ReducedRun& run);
#endif
#if LIMBER_HAS_MUJOCO
std::unique_ptr<PileEngine> mujoco_pile(const RigidPile& pile);
#endif

}  // namespace limber::tools
