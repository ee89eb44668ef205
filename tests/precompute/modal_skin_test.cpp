#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <random>

#include "limber/model/skin_pose.h"
#include "skinned_bodies.h"

namespace limber {
namespace {

using namespace limber::testing;

/// The body that a claim is looked at on.
struct Case {
  const char* name;
  TetMesh (*mesh)();
  bool held;
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

std::unique_ptr<SkinnedBody> skinned(const Case& c) {
  TetMesh mesh = c.mesh();
  std::vector<Index> fixed = c.held ? nodes_at_zero_x(mesh) : std::vector<Index>{};
  return limber::testing::skinned(std::move(mesh), std::move(fixed), 20, 16);
}

/// All modes at once, each with the same energy, so that some handle turns by an angle.
std::vector<double> mixed(const SkinnedBody& b, double angle, int seed) {
  std::mt19937 random(static_cast<std::mt19937::result_type>(seed));
  std::vector<double> z;
  for (const double lambda : b.body->eigenvalues)
    z.push_back((static_cast<double>(random() % 2001) - 1000.0) / 1000.0 / std::sqrt(lambda));
  SkinPose pose(b.skin.skin);
  pose.set(z);
  const double scale = angle / pose.largest_angle();
  for (double& x : z) x *= scale;
  return z;
}

std::vector<double> sum(std::span<const double> a, double s, std::span<const double> b) {
  std::vector<double> out;
  for (std::size_t i = 0; i < a.size(); ++i) out.push_back(a[i] + s * b[i]);
  return out;
}

class Skins : public ::testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Bodies, Skins,
                         ::testing::Values(Case{"bar", flat_bar, true}, Case{"free_bar", flat_bar, false},
                                           Case{"angle", angle_piece, true}, Case{"free_fork", fork_piece, false},
                                           Case{"fork", fork_piece, true},
                                           Case{"plate", [] { return curled_plate(24, 10, 2); }, true}),
                         [](const auto& tested) { return std::string(tested.param.name); });

TEST_P(Skins, DerivativeIsThatOfThePositions) {
  const auto b = skinned(GetParam());
  SkinPose pose(b->skin.skin);
  for (const double angle : {0.02, 1.0, 3.0}) {
    const std::vector<double> z = mixed(*b, angle, 1), dz = mixed(*b, 1.0, 2);
    pose.set(z);
    pose.differentiate();
    constexpr double kStep = 1e-4;  // error of the difference: its fourth power, and round-off over it
    const auto above = b->places(sum(z, kStep, dz)), below = b->places(sum(z, -kStep, dz));
    const auto far_above = b->places(sum(z, 2.0 * kStep, dz)), far_below = b->places(sum(z, -2.0 * kStep, dz));
    std::vector<Vec3> rates(above.size());
    double scale = 0.0;
    for (std::size_t v = 0; v < above.size(); ++v) {
      rates[v] = (8.0 * (above[v] - below[v]) - (far_above[v] - far_below[v])) / (12.0 * kStep);
      scale = std::max(scale, rates[v].norm());
    }
    for (std::size_t v = 0; v < above.size(); v += 7) {
      const Vec3 f = Vec3(0.3, -0.8, 0.5);
      std::vector<double> g(z.size(), 0.0);
      const Vec3 by_modes = pose.add_rows(b->skin.nodes[v], b->rest(v), b->linear(v, z), f, g);
      double rate = by_modes.dot(b->linear(v, dz));
      for (std::size_t i = 0; i < g.size(); ++i) rate += g[i] * dz[i];
      EXPECT_NEAR(rate, f.dot(rates[v]), 1e-9 * scale) << v << " at " << angle;
    }
  }
}

TEST_P(Skins, SmallAmplitudesMoveAsTheModesDo) {
  const auto b = skinned(GetParam());
  for (int seed = 1; seed < 4; ++seed) {
    double before = 0.0;
    for (const double angle : {1e-2, 1e-3, 1e-4}) {
      const std::vector<double> z = mixed(*b, angle, seed);
      const auto x = b->places(z);
      double error = 0.0, moved = 0.0;
      for (std::size_t v = 0; v < x.size(); ++v) {
        const Vec3 u = b->linear(v, z);
        error = std::max(error, (x[v] - b->rest(v) - u).norm());
        moved = std::max(moved, u.norm());
      }
      EXPECT_LE(error, angle * moved);
      if (before > 0.0) {
        EXPECT_NEAR(error / before, 1e-2, 1e-3);  // second order
      }
      before = error;
    }
  }
}

TEST_P(Skins, AtRestNothingMovesAndHeldNodesNeverDo) {
  const auto b = skinned(GetParam());
  const std::vector<double> none(static_cast<std::size_t>(b->modes()), 0.0);
  const auto still = b->places(none), bent = b->places(mixed(*b, 2.0, 5));
  for (std::size_t v = 0; v < still.size(); ++v)
    EXPECT_LE((still[v] - b->rest(v)).norm(), (b->fixed.empty() ? 1e-15 : 0.0) * b->size());
  for (const Index v : b->fixed) EXPECT_EQ(bent[static_cast<std::size_t>(v)], b->rest(static_cast<std::size_t>(v)));
}

TEST_P(Skins, FreeBodiesStayInTheirFrame) {
  for (const MassKind mass : {MassKind::kLumped, MassKind::kConsistent}) {
    const auto b = limber::testing::skinned(GetParam().mesh(), {}, 20, 16, mass);
    const SparseMatrix M = assemble_mass(b->mesh, b->materials, mass);
    for (const double angle : {0.5, 2.0, 10.0}) {
      const auto x = b->places(mixed(*b, angle, 3));
      Vec3 momentum = Vec3::Zero(), turn = Vec3::Zero();
      double total = 0.0;
      for (Index c = 0; c < M.size; ++c)
        for (Index e = M.column_start[c]; e < M.column_start[c + 1]; ++e) {
          momentum += M.value[e] * x[static_cast<std::size_t>(c)];
          turn += M.value[e] * b->rest(static_cast<std::size_t>(M.row[e])).cross(x[static_cast<std::size_t>(c)]);
          total += M.value[e];
        }
      EXPECT_LE(momentum.norm() / total, 1e-12 * b->size());
      EXPECT_LE(turn.norm() / total, 1e-12 * b->size() * b->size());
    }
  }
}

/// Moves a shape so that it lies as near to another as it can.
std::vector<Vec3> laid_on(const std::vector<Vec3>& shape, const std::vector<Vec3>& other) {
  const auto count = static_cast<Eigen::Index>(shape.size());
  const Eigen::Map<const Eigen::Matrix3Xd> from(shape[0].data(), 3, count), to(other[0].data(), 3, count);
  const Eigen::Matrix4d X = Eigen::umeyama(from, to, false);
  std::vector<Vec3> out;
  for (const Vec3& x : shape) out.push_back(X.block<3, 3>(0, 0) * x + X.block<3, 1>(0, 3));
  return out;
}

TEST_P(Skins, ShapesAreThoseOfRotationStrainWarping) {
  // Of the plate the lowest mode alone: twisting thin plates is what the map, and warping too, do worst.
  const bool thin = std::string(GetParam().name) == "plate";
  const auto b = skinned(GetParam());
  for (Index mode = 0; mode < (thin ? 1 : 2); ++mode) {
    const std::vector<double> z = turned_by(*b, mode, (GetParam().held ? 120.0 : 60.0) * kDegree);
    const auto shown = b->places(z);
    auto oracle = rotation_strain(*b, z);
    if (!GetParam().held) oracle = laid_on(oracle, shown);
    EXPECT_LE(largest_distance(shown, oracle) / b->size(), thin ? 0.006 : 0.005) << "mode " << mode;
  }
}

TEST_P(Skins, AnyAmplitudeStaysFiniteAndNear) {
  const auto b = skinned(GetParam());
  for (const double angle : {10.0, 100.0})
    for (const Vec3& x : b->places(turned_by(*b, 0, angle))) ASSERT_LE(x.norm(), 1.5 * b->size());
}

// A bar by itself ---------------------------------------------------------------------------------------------------

std::unique_ptr<SkinnedBody> held_bar(TetMesh mesh) {
  std::vector<Index> fixed = nodes_at_zero_x(mesh);
  return limber::testing::skinned(std::move(mesh), std::move(fixed), 20, 16);
}

/// The lowest mode that turns the tip about the bar more than across it.
Index first_twist(const SkinnedBody& b) {
  for (Index i = 0; i < b.modes(); ++i) {
    Vec3 turn = Vec3::Zero();
    std::vector<double> z(static_cast<std::size_t>(b.modes()), 0.0);
    z[static_cast<std::size_t>(i)] = 1.0;
    for (const Tet& t : b.mesh.tets)
      if (b.mesh.nodes[t[0]].x() > 7.0) turn += motion_of(b, t, z).turn();
    if (std::abs(turn.x()) > 10.0 * turn.tail<2>().norm()) return i;
  }
  return -1;
}

void expect_sound(const SkinnedBody& b, const std::vector<double>& z) {
  const auto x = b.places(z);
  EXPECT_NEAR(internal::shape_energy(*b.body, x) / b.modal_energy(z), 1.0, 0.05);
  EXPECT_NEAR(volume_of(b.mesh, x) / volume_of(b.mesh, b.mesh.nodes), 1.0, 0.015);
}

TEST(SkinOfABar, EnergyOfTheShapeIsThatOfTheModesAndTheVolumeStays) {
  const auto flat = held_bar(flat_bar());
  expect_sound(*flat, turned_by(*flat, 0, 120.0 * kDegree));
  const auto b = held_bar(mirrored_box(24, 4, 4, {8.0, 1.0, 1.0}));
  expect_sound(*b, turned_by(*b, 0, 120.0 * kDegree));
  ASSERT_GE(first_twist(*b), 0);
  expect_sound(*b, turned_by(*b, first_twist(*b), 180.0 * kDegree));
}

TEST(SkinOfABar, CentreLineIsTheCurveOfItsSlopesWithoutStretch) {
  // x' = cos φ, y' = sin φ, with φ(s) = w'(s) z from the nodes' displacements alone: bending without stretch in closed
  // form. Simpson's rule between planes of nodes is exact to 1e-4 here.
  const auto b = held_bar(flat_bar());
  const std::vector<double> z = turned_by(*b, 0, 90.0 * kDegree);
  const auto shown = b->places(z);
  const auto centre_at = [&](double s, const std::function<Vec3(std::size_t)>& value) {
    Vec3 sum = Vec3::Zero();
    int count = 0;
    for (std::size_t v = 0; v < b->mesh.nodes.size(); ++v)
      if (std::abs(b->mesh.nodes[v].x() - s) < 1e-9) sum += value(v), ++count;
    return Vec3(sum / count);
  };
  const double step = 10.0 / 30.0;
  std::vector<Vec3> u;
  for (int i = 0; i <= 30; ++i) u.push_back(centre_at(i * step, [&](std::size_t v) { return b->linear(v, z); }));
  const auto slope = [&](int i) {
    if (i == 0) return Vec3(Vec3::Zero());
    if (i == 30) return Vec3((3.0 * u[30] - 4.0 * u[29] + u[28]) / (2.0 * step));
    return Vec3((u[static_cast<std::size_t>(i) + 1] - u[static_cast<std::size_t>(i) - 1]) / (2.0 * step));
  };
  const auto tangent = [&](int i) {
    const Vec3 w = slope(i);
    const double angle = w.tail<2>().norm();
    return Vec3(std::cos(angle), angle == 0.0 ? 0.0 : w.y() / angle * std::sin(angle),
                angle == 0.0 ? 0.0 : w.z() / angle * std::sin(angle));
  };
  Vec3 curve = centre_at(0.0, [&](std::size_t v) { return b->rest(v); });
  for (int i = 2; i <= 30; i += 2) {
    curve += step / 3.0 * (tangent(i - 2) + 4.0 * tangent(i - 1) + tangent(i));
    const Vec3 at = centre_at(i * step, [&](std::size_t v) { return shown[v]; });
    EXPECT_LE((at - curve).norm(), 0.002 * 10.0) << i;
  }
}

TEST(SkinOfABar, MoreHandlesAreTakenWhereTurnsSpread) {
  const auto b = limber::testing::skinned(flat_bar(), nodes_at_zero_x(flat_bar()));
  EXPECT_LE(b->report.spread, 13.0 * kDegree);
  EXPECT_LE(b->report.handles, 16);
  const auto few = limber::testing::skinned(flat_bar(), nodes_at_zero_x(flat_bar()), 20, 4);
  EXPECT_EQ(few->report.handles, 4 + (few->report.ground ? 1 : 0));
  EXPECT_GT(few->report.spread, b->report.spread);
}

TEST(SkinOfABar, VerticesOfASurfaceHangOnTheHandlesOfTheirNodes) {
  const auto b = held_bar(flat_bar());
  std::vector<Index> nodes;
  for (std::size_t v = 0; v < b->mesh.nodes.size(); ++v) nodes.push_back(static_cast<Index>(v));
  const auto at_nodes = internal::surface_influences(b->skin, b->mesh, embed_nodes(nodes, b->mesh));
  EXPECT_EQ(at_nodes, b->skin.nodes);
  const auto inside = internal::surface_influences(
      b->skin, b->mesh, embed(std::vector<Vec3>{{5.1, 0.7, 0.4}, {0.01, 0.2, 0.9}, {10.5, 0.7, 0.4}}, b->mesh));
  for (const SkinInfluences& at : inside) EXPECT_EQ(at.weight[0] + at.weight[1] + at.weight[2] + at.weight[3], 1.0f);
}

}  // namespace
}  // namespace limber
