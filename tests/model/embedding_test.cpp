#include "limber/model/embedding.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>

#include "asked.h"
#include "limber/core/error.h"
#include "limber/mesh/tet_locator.h"
#include "tet_box.h"

namespace limber {
namespace {

constexpr double kRoundOff = 1e-12;  // weights of well-shaped tets lose a few digits of 1e-16

/// nx × ny × nz cells of one size; inner nodes are moved by up to 0.15 of it on each axis, which keeps all tets
/// positive.
TetMesh jittered_box(int nx, int ny, int nz, double cell) {
  TetMesh mesh = testing::tet_box(nx, ny, nz, cell * Vec3(nx, ny, nz));
  std::mt19937 random(1);
  std::uniform_real_distribution<double> move(-0.15 * cell, 0.15 * cell);
  const Vec3 high = cell * Vec3(nx, ny, nz) - Vec3::Constant(0.5 * cell);
  for (Vec3& p : mesh.nodes)
    if (p.minCoeff() > 0.5 * cell && (high - p).minCoeff() > 0.0) p += Vec3(move(random), move(random), move(random));
  return mesh;
}

std::vector<Vec3> random_points(int count, const Vec3& low, const Vec3& high) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> u(0.0, 1.0);
  std::vector<Vec3> points;
  for (int i = 0; i < count; ++i)
    points.push_back(low + (high - low).cwiseProduct(Vec3(u(random), u(random), u(random))));
  return points;
}

/// Σ weight · value at the tet's nodes.
Vec3 interpolated(const EmbeddedVertex& v, const TetMesh& mesh, const auto& value) {
  Vec3 sum = Vec3::Zero();
  for (int a = 0; a < 4; ++a) sum += v.weight[a] * value(mesh.nodes[mesh.tets[v.tet][a]]);
  return sum;
}

Vec3 position(const Vec3& x) { return x; }

/// Some linear field with rotation, stretch and shear.
Vec3 linear_field(const Vec3& x) {
  Mat3 gradient;
  gradient << 0.3, -1.2, 0.4, 2.0, 0.1, -0.7, 0.5, 0.9, -0.2;
  return gradient * x + Vec3(3.0, -1.0, 0.5);
}

double sum(const std::array<double, 4>& w) { return w[0] + w[1] + w[2] + w[3]; }
double size(const std::array<double, 4>& w) {
  return std::max({std::abs(w[0]), std::abs(w[1]), std::abs(w[2]), std::abs(w[3])});
}

/// The distance from p to a tet by a second route: its squared distance is convex in the barycentric weights, and the
/// best of all sub-simplices (corners, edges, faces, the whole) whose unconstrained nearest point lies in them is it.
double distance_to_tet(const TetMesh& mesh, const Tet& tet, const Vec3& p) {
  double best = std::numeric_limits<double>::infinity();
  for (unsigned subset = 1; subset < 16; ++subset) {
    std::vector<Vec3> x;
    for (unsigned a = 0; a < 4; ++a)
      if (subset >> a & 1) x.push_back(mesh.nodes[tet[a]]);
    const auto n = static_cast<Eigen::Index>(x.size()) - 1;
    Eigen::MatrixXd edges(3, n);
    for (Eigen::Index i = 0; i < n; ++i) edges.col(i) = x[i + 1] - x[0];
    const Eigen::VectorXd w =
        n == 0 ? Eigen::VectorXd()
               : Eigen::VectorXd((edges.transpose() * edges).inverse() * (edges.transpose() * (p - x[0])));
    if (n > 0 && (w.minCoeff() < 0.0 || w.sum() > 1.0)) continue;
    best = std::min(best, (x[0] + (n == 0 ? Vec3(Vec3::Zero()) : Vec3(edges * w)) - p).norm());
  }
  return best;
}

TEST(TetLocator, FindsTheNearestTetThatTryingAllFinds) {
  const TetMesh mesh = jittered_box(4, 3, 5, 0.25);
  const TetLocator locator(mesh);
  for (const Vec3& p : random_points(testing::all_or_tenth(100), {-0.5, -0.5, -0.5}, {1.5, 1.25, 1.75})) {
    double expected = std::numeric_limits<double>::infinity();
    for (const Tet& t : mesh.tets) expected = std::min(expected, distance_to_tet(mesh, t, p));
    const TetLocation at = locator.locate(p);
    EXPECT_NEAR(at.distance, expected, kRoundOff);
    EXPECT_NEAR(distance_to_tet(mesh, mesh.tets[at.tet], p), expected, kRoundOff);
  }
}

TEST(TetLocator, SharedNodesAndFacesGoToTheLowestTet) {
  const TetMesh mesh = jittered_box(3, 3, 3, 1.0);
  const TetLocator locator(mesh);
  for (std::size_t n = 0; n < mesh.nodes.size(); ++n) {
    const auto uses = [&](const Tet& t) { return std::find(t.begin(), t.end(), static_cast<Index>(n)) != t.end(); };
    const auto first = std::find_if(mesh.tets.begin(), mesh.tets.end(), uses) - mesh.tets.begin();
    EXPECT_EQ(locator.locate(mesh.nodes[n]).tet, first);
  }
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    const Tet& c = mesh.tets[t];
    const Vec3 on_face = (mesh.nodes[c[0]] + mesh.nodes[c[1]] + mesh.nodes[c[2]]) / 3.0;
    EXPECT_LE(locator.locate(on_face).tet, static_cast<Index>(t));
  }
}

TEST(Embedding, IsExactForLinearFieldsInside) {
  const TetMesh mesh = jittered_box(4, 3, 5, 0.25);
  const auto points = random_points(1000, {0, 0, 0}, {1.0, 0.75, 1.25});
  const Embedding e = embed(points, mesh);
  EXPECT_EQ(e.outside, 0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_LT((interpolated(e.vertices[i], mesh, linear_field) - linear_field(points[i])).norm(), 10 * kRoundOff);
    EXPECT_GE(*std::min_element(e.vertices[i].weight.begin(), e.vertices[i].weight.end()), -kRoundOff);
  }
}

TEST(Embedding, IsExactForLinearFieldsUpToATetsSizeOutside) {
  // Tets of a grid are a cell high over the hull's faces, so half a cell outside is within the bound on weights.
  const TetMesh mesh = testing::tet_box(4, 3, 5, {1.0, 0.75, 1.25});
  std::vector<Vec3> points;
  for (const Vec3& p : random_points(1000, {0, 0, 0}, {1.0, 0.75, 1.25}))
    points.push_back({p.x(), p.y(), -0.1 * p.z()});
  const Embedding e = embed(points, mesh);
  EXPECT_EQ(e.outside, 1000);
  EXPECT_EQ(e.limited, 0);
  for (std::size_t i = 0; i < points.size(); ++i)
    EXPECT_LT((interpolated(e.vertices[i], mesh, linear_field) - linear_field(points[i])).norm(), 10 * kRoundOff);
}

TEST(Embedding, FarPointsHaveBoundedWeightsThatSumToOne) {
  const TetMesh mesh = jittered_box(4, 3, 5, 0.25);
  const auto points = random_points(1000, {-50, -50, -50}, {50, 50, 50});
  const Embedding e = embed(points, mesh);
  EXPECT_GT(e.limited, 900);
  EXPECT_GT(e.max_distance, 40.0);
  for (const EmbeddedVertex& v : e.vertices) {
    EXPECT_NEAR(sum(v.weight), 1.0, kRoundOff);
    EXPECT_LE(size(v.weight), kMaxEmbeddingWeight + kRoundOff);
  }
}

TEST(Embedding, ASliverOnTheHullDoesNotFlingAVertexAbout) {
  // A unit tet with a sliver a thousandth high on its face z = 0, and a vertex one tenth below: on the sliver's linear
  // field the weight of its flat corner would be in the hundreds.
  TetMesh mesh;
  mesh.nodes = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.3, 0.3, -1e-3}};
  mesh.tets = {{0, 1, 2, 3}, {0, 2, 1, 4}};
  mesh.tet_region = {0, 0};
  mesh.regions = {{"*", 0}};
  ASSERT_GT(signed_volume(mesh, 1), 0.0);
  const Vec3 vertex(0.3, 0.3, -0.1);
  const Embedding e = embed({&vertex, 1}, mesh);
  EXPECT_EQ(e.limited, 1);
  EXPECT_NEAR(e.max_distance, 0.099, kRoundOff);
  EXPECT_LE(size(e.vertices[0].weight), kMaxEmbeddingWeight + kRoundOff);
}

TEST(Embedding, NodesAreThemselves) {
  const TetMesh mesh = testing::tet_box(2, 2.0);
  std::vector<Index> nodes(mesh.nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) nodes[i] = static_cast<Index>(i);
  const Embedding e = embed_nodes(nodes, mesh);
  for (std::size_t i = 0; i < nodes.size(); ++i) EXPECT_EQ(interpolated(e.vertices[i], mesh, position), mesh.nodes[i]);
}

TEST(Embedding, WrongArgumentsAreNamed) {
  const TetMesh mesh = testing::tet_box(1, 1.0);
  const auto message = [](const auto& action) -> std::string {
    try {
      action();
    } catch (const InvalidArgument& e) {
      return e.what();
    }
    return "no error";
  };
  const std::vector<Vec3> points = {{0, 0, 0}, {0, std::numeric_limits<double>::quiet_NaN(), 0}};
  EXPECT_THAT(message([&] { embed(points, mesh); }), ::testing::HasSubstr("point 1 "));
  EXPECT_THAT(message([&] { embed(points, TetMesh{}); }), ::testing::HasSubstr("no tetrahedra"));
  const std::vector<Index> nodes = {8};
  EXPECT_THAT(message([&] { embed_nodes(nodes, mesh); }), ::testing::HasSubstr("node 8 is in no tetrahedron"));
}

}  // namespace
}  // namespace limber
