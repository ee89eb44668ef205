#include "limber/precompute/bake.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "limber/core/error.h"
#include "rubber_box.h"

namespace limber {
namespace {

using limber::testing::bake_box;
using limber::testing::kBoxSize;
using limber::testing::kRubber;
using limber::testing::kSteel;
using limber::testing::nodes_where;
using limber::testing::rubber;
using limber::testing::tet_box;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kRoundOff = 1e-12;
constexpr double kFloat = 4e-7;  // shapes are stored in single precision

std::shared_ptr<const ModalModel> only_body(const BakeResult& r) { return r.asset.bodies.at(0); }

template <class F>
std::string message_of(F&& action) {
  try {
    action();
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

NodesInBox face_at_zero_x() { return {{-1e-9, -1.0, -1.0}, {1e-9, 1.0, 1.0}}; }

TEST(Bake, FreeBoxHasTheMassCentreAndInertiaOfABox) {
  const BakeResult r = bake_box(rubber());
  const auto body = only_body(r);
  const ModalModelData& d = body->data();
  const double mass = kRubber.density * kBoxSize.prod();
  EXPECT_EQ(d.motion, FrameMotion::kFree);
  EXPECT_NEAR(d.mass, mass, kRoundOff * mass);
  EXPECT_LT((d.origin_in_input - kBoxSize / 2).norm(), kRoundOff);
  for (int a = 0; a < 3; ++a) {
    const double expected = mass / 12.0 * (kBoxSize.squaredNorm() - kBoxSize[a] * kBoxSize[a]);
    EXPECT_NEAR(d.inertia(a, a), expected, kRoundOff * expected);
  }
  EXPECT_EQ(r.bodies.at(0).freedom.zero_modes(), 6);
  EXPECT_TRUE(r.bodies.at(0).accuracy.certified);
}

TEST(Bake, AllModesOfAClampedBodyCarryAllItsFreeMass) {
  // Σ p_i p_iᵀ = Rᵀ M W Wᵀ M R: with every mode W Wᵀ = M⁻¹ on the free nodes, so the sum is their mass (lumped).
  BakeOptions o = rubber(10000);
  o.fixed = {face_at_zero_x()};
  const TetMesh mesh = tet_box(2, 1, 1, kBoxSize);
  const auto body = only_body(bake_box(o, mesh));
  const ModalModelData& d = body->data();
  EXPECT_EQ(d.motion, FrameMotion::kKinematic);
  Mat3 carried = Mat3::Zero();
  for (const Vec3& p : d.participation) carried += p * p.transpose();
  double free_mass = 0.0;
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    for (const Index n : mesh.tets[t])
      if (mesh.nodes[n].x() > 1e-9) free_mass += kRubber.density * signed_volume(mesh, static_cast<Index>(t)) / 4.0;
  EXPECT_LT((carried - free_mass * Mat3::Identity()).norm(), 1e-9 * free_mass);
}

TEST(Bake, FreeModesCarryNoAngularMomentum) {
  // ∫ρ x × w_i = 0, the antisymmetric part of the moments: modes are M-orthogonal to rotations.
  const auto body = only_body(bake_box(rubber()));
  const ModalModelData& d = body->data();
  for (const Mat3& m : d.moments) EXPECT_LT((m - m.transpose()).norm(), 1e-9 * std::sqrt(d.mass) * kBoxSize.norm());
}

TEST(Bake, OneHeldNodeIsAPivotTwoAreAHingeThreeAreAClamp) {
  const TetMesh mesh = tet_box(3, 2, 2, kBoxSize);
  BakeOptions o = rubber(4);
  o.fixed = {NodesByIndex{{0}}};
  const auto pivot_body = only_body(bake_box(o, mesh));
  const ModalModelData& pivot = pivot_body->data();
  EXPECT_EQ(pivot.motion, FrameMotion::kPoint);
  EXPECT_LT((pivot.origin_in_input - mesh.nodes[0]).norm(), kRoundOff);
  EXPECT_LT((pivot.center_of_mass - kBoxSize / 2).norm(), kRoundOff);
  // Parallel axes, about the corner: I_xx = m/3 (b² + c²).
  const double expected = pivot.mass / 3.0 * (kBoxSize.y() * kBoxSize.y() + kBoxSize.z() * kBoxSize.z());
  EXPECT_NEAR(pivot.inertia(0, 0), expected, kRoundOff * expected);

  o.fixed = {NodesByIndex{{0, 3}}};  // both on the x axis
  const auto hinge_body = only_body(bake_box(o, mesh));
  const ModalModelData& hinge = hinge_body->data();
  EXPECT_EQ(hinge.motion, FrameMotion::kLine);
  EXPECT_NEAR(std::abs(hinge.line_axis.x()), 1.0, kRoundOff);

  o.fixed = {NodesByIndex{{0}}, NodesByIndex{{3, 4}}};
  EXPECT_EQ(only_body(bake_box(o, mesh))->data().motion, FrameMotion::kKinematic);
}

TEST(Bake, RegionsHaveTheirOwnMaterials) {
  TetMesh mesh = tet_box(2, 1, 1, kBoxSize);
  mesh.regions = {{.name = "soft", .tag = 1}, {.name = "legs", .tag = 7}};
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) mesh.tet_region[t] = t < mesh.tets.size() / 2 ? 0 : 1;
  BakeOptions o = rubber(3);
  o.materials = {{"soft", kRubber}, {"7", kSteel}};
  const double half = kBoxSize.prod() / 2;
  const auto body = only_body(bake_box(o, mesh));
  const ModalModelData& d = body->data();
  EXPECT_NEAR(d.mass, half * (kRubber.density + kSteel.density), kRoundOff * d.mass);

  o.materials = {{"soft", kRubber}};
  EXPECT_THAT(message_of([&] { bake_box(o, mesh); }), HasSubstr("region \"legs\" (tag 7)"));
  o.materials = {{"*", kRubber}, {"leg", kSteel}};
  EXPECT_THAT(message_of([&] { bake_box(o, mesh); }), HasSubstr("no region \"leg\""));
}

/// Two boxes apart, with an unused node between them in the list.
TetMesh two_boxes() {
  TetMesh mesh = tet_box(2, 1, 1, kBoxSize), other = tet_box(1, 1, 1, kBoxSize);
  mesh.nodes.emplace_back(9.0, 9.0, 9.0);
  const auto offset = static_cast<Index>(mesh.nodes.size());
  for (const Vec3& x : other.nodes) mesh.nodes.push_back(x + Vec3(0.0, 1.0, 0.0));
  for (Tet t : other.tets) {
    for (Index& n : t) n += offset;
    mesh.tets.push_back(t);
    mesh.tet_region.push_back(0);
  }
  return mesh;
}

TEST(Bake, SeparateComponentsAreSeparateBodiesAndUnusedNodesAreDropped) {
  Warnings warnings;
  const BakeResult r = bake({.name = "pair", .mesh = two_boxes()}, rubber(4), warnings);
  ASSERT_EQ(r.bodies.size(), 2u);
  EXPECT_EQ(r.asset.bodies[0]->name(), "pair_1");
  EXPECT_EQ(r.bodies[0].mesh.nodes + r.bodies[1].mesh.nodes, 12 + 8);
  EXPECT_NEAR(r.bodies[1].solid.center_of_mass.y(), 1.0 + kBoxSize.y() / 2, kRoundOff);
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("1 of 21 nodes belong to no tetrahedron")));
}

TEST(Bake, ARenderSurfaceOfTwoBodiesIsDealtOutTriangleByTriangle) {
  const TetMesh mesh = two_boxes();
  Warnings warnings;
  const BakeResult r =
      bake({.name = "pair", .mesh = mesh, .render = boundary_surface(mesh).surface}, rubber(4), warnings);
  EXPECT_EQ(r.bodies[0].surfaces.render.vertices, 12);
  EXPECT_EQ(r.bodies[1].surfaces.render.vertices, 8);
  EXPECT_EQ(r.bodies[0].surfaces.render.outside + r.bodies[1].surfaces.render.outside, 0);

  SurfaceMesh half;  // covers the first box only
  half.vertices = {{0, 0, 0}, {0.3, 0, 0}, {0, 0.2, 0}};
  half.triangles = {{0, 1, 2}};
  EXPECT_THAT(message_of([&] { bake({.name = "pair", .mesh = mesh, .render = half}, rubber(4), warnings); }),
              HasSubstr("body 2 of 2"));
}

TEST(Bake, AnEmbeddedVertexMovesByInterpolation) {
  // A vertex at the middle of an edge of the mesh moves by the mean of its ends: compare with the boundary surface's
  // own.
  const TetMesh mesh = tet_box(3, 2, 2, kBoxSize);
  const BakeResult plain = bake_box(rubber(6), mesh);
  SurfaceMesh one;
  one.vertices = {mesh.nodes[0], mesh.nodes[1], (mesh.nodes[0] + mesh.nodes[1]) / 2};
  one.triangles = {{0, 1, 2}};
  Warnings warnings;
  const BakeResult embedded = bake({.name = "box", .mesh = mesh, .render = one}, rubber(6), warnings);
  const ModalSurface& s = only_body(embedded)->data().render;
  for (Index m = 0; m < 6; ++m) {
    const Vec3f mean = (s.basis.shape(0, m) + s.basis.shape(1, m)) / 2;
    EXPECT_LT((s.basis.shape(2, m) - mean).norm(), kFloat * s.basis.shape(0, m).norm());
    EXPECT_LT((s.basis.shape(0, m) - only_body(plain)->data().render.basis.shape(0, m)).norm(), kFloat * mean.norm());
  }
  EXPECT_TRUE(only_body(embedded)->data().collision.has_value()) << "a given render surface is not what touches";
}

TEST(Bake, VolumeBlockProjectsAShapeOntoItsOwnAmplitude) {
  BakeOptions o = rubber(5);
  o.volume_block = true;
  const auto body = only_body(bake_box(o));
  const ModalModelData& d = body->data();
  const ModalVolume& v = d.volume_block.value();
  for (Index i = 0; i < 5; ++i)
    for (Index j = 0; j < 5; ++j) {
      double z = 0.0;  // (W^T M W)_ij
      for (Index n = 0; n < static_cast<Index>(v.rest.size()); ++n)
        z += v.mass_times_basis.shape(n, i).cast<double>().dot(v.basis.shape(n, j).cast<double>());
      EXPECT_NEAR(z, i == j ? 1.0 : 0.0, 10 * kFloat);
    }
}

TEST(Bake, LimitsLeaveOutWhatTheSceneCannotShow) {
  BakeOptions o = rubber(20);
  const auto all = bake_box(o).bodies.at(0).modes.frequencies_hz;
  o.limits.frame_rate = all[6] + all[7];  // half of it lies between the seventh and the eighth
  const BodyReport r = bake_box(o).bodies.at(0);
  EXPECT_EQ(r.modes.selection.kept.size(), 7u);
  EXPECT_EQ(r.modes.selection.dropped.size(), all.size() - 7);
  for (const DroppedMode& m : r.modes.selection.dropped) EXPECT_EQ(m.reason, DropReason::kTooFast);
}

/// A collision surface where the first mode has its node moves less than the ends, which a strike can reach.
TEST(Bake, AModeIsKeptIfAStrikeOnTheRenderSurfaceCanShowItThoughContactsCannot) {
  SurfaceMesh small;  // one triangle on the axis, where a free beam's first bending mode is still; its torsion is too
  const Vec3 still(0.224 * kBoxSize.x(), 0.5 * kBoxSize.y(), 0.5 * kBoxSize.z());
  small.vertices = {still, still + Vec3(0.001, 0.0, 0.0), still + Vec3(0.0, 0.001, 0.0)};
  small.triangles = {{0, 1, 2}};
  BakeOptions o = rubber(1);
  const auto bake_with_small = [&](const BakeOptions& options) {
    Warnings warnings;
    return bake({.name = "box", .mesh = tet_box(3, 2, 2, kBoxSize), .collision = small}, options, warnings);
  };
  const auto body = only_body(bake_with_small(o));
  const auto largest = [](const ModalSurface& s) {
    double most = 0.0;
    for (Index v = 0; v < s.vertices(); ++v) most = std::max(most, static_cast<double>(s.basis.shape(v, 0).norm()));
    return most;
  };
  const double shown = largest(body->render()), touched = largest(body->collision());
  ASSERT_LT(touched, 0.5 * shown);
  // What a sudden force makes the mode show: 2 |w|·|w| F/λ. The limit lies between the two surfaces'.
  o.limits.max_force = 10.0;
  const double static_answer = 2.0 * o.limits.max_force * shown / body->data().eigenvalues[0];
  o.limits.min_displacement = static_answer * std::sqrt(shown * touched);
  EXPECT_EQ(only_body(bake_with_small(o))->modes(), 1);
  o.limits.min_displacement = 1.01 * static_answer * shown;
  EXPECT_EQ(only_body(bake_with_small(o))->modes(), 0);
}

TEST(RayleighDamping, HasTheRatioAskedForAtBothFrequencies) {
  const RayleighDamping d = RayleighDamping::from_ratio(0.03, 20.0, 300.0);
  for (const double hz : {20.0, 300.0}) {
    const double omega = 2.0 * std::numbers::pi * hz;
    EXPECT_NEAR((d.stiffness_proportional * omega + d.mass_proportional / omega) / 2.0, 0.03, kRoundOff);
  }
  EXPECT_THROW(RayleighDamping::from_ratio(-0.1, 20.0, 300.0), InvalidArgument);
  EXPECT_THROW(RayleighDamping::from_ratio(0.1, 0.0, 300.0), InvalidArgument);
}

TEST(NodeSelector, SelectsByGroupBoxAndNumber) {
  TetMesh mesh = tet_box(2, 1, 1, kBoxSize);
  mesh.node_groups = {{.name = "end", .nodes = {2, 5}}};
  EXPECT_THAT(select_nodes(mesh, parse_node_selector("group:end")), ElementsAre(2, 5));
  EXPECT_THAT(select_nodes(mesh, parse_node_selector("nodes:7,0,7")), ElementsAre(0, 7));
  EXPECT_EQ(select_nodes(mesh, parse_node_selector("box:-1e-9,-1,-1,1e-9,1,1")),
            nodes_where(mesh, [](const Vec3& x) { return x.x() == 0.0; }));
}

TEST(NodeSelector, RefusesWhatItCannotRead) {
  for (const char* text : {"", "end", "group:", "box:1,2,3", "box:0,0,0,1,1,x", "box:1,0,0,0,1,1", "box:nan,0,0,1,1,1",
                           "nodes:", "nodes:1,,2", "nodes:1.5", "nodes:99999999999", "sphere:1"})
    EXPECT_THAT(message_of([&] { parse_node_selector(text); }), HasSubstr("expected group:NAME")) << text;
  const TetMesh mesh = tet_box(1, 1, 1, kBoxSize);
  EXPECT_THAT(message_of([&] { select_nodes(mesh, NodesOfGroup{"end"}); }), HasSubstr("it has none"));
  EXPECT_THAT(message_of([&] { select_nodes(mesh, NodesByIndex{{8}}); }), HasSubstr("expected 0 to 7"));
  EXPECT_THAT(message_of([&] { select_nodes(mesh, NodesInBox{{5, 5, 5}, {6, 6, 6}}); }), HasSubstr("no node"));
}

}  // namespace
}  // namespace limber
