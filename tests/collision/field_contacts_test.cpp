// Contacts by distance fields: what they are made of, and what they find beside NarrowPhase.
#include "field/field_contacts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <set>
#include <tuple>
#include <vector>

#include "asked.h"
#include "coarse_bunny.h"
#include "counted_new.h"
#include "finder_scenes.h"
#include "instruction_sets.h"
#include "limber/collision/contact_finder.h"
#include "limber/collision/manifold_finder.h"
#include "limber/mesh/winding_number.h"
#include "random_states.h"
#include "solid_bodies.h"
#include "thread_jobs.h"

namespace limber {
namespace {

using internal::DeformedPointshell;
using internal::FieldBody;
using internal::FieldContacts;
using internal::FieldHit;
using internal::FieldQuery;
using internal::Pointshell;
using internal::SignedDistanceGrid;
using testing::Random;

SurfaceMesh scaled(SurfaceMesh mesh, double by) {
  for (Vec3& v : mesh.vertices) v *= by;
  return mesh;
}

/// 300 mm long, faces cut in squares of 25 mm.
SurfaceMesh bar() { return boundary_surface(testing::solid_box({0.15, 0.025, 0.025}, {12, 2, 2})).surface; }
SurfaceMesh ball() { return shapes::sphere(Vec3::Zero(), 0.1, 3); }

FieldQuery query_of(const internal::DistanceView& field) {
  FieldQuery query;
  query.field = field;
  for (int axis = 0; axis < 3; ++axis) query.R[axis][axis] = 1.0f;
  return query;
}

double distance_at(const FieldQuery& query, const Vec3& p) {
  const Vec3f x = p.cast<float>();
  return static_cast<double>(field_at(query, x.data()).distance);
}

/// A body as both ways of finding contacts have it.
struct TwoWays {
  explicit TwoWays(const std::shared_ptr<const ModalModel>& model)
      : exact(model), shell(std::make_shared<const Pointshell>(std::make_shared<const CollisionSurface>(model))) {}
  explicit TwoWays(const Shape& shape) : exact(shape), geometry(shape) {
    if (geometry->surface()) shell = DeformedPointshell(std::make_shared<const Pointshell>(*geometry));
  }

  void place(const RigidTransform& X_WB, const std::vector<double>& z = {}) {
    exact.place(X_WB, z);
    if (geometry) return;
    shell->set_amplitudes(z);
    DeformedPointshell* const bodies[] = {&*shell};
    deform(bodies, serial_jobs());
  }
  FieldBody field() const { return {shell ? &*shell : nullptr, geometry ? &*geometry : nullptr}; }

  testing::Body exact;
  std::optional<DeformedPointshell> shell;
  std::optional<RigidGeometry> geometry{};
};

RigidTransform between(const TwoWays& a, const TwoWays& b) { return a.exact.pose.inverse() * b.exact.pose; }

/// As NarrowPhase tells contacts.
std::vector<ContactPoint> by_fields(const TwoWays& a, const TwoWays& b, double margin) {
  FieldContacts finder;
  std::vector<ContactPoint> contacts;
  for (const internal::FoundContact& c : finder.find(a.field(), b.field(), between(a, b), margin)) {
    ContactPoint point;
    for (const auto& [side, of, index] : {std::tuple(&point.a, &c.of[0], 0), std::tuple(&point.b, &c.of[1], 1)})
      side->body = index, side->triangle = of->triangle, side->weight = of->weight, side->point_B = of->point;
    point.normal = a.exact.pose.q * c.normal, point.gap = c.gap, point.id = c.id();
    point.position = 0.5 * (point_a(point, a.exact) + point_b(point, b.exact));
    contacts.push_back(point);
  }
  return contacts;
}

double deepest_gap(const std::vector<ContactPoint>& contacts) {
  double depth = 0.0;
  for (const ContactPoint& c : contacts) depth = std::max(depth, -c.gap);
  return depth;
}

/// Brings b along a direction, from afar, as near to a as makes an exact contact of that depth, and no nearer: with a
/// ball's middle in a thin plate contacts are less deep again.
void bring_together(TwoWays& a, TwoWays& b, const Vec3& direction, const std::vector<double>& z, double depth) {
  const Quaternion turn = b.exact.pose.q;
  const auto contacts_at = [&](double distance) {
    b.exact.place({turn, distance * direction}, z);
    return contacts_of(a.exact, b.exact, 1e-3);
  };
  double near = 0.0, far = 1.0;
  for (int halving = 0; halving < 10; ++halving) {
    const double middle = 0.5 * (near + far);
    (contacts_at(middle).empty() ? far : near) = middle;
  }
  while (near > 0.0 && !(deepest_gap(contacts_at(near)) > depth)) far = near, near -= 0.5 * depth;
  for (int halving = 0; halving < 5; ++halving) {
    const double middle = 0.5 * (near + far);
    (deepest_gap(contacts_at(middle)) > depth ? near : far) = middle;
  }
  b.place({turn, near * direction}, z);
}

/// What of the exact contacts the fields have none like of: within 30 mm, of a normal within 45° and a third of the
/// depth.
bool has_like(const ContactPoint& c, const std::vector<ContactPoint>& all) {
  return std::ranges::any_of(all, [&](const ContactPoint& o) {
    return (o.position - c.position).norm() < 0.03 && o.normal.dot(c.normal) > 0.7 && -o.gap > 0.3 * -c.gap;
  });
}

bool is_edge_on_edge(const ContactPoint& c) {
  return testing::is_kind(testing::key_of(c, 0), Feature::Kind::kEdge) &&
         testing::is_kind(testing::key_of(c, 1), Feature::Kind::kEdge);
}

// -- Distances --------------------------------------------------------------------------------------------------------

TEST(SignedDistanceGrid, TellsDistanceAndSide) {
  const CollisionSurface surface(testing::wavy_model(bar(), 0));
  const SignedDistanceGrid grid(surface);
  const FieldQuery query = query_of(grid.view());
  const auto to_box = [](const Vec3& p) {
    const Vec3 beyond = p.cwiseAbs() - Vec3(0.15, 0.025, 0.025);
    return beyond.cwiseMax(0.0).norm() + std::min(beyond.maxCoeff(), 0.0);
  };
  Random random(1);
  for (int i = 0; i < 2000; ++i) {
    const Vec3 p = random.vector(1.0).cwiseProduct(Vec3(0.16, 0.035, 0.035));
    const double exact = to_box(p);
    // Trilinear interpolation is off where the distance has a ridge: by less than half a cell's way along the diagonal.
    EXPECT_NEAR(distance_at(query, p), exact, 0.45 * grid.cell()) << p.transpose();
    if (std::abs(exact) > 0.45 * grid.cell()) {
      EXPECT_EQ(distance_at(query, p) < 0.0, exact < 0.0);
    }
  }
}

TEST(SignedDistanceGrid, IsExactAtNodesToItsUnit) {
  const SurfaceMesh mesh = ball();
  const CollisionSurface surface(testing::wavy_model(mesh, 0));
  const SignedDistanceGrid grid(surface);
  const internal::DistanceView view = grid.view();
  const SurfaceLocator locator(mesh.vertices, mesh.triangles);
  Random random(2);
  for (int i = 0; i < 300; ++i) {
    Vec3 p;
    for (int axis = 0; axis < 3; ++axis)
      p[axis] = static_cast<double>(view.grid.origin[axis]) +
                grid.cell() * random.index(static_cast<Index>(view.grid.last[axis]));
    const double exact = locator.nearest(p).distance;
    EXPECT_NEAR(std::abs(distance_at(query_of(view), p)), exact, static_cast<double>(view.unit) + 1e-6);
    EXPECT_EQ(distance_at(query_of(view), p) < 0.0, winding_number(mesh, p) > 0.5 && exact > 0.0);
  }
}

TEST(SignedDistanceGrid, BeyondItsBoxIsNoMoreThanTheDistance) {
  const CollisionSurface surface(testing::wavy_model(ball(), 0));
  const SignedDistanceGrid grid(surface);
  Random random(3);
  for (int i = 0; i < 200; ++i) {
    const Vec3 p = random.vector(0.5);
    EXPECT_LE(distance_at(query_of(grid.view()), p), p.norm() - 0.099 + 0.5 * grid.cell());
  }
}

// -- One body ---------------------------------------------------------------------------------------------------------

TEST(Pointshell, LeavesSheetsAndOpenSurfacesToTriangles) {
  const auto resolved = [](const SurfaceMesh& mesh) {
    return Pointshell(std::make_shared<const CollisionSurface>(testing::wavy_model(mesh, 0))).resolved();
  };
  EXPECT_TRUE(resolved(ball()));
  EXPECT_TRUE(resolved(bar()));
  // 200 mm across: two cells are 9 mm.
  EXPECT_TRUE(resolved(boundary_surface(testing::solid_box({0.1, 0.1, 0.006}, {8, 8, 1})).surface));
  EXPECT_FALSE(resolved(boundary_surface(testing::solid_box({0.1, 0.1, 0.003}, {8, 8, 1})).surface));
  SurfaceMesh open = ball();
  open.triangles.pop_back();
  EXPECT_FALSE(resolved(open));
}

TEST(DeformedPointshell, HasVerticesWhereTheModesTakeThem) {
  const Index modes = 11;
  const auto model = testing::wavy_model(ball(), modes);
  const auto shell = std::make_shared<const Pointshell>(std::make_shared<const CollisionSurface>(model));
  Random random(4);
  std::vector<DeformedPointshell> bodies;
  std::vector<std::vector<double>> z;
  for (int i = 0; i < 7; ++i) {
    z.push_back(random.amplitudes(modes, 0.01));
    bodies.emplace_back(shell).set_amplitudes(z.back());
  }
  std::vector<DeformedPointshell*> all;
  for (DeformedPointshell& body : bodies) all.push_back(&body);
  deform(all, serial_jobs());
  for (std::size_t i = 0; i < bodies.size(); ++i)
    for (Index v = 0; v < shell->surface().vertices(); ++v) {
      Vec3 p = shell->surface().rest(v);
      for (Index m = 0; m < modes; ++m)
        p += z[i][static_cast<std::size_t>(m)] * model->collision().basis.shape(v, m).cast<double>();
      const Vec3f q = bodies[i].vertex(v);
      ASSERT_LE((q.cast<double>() - p).norm(), 1e-7);
      ASSERT_TRUE((q.array() >= bodies[i].low().array() - 1e-6f).all() &&
                  (q.array() <= bodies[i].high().array() + 1e-6f).all());
      ASSERT_LE((q - shell->surface().rest(v).cast<float>()).norm(), bodies[i].flex() * 1.2f + 1e-6f);
    }
  // Alone, in parts by many threads, and on every instruction set with fused multiply-add: the same bits.
  const std::vector<Vec3f> before = [&] {
    std::vector<Vec3f> x;
    for (Index v = 0; v < shell->surface().vertices(); ++v) x.push_back(bodies[5].vertex(v));
    return x;
  }();
  const auto expect_same = [&] {
    for (Index v = 0; v < shell->surface().vertices(); ++v)
      ASSERT_EQ(bodies[5].vertex(v), before[static_cast<std::size_t>(v)]);
  };
  DeformedPointshell* const alone[] = {&bodies[5]};
  deform(alone, serial_jobs());
  expect_same();
  testing::ThreadJobs threads(3);
  deform(all, threads);
  expect_same();
  for_each_instruction_set([&](std::int64_t target) {
    if (!has_fused_multiply_add(target)) return;
    deform(all, serial_jobs());
    expect_same();
  });
}

// The lattice has any displacement that is linear in space exactly, and what it carries back is where it was at rest.
TEST(DeformedPointshell, CarriesPointsBackIntoTheRestShape) {
  ModalModelData data = testing::wavy_data(bar(), 2);
  for (Index v = 0; v < data.render.vertices(); ++v) {
    const Vec3f& r = data.render.rest[static_cast<std::size_t>(v)];
    data.render.basis.set(v, 0, Vec3f(0.1f * r.x() + 0.02f * r.y(), 0.05f * r.x(), 0.0f));
    data.render.basis.set(v, 1, Vec3f(0.0f, 0.3f * r.z(), 0.1f * r.x()));
  }
  const auto model = std::make_shared<const ModalModel>(std::move(data));
  DeformedPointshell body(std::make_shared<const Pointshell>(std::make_shared<const CollisionSurface>(model)));
  const std::vector<double> z{0.5, 0.4};
  body.set_amplitudes(z);
  DeformedPointshell* const bodies[] = {&body};
  deform(bodies, serial_jobs());
  FieldQuery query = query_of(body.shell().distance());
  query.lattice = body.lattice();
  ASSERT_EQ(query.lattice.steps, 2);
  Random random(5);
  for (int i = 0; i < 300; ++i) {
    const Vec3 r = random.vector(1.0).cwiseProduct(Vec3(0.15, 0.025, 0.025));
    const Vec3 u =
        z[0] * Vec3(0.1 * r.x() + 0.02 * r.y(), 0.05 * r.x(), 0.0) + z[1] * Vec3(0.0, 0.3 * r.z(), 0.1 * r.x());
    const Vec3f q = (r + u).cast<float>();
    const FieldHit hit = field_at(query, q.data());
    // Each of two steps leaves |∇u| < 0.15 of what was off.
    EXPECT_LE((Vec3(hit.rest[0], hit.rest[1], hit.rest[2]) - r).norm(),
              0.15 * 0.15 * u.norm() + 1e-4 * u.norm() + 1e-6);
  }
}

// -- Two bodies -------------------------------------------------------------------------------------------------------

struct Missed {
  int vertices = 0, edges = 0, missed_vertices = 0, missed_edges = 0, deep_pairs = 0, unseen_pairs = 0;
};

/// Random pairs, bent by up to 2 % of their size, 3 mm deep.
void look_at_pairs(TwoWays& a, TwoWays& b, Index modes, int pairs, unsigned seed, Missed& missed) {
  Random random(seed);
  for (int i = 0; i < pairs; ++i) {
    a.place({random.pose(0.0).q, Vec3::Zero()}, random.amplitudes(modes, 0.002));
    const std::vector<double> z = random.amplitudes(modes, 0.002);
    b.place({random.pose(0.0).q, Vec3::Zero()}, z);
    bring_together(a, b, random.vector(1.0).normalized(), z, 3e-3);
    const std::vector<ContactPoint> exact = contacts_of(a.exact, b.exact, 1e-3), found = by_fields(a, b, 1e-3);
    for (std::size_t c = 0; c < found.size(); ++c) {
      ASSERT_NEAR(found[c].normal.norm(), 1.0, 1e-12);
      ASSERT_LE(found[c].gap, 1e-3);
      ASSERT_NEAR(found[c].gap, found[c].normal.dot(point_a(found[c], a.exact) - point_b(found[c], b.exact)), 1e-12);
      if (c > 0) {
        ASSERT_LT(found[c - 1].id, found[c].id);
      }
    }
    missed.deep_pairs += deepest_gap(exact) > 3e-3 ? 1 : 0;
    missed.unseen_pairs += deepest_gap(exact) > 3e-3 && deepest_gap(found) == 0.0 ? 1 : 0;
    for (const ContactPoint& c : exact) {
      if (!(-c.gap > 1e-3)) continue;
      (is_edge_on_edge(c) ? missed.edges : missed.vertices) += 1;
      if (!has_like(c, found)) (is_edge_on_edge(c) ? missed.missed_edges : missed.missed_vertices) += 1;
    }
  }
}

// The gate: of exact contacts deeper than 1 mm no more than 2 % of vertex–surface and 5 % of edge–edge ones have none
// like them; no pair deeper than 3 mm is unseen.
TEST(FieldContacts, HasWhatNarrowPhaseHas) {
  constexpr Index kModes = 8;
  std::vector<SurfaceMesh> meshes{bar(), ball()};
  if (const auto bunny = testing::coarse_bunny(300)) meshes.push_back(scaled(*bunny, 0.2));
  std::deque<TwoWays> a, b;
  for (const SurfaceMesh& mesh : meshes) {
    const auto model = testing::wavy_model(mesh, kModes);
    a.emplace_back(model), b.emplace_back(model);
  }
  Missed missed;
  for (std::size_t i = 0; i < meshes.size(); ++i)
    for (std::size_t j = i; j < meshes.size(); ++j)
      look_at_pairs(a[i], b[j], kModes, testing::trials(12), static_cast<unsigned>(10 * i + j), missed);
  EXPECT_GT(missed.vertices, testing::all_or_tenth(100));
  EXPECT_GT(missed.edges, testing::all_or_tenth(25));
  EXPECT_LE(missed.missed_vertices, 0.02 * missed.vertices) << "of " << missed.vertices;
  EXPECT_LE(missed.missed_edges, 0.05 * missed.edges) << "of " << missed.edges;
  EXPECT_EQ(missed.unseen_pairs, 0) << "of " << missed.deep_pairs;
}

// Two balls 20 mm apart. What their motion brings together until the step's end is told before it, and nothing else.
TEST(FieldContacts, TellsWhatTheExpectedMotionOfItsPointsCloses) {
  constexpr Index kModes = 4;
  constexpr double kReach = 1e-3, kApart = 0.02;
  const auto model = testing::wavy_model(ball(), kModes);
  TwoWays a(model), b(model);
  Random random(21);
  const RigidTransform start{random.pose(0.0).q, {0.0, 0.0, 0.2 + kApart}};
  const auto at_end = [&](const std::vector<double>& z, const RigidTransform& end) {
    b.place(end, z);
    return by_fields(a, b, kReach);
  };
  FieldContacts finder;
  const std::vector<double> still(kModes, 0.0);
  const auto motion_to = [&](const RigidTransform& end) {
    return internal::FieldMotion{between(a, b), a.exact.pose.inverse() * end};
  };
  const auto expected = [&](const std::vector<double>& z, const RigidTransform& end) {
    b.place(start, still);
    b.shell->set_amplitudes(still, z);
    DeformedPointshell* const bodies[] = {&*b.shell};
    deform(bodies, serial_jobs());
    return finder.find(a.field(), b.field(), motion_to(end), kReach);
  };
  a.place({}, still);
  const RigidTransform near{start.q, start.p - Vec3(0.0, 0.0, kApart + 0.005)};
  const RigidTransform beside{start.q, start.p + Vec3(0.1, 0.0, 0.0)};
  const RigidTransform spun{quaternion_from_rotation_vector({0.0, 0.0, 1.0}) * start.q, start.p};
  EXPECT_TRUE(expected(still, start).empty());
  EXPECT_TRUE(expected(still, beside).empty());
  EXPECT_TRUE(expected(still, spun).empty());
  // One of the two may fall on the other, but not beside it.
  const RigidTransform here = between(a, b);
  const auto count_in_fall = [&](const Vec3& fall) {
    return finder.find(a.field(), b.field(), internal::FieldMotion{here, here, fall}, kReach).size();
  };
  EXPECT_EQ(count_in_fall({1.1 * kApart, 0.0, 0.0}), 0u);
  EXPECT_GT(count_in_fall({0.0, 0.0, -1.1 * kApart}), 0u);
  // By its frame alone, by its modes alone, and by both.
  std::vector<double> bent = random.amplitudes(kModes, 0.01);
  while (deepest_gap(at_end(bent, start)) < 3e-3)
    for (double& z : bent) z *= 1.2;
  for (const auto& [z, end] : {std::pair(still, near), std::pair(bent, start), std::pair(bent, near)}) {
    const std::vector<ContactPoint> then = at_end(z, end);
    std::map<std::uint64_t, double> before;
    int deep = 0;
    for (const internal::FoundContact& c : expected(z, end)) {
      before[c.id()] = c.gap;
      EXPECT_LE(c.gap, kReach + FieldContacts::closing(a.field(), b.field(), motion_to(end), c));
    }
    for (const ContactPoint& c : then) {
      if (is_edge_on_edge(c) || c.gap > -1e-3) continue;
      ++deep;
      EXPECT_TRUE(before.contains(c.id)) << c.gap;
    }
    EXPECT_GT(deep, 0);
  }
}

// Directions along which two bodies may part save time: what is within reach now is found without them as well.
TEST(FieldContacts, PartingPlanesLeaveOutNothingWithinReach) {
  const auto model = testing::wavy_model(bar(), 8);
  TwoWays a(model), b(model);
  Random random(31);
  FieldContacts finder;
  std::size_t found = 0, parted = 0;
  for (int i = 0; i < 60; ++i) {
    a.place(random.pose(0.06), random.amplitudes(8, 0.003)), b.place(random.pose(0.06), random.amplitudes(8, 0.003));
    const RigidTransform here = between(a, b);
    const RigidTransform moved{quaternion_from_rotation_vector(random.vector(0.1)), random.vector(0.01)};
    const internal::FieldMotion motion{here, moved * here, random.vector(0.003)};
    std::set<std::uint64_t> ids[2];
    for (const int looks : {0, 8}) {
      internal::collision_tuning_in_use.field.looks_apart = looks;
      for (const internal::FoundContact& c : finder.find(a.field(), b.field(), motion, 2e-3))
        if (c.gap <= 2e-3) ids[looks > 0 ? 1 : 0].insert(c.id());
    }
    EXPECT_EQ(ids[0], ids[1]);
    found += ids[0].size(), parted += ids[0].empty() ? 1 : 0;
  }
  EXPECT_GT(found, 100u);
  EXPECT_GT(parted, 5u);
}

// Two bars laid across each other without a vertex in the other: their edges carry them.
TEST(FieldContacts, BarsAcrossEachOtherRestOnTheirEdges) {
  const auto bar_model =
      testing::wavy_model(boundary_surface(testing::solid_box({0.15, 0.02, 0.02}, {1, 1, 1})).surface, 0);
  TwoWays a(bar_model), b(bar_model);
  a.place({});
  for (const double depth : {-5e-4, 1e-3, 5e-3}) {
    b.place({quaternion_from_rotation_vector({0.0, 0.0, 1.2}), {0.01, 0.005, 0.04 - depth}});
    const std::vector<ContactPoint> found = by_fields(a, b, 1e-3);
    int edges = 0;
    for (const ContactPoint& c : found) {
      edges += is_edge_on_edge(c) ? 1 : 0;
      EXPECT_NEAR(c.normal.z(), -1.0, 1e-6);
      EXPECT_NEAR(c.gap, -depth, 1e-6);
    }
    EXPECT_EQ(edges, 4) << depth;
  }
}

// A corner that has gone through a ridge and out of its other side: no vertex is inside, and the common perpendiculars
// of edges that have crossed may lie in no cone of normals. The overlap is seen all the same.
TEST(FieldContacts, CornersThroughRidgesAreSeen) {
  constexpr double kHalf = 0.05, kCorner = 0.1;
  const auto coarse = [](const Vec3& half) {
    return testing::wavy_model(boundary_surface(testing::solid_box(half, {1, 1, 1})).surface, 0);
  };
  TwoWays ridge(coarse({0.15, kHalf, kHalf})), cube(coarse(Vec3::Constant(kCorner)));
  ridge.place({quaternion_from_rotation_vector({0.25 * std::numbers::pi, 0.0, 0.0}), Vec3::Zero()});
  const double top = std::sqrt(2.0) * kHalf;
  // Takes (1, 1, 1) to y.
  const Quaternion along =
      quaternion_from_rotation_vector(std::acos(1.0 / std::sqrt(3.0)) * Vec3(-1.0, 0.0, 1.0).normalized());
  int overlaps = 0;
  for (const double beyond : {0.01, 0.02, 0.03})
    for (const double below : {0.003, 0.006})
      for (int roll = 0; roll < 12; ++roll) {
        const Quaternion turn = quaternion_from_rotation_vector({0.0, 0.2 * roll, 0.0}) * along;
        const Vec3 tip(0.01, beyond, top - below);
        cube.place({turn, tip - turn * Vec3::Constant(kCorner)});
        // How far the ridge's middle is inside of the cube.
        const Vec3 middle = turn.conjugate() * (Vec3(0.01, 0.0, top) - cube.exact.pose.p);
        if (kCorner - middle.cwiseAbs().maxCoeff() < 2e-3) continue;
        ++overlaps;
        EXPECT_GT(deepest_gap(by_fields(ridge, cube, 1e-3)), 0.0) << beyond << ' ' << below << ' ' << roll;
      }
  EXPECT_GT(overlaps, 40);
}

// A bar pushed into another: nearest points of vertices next to its sides are there, and ways out to both of them and
// to the top would hold it in place.
TEST(FieldContacts, PatchesHaveOneWayOut) {
  const auto model = testing::wavy_model(bar(), 0);
  TwoWays a(model), b(model);
  a.place({});
  for (const double depth : {0.002, 0.006, 0.012, 0.02}) {
    b.place({quaternion_from_rotation_vector({0.0, 0.0, 1.5}), {0.01, 0.02, 0.05 - depth}});
    const std::vector<ContactPoint> found = by_fields(a, b, 1e-3);
    EXPECT_GT(deepest_gap(found), 0.99 * depth);
    for (const ContactPoint& c : found)
      for (const ContactPoint& d : found)
        if (c.gap < 0.0 && d.gap < 0.0) {
          EXPECT_GT(c.normal.dot(d.normal), 0.0) << depth;
        }
  }
}

// A box on another of its size, a little off, and sunk in farther than it is off: the nearest points of the corners are
// on each other's sides.
TEST(FieldContacts, ASunkBoxLeavesUpwards) {
  const Vec3 half(0.15, 0.12, 0.09);
  TwoWays below(Shape{Box{half}}),
      above(testing::wavy_model(boundary_surface(testing::solid_box(half, {1, 1, 1})).surface, 0));
  below.place({});
  for (const double depth : {0.02, 0.04, 0.06})
    for (const double turn : {0.0, 0.03, 1.5, 3.1}) {
      const Vec3 at(0.011, -0.007, 2.0 * half.z() - depth);
      above.place({quaternion_from_rotation_vector({0.0, 0.0, turn}), at});
      const std::vector<ContactPoint> found = by_fields(below, above, 1e-3);
      EXPECT_NEAR(deepest_gap(found), depth, 0.1 * depth) << turn;
      for (const ContactPoint& c : found)
        if (c.gap < 0.0) {
          EXPECT_LT(c.normal.z(), -0.9) << depth << ' ' << turn << ' ' << c.gap;
        }
    }
}

TEST(FieldContacts, RigidShapesAreMetAsByNarrowPhase) {
  constexpr Index kModes = 6;
  TwoWays body(testing::wavy_model(ball(), kModes));
  // Upwards these all meet the ball; a capsule with its end and its side.
  const RigidTransform upright{}, lying{quaternion_from_rotation_vector({1.5, 0.2, 0.0}), Vec3::Zero()};
  const std::vector<std::pair<Shape, RigidTransform>> kinds{{HalfSpace{{0.0, 0.0, 1.0}, 0.01}, upright},
                                                            {Sphere{0.06}, upright},
                                                            {Capsule{0.03, 0.08}, upright},
                                                            {Capsule{0.03, 0.08}, lying},
                                                            {Box{{0.3, 0.3, 0.002}}, upright},
                                                            {Box{{0.04, 0.05, 0.06}}, lying}};
  Random random(8);
  for (const auto& [kind, pose] : kinds) {
    TwoWays shape(kind);
    shape.place(pose);
    for (int i = 0; i < testing::all_or_tenth(15); ++i) {
      const std::vector<double> z = random.amplitudes(kModes, 0.002);
      body.place({random.pose(0.0).q, Vec3::Zero()}, z);
      ASSERT_TRUE(FieldContacts::serves(shape.field(), body.field()));
      bring_together(shape, body, (Vec3::UnitZ() + random.vector(0.2)).normalized(), z, 1.5e-3);
      const std::vector<ContactPoint> exact = contacts_of(shape.exact, body.exact, 1e-3),
                                      found = by_fields(shape, body, 1e-3);
      EXPECT_NEAR(deepest_gap(found), deepest_gap(exact), 1e-4) << kind.index();
      for (const ContactPoint& c : exact)
        if (c.gap < -1e-3) {
          EXPECT_TRUE(has_like(c, found)) << kind.index() << " " << c.gap;
        }
      for (const ContactPoint& c : found)
        EXPECT_NEAR(c.gap, c.normal.dot(point_a(c, shape.exact) - point_b(c, body.exact)), 1e-12);
    }
  }
}

TEST(FieldContacts, OneBodyAndItsMirrorHaveTheSameContacts) {
  const auto model = testing::wavy_model(ball(), 4);
  TwoWays a(model), b(model);
  Random random(9);
  a.place({random.pose(0.0).q, Vec3::Zero()}, random.amplitudes(4, 0.002));
  b.place({random.pose(0.0).q, {0.0, 0.0, 0.19}}, random.amplitudes(4, 0.002));
  const std::vector<ContactPoint> one = by_fields(a, b, 1e-3), other = by_fields(b, a, 1e-3);
  ASSERT_FALSE(one.empty());
  ASSERT_EQ(one.size(), other.size());
  for (const ContactPoint& c : one)
    EXPECT_TRUE(std::ranges::any_of(other, [&](const ContactPoint& d) {
      return (c.position - d.position).norm() < 1e-6 && (c.normal + d.normal).norm() < 1e-4;
    }));
}

TEST(FieldContacts, NothingIsAllocatedOnceWarm) {
  const auto model = testing::wavy_model(bar(), 8);
  TwoWays a(model), b(model), floor{Shape{HalfSpace{}}};
  FieldContacts finder;
  std::size_t found = 0;
  const auto pass = [&](Random random) {
    for (int i = 0; i < 20; ++i) {
      a.exact.pose = random.pose(0.03), b.exact.pose = random.pose(0.03), floor.exact.pose = random.pose(0.03);
      found += finder.find(a.field(), b.field(), between(a, b), 1e-3).size();
      found += finder.find(a.field(), floor.field(), between(a, floor), 1e-3).size();
    }
  };
  const std::vector<double> z = Random(11).amplitudes(8, 0.002);
  a.place({}, z), b.place({}, z);
  pass(Random(12));
  const long before = testing::allocations();
  DeformedPointshell* const both[] = {&*a.shell, &*b.shell};
  a.shell->set_amplitudes(z);
  deform(both, serial_jobs());
  pass(Random(12));
  EXPECT_EQ(testing::allocations(), before);
  EXPECT_GT(found, 100u);
}

// -- Next to rims ----------------------------------------------------------------------------------------------------

/// A bar on another one, sides flush but for what is to be told apart from nothing.
TEST(FieldContacts, BarsWhoseSidesAreFlushPressStraightDown) {
  const auto model = testing::wavy_model(bar(), 2);
  const std::vector<double> still(2, 0.0);
  TwoWays below(model), above(model);
  below.place({}, still);
  for (const double gap : {1e-4, 1e-7, 0.0, -1e-7, -1e-5})
    for (const double aside : {0.0, 1e-7, -1e-7, 2e-5, -2e-5}) {
      above.place({{}, {aside, 0.5 * aside, 0.05 + gap}}, still);
      std::set<std::pair<bool, bool>> corners;
      for (const ContactPoint& c : by_fields(below, above, 1e-3)) {
        EXPECT_LT(c.normal.z(), -0.999) << gap << ' ' << aside << ' ' << c.position.transpose();
        if (std::abs(c.position.x()) > 0.149 && std::abs(c.position.y()) > 0.024)
          corners.insert({c.position.x() > 0.0, c.position.y() > 0.0});
      }
      EXPECT_EQ(corners.size(), 4u) << gap << ' ' << aside;
    }
}

/// A bar's end slides over the rim between two flush boxes, a little lower than they are.
TEST(FieldContacts, TheSideOfAFlushBoxDoesNotStopWhatSlidesOverIt) {
  const double low = 1e-5, way = 0.01;  // m
  TwoWays slider(testing::wavy_model(bar(), 2)), box(Box{{0.1, 0.1, 0.1}});
  FieldContacts finder;
  for (const double ahead : {0.008, 0.001, 1e-6, -1e-6, -0.001}) {  // of the end, from the box's side
    slider.place({}, std::vector<double>(2, 0.0));
    box.place({{}, {0.15 + ahead + 0.1, 0.0, -0.025 - 0.1 + low}});
    RigidTransform end = between(slider, box);
    end.p.x() -= way;
    for (const internal::FoundContact& c :
         finder.find(slider.field(), box.field(), {between(slider, box), end, Vec3::Zero(), 1e-4}, 1e-3))
      EXPECT_GT(std::abs(c.normal.z()), 0.999) << ahead << ' ' << c.normal.transpose();
  }
  // A step is met.
  box.place({{}, {0.15 + 0.008 + 0.1, 0.0, -0.1}});
  RigidTransform end = between(slider, box);
  end.p.x() -= way;
  EXPECT_FALSE(finder.find(slider.field(), box.field(), {between(slider, box), end, Vec3::Zero(), 1e-4}, 1e-3).empty());
}

// -- In ManifoldFinder -----------------------------------------------------------------------------------------------

TEST(FieldPairs, ManifoldFinderFindsByThemWhatItFindsByTriangles) {
  const testing::ContactScene heap = testing::heap(40);
  ManifoldFinder by_fields;
  ContactFinder by_triangles;
  heap.add_all_to(by_fields), heap.add_all_to(by_triangles);
  const auto found = contacts_of(by_fields, heap, 1e-2), exact = contacts_of(by_triangles, heap, 1e-2);
  // Bodies of 1 m, three hundredths deep in each other: no pair that triangles have deep is missing.
  std::map<std::pair<Index, Index>, std::pair<double, double>> depths;
  for (const ContactPoint& c : exact) {
    double& depth = depths[{c.a.body, c.b.body}].first;
    depth = std::max(depth, -c.gap);
  }
  for (const ContactPoint& c : found) {
    double& depth = depths[{c.a.body, c.b.body}].second;
    depth = std::max(depth, -c.gap);
  }
  int deep = 0;
  for (const auto& [pair, depth] : depths) {
    deep += depth.first > 0.01 ? 1 : 0;
    if (depth.first > 0.01) {
      EXPECT_GT(depth.second, 0.3 * depth.first) << pair.first << " on " << pair.second;
    }
  }
  EXPECT_GT(deep, 10);
}

TEST(FieldPairs, AnyNumberOfThreadsFindsTheSameBits) {
  const testing::ContactScene heap = testing::heap(40);
  const auto found_by = [&](int threads) {
    ManifoldFinder finder;
    heap.add_all_to(finder);
    testing::ThreadJobs jobs(threads);
    return contacts_of(finder, heap, 1e-2, Vec3::Zero(), jobs);
  };
  const std::vector<ContactPoint> found = found_by(1);
  EXPECT_GT(found.size(), 100u);
  for (const int threads : testing::all_or_first<int>({3, 2, 8})) {
    const std::vector<ContactPoint> again = found_by(threads);
    ASSERT_EQ(found.size(), again.size());
    for (std::size_t c = 0; c < found.size(); ++c) {
      EXPECT_EQ(found[c].id, again[c].id);
      EXPECT_EQ(found[c].gap, again[c].gap);
      EXPECT_EQ(found[c].normal, again[c].normal);
      EXPECT_EQ(found[c].position, again[c].position);
    }
  }
}

TEST(FieldPairs, AWarmQueryAllocatesNothing) {
  testing::ContactScene heap = testing::heap(24);
  ManifoldFinder finder;
  heap.add_all_to(finder);
  std::vector<ContactPoint> contacts;
  const auto query = [&](double sign) {
    for (RigidTransform& pose : heap.poses) pose.p.z() += sign * 0.02;  // farther than manifolds are kept
    finder.find_contacts({.states = heap.states(), .margin = 1e-2}, contacts, serial_jobs());
  };
  for (int i = 0; i < 6; ++i) query(i % 2 == 0 ? 1.0 : -1.0);
  const std::vector<BodyState> states = heap.states();
  std::vector<BodyState> moved = states;
  for (std::size_t i = 1; i < moved.size(); ++i) moved[i].pose.p.x() += 0.02 * static_cast<double>(i % 2);
  finder.find_contacts({.states = moved, .margin = 1e-2}, contacts, serial_jobs());
  finder.find_contacts({.states = states, .margin = 1e-2}, contacts, serial_jobs());
  const long before = testing::allocations();
  finder.find_contacts({.states = moved, .margin = 1e-2}, contacts, serial_jobs());
  finder.find_contacts({.states = states, .margin = 1e-2}, contacts, serial_jobs());
  EXPECT_EQ(testing::allocations(), before);
  EXPECT_FALSE(contacts.empty());
}

}  // namespace
}  // namespace limber
