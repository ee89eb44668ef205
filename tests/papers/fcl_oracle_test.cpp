// ContactFinder against FCL, for random pairs of bodies that bend and shapes: FCL's own queries on the same triangles
// (do they intersect, how far apart are they, and along which way), and FclContactSource (how deep, and which way out).
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/distance.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "asked.h"
#include "finder_scenes.h"
#include "limber/collision/collision_surface.h"
#include "limber/collision_fcl/fcl_contact_source.h"
#include "narrow_phase_bodies.h"

namespace limber {
namespace {

using testing::ContactScene;
using testing::Random;

/// What FCL and limber may differ by on gaps of bodies of about 1 m: some hundred roundings of FCL's projections.
constexpr double kOracleGap = 1e-9;
/// What libccd's iteration, which FCL asks for capsules and triangles, is off by (1.4e-8 in 100 trials of each kind).
constexpr double kIterated = 1e-7;
/// Of unit normals, times size / gap: points that are right to a gap's tolerance, a gap apart.
constexpr double kOracleNormal = 1e-8;
/// Nearer than this nothing is said of touching or not.
constexpr double kGrazing = 1e-8;
/// m: as deep as a hundredth of an edge, solids lie on each other face to face, and each source has its way to choose
/// which face that is.
constexpr double kFaceOnFace = 0.01;
/// ConvexTuning::edge_preference: least depths may be so much of what is found.
constexpr double kEdgePreference = 0.95;
/// libccd's word on whether convex shapes touch is good to this.
constexpr double kPartsBy = 1e-5;

/// A body as FCL alone has it: its triangles in the world as a mesh, or a ball or capsule.
struct OracleBody {
  std::shared_ptr<fcl::CollisionGeometry<double>> geometry;
  fcl::Transform3<double> X = fcl::Transform3<double>::Identity();

  OracleBody(const BodyGeometry& of, const BodyState& state) {
    X.linear() = to_matrix(state.pose.q);
    X.translation() = state.pose.p;
    if (of.shape != nullptr) {
      if (const auto* ball = std::get_if<Sphere>(of.shape.get()))
        geometry = std::make_shared<fcl::Sphere<double>>(ball->radius);
      if (const auto* capsule = std::get_if<Capsule>(of.shape.get()))
        geometry = std::make_shared<fcl::Capsule<double>>(capsule->radius, 2.0 * capsule->half_length);
    }
    if (geometry == nullptr) geometry = mesh(of, state);
  }
  static std::shared_ptr<fcl::CollisionGeometry<double>> mesh(const BodyGeometry& of, const BodyState& state) {
    const auto surface =
        of.model ? std::make_shared<const CollisionSurface>(of.model) : RigidGeometry(*of.shape).surface();
    DeformedSurface deformed;
    deformed.bind(surface, state.amplitudes);
    std::vector<Vec3> points;
    for (Index v = 0; v < surface->vertices(); ++v) points.push_back(deformed.vertex(v));
    std::vector<fcl::Triangle> triangles;
    for (Index t = 0; t < surface->triangles(); ++t) {
      const Triangle& c = surface->triangle(t);
      triangles.emplace_back(static_cast<std::size_t>(c[0]), static_cast<std::size_t>(c[1]),
                             static_cast<std::size_t>(c[2]));
    }
    auto mesh = std::make_shared<fcl::BVHModel<fcl::OBBRSS<double>>>();
    mesh->beginModel();
    mesh->addSubModel(points, triangles);
    mesh->endModel();
    return mesh;
  }
};

bool intersect(const OracleBody& a, const OracleBody& b) {
  const fcl::CollisionRequest<double> ask;
  fcl::CollisionResult<double> answer;
  return fcl::collide(a.geometry.get(), a.X, b.geometry.get(), b.X, ask, answer) > 0;
}
fcl::DistanceResult<double> distance(const OracleBody& a, const OracleBody& b) {
  fcl::DistanceRequest<double> ask(true);
  ask.distance_tolerance = 1e-12;
  fcl::DistanceResult<double> answer;
  fcl::distance(a.geometry.get(), a.X, b.geometry.get(), b.X, ask, answer);
  return answer;
}

/// A kind of body, and how it is placed.
struct Kind {
  std::string name;
  std::function<BodyGeometry(Random&)> make;
};

BodyGeometry of_shape(const Shape& s) { return {.model = {}, .shape = std::make_shared<const Shape>(s)}; }

ConvexHull random_hull(Random& random) {
  ConvexHull hull;
  for (int i = 0; i < 14; ++i) {
    const Vec3 p = random.vector(1.0);
    hull.points.push_back(0.5 * p / p.norm());
  }
  return hull;
}

TriangleMesh lumpy_mesh() {
  SurfaceMesh mesh = shapes::sphere(Vec3::Zero(), 0.5, 2);
  for (Vec3& p : mesh.vertices) p *= 1.0 + 0.1 * std::sin(9.0 * p.x() + 2.0 * p.y());
  return {mesh.vertices, mesh.triangles};
}

const std::vector<Kind>& solids() {
  static const std::vector<Kind> all{
      {"bending", [](Random&) { return BodyGeometry{.model = testing::lumpy_sphere(2, 6), .shape = {}}; }},
      {"bending bar",
       [](Random&) {
         return BodyGeometry{.model = testing::wavy_model(shapes::box({-0.5, -0.12, -0.12}, {0.5, 0.12, 0.12}), 4),
                             .shape = {}};
       }},
      {"mesh", [](Random&) { return of_shape(lumpy_mesh()); }},
      {"box",
       [](Random& r) { return of_shape(Box{Vec3(r.uniform(0.1, 0.5), r.uniform(0.1, 0.5), r.uniform(0.1, 0.5))}); }},
      {"hull", [](Random& r) { return of_shape(random_hull(r)); }},
  };
  return all;
}
const std::vector<Kind>& rounds() {
  static const std::vector<Kind> all{
      {"ball", [](Random& r) { return of_shape(Sphere{r.uniform(0.1, 0.5)}); }},
      {"capsule",
       [](Random& r) {
         return of_shape(Capsule{r.uniform(0.1, 0.3), r.uniform(0.1, 0.4)});
       }},
  };
  return all;
}

std::vector<double> random_amplitudes(const BodyGeometry& g, Random& random) {
  return g.model ? random.amplitudes(g.model->modes(), 0.03) : std::vector<double>{};
}

const ContactPoint& least(const std::vector<ContactPoint>& contacts) {
  return *std::min_element(contacts.begin(), contacts.end(),
                           [](const ContactPoint& p, const ContactPoint& q) { return p.gap < q.gap; });
}

constexpr double kOracleMargin = 0.05, kDeepest = 0.03;

struct Found {
  std::vector<ContactPoint> limber, fcl;
};
Found find_both(const ContactScene& scene) {
  ContactFinder finder({.overlap = OverlapMethod::kNearestPoint});
  FclContactSource source;
  scene.add_all_to(finder);
  scene.add_all_to(source);
  return {testing::contacts_of(finder, scene, kOracleMargin), testing::contacts_of(source, scene, kOracleMargin)};
}

/// Two bodies near where they just touch along some way, by FCL's word: at most kDeepest past it.
ContactScene random_pair(const Kind& a, const Kind& b, Random& random) {
  ContactScene scene;
  for (const Kind* kind : {&a, &b}) {
    const BodyGeometry g = kind->make(random);
    scene.add(g, random.pose(0.1), random_amplitudes(g, random));
  }
  const OracleBody first(scene.geometries[0], scene.states()[0]);
  OracleBody second(scene.geometries[1], scene.states()[1]);
  const Vec3 start = scene.poses[1].p, way = random.vector(1.0).normalized();
  double low = 3.0;
  do {
    low -= 0.03;
    second.X.translation() = start + low * way;
  } while (low > 0.0 && !intersect(first, second));
  double high = low + 0.03;
  while (high - low > 1e-4) {
    second.X.translation() = start + 0.5 * (low + high) * way;
    (intersect(first, second) ? low : high) = 0.5 * (low + high);
  }
  scene.poses[1].p = start + (high + random.uniform(-kDeepest, kOracleMargin)) * way;
  return scene;
}

bool is_convex_shape(const BodyGeometry& g) {
  return g.shape != nullptr && !std::holds_alternative<TriangleMesh>(*g.shape);
}

/// Corners of a body's surface as it is bent, body frame.
std::vector<Vec3> corners_of(const OracleBody& body) {
  const auto* mesh = dynamic_cast<const fcl::BVHModel<fcl::OBBRSS<double>>*>(body.geometry.get());
  return mesh == nullptr ? std::vector<Vec3>() : std::vector<Vec3>(mesh->vertices, mesh->vertices + mesh->num_vertices);
}

/// The contact that a corner of one side makes, if it is one of a corner inside the other body.
struct CornerInside {
  const ContactPoint* contact;
  int side;
  std::size_t corner;
};
std::vector<CornerInside> corners_inside(const std::vector<ContactPoint>& contacts,
                                         const std::array<std::vector<Vec3>, 2>& corners) {
  std::vector<CornerInside> all;
  for (const ContactPoint& c : contacts)
    for (int side = 0; side < 2 && c.gap < -kGrazing; ++side) {
      const auto& of = corners[static_cast<std::size_t>(side)];
      for (std::size_t v = 0; v < of.size(); ++v)
        if ((of[v] - (side == 0 ? c.a : c.b).point_B).norm() < kOracleGap) all.push_back({&c, side, v});
    }
  return all;
}

struct Tally {
  int apart = 0, overlapping = 0, corners = 0;
  int other_face = 0;  ///< of corners that lie on a solid, face to face
};

/// As FCL's own queries have it; what is apart also as FclContactSource has it.
void expect_gap_and_normal(const OracleBody& a, const OracleBody& b, const Found& found) {
  const auto apart = distance(a, b);
  if (apart.min_distance > kOracleMargin - kGrazing) {
    if (apart.min_distance > kOracleMargin + kGrazing) {
      EXPECT_TRUE(found.limber.empty());
    }
    return;
  }
  ASSERT_FALSE(found.limber.empty());
  ASSERT_FALSE(found.fcl.empty());
  const ContactPoint &l = least(found.limber), &f = least(found.fcl);
  const bool iterates = dynamic_cast<const fcl::Capsule<double>*>(a.geometry.get()) != nullptr ||
                        dynamic_cast<const fcl::Capsule<double>*>(b.geometry.get()) != nullptr;
  EXPECT_NEAR(l.gap, apart.min_distance, iterates ? kIterated : kOracleGap);
  EXPECT_NEAR(f.gap, l.gap, kOracleGap);
  EXPECT_LE((l.normal - f.normal).norm() * l.gap, kOracleNormal);
}

/// Convex shapes have one normal and depth, those of least penetration: moved so far they part, and along no other way
/// sooner, but for the preference of faces over edges.
void expect_least_penetration(const OracleBody& a, OracleBody b, const ContactPoint& deepest, Random& random) {
  const Vec3 at = b.X.translation();
  const auto parts = [&](const Vec3& way) {
    b.X.translation() = at + way;
    return !intersect(a, b);
  };
  EXPECT_TRUE(parts((kPartsBy - deepest.gap) * -deepest.normal)) << deepest.gap;
  const double least = kEdgePreference * -deepest.gap - kPartsBy;
  EXPECT_FALSE(parts(least * -deepest.normal)) << deepest.gap;
  for (int i = 0; i < 30; ++i) EXPECT_FALSE(parts(least * random.vector(1.0).normalized()));
}

/// Of balls and capsules the deepest contact is one of both.
void expect_least_alike(const Found& found) {
  const ContactPoint &l = least(found.limber), &f = least(found.fcl);
  EXPECT_NEAR(l.gap, f.gap, kOracleGap);
  EXPECT_LE((l.normal - f.normal).norm() * -l.gap, kOracleNormal) << l.gap;
}

/// What is inside the other body is a contact of both, as deep and with the same way out.
void expect_corners_inside_alike(const OracleBody& a, const OracleBody& b, const Found& found, Tally& tally) {
  const std::array<std::vector<Vec3>, 2> corners{corners_of(a), corners_of(b)};
  const auto of_limber = corners_inside(found.limber, corners), of_fcl = corners_inside(found.fcl, corners);
  for (const CornerInside& l : of_limber) {
    const auto twin = std::find_if(of_fcl.begin(), of_fcl.end(),
                                   [&](const CornerInside& f) { return f.side == l.side && f.corner == l.corner; });
    ASSERT_NE(twin, of_fcl.end()) << l.contact->gap;
    ++tally.corners;
    if (-l.contact->gap < kFaceOnFace && (l.contact->normal - twin->contact->normal).norm() > kOracleNormal) {
      ++tally.other_face;
      continue;
    }
    EXPECT_NEAR(l.contact->gap, twin->contact->gap, kOracleGap);
    EXPECT_LE((l.contact->normal - twin->contact->normal).norm() * -l.contact->gap, kOracleNormal) << l.contact->gap;
  }
  EXPECT_EQ(of_limber.size(), of_fcl.size());
}

void compare(const ContactScene& scene, Random& random, Tally& tally) {
  const Found found = find_both(scene);
  const OracleBody a(scene.geometries[0], scene.states()[0]), b(scene.geometries[1], scene.states()[1]);
  if (!intersect(a, b)) {
    ++tally.apart;
    expect_gap_and_normal(a, b, found);
    return;
  }
  ++tally.overlapping;
  ASSERT_FALSE(found.limber.empty());
  ASSERT_FALSE(found.fcl.empty());
  EXPECT_LE(least(found.limber).gap, kGrazing);
  EXPECT_LE(least(found.fcl).gap, kGrazing);
  const auto is_round = [](const OracleBody& body) { return corners_of(body).empty(); };
  if (is_convex_shape(scene.geometries[0]) && is_convex_shape(scene.geometries[1]))
    expect_least_penetration(a, b, least(found.limber), random);
  else if (is_round(a) || is_round(b))
    expect_least_alike(found);
  else
    expect_corners_inside_alike(a, b, found, tally);
}

TEST(FclOracle, PairsOfSolidsTouchAlikeWithGapsDepthsAndNormalsAlike) {
  Random random(31);
  std::vector<const Kind*> all;
  for (const Kind& k : solids()) all.push_back(&k);
  for (const Kind& k : rounds()) all.push_back(&k);
  Tally tally;
  const int trials = testing::asked("LIMBER_TRIALS", 12);  // of each pair
  for (std::size_t i = 0; i < all.size(); ++i)
    for (std::size_t j = i; j < all.size(); ++j) {
      SCOPED_TRACE(all[i]->name + " and " + all[j]->name);
      for (int trial = 0; trial < trials; ++trial) compare(random_pair(*all[i], *all[j], random), random, tally);
    }
  EXPECT_GT(tally.apart, trials);
  EXPECT_GT(tally.overlapping, trials);
  EXPECT_GT(tally.corners, trials);
  EXPECT_LE(tally.other_face, tally.corners / 50);
}

}  // namespace
}  // namespace limber
