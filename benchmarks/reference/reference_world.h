/// @file reference_world.h
/// Bodies of nodal elasticity that move: pushed, held, tied to each other, stopped by walls without friction.
///
///   M v½ = M v₋½ + Δt (f(x, t) + Jᵀλ),   x ← x + Δt v½,    0 ≤ λ ⊥ gap(x) ≥ 0 for walls, held and tied nodes in place
///
/// Central differences, second order in Δt, stable below 2/ω_max (stable_step). The reactions λ are those that bring
/// the nodes to where they belong at the step's end: exact for bilateral rows; a node that meets a wall stops there,
/// which costs its share of mass alone and so vanishes with the mesh.
#pragma once

#include <Eigen/SparseCholesky>
#include <functional>
#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

#include "nodal_elasticity.h"

namespace limber::testing {

/// The half-space in which the nodes of a body stay: sign · x[axis] ≥ offset.
struct Wall {
  int axis = 2;
  double sign = 1.0, offset = 0.0;
};

struct MovingBody {
  std::shared_ptr<const NodalElasticity> elasticity;
  NodeVectors x, v;  ///< places and velocities at first, m and m/s
  std::optional<Wall> wall{};
};

/// A force on one node from `start` to `end`, N.
struct NodeForce {
  std::size_t body = 0;
  Index node = 0;
  Vec3 force = Vec3::Zero();
  double start = 0.0, end = 0.0;  ///< s
};

/// A node that is led from where it is at `start`, by a way of its own, until `end`.
struct LedNode {
  std::size_t body = 0;
  Index node = 0;
  double start = 0.0, end = 0.0;      ///< s
  std::function<Vec3(double)> way{};  ///< of the time since `start`; zero at 0
};

/// Two nodes at one place.
struct Tie {
  std::size_t body_a = 0;
  Index node_a = 0;
  std::size_t body_b = 0;
  Index node_b = 0;
};

struct ReferenceScene {
  std::vector<MovingBody> bodies{};
  Vec3 gravity = Vec3::Zero();  ///< m/s²
  std::vector<NodeForce> forces{};
  std::vector<LedNode> led{};
  std::vector<Tie> ties{};
};

/// The step of central differences that is just stable at rest, 2/ω_max of M⁻¹K, s.
double stable_step(const NodalElasticity& elasticity);

class ReferenceWorld {
 public:
  explicit ReferenceWorld(ReferenceScene scene);
  ~ReferenceWorld();

  /// Goes on by `seconds` in equal steps, none longer than `longest`.
  void advance(double seconds, double longest);
  double time() const { return time_; }
  const Eigen::VectorXd& node_masses(std::size_t body) const { return scene_.bodies[body].elasticity->node_masses(); }
  const NodeVectors& places(std::size_t body) const { return scene_.bodies[body].x; }
  const NodeVectors& velocities(std::size_t body) const { return scene_.bodies[body].v; }  ///< half a step before
  /// Kinetic (of the mean of the velocities before and after), elastic and in gravity, J.
  double energy() const;
  Vec3 momentum() const;  ///< kg·m/s
  /// By all walls together, of the steps in which they gave any.
  struct WallImpulse {
    double time = 0.0, impulse = 0.0;  ///< s, at the step's end; N·s
  };
  const std::vector<WallImpulse>& wall_impulses() const { return wall_impulses_; }

 private:
  struct Row;
  class MassSolver;
  void step(double h);
  std::vector<Row> bilateral_rows(double h);
  void solve_rows(std::vector<Row>& rows, double h);
  void add_reaction(const Row& row, double impulse);
  void settle(std::vector<Row> rows, double h);
  double end_value(const Row& row, double h) const;

  ReferenceScene scene_;
  std::vector<std::unique_ptr<MassSolver>> masses_;
  std::vector<std::optional<Vec3>> led_from_;
  std::vector<WallImpulse> wall_impulses_;
  double time_ = 0.0, last_step_ = 0.0;
};

/// Implicit midpoint of one body without walls, sparse direct: M (v₁ − v)/Δt = f((x + x₁)/2), x₁ = x + Δt (v + v₁)/2,
/// by Newton's method. Second order in Δt, stable at any.
class MidpointBody {
 public:
  MidpointBody(std::shared_ptr<const NodalElasticity> elasticity, NodeVectors x, NodeVectors v);

  /// @param loads N on every node @return Newton steps taken
  int step(double h, const NodeVectors& loads);
  const NodeVectors& places() const { return x_; }
  const NodeVectors& velocities() const { return v_; }
  double energy() const;  ///< kinetic and elastic, J

 private:
  std::shared_ptr<const NodalElasticity> elasticity_;
  NodeVectors x_, v_;
  std::vector<int> free_;  // numbers of the free unknowns; −1: fixed
  int unknowns_ = 0;
  SparseDoubles mass_;  // of all unknowns, 3n × 3n
};

/// Places where the forces on all free nodes are balanced, found from x on: Newton's method with a line search. NaN
/// where it gives up.
NodeVectors equilibrium(const NodalElasticity& elasticity, NodeVectors x, const NodeVectors& loads);

}  // namespace limber::testing
