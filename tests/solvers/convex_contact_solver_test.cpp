// The convex problem of contacts, at the options at which islands run it: its potentials against their definition, its
// answer against Coulomb's law, and what holds where it ends early.
#include "limber/solvers/convex_contact_solver.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>
#include <random>
#include <vector>

namespace limber::internal {
namespace {

using Set = ContactPotential::Set;

constexpr ContactPotential kCone{.set = Set::kCone, .compliance = 2e-3, .bound = 0.6};
constexpr ContactPotential kBall{.set = Set::kBall, .compliance = 5e-2, .bound = 0.3};
constexpr ContactPotential kLimit{.set = Set::kInterval, .compliance = 1e-2, .lower = 0.0, .upper = 4.0};

Vec3 random_vector(std::mt19937& random, double size) {
  std::normal_distribution<double> normal(0.0, size);
  return {normal(random), normal(random), normal(random)};
}

/// −u·F − ½ c |F|², which the impulse makes greatest within its set.
double objective(const ContactPotential& p, const Vec3& u, const Vec3& F) {
  return -u.dot(F) - 0.5 * p.compliance * F.squaredNorm();
}

/// A force of the set, and the set's own numbers alone.
Vec3 within(const ContactPotential& p, std::mt19937& random) {
  std::uniform_real_distribution<double> part(0.0, 1.0);
  const Vec3 way = random_vector(random, 1.0).normalized();
  if (p.set == Set::kBall) return p.bound * std::cbrt(part(random)) * way;
  if (p.set == Set::kInterval) return {p.lower + part(random) * (p.upper - p.lower), 0.0, 0.0};
  const double normal = -50.0 * std::log(1.0 - part(random)), angle = 2.0 * std::numbers::pi * part(random);
  const double across = p.bound * normal * std::sqrt(part(random));
  return {normal, across * std::cos(angle), across * std::sin(angle)};
}

TEST(ContactPotential, IsTheGreatestValueOverItsSet) {
  std::mt19937 random(1);
  for (const ContactPotential& p : {kCone, kBall, kLimit})
    for (int trial = 0; trial < 300; ++trial) {
      const Vec3 u = random_vector(random, 10.0 * p.compliance);
      const ContactPotential::Value v = p.at(u);
      const Vec3 own = p.set == Set::kInterval ? Vec3(u[0], 0.0, 0.0) : u;
      EXPECT_NEAR(objective(p, own, v.impulse), v.potential, 1e-12 * (1.0 + std::abs(v.potential)));
      for (int i = 0; i < 200; ++i) EXPECT_LE(objective(p, own, within(p, random)), v.potential + 1e-12);
    }
}

TEST(ContactPotential, ItsImpulseLiesInItsSet) {
  std::mt19937 random(2);
  for (int trial = 0; trial < 1000; ++trial) {
    const Vec3 cone = kCone.at(random_vector(random, 0.02)).impulse;
    EXPECT_LE(cone.tail<2>().norm(), kCone.bound * cone[0] * (1.0 + 1e-14) + 1e-300);
    EXPECT_LE(kBall.at(random_vector(random, 0.02)).impulse.norm(), kBall.bound * (1.0 + 1e-14));
  }
}

TEST(ContactPotential, ImpulseAndStiffnessAreItsDerivatives) {
  std::mt19937 random(3);
  for (const ContactPotential& p : {kCone, kBall, kLimit}) {
    const int rows = p.set == Set::kInterval ? 1 : 3;
    const double h = 1e-7 * p.compliance;
    for (int trial = 0; trial < 300; ++trial) {
      const Vec3 u = random_vector(random, 3.0 * p.compliance);
      const ContactPotential::Value v = p.at(u);
      for (int i = 0; i < rows; ++i) {
        const Vec3 step = h * Vec3::Unit(i);
        const ContactPotential::Value up = p.at(u + step), down = p.at(u - step);
        EXPECT_NEAR((up.potential - down.potential) / (2.0 * h), -v.impulse[i], 1e-6);
        if ((up.stiffness - down.stiffness).norm() > 1e-3 * (1.0 + v.stiffness.norm())) continue;  // an edge between
        const Vec3 slope = (down.impulse - up.impulse) / (2.0 * h);
        EXPECT_LE((slope - v.stiffness.col(i)).head(rows).norm(), 1e-5 / p.compliance);
      }
    }
  }
}

/// A heap: bodies in a row, contacts between neighbours and with the ground, random rows.
struct Heap {
  Heap(int bodies, int contacts_each, unsigned seed, const std::vector<std::size_t>& order = {}) : random(seed) {
    solver.begin_structure();
    std::vector<std::size_t> nodes(static_cast<std::size_t>(bodies));
    for (int i = 0; i < bodies; ++i) {
      const std::size_t at = order.empty() ? static_cast<std::size_t>(i) : order[static_cast<std::size_t>(i)];
      nodes[at] = solver.add_node(kWidth);
    }
    for (int i = 0; i < bodies; ++i)
      for (int k = 0; k < contacts_each; ++k) {
        solver.add_unit(3, {.set = Set::kCone, .compliance = 1e-3 * kWidth, .bound = 0.5});
        sides.push_back({solver.add_side(nodes[static_cast<std::size_t>(i)])});
        if (i > 0) sides.back().push_back(solver.add_side(nodes[static_cast<std::size_t>(i - 1)]));
      }
    solver.end_structure();
    for (std::size_t u = 0; u < sides.size(); ++u) {
      for (const std::size_t side : sides[u]) {
        const MatrixView J = solver.values(side);
        for (std::size_t r = 0; r < 3; ++r)
          for (std::size_t c = 0; c < kWidth; ++c) J.row(r)[c] = normal(random);
      }
      solver.start(u) = random_vector(random, 1.0) - Vec3(0.5, 0.0, 0.0);
    }
  }
  static constexpr std::size_t kWidth = 6;
  std::mt19937 random;
  std::normal_distribution<double> normal{0.0, 1.0};
  ConvexContactSolver solver;
  std::vector<std::vector<std::size_t>> sides;
};

TEST(ConvexContacts, MotionIsThatOfTheImpulses) {
  Heap heap(30, 8, 4);
  ASSERT_EQ(heap.solver.solve({}).status, SolveStatus::kSolved);
  // y = Σ Jᵀ F, summed here by hand, to the tolerance of the solve.
  std::vector<std::vector<double>> sum(30, std::vector<double>(Heap::kWidth, 0.0));
  double error = 0.0, size = 0.0;
  for (std::size_t u = 0; u < heap.sides.size(); ++u)
    for (std::size_t s = 0; s < heap.sides[u].size(); ++s) {
      const MatrixView J = heap.solver.values(heap.sides[u][s]);
      const std::size_t body = u / 8 - s;
      for (std::size_t c = 0; c < Heap::kWidth; ++c)
        for (std::size_t r = 0; r < 3; ++r) sum[body][c] += J.row(r)[c] * heap.solver.impulse(u)[static_cast<int>(r)];
    }
  for (std::size_t b = 0; b < sum.size(); ++b)
    for (std::size_t c = 0; c < Heap::kWidth; ++c) {
      const double y = heap.solver.motion(b)[c];
      error += (y - sum[b][c]) * (y - sum[b][c]), size += y * y;
    }
  EXPECT_LE(std::sqrt(error), 1e-9 * std::sqrt(size));
}

TEST(ConvexContacts, SlidingContactsAreBrakedAgainstTheirSlip) {
  Heap heap(30, 8, 5);
  ASSERT_EQ(heap.solver.solve({.tolerance = 1e-12}).status, SolveStatus::kSolved);
  int sliding = 0, sticking = 0, open = 0;
  for (std::size_t u = 0; u < heap.sides.size(); ++u) {
    const Vec3 F = heap.solver.impulse(u), slip = heap.solver.end(u) + heap.solver.potential(u).compliance * F;
    const double most = 0.5 * F[0];
    if (F[0] == 0.0) {
      EXPECT_GE(heap.solver.end(u)[0], 0.0);
      ++open;
    } else if (F.tail<2>().norm() < (1.0 - 1e-9) * most) {  // the spring alone gives
      EXPECT_LE(slip.norm(), 1e-9);
      ++sticking;
    } else {  // along the cone: the normal of its face
      EXPECT_NEAR(F.tail<2>().dot(slip.tail<2>()), -most * slip.tail<2>().norm(), 1e-9);
      EXPECT_NEAR(slip[0], 0.5 * slip.tail<2>().norm(), 1e-9);
      ++sliding;
    }
  }
  EXPECT_GT(sliding, 10);
  EXPECT_GT(sticking, 10);
  EXPECT_GT(open, 10);
}

TEST(ConvexContacts, EveryIterationLowersTheProblem) {
  double last = std::numeric_limits<double>::infinity();
  for (int most = 0; most < 12; ++most) {
    Heap heap(40, 10, 6);
    heap.solver.solve({.max_iterations = most});
    double value = 0.0;
    for (std::size_t b = 0; b < 40; ++b)
      for (const double y : heap.solver.motion(b)) value += 0.5 * y * y;
    for (std::size_t u = 0; u < heap.sides.size(); ++u)
      value += heap.solver.potential(u).at(heap.solver.end(u)).potential;
    EXPECT_LE(value, last * (1.0 + 1e-12)) << most;
    last = value;
  }
}

TEST(ConvexContacts, AnswerDoesNotDependOnTheOrderOfBodies) {
  std::vector<std::size_t> backwards(30);
  for (std::size_t i = 0; i < backwards.size(); ++i) backwards[i] = backwards.size() - 1 - i;
  Heap one(30, 8, 7), other(30, 8, 7, backwards);
  one.solver.solve({.tolerance = 1e-12});
  other.solver.solve({.tolerance = 1e-12});
  for (std::size_t u = 0; u < one.sides.size(); ++u)
    EXPECT_LE((one.solver.impulse(u) - other.solver.impulse(u)).norm(), 1e-9 * (1.0 + one.solver.impulse(u).norm()));
}

TEST(ConvexContacts, ManyContactsOfOneBodyShareOneLoad) {
  // A hundred equal contacts: as one with a hundredth of the compliance.
  constexpr int kContacts = 100;
  ConvexContactSolver solver;
  solver.begin_structure();
  const std::size_t body = solver.add_node(1);
  std::vector<std::size_t> sides;
  for (int i = 0; i < kContacts; ++i) {
    solver.add_unit(1, {.set = Set::kInterval, .compliance = 1e-3, .lower = 0.0, .upper = 1e30});
    sides.push_back(solver.add_side(body));
  }
  solver.end_structure();
  for (std::size_t u = 0; u < sides.size(); ++u) solver.values(sides[u]).row(0)[0] = 1.0, solver.start(u)[0] = -1.0;
  ASSERT_EQ(solver.solve({.tolerance = 1e-13}).status, SolveStatus::kSolved);
  for (std::size_t u = 0; u < sides.size(); ++u) EXPECT_NEAR(solver.impulse(u)[0], 1.0 / (1e-3 + kContacts), 1e-13);
}

}  // namespace
}  // namespace limber::internal
