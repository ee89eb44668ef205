// The contacts of an island as one unconstrained convex problem, in the bodies' degrees of freedom:
//
//   min over y   ½ |y|² + Σ_c l_c(u_c + J_c y)                                                                     (1)
//
// y is what contacts change about the motion of the step, scaled so that its mass matrix is 1; u_c is where a contact
// would be at the end of the free step, less what it asks for; l_c is the potential of a spring whose impulse stays in
// a set (contact_potential.h). At the minimum y = Σ J_cᵀ F_c, so that (1) is the complementarity problem of the
// contacts with their compliance.
//
// Newton's method: (1 + Σ J_cᵀ ∇²l_c J_c) d = −∇, factored in blocks by body (block_factor.h), with an exact search
// along d, which needs u_c and J_c d alone. It converges from everywhere, as (1) is strongly convex with a Lipschitz
// gradient. Only pairs of bodies that have pressed on each other have a block: most contacts of a fall are found ahead
// and exert nothing. The order of elimination is kept from problem to problem while no other pair presses. It ends
// where no unit is farther off than its tolerance, or than what rounding u makes of F = −u/c.
//
// Energy: with rows linear in the step the bodies gain  Σ l_c(u⁰_c) − l_c(u_c) − ½|y|²  at most, u⁰ being the start of
// the step: what springs had stored. This needs y as it is, not F: a solve that ends early is still safe by y.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "limber/solvers/aligned_buffer.h"
#include "limber/solvers/block_factor.h"
#include "limber/solvers/contact_potential.h"
#include "limber/solvers/solve_status.h"

namespace limber::internal {

struct ConvexContactOptions {
  double tolerance = 1e-9;   ///< of the residual, > 0
  int max_iterations = 100;  ///< of Newton's method
};

struct ConvexContactReport {
  SolveStatus status = SolveStatus::kSolved;  ///< kIterationLimit: y is the best motion found
  int iterations = 0;
  double residual = 0.0;  ///< the farthest that ∇, as a motion, moves a unit, in units of the unit's tolerance
};

class ConvexContactSolver {
 public:
  // Built in this order: nodes, units with their sides, end_structure(), then values, then starts, potentials and
  // impulses.
  void begin_structure();
  /// Degrees of freedom of one body. @return its number
  std::size_t add_node(std::size_t width);
  /// The next contact, of one or three rows. @param tolerance of u_c, > 0. @return its number
  std::size_t add_unit(std::size_t rows, const ContactPotential& potential, double tolerance = 1.0);
  /// What the last unit's rows see of a node. @return the side's number
  std::size_t add_side(std::size_t node);
  /// All values are zero. Memory grows to the largest problem seen.
  void end_structure();

  /// J_c of a side, row by row: rows of its unit × the node's width.
  MatrixView values(std::size_t side);
  /// y of the impulses given.
  void set_motion();
  /// J_c y
  Vec3 moved(std::size_t unit);
  /// |J_c|² row by row: how far a unit impulse of each moves its own row.
  Vec3 response(std::size_t unit) const;
  /// u_c, as many numbers as the unit has rows.
  Vec3& start(std::size_t unit) { return units_[unit].start; }
  /// F_c: a guess before solve(), what was found after it.
  Vec3& impulse(std::size_t unit) { return units_[unit].impulse; }
  const Vec3& impulse(std::size_t unit) const { return units_[unit].impulse; }
  /// u_c + J_c y, after solve().
  const Vec3& end(std::size_t unit) const { return units_[unit].end; }
  ContactPotential& potential(std::size_t unit) { return units_[unit].potential; }

  /// Before the first solve_on(), once values are there; solve() does it.
  void begin();
  /// From the impulses given, or from the free motion where (1) is less there.
  ConvexContactReport solve(const ConvexContactOptions& options);
  /// Goes on from y, after potentials or starts were changed.
  ConvexContactReport solve_on(const ConvexContactOptions& options);
  /// y of a node, after solve().
  std::span<const double> motion(std::size_t node) { return part_of(y_, node); }

 private:
  struct Node {
    std::size_t width = 0, first = 0;
    double reach = 0.0;  // the largest of its units, in units of their tolerance
  };
  struct Unit {
    std::size_t rows = 0, first_side = 0, sides = 0;
    ContactPotential potential{};
    double tolerance = 1.0, reach = 0.0;                                   // how far y = 1 moves it at most
    Vec3 start = Vec3::Zero(), end = Vec3::Zero(), change = Vec3::Zero();  // u⁰, u, J d
    Vec3 impulse = Vec3::Zero();
    Mat3 stiffness = Mat3::Zero();
    bool acts = false;
    bool has_pressed = false;    // in this problem
    BlockFactor::Block block{};  // of its pair, where it has two sides and has pressed
  };
  using Pair = std::pair<std::size_t, std::size_t>;
  /// Of Newton's method, one row for each node and a block for each pair that has pressed.
  struct Blocks {
    void place();  // in a new structure, if that of the factor lacks a pair
    BlockFactor factor;
    std::vector<std::size_t> widths, factor_widths;
    std::vector<Pair> pairs, factor_pairs;  // sorted
  };

  std::span<double> part_of(AlignedBuffer& vector, std::size_t node) {
    return {vector.data() + nodes_[node].first, nodes_[node].width};
  }
  MatrixView jacobian(std::size_t side) const;
  void find_seen(const double* y);
  Vec3 seen_by(const Unit& unit) const;
  void add_impulses(double* y);
  void begin_with_better_start();
  struct Gradient {
    double residual = 0.0;   // as reported
    double round_off = 0.0;  // of that, what may be round-off
  };
  Gradient gradient();
  void find_reaches();
  void find_ends(const double* y);
  Pair pair_of(const Unit& unit) const;
  void place_pairs();
  void assemble();
  void list_product(const Unit& unit, std::size_t a, std::size_t b, const BlockFactor::Block& block);
  void find_direction(const double* g, double* d);
  ContactPotential::Slope slope_at(double step, double yd, double dd) const;
  double best_step(double slope_at_start) const;
  double potential_of(const double* y);

  std::vector<Node> nodes_;
  std::vector<Unit> units_;
  std::vector<RowBlock> sides_;       // their rows, in `values_` and in vectors of the nodes
  std::vector<std::size_t> node_of_;  // by side
  std::vector<Congruence> products_;  // of the units that act
  std::size_t numbers_ = 0, size_ = 0;
  AlignedBuffer values_, y_, d_, gradient_, ordered_, by_side_;
  Blocks blocks_;
  bool pairs_are_new_ = true;  // a unit has pressed whose block has not been looked up
};

}  // namespace limber::internal
