#include "limber/collision/narrow_phase.h"

#include <gtest/gtest.h>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>
#include <vector>

#include "asked.h"
#include "block_model.h"
#include "contact_bodies.h"
#include "counted_new.h"
#include "limber/collision/closest_features.h"
#include "limber/core/error.h"
#include "narrow_phase_bodies.h"
#include "random_states.h"
#include "sample_models.h"
#include "shapes.h"
#include "solid_bodies.h"
#include "wavy_model.h"

namespace limber {
namespace {

using testing::Body;
using testing::contacts_of;
using testing::expect_well_formed;
using testing::index_of;
using testing::is_kind;
using testing::key_of;
using testing::kGap;
using testing::lumpy_sphere;
using testing::nearest_distance;
using testing::point_a;
using testing::point_b;
using testing::Random;
using testing::rigid;

TEST(NarrowPhase, ABodyWithinAnotherIsFoundThoughNoTrianglesMeet) {
  Body outer(testing::wavy_model(shapes::sphere(Vec3::Zero(), 1.0, 2), 0));
  Body inner(testing::wavy_model(shapes::sphere(Vec3::Zero(), 0.2, 1), 0));
  outer.place({}), inner.place({.p = {0.3, 0.1, 0.0}});
  const auto contacts = contacts_of(outer, inner, 0.01);
  EXPECT_EQ(contacts.size(), inner.plain().vertices.size());
  for (const ContactPoint& c : contacts) EXPECT_NEAR(c.gap, -nearest_distance(outer.plain(), point_b(c, inner)), kGap);
  // So is a rigid ball, and a body within a box.
  Body ball(Shape{Sphere{0.1}}), box(Shape{Box{Vec3::Ones()}});
  ball.place({}), box.place({});
  EXPECT_EQ(contacts_of(outer, ball, 0.01).size(), 1u);
  EXPECT_EQ(contacts_of(inner, box, 0.01).size(), inner.plain().vertices.size());
}

/// Over 0 ≤ z ≤ 1 of a polygon, counter-clockwise and star-shaped from its first corner.
SurfaceMesh prism(const std::vector<std::array<double, 2>>& polygon) {
  SurfaceMesh mesh;
  const auto n = static_cast<Index>(polygon.size());
  for (const double z : {0.0, 1.0})
    for (const auto& [x, y] : polygon) mesh.vertices.emplace_back(x, y, z);
  for (Index i = 0; i < n; ++i) {
    const Index j = (i + 1) % n;
    mesh.triangles.push_back({i, j, n + j}), mesh.triangles.push_back({i, n + j, n + i});
    if (i == 0 || j == 0) continue;
    mesh.triangles.push_back({0, j, i}), mesh.triangles.push_back({n, n + i, n + j});
  }
  return mesh;
}

TEST(NarrowPhase, InsideIsInsideWherePartsOfASolidMeetInAnEdge) {
  // Three quarters of a square and, in the fourth, a wedge that touches them along the edge in their corner: four faces
  // meet there, and much of what is inside the three quarters is nearest to it.
  SurfaceMesh mesh = prism({{0, 0}, {0, 1}, {-1, 1}, {-1, -1}, {1, -1}, {1, 0}});
  shapes::append(prism({{0, 0}, {0.8, 0.6}, {0.6, 0.8}}), mesh);
  Body solid(testing::wavy_model(mesh, 0)), probe(Shape{Sphere{1e-3}});
  ASSERT_TRUE(solid.surface().closed());
  solid.place({});
  Random random(30);
  int inside = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    const double x = random.uniform(-0.4, 0.4), y = random.uniform(-0.4, 0.4);
    if (nearest_distance(solid.plain(), {x, y, 0.5}) < 2e-3) continue;
    const bool in_wedge = 0.75 * x < y && y < x / 0.75, is_inside = in_wedge || x < 0.0 || y < 0.0;
    probe.place({.p = {x, y, 0.5}});
    const auto contacts = contacts_of(solid, probe, 1e-4);
    ASSERT_EQ(contacts.empty(), !is_inside) << x << ", " << y;
    inside += is_inside ? 1 : 0;
  }
  EXPECT_GT(inside, 700);
  EXPECT_LT(inside, 950);
}

TEST(NarrowPhase, EdgesThatCrossWithoutAVertexInsideMakeAnEdgeContact) {
  // Two bars, each with an edge foremost, crossed at a right angle and 0.01 into each other.
  const auto roof = [] { return testing::wavy_model(shapes::box(Vec3(-1, -0.1, -0.1), Vec3(1, 0.1, 0.1)), 0); };
  Body lower(roof()), upper(roof());
  const Quaternion on_edge = quaternion_from_rotation_vector(Vec3(std::numbers::pi / 4.0, 0, 0));
  const Quaternion across = quaternion_from_rotation_vector(Vec3(0, 0, std::numbers::pi / 2.0));
  const double height = 2.0 * 0.1 * std::numbers::sqrt2;
  for (const double gap : {0.01, 0.0, -0.01, -0.03}) {
    lower.place({on_edge, Vec3::Zero()});
    upper.place({across * on_edge, Vec3(0, 0, height + gap)});
    const auto contacts = contacts_of(upper, lower, 0.02);
    ASSERT_EQ(contacts.size(), 1u) << "gap " << gap;
    EXPECT_NEAR(contacts[0].gap, gap, 1e-7);  // the corners at ±0.1 are stored in single precision
    EXPECT_LE((contacts[0].normal - Vec3::UnitZ()).norm(), 1e-12);
    EXPECT_TRUE(is_kind(key_of(contacts[0], 0), Feature::Kind::kEdge));
  }
}

TEST(NarrowPhase, BarsLaidAcrossEachOtherTouchWhereverTheirRimsHaveCrossed) {
  // One bar along y, tilted, over one along x: of the four crossings of its lower rim with the upper rim of the other
  // those that overlap are contacts, each as deep as its own lines are, and none pushes the bars sideways.
  const double half = 0.1;
  const auto bar = [&](const Vec3& extent) { return testing::wavy_model(shapes::box(-extent, extent), 0); };
  Body lower(bar({1.0, half, half})), upper(bar({half, 1.0, half}));
  lower.place({});
  Random random(28);
  int found = 0, deep = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const Vec3 tilt(random.uniform(-0.1, 0.1), random.uniform(-0.3, 0.3), random.uniform(-0.5, 0.5));
    upper.place({quaternion_from_rotation_vector(tilt), {0.0, 0.0, 2.0 * half + random.uniform(-0.01, 0.03)}});
    const auto contacts = contacts_of(upper, lower, 0.0);
    for (const ContactPoint& c : contacts) ASSERT_GT(c.normal.z(), 0.9) << "trial " << trial;
    for (const double x : {-half, half})
      for (const double y : {-half, half}) {
        const Vec3 u = upper.pose.q * Vec3::UnitY(), p = upper.pose * Vec3(x, 0.0, -half);
        const double height = p.z() + (y - p.y()) / u.y() * u.z() - half;  // of the upper line over the lower one
        if (height > -1e-3) continue;
        const Vec3 n = Vec3::UnitX().cross(u).normalized();
        const double gap = height * n.z();
        ++found, deep += gap < -0.02 ? 1 : 0;
        EXPECT_TRUE(std::any_of(contacts.begin(), contacts.end(),
                                [&](const ContactPoint& c) { return std::abs(c.gap - gap) < 1e-7; }))
            << "trial " << trial << ", gap " << gap;
      }
  }
  EXPECT_GT(found, 300);
  EXPECT_GT(deep, 50);
}

TEST(NarrowPhase, NormalsOfNeighbouringVerticesDoNotTurnAround) {
  // A soft block sinks ever deeper into a rigid box: what is inside is pushed up as long as the top is nearest.
  Body block(testing::block_model(0)), box(Shape{Box{Vec3(2.0, 2.0, 2.0)}});
  box.place({.p = {0, 0, -2.0}});
  for (double depth = -0.05; depth < 0.9; depth += 0.01) {
    block.place({.p = {0, 0, 0.5 - depth}});
    for (const ContactPoint& c : contacts_of(block, box, 0.1)) ASSERT_LE((c.normal - Vec3::UnitZ()).norm(), 1e-12);
  }
}

TEST(NarrowPhase, RestDepthOfAnUndeformedBoxIsItsSignedDistance) {
  const Vec3 half(0.3, 0.2, 0.1);
  const auto model = testing::sample_model({.half_extent = half});
  Body soft(model), probe(testing::wavy_model(shapes::sphere(Vec3::Zero(), 0.02, 0), 0));
  soft.use_volume();
  // The sample's corners are about its centre of mass, not the middle, and in single precision.
  Vec3 low = Vec3::Constant(1e9), high = -low;
  for (const Vec3f& r : model->collision().rest)
    low = low.cwiseMin(r.cast<double>()), high = high.cwiseMax(r.cast<double>());
  const Vec3 middle = 0.5 * (low + high);
  Random random(26);
  int inside = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const RigidTransform X_WB = random.pose(1.0);
    soft.place(X_WB, {0.0, 0.0, 0.0, 0.0});
    probe.place({random.pose(1.0).q, X_WB * (middle + random.vector(1.0).cwiseProduct(half))});
    for (const ContactPoint& c : contacts_of(soft, probe, 1e-6)) {
      if (!is_kind(key_of(c, 1), Feature::Kind::kVertex) || c.gap > -1e-3) continue;
      const Vec3 p_B = X_WB.inverse() * point_b(c, probe);
      const double depth = (0.5 * (high - low) - (p_B - middle).cwiseAbs()).minCoeff();  // to the nearest face
      if (depth < 1e-3) continue;  // a corner of the soft box in the probe
      ++inside;
      ASSERT_NEAR(c.gap, -depth, 1e-7);
      ASSERT_NEAR(c.normal.norm(), 1.0, 1e-13);
    }
  }
  EXPECT_GT(inside, 300);
}

/// A solid in one state as plain arrays, in its body frame.
struct PlainSolid {
  TetMesh rest;
  std::vector<Vec3> now;  // of the nodes
  BoundarySurface boundary;

  explicit PlainSolid(const TetMesh& mesh) : rest(mesh), boundary(boundary_surface(mesh)) {}
  void bend(const ModalModel& model, const std::vector<double>& z) {
    now = rest.nodes;
    for (std::size_t v = 0; v < now.size(); ++v)
      for (std::size_t i = 0; i < z.size(); ++i)
        now[v] +=
            z[i] * model.data().volume_block->basis.shape(static_cast<Index>(v), static_cast<Index>(i)).cast<double>();
  }
};

Eigen::Matrix4d homogeneous(const std::vector<Vec3>& nodes, const Tet& tet) {
  Eigen::Matrix4d m;
  for (int i = 0; i < 4; ++i) m.col(i) << nodes[static_cast<std::size_t>(tet[static_cast<std::size_t>(i)])], 1.0;
  return m;
}

/// Where a point of a bent solid is at rest, and the affine map of the tetrahedron there; none if no tetrahedron holds
/// the point.
struct PulledBack {
  Vec3 rest;
  Mat3 F;
};
std::optional<PulledBack> pull_back(const PlainSolid& solid, const Vec3& p) {
  for (const Tet& tet : solid.rest.tets) {
    const Eigen::Matrix4d now = homogeneous(solid.now, tet), rest = homogeneous(solid.rest.nodes, tet);
    const Eigen::Vector4d weights = now.inverse() * p.homogeneous();
    if (weights.minCoeff() < 0.0) continue;
    return PulledBack{(rest * weights).head<3>(), (now * rest.inverse()).topLeftCorner<3, 3>()};
  }
  return std::nullopt;
}

/// Where a point inside leaves the bent solid by the rest shape: at the material point that is nearest at rest.
struct WayOut {
  Vec3 at, normal;
};
WayOut way_out_by_rest(const PlainSolid& solid, const PulledBack& from) {
  testing::HullDistance nearest;
  WayOut out{};
  for (const Triangle& t : solid.boundary.surface.triangles) {
    std::array<Vec3, 3> x, x_now;
    for (std::size_t c = 0; c < 3; ++c) {
      const auto node = static_cast<std::size_t>(solid.boundary.node_of[static_cast<std::size_t>(t[c])]);
      x[c] = solid.rest.nodes[node], x_now[c] = solid.now[node];
    }
    const testing::HullDistance d = testing::hull_distance({&from.rest, 1}, x);
    if (!(d.distance < nearest.distance)) continue;
    nearest = d;
    Mat3 corners;
    corners << x[0], x[1], x[2];
    // Shifted, for a triangle whose plane holds the origin.
    const Vec3 off = (x[1] - x[0]).cross(x[2] - x[0]);
    const Vec3 weights = (corners.colwise() + off).inverse() * (d.b + off);
    out.at = weights[0] * x_now[0] + weights[1] * x_now[1] + weights[2] * x_now[2];
  }
  out.normal = (from.F.inverse().transpose() * (nearest.b - from.rest)).normalized();
  return out;
}

TEST(NarrowPhase, ByDefaultBentBodiesAreLeftWhereTheRestShapeSays) {
  const TetMesh mesh = testing::solid_box({0.75, 0.25, 0.25}, {6, 2, 2});  // exact in single precision too
  const auto model = testing::solid(mesh, 4);
  PlainSolid solid(mesh);
  Body soft(model), probe(testing::wavy_model(shapes::sphere(Vec3::Zero(), 0.02, 0), 0));
  soft.use_volume();
  Random random(27);
  int inside = 0, unlike_nearest = 0;
  for (int trial = 0; trial < testing::all_or_tenth(150); ++trial) {
    const std::vector<double> z = random.amplitudes(4, 0.08);
    solid.bend(*model, z);
    soft.place(random.pose(1.0), z);
    probe.place({random.pose(1.0).q, soft.pose * random.vector(1.0).cwiseProduct(Vec3(0.75, 0.25, 0.25))});
    const auto contacts = contacts_of(soft, probe, 1e-6);
    expect_well_formed(contacts, soft, probe, 1e-6);
    for (std::size_t v = 0; v < probe.plain().vertices.size(); ++v) {
      const Vec3 p_B = soft.pose.inverse() * probe.plain().vertices[v];
      const auto from = pull_back(solid, p_B);
      const double nearest = nearest_distance(soft.plain(), probe.plain().vertices[v]);
      if (!from || nearest < 1e-3) continue;
      const WayOut out = way_out_by_rest(solid, *from);
      const double gap = out.normal.dot(p_B - out.at);
      const auto c = std::find_if(contacts.begin(), contacts.end(), [&](const ContactPoint& x) {
        return x.gap < 0.0 && is_kind(key_of(x, 1), Feature::Kind::kVertex) &&
               index_of(key_of(x, 1)) == static_cast<Index>(v);
      });
      ASSERT_NE(c, contacts.end()) << "trial " << trial << ", vertex " << v;
      ASSERT_NEAR(c->gap, gap, kGap) << "trial " << trial << ", vertex " << v;
      ASSERT_LE((soft.pose.inverse() * point_a(*c, soft) - out.at).norm(), kGap);
      // Out of the soft body, which is a: the other way round.
      ASSERT_LE((c->normal + soft.pose.q * out.normal).norm(), kGap / nearest);
      ++inside, unlike_nearest += (p_B - out.at).norm() > 1.01 * nearest ? 1 : 0;
    }
  }
  EXPECT_GT(inside, testing::all_or_tenth(700));
  EXPECT_GT(unlike_nearest, testing::all_or_tenth(200));  // else the above does not tell the two methods apart
}

TEST(NarrowPhase, IdenticalBodiesInOnePlaceHaveFinitelyManyFiniteContacts) {
  Body a(lumpy_sphere(2, 3)), b(lumpy_sphere(2, 3));
  a.place({}, {0.1, 0.2, 0.0}), b.place({}, {0.1, 0.2, 0.0});
  const auto contacts = contacts_of(a, b, 0.01);
  expect_well_formed(contacts, a, b, 0.01);
  EXPECT_GE(contacts.size(), a.plain().vertices.size());
  EXPECT_LE(contacts.size(), 10 * a.plain().vertices.size());
}

TEST(NarrowPhase, FlatTrianglesDoubleVerticesAndInsideOutShapesGiveFiniteContacts) {
  Random random(41);
  SurfaceMesh mesh = shapes::sphere(Vec3::Zero(), 0.5, 1);
  shapes::append(shapes::sphere(Vec3(0.1, 0, 0), 0.5, 1), mesh);  // crosses the first
  const auto v = static_cast<Index>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), {Vec3(0, 0, 0.6), Vec3(0, 0, 0.6), Vec3(0, 0, 0.7), Vec3(0, 0, 0.8)});
  mesh.triangles.insert(mesh.triangles.end(), {{v, v + 1, v + 2}, {v, v + 2, v + 3}, {0, v, v + 3}});
  Body a(testing::wavy_model(mesh, 5)), b(lumpy_sphere(1, 5)), box(Shape{Box{}}), ball(Shape{Sphere{}}),
      rod(Shape{Capsule{}});
  for (int trial = 0; trial < 300; ++trial) {
    const double size = std::pow(10.0, random.uniform(-3.0, 2.0));  // up to a hundred times the body: inside out
    a.place(random.pose(0.7), random.amplitudes(5, size)), b.place(random.pose(0.7), random.amplitudes(5, size));
    for (Body* other : {&b, &box, &ball, &rod}) {
      if (other != &b) other->place(random.pose(0.7));
      for (const ContactPoint& c : contacts_of(a, *other, 0.05)) {
        ASSERT_TRUE(std::isfinite(c.gap) && c.normal.allFinite() && c.position.allFinite());
        ASSERT_NEAR(c.normal.norm(), 1.0, 1e-12);
      }
    }
  }
}

TEST(NarrowPhase, FarFromTheOriginContactsAreTheSame) {
  Random random(42);
  Body a(lumpy_sphere(2, 4)), b(lumpy_sphere(2, 4));
  const Vec3 far(1048576.0, -2097152.0, 524288.0);  // sums with multiples of 2⁻³⁰ below are exact
  for (int trial = 0; trial < 50; ++trial) {
    const auto z = random.amplitudes(4, 0.05);
    const Quaternion q = random.pose(1.0).q, r = random.pose(1.0).q;
    Vec3 at = random.uniform(0.8, 1.0) * random.vector(1.0).normalized();
    for (int i = 0; i < 3; ++i) at[i] = std::ldexp(std::round(std::ldexp(at[i], 30)), -30);
    NarrowPhase narrow;
    std::vector<ContactPoint> here, there;
    a.place({q, Vec3::Zero()}, z), b.place({r, at}, z);
    narrow.find_contacts(a.body(0), b.body(1), 0.05, Vec3::Zero(), here);
    a.place({q, far}, z), b.place({r, far + at}, z);
    narrow.find_contacts(a.body(0), b.body(1), 0.05, far, there);
    ASSERT_EQ(here.size(), there.size());
    for (std::size_t i = 0; i < here.size(); ++i) {
      ASSERT_EQ(here[i].id, there[i].id);
      ASSERT_EQ(here[i].gap, there[i].gap);
      ASSERT_EQ(here[i].position, there[i].position);
    }
  }
}

/// Forces go on by the names of contacts: bricks that lie on each other must not change them as they rock by round-off.
TEST(NarrowPhase, BricksThatLieFlushKeepTheNamesOfTheirContacts) {
  Random random(44);
  NarrowPhase narrow;
  const Vec3 half(0.15, 0.12, 0.09);
  for (int pair = 0; pair < 20; ++pair) {
    const double turn = random.uniform(-3.0, 3.0), x = random.uniform(-0.1, 0.1), y = random.uniform(-0.1, 0.1);
    std::set<std::uint64_t> names;
    for (int rock = 0; rock < 50; ++rock) {
      const Quaternion tilt = quaternion_from_rotation_vector(1e-5 * random.vector(1.0));
      Body lower = rigid(Box{half}, {}),
           upper = rigid(Box{half}, {tilt * quaternion_from_rotation_vector({0.0, 0.0, turn}),
                                     {x, y, 2.0 * half.z() + random.uniform(-1e-6, 1e-6)}});
      std::vector<ContactPoint> contacts;
      narrow.find_contacts(lower.body(0), upper.body(1), 0.01, Vec3::Zero(), contacts);
      std::set<std::uint64_t> now;
      for (const ContactPoint& contact : contacts) now.insert(contact.id);
      if (rock == 0) names = now;
      if (now.size() < names.size())
        std::swap(now, names);  // the two nearest points may come in beside a face's corners
      EXPECT_GE(names.size(), 3u);
      EXPECT_TRUE(std::ranges::includes(now, names)) << pair << ' ' << rock;
    }
  }
}

TEST(NarrowPhase, WarmQueriesAllocateNothingAndRepeatTheSameBits) {
  Random random(43);
  Body a(lumpy_sphere(2, 4)), b(lumpy_sphere(2, 4)), box(Shape{Box{}}), ball(Shape{Sphere{}}),
      plane(Shape{HalfSpace{}});
  a.place({}, random.amplitudes(4, 0.05)), b.place({.p = {0.8, 0, 0}}, random.amplitudes(4, 0.05));
  box.place({.p = {0, 0.9, 0}}), ball.place({.p = {0, 0, 0.9}}), plane.place({});
  NarrowPhase narrow;
  std::vector<ContactPoint> first, second;
  const auto query = [&](std::vector<ContactPoint>& contacts) {
    contacts.clear();
    for (Body* other : {&b, &box, &ball, &plane})
      narrow.find_contacts(a.body(0), other->body(1), 0.05, Vec3::Zero(), contacts);
    narrow.find_contacts(ball.body(0), box.body(1), 0.5, Vec3::Zero(), contacts);
    narrow.find_contacts(box.body(0), plane.body(1), 0.5, Vec3::Zero(), contacts);
  };
  query(first), query(second);
  const long before = testing::allocations();
  query(second);
  EXPECT_EQ(testing::allocations(), before);
  ASSERT_EQ(first.size(), second.size());
  EXPECT_GT(first.size(), 20u);
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(first[i].id, second[i].id);
    EXPECT_EQ(first[i].gap, second[i].gap);
    EXPECT_EQ(first[i].normal, second[i].normal);
  }
}

TEST(NarrowPhase, ABodyTouchesItselfWhereItIsBentOntoItselfAndNotAtRest) {
  // Two sheets of one body, 0.2 apart, and one mode that moves the upper one down.
  SurfaceMesh mesh = shapes::box(Vec3(-0.5, -0.5, 0.0), Vec3(0.5, 0.5, 0.05));
  shapes::append(shapes::box(Vec3(-0.4, -0.4, 0.25), Vec3(0.4, 0.4, 0.3)), mesh);
  ModalModelData data = testing::wavy_data(mesh, 1);
  for (Index v = 0; v < data.render.vertices(); ++v) data.render.basis.set(v, 0, Vec3f(0, 0, v < 8 ? 0.0f : -1.0f));
  Body body(std::make_shared<const ModalModel>(std::move(data)));
  NarrowPhase narrow;
  std::vector<ContactPoint> contacts;
  body.place({}, {0.0});
  narrow.find_self_contacts(body.body(3), 0.05, Vec3::Zero(), contacts);
  EXPECT_TRUE(contacts.empty());
  body.place({}, {0.19});
  narrow.find_self_contacts(body.body(3), 0.05, Vec3::Zero(), contacts);
  ASSERT_GE(contacts.size(), 4u);
  for (const ContactPoint& c : contacts) {
    EXPECT_EQ(c.a.body, 3);
    EXPECT_EQ(c.b.body, 3);
    EXPECT_NEAR(c.gap, 0.01, 1e-7);
    EXPECT_LE(c.normal.cross(Vec3::UnitZ()).norm(), 1e-7);
    EXPECT_NEAR(c.gap, c.normal.dot(c.a.point_B - c.b.point_B), 1e-14);
  }
}

TEST(NarrowPhase, ABodyWithTwoGeometriesOrNoneIsRefused) {
  Body ball(Shape{Sphere{}});
  CollisionBody none;
  NarrowPhase narrow;
  std::vector<ContactPoint> contacts;
  EXPECT_THROW(narrow.find_contacts(ball.body(0), none, 0.1, Vec3::Zero(), contacts), InvalidArgument);
  EXPECT_THROW(RestVolume(testing::block_model(1)), InvalidArgument);
}

}  // namespace
}  // namespace limber
