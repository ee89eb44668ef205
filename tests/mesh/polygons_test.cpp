// Polygons of any shape become triangles that cover them exactly.
#include <gmock/gmock.h>

#include <cmath>
#include <map>
#include <numbers>
#include <random>

#include "limber/core/error.h"
#include "limber/mesh/read_mesh.h"
#include "sample_meshes.h"

namespace limber {
namespace {

using namespace samples;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

using Outline = std::vector<Eigen::Vector2d>;

double area(const Outline& p) {
  double twice = 0.0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const auto &a = p[i], &b = p[(i + 1) % p.size()];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return 0.5 * twice;
}

/// A prism of height 1 over an outline whose equal points are one vertex: two end faces and a quad for each side that
/// the outline passes once. @param frame turns it in space
SurfaceMesh prism(const Folder& folder, const Outline& outline, const Mat3& frame, const std::string& format,
                  Warnings& warnings) {
  std::map<std::pair<double, double>, int> number;
  std::vector<int> corner;
  std::vector<Vec3> low;
  for (const auto& p : outline) {
    const auto [entry, is_new] = number.try_emplace({p.x(), p.y()}, static_cast<int>(low.size()));
    if (is_new) low.emplace_back(p.x(), p.y(), 0.0);
    corner.push_back(entry->second);
  }
  const int n = static_cast<int>(low.size());
  std::vector<Vec3> vertices;
  for (const Vec3& p : low) vertices.emplace_back(frame * p);
  for (const Vec3& p : low) vertices.emplace_back(frame * (p + Vec3(0, 0, 1)));
  std::vector<std::vector<int>> faces(2);
  for (const int c : corner) faces[0].push_back(n + c), faces[1].insert(faces[1].begin(), c);
  std::map<std::pair<int, int>, int> passes;
  const auto next = [&](std::size_t i) { return corner[(i + 1) % corner.size()]; };
  for (std::size_t i = 0; i < corner.size(); ++i) ++passes[std::minmax(corner[i], int{next(i)})];
  for (std::size_t i = 0; i < corner.size(); ++i)
    if (passes[std::minmax(corner[i], int{next(i)})] == 1)
      faces.push_back({corner[i], next(i), n + next(i), n + corner[i]});

  std::string text;
  if (format == "obj") {
    for (const Vec3& p : vertices) text += "v" + joined(p) + "\n";
    for (const auto& f : faces) text += "f" + joined(f, 1) + "\n";
  } else {
    const std::string v = std::to_string(vertices.size()), f = std::to_string(faces.size());
    text = format == "off" ? "OFF\n" + v + " " + f + " 0\n"
                           : "ply\nformat ascii 1.0\nelement vertex " + v +
                                 "\nproperty double x\nproperty double y\nproperty double z\nelement face " + f +
                                 "\nproperty list int int vertex_indices\nend_header\n";
    for (const Vec3& p : vertices) text += joined(p) + "\n";
    for (const auto& polygon : faces) text += std::to_string(polygon.size()) + joined(polygon) + "\n";
  }
  return read_surface_mesh(folder.write("prism." + format, text), warnings);
}

Outline ring(double radius, int corners, double depth = 0.0) {
  Outline out;
  for (int i = 0; i < corners; ++i) {
    const double r = radius - (i % 2 == 1 ? depth : 0.0), angle = 2.0 * std::numbers::pi * i / corners;
    out.emplace_back(r * std::cos(angle), r * std::sin(angle));
  }
  return out;
}

/// Goes from the outer corner `from` to a hole, around it, and back: a keyhole.
Outline with_hole(const Outline& outer, std::size_t from, const Outline& hole) {
  Outline out(outer.begin(), outer.begin() + static_cast<std::ptrdiff_t>(from) + 1);
  out.insert(out.end(), hole.begin(), hole.end());
  out.push_back(hole.front());
  out.insert(out.end(), outer.begin() + static_cast<std::ptrdiff_t>(from), outer.end());
  return out;
}

Outline square(double x, double y, double side, bool clockwise = false) {
  Outline out = {{x, y}, {x + side, y}, {x + side, y + side}, {x, y + side}};
  if (clockwise) std::reverse(out.begin() + 1, out.end());
  return out;
}

struct Case {
  std::string name;
  Outline outline;
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

std::vector<Case> cases() {
  const Outline two_holes =
      with_hole(with_hole(square(0, 0, 5), 0, square(1, 1, 1, true)), 8, {{4, 4}, {4, 3}, {3, 3}, {3, 4}});
  Outline spiral;
  for (int i = 0; i <= 60; ++i)
    spiral.push_back((1.0 + 0.1 * i) * Eigen::Vector2d(std::cos(0.3 * i), std::sin(0.3 * i)));
  for (int i = 60; i >= 0; --i)
    spiral.push_back((0.7 + 0.1 * i) * Eigen::Vector2d(std::cos(0.3 * i), std::sin(0.3 * i)));
  Outline lined = {{0, 0}, {1, 0}, {2, 0}, {3, 0}, {3, 1}, {3, 3}, {2, 3}, {1, 3}, {0, 3}, {0, 1}};
  Outline comb = {{0, 0}, {20, 0}};
  for (int i = 20; i-- > 0;) {
    comb.emplace_back(i + 1.0, 5.0);
    comb.emplace_back(i + 0.5, 1.0);
  }
  comb.emplace_back(0.0, 5.0);
  return {{"Square", square(0, 0, 2)},
          {"SquareWithPointsOnItsSides", lined},
          {"Tube", with_hole(square(0, 0, 2), 0, square(0.5, 0.5, 1, true))},
          {"TubeBridgedElsewhere", with_hole(square(0, 0, 2), 2, {{1.5, 1.5}, {1.5, 0.5}, {0.5, 0.5}, {0.5, 1.5}})},
          {"TwoHoles", two_holes},
          {"SerratedDiscOf514", ring(1.0, 514, 0.1)},
          {"SerratedDiscOf4000", ring(1.0, 4000, 0.01)},
          {"DiscOf1000", ring(1.0, 1000)},
          {"Annulus", with_hole(ring(1.0, 400), 7,
                                [] {
                                  Outline hole = ring(0.6, 400);
                                  std::reverse(hole.begin() + 1, hole.end());
                                  return hole;
                                }())},
          {"Star", ring(1.0, 10, 0.6)},
          {"Spiral", spiral},
          {"Comb", comb}};
}

class Prism : public ::testing::TestWithParam<Case> {};

TEST_P(Prism, IsClosedAndHasItsVolume) {
  const Folder folder;
  Outline outline = GetParam().outline;
  if (area(outline) < 0.0) std::reverse(outline.begin(), outline.end());
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  for (const std::string format : {"obj", "ply", "off"})
    for (int turn = 0; turn < 4; ++turn) {
      const Mat3 frame = turn == 0 ? Mat3::Identity()
                                   : Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
                                         .normalized()
                                         .toRotationMatrix();
      Warnings warnings;
      const SurfaceMesh s = prism(folder, outline, frame, format, warnings);
      EXPECT_THAT(warnings, IsEmpty());
      EXPECT_TRUE(surface_quality(s).closed_manifold()) << format << turn;
      EXPECT_NEAR(enclosed_volume(s), area(outline), 1e-12 * area(outline)) << format << turn;
      for (const Triangle& t : s.triangles) {
        const Vec3 u = s.vertices[t[1]] - s.vertices[t[0]], v = s.vertices[t[2]] - s.vertices[t[0]];
        EXPECT_GT(u.cross(v).norm(), 1e-12 * std::max(u.squaredNorm(), v.squaredNorm()));
      }
    }
}

/// None covers another: their areas, all positive, add up to the outline's.
TEST_P(Prism, HasEndsOfTrianglesThatDoNotOverlap) {
  const Folder folder;
  Outline outline = GetParam().outline;
  if (area(outline) < 0.0) std::reverse(outline.begin(), outline.end());
  Warnings warnings;
  const SurfaceMesh s = prism(folder, outline, Mat3::Identity(), "obj", warnings);
  double up = 0.0;
  for (const Triangle& t : s.triangles) {
    const Vec3 n = 0.5 * (s.vertices[t[1]] - s.vertices[t[0]]).cross(s.vertices[t[2]] - s.vertices[t[0]]);
    if (s.vertices[t[0]].z() + s.vertices[t[1]].z() + s.vertices[t[2]].z() == 3.0) {
      EXPECT_GT(n.z(), 0.0);
      up += n.norm();
    }
  }
  EXPECT_NEAR(up, area(outline), 1e-12 * area(outline));
}

INSTANTIATE_TEST_SUITE_P(Over, Prism, ::testing::ValuesIn(cases()), [](const auto& c) { return c.param.name; });

/// Outlines that do not cross: radii at random around a point, then holes at random places far inside.
TEST(Polygons, ThousandRandomOnesAreCovered) {
  const Folder folder;
  std::mt19937 random(20261126);
  std::uniform_real_distribution<double> unit;
  for (int trial = 0; trial < 1000; ++trial) {
    Outline outline;
    const int corners = 5 + static_cast<int>(random() % 60);
    for (int i = 0; i < corners; ++i) {
      const double angle = 2.0 * std::numbers::pi * (i + 0.8 * unit(random)) / corners, r = 1.0 + 3.0 * unit(random);
      outline.emplace_back(r * std::cos(angle), r * std::sin(angle));
    }
    if (trial % 3 == 1) {
      const Eigen::Vector2d along = 0.05 * outline[0].normalized(), across(-along.y(), along.x());
      outline = with_hole(outline, 0, {along, -across, -along, across});
    }
    // On a grid, corners lie on lines of others.
    if (trial % 3 == 2)
      for (auto& p : outline) p = {std::round(p.x() * 1024.0) / 1024.0, std::round(p.y() * 1024.0) / 1024.0};
    Warnings warnings;
    const SurfaceMesh s = prism(folder, outline, Mat3::Identity(), "obj", warnings);
    double covered = 0.0;
    for (const Triangle& t : s.triangles) {
      const Vec3 n = 0.5 * (s.vertices[t[1]] - s.vertices[t[0]]).cross(s.vertices[t[2]] - s.vertices[t[0]]);
      if (std::abs(n.z()) > 0.999 * n.norm()) covered += n.norm();
    }
    ASSERT_NEAR(covered, 2.0 * area(outline), 1e-9) << trial;
    ASSERT_TRUE(surface_quality(s).closed_manifold()) << trial;
    ASSERT_THAT(warnings, IsEmpty()) << trial;
  }
}

TEST(Polygons, MayTouchThemselvesAtACorner) {
  const Folder folder;
  const Outline outline = {{0, 0}, {0.5, 1.0}, {1.0, 0.5}, {0, 0}, {2, 0}, {2, 2}, {0, 2}};
  Warnings warnings;
  EXPECT_NEAR(enclosed_volume(prism(folder, outline, Mat3::Identity(), "obj", warnings)), 4.0 - 0.375, 1e-14);
  EXPECT_THAT(warnings, IsEmpty());
}

TEST(Polygons, ThatCrossThemselvesAreTold) {
  const Folder folder;
  Warnings warnings;
  read_surface_mesh(folder.write("bow.obj", "v 0 0 0\nv 2 0 0\nv 0 1 0\nv 3 1.5 0\nv 4 0 1\nf 1 2 3 4\nf 1 2 5\n"),
                    warnings);
  EXPECT_THAT(warnings, ::testing::ElementsAre(HasSubstr("1 polygons cross themselves")));
}

}  // namespace
}  // namespace limber
