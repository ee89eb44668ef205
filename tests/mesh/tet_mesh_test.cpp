#include "limber/mesh/tet_mesh.h"

#include <gmock/gmock.h>

#include "limber/core/error.h"
#include "limber/mesh/surface_mesh.h"
#include "same_mesh.h"
#include "sample_meshes.h"

namespace limber {
namespace {

using namespace samples;
using ::testing::HasSubstr;

// Sums over 144 tets: 144 ε = 3e-14, and moments about a corner are three times those about the centre.
constexpr double kSumRoundOff = 1e-13;

void move(TetMesh& mesh, const Mat3& A, const Vec3& b) {
  for (Vec3& x : mesh.nodes) x = A * x + b;
}

Mat3 rotation() { return Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()).toRotationMatrix(); }

TEST(VolumeProperties, OfABoxAreThoseOfTheClosedForm) {
  const auto p = volume_properties(block(2, 3, 4, 0.5));  // 1 × 1.5 × 2 m
  EXPECT_NEAR(p.volume, 3.0, 3.0 * kSumRoundOff);
  EXPECT_LT((p.centroid - Vec3(0.5, 0.75, 1.0)).norm(), 2 * kSumRoundOff);
  const Vec3 sides(1.0, 1.5, 2.0);
  const Mat3 expected = (3.0 / 12.0 * sides.cwiseAbs2()).asDiagonal();  // V a²/12 about the centre
  EXPECT_LT((p.second_moment - expected).norm(), expected.norm() * kSumRoundOff);
}

TEST(VolumeProperties, TurnWithTheBodyAndDoNotFeelADistantOrigin) {
  auto mesh = block(2, 3, 4, 0.5);
  const auto before = volume_properties(mesh);
  const Mat3 R = rotation();
  const Vec3 far(1e6, -2e6, 3e6);
  move(mesh, R, far);
  const auto after = volume_properties(mesh);
  // Coordinates of 4e6 m carry an error of 4e6 ε, against sides of 1 m.
  constexpr double kCoordinateRoundOff = 4e6 * 2.2e-16 * 10;
  EXPECT_NEAR(after.volume, before.volume, kCoordinateRoundOff);
  EXPECT_LT((after.centroid - (R * before.centroid + far)).norm(), kCoordinateRoundOff);
  EXPECT_LT((after.second_moment - R * before.second_moment * R.transpose()).norm(), kCoordinateRoundOff);
}

TEST(VolumeProperties, SecondMomentOfATetAgreesWithQuadratureExactForSquares) {
  TetMesh mesh;
  mesh.nodes = {{0.1, 0, 0}, {1.3, 0.2, 0}, {0.3, 0.9, 0.1}, {0.2, 0.3, 1.1}};
  mesh.tets = {{0, 1, 2, 3}};
  const auto p = volume_properties(mesh);
  // Four points at (a, b, b, b) and its permutations, equal weights: exact to degree 2.
  const double b = (5.0 - std::sqrt(5.0)) / 20.0, a = 1.0 - 3.0 * b;
  Mat3 expected = Mat3::Zero();
  for (int k = 0; k < 4; ++k) {
    Vec3 x = Vec3::Zero();
    for (int i = 0; i < 4; ++i) x += (i == k ? a : b) * mesh.nodes[i];
    expected += p.volume / 4.0 * (x - p.centroid) * (x - p.centroid).transpose();
  }
  EXPECT_LT((p.second_moment - expected).norm(), expected.norm() * kSumRoundOff);
}

TEST(Boundary, OfABlockIsClosedLooksOutwardAndEnclosesItsVolume) {
  auto mesh = block(2, 3, 4, 0.5);
  move(mesh, rotation(), Vec3(3, 2, 1));
  const auto boundary = boundary_surface(mesh);
  const auto quality = surface_quality(boundary.surface);
  EXPECT_TRUE(quality.closed_manifold());
  EXPECT_EQ(quality.components, 1);
  EXPECT_EQ(boundary.surface.triangles.size(), 2u * 2 * (2 * 3 + 3 * 4 + 4 * 2));
  EXPECT_NEAR(enclosed_volume(boundary.surface), 3.0, 10 * kSumRoundOff);  // positive: seen from outside
  for (std::size_t v = 0; v < boundary.node_of.size(); ++v)
    EXPECT_EQ(boundary.surface.vertices[v], mesh.nodes[boundary.node_of[v]]);
}

TEST(Boundary, LeavesInnerNodesOut) {
  const auto boundary = boundary_surface(block(2, 2, 2, 1.0));
  EXPECT_EQ(boundary.node_of.size(), 26u);  // all but the middle one
  EXPECT_THAT(boundary.node_of, ::testing::Not(::testing::Contains(13)));
}

TEST(Components, AreTetsThatShareANode) {
  auto mesh = block(1, 1, 1, 1.0);
  const auto add = [&](const Vec3& offset) {
    const auto first = static_cast<Index>(mesh.nodes.size());
    const auto other = block(1, 1, 1, 1.0);
    for (const Vec3& x : other.nodes) mesh.nodes.push_back(x + offset);
    for (Tet t : other.tets) {
      for (Index& n : t) n += first;
      mesh.tets.push_back(t);
      mesh.tet_region.push_back(0);
    }
  };
  add({5, 0, 0});
  EXPECT_THAT(connected_components(mesh), ::testing::ElementsAreArray({0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1}));
  for (Tet& t : mesh.tets)
    for (Index& n : t)
      if (n == 8) n = 7;  // one node in common: one body
  EXPECT_THAT(connected_components(mesh), ::testing::Each(0));
}

TEST(Components, PartsJoinedAtANodeOrAnEdgeAreOneBodyButTwoParts) {
  TetMesh mesh;
  mesh.nodes = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-1, 0, 0}, {0, -1, 0}, {0, 0, -1}, {1, 1, 1}};
  mesh.tets = {{0, 1, 2, 3}, {0, 4, 5, 6}, {1, 2, 3, 7}};  // the second shares a node with the first, the third a face
  EXPECT_THAT(connected_components(mesh), ::testing::ElementsAre(0, 0, 0));
  EXPECT_THAT(face_connected_parts(mesh), ::testing::ElementsAre(0, 1, 0));
  mesh.tets[1] = {0, 1, 5, 6};  // now an edge
  EXPECT_THAT(face_connected_parts(mesh), ::testing::ElementsAre(0, 1, 0));
}

TEST(Components, TakenOutCarryTheirRegionsAndGroups) {
  TetMesh mesh = two_cubes();
  std::vector<Index> upper(mesh.tets.size());
  for (std::size_t i = 0; i < upper.size(); ++i) upper[i] = mesh.tet_region[i];
  const auto part = extract_component(mesh, upper, 1);
  EXPECT_THAT(part.node_of, ::testing::ElementsAre(4, 5, 6, 7, 8, 9, 10, 11));
  EXPECT_THAT(part.tet_of, ::testing::ElementsAre(6, 7, 8, 9, 10, 11));
  EXPECT_THAT(part.mesh.tet_region, ::testing::Each(1));
  ASSERT_EQ(part.mesh.node_groups.size(), 2u);                                      // the floor has no node here
  EXPECT_THAT(part.mesh.node_groups[0].nodes, ::testing::ElementsAre(0, 1, 2, 3));  // of region 21: the shared face
  for (std::size_t i = 0; i < part.mesh.tets.size(); ++i)
    EXPECT_DOUBLE_EQ(signed_volume(part.mesh, static_cast<Index>(i)), signed_volume(mesh, part.tet_of[i]));
  EXPECT_THROW(extract_component(mesh, std::vector<Index>(3), 0), InvalidArgument);
}

TEST(Validate, TurnsLeftHandedTetsAndSaysHowMany) {
  TetMesh mesh = two_cubes();
  std::swap(mesh.tets[2][0], mesh.tets[2][1]);
  std::swap(mesh.tets[7][1], mesh.tets[7][3]);
  Warnings warnings;
  validate(mesh, "\"m\"", warnings);
  EXPECT_THAT(warnings, ::testing::ElementsAre(HasSubstr("\"m\": 2 of 12 tetrahedra were left-handed")));
  for (Index i = 0; i < 12; ++i) EXPECT_GT(signed_volume(mesh, i), 0.0);
  EXPECT_NEAR(volume_properties(mesh).volume, 0.002, 0.002 * kSumRoundOff);
}

TEST(Validate, NamesTheFirstWrongElement) {
  const auto message_of = [](TetMesh mesh) {
    Warnings warnings;
    try {
      validate(mesh, "\"m\"", warnings);
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  TetMesh mesh = two_cubes();
  mesh.nodes[12][1] = std::numeric_limits<double>::infinity();  // even of a node that no tet uses
  EXPECT_THAT(message_of(mesh), HasSubstr("\"m\": node 12 (counted from 0)"));
  mesh = two_cubes();
  mesh.tets[4][3] = 13;
  EXPECT_THAT(message_of(mesh), HasSubstr("tetrahedron 4"));
  mesh = two_cubes();
  mesh.tets[5][3] = mesh.tets[5][0];
  EXPECT_THAT(message_of(mesh), HasSubstr("names node 0 twice"));
  mesh = two_cubes();
  mesh.nodes[7][2] = mesh.nodes[7][1] = 0.0;  // (h, 0, 0): on node 1
  EXPECT_THAT(message_of(mesh), HasSubstr("is flat: volume 0 m^3"));
  mesh = two_cubes();
  mesh.tets.push_back({mesh.tets[7][1], mesh.tets[7][2], mesh.tets[7][0], mesh.tets[7][3]});
  mesh.tet_region.push_back(mesh.tet_region[7]);
  EXPECT_THAT(message_of(mesh), HasSubstr("has the nodes of tetrahedron 7 again"));
  mesh = two_cubes();
  mesh.tet_region.pop_back();
  EXPECT_THAT(message_of(mesh), HasSubstr("11 region indices for 12 tetrahedra"));
  mesh = two_cubes();
  mesh.node_groups[0].nodes.push_back(99);
  EXPECT_THAT(message_of(mesh), HasSubstr("node group \"21\" names node 99"));
}

TEST(Validate, CallsATetFlatByItsShapeNotItsSize) {
  Warnings warnings;
  TetMesh tiny = two_cubes();
  move(tiny, 1e-80 * Mat3::Identity(), Vec3::Zero());  // cubes of edges still above the smallest double
  validate(tiny, "\"m\"", warnings);
  TetMesh thin = block(1, 1, 1, 1.0);
  move(thin, Vec3(1, 1, 1e-13).asDiagonal(), Vec3::Zero());
  EXPECT_THROW(validate(thin, "\"m\"", warnings), InputError);
  TetMesh slim = block(1, 1, 1, 1.0);
  move(slim, Vec3(1, 1, 1e-11).asDiagonal(), Vec3::Zero());
  validate(slim, "\"m\"", warnings);
  EXPECT_THAT(warnings, ::testing::IsEmpty());
}

}  // namespace
}  // namespace limber
