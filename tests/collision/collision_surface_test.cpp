#include "limber/collision/collision_surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <set>

#include "limber/core/error.h"
#include "shapes.h"
#include "soup.h"
#include "wavy_model.h"

namespace limber {
namespace {

CollisionSurface rigid(const SurfaceMesh& mesh) {
  return CollisionSurface(TriangleMesh{mesh.vertices, mesh.triangles});
}

TEST(CollisionSurface, SphereIsClosedAndFulfilsEulersFormula) {
  const CollisionSurface s(testing::wavy_model(shapes::sphere(Vec3::Zero(), 1.0, 3), 4));
  EXPECT_TRUE(s.closed());
  EXPECT_EQ(s.vertices() - s.edges() + s.triangles(), 2);
}

TEST(CollisionSurface, EveryEdgeKnowsItsTrianglesAndTheyKnowTheEdge) {
  for (const SurfaceMesh& mesh : {shapes::sphere(Vec3::Zero(), 1.0, 2), shapes::soup()}) {
    const CollisionSurface s = rigid(mesh);
    std::vector<Index> count(static_cast<std::size_t>(s.edges()), 0);
    for (Index t = 0; t < s.triangles(); ++t)
      for (int corner = 0; corner < 3; ++corner) {
        const SurfaceEdge& edge = s.edge(s.edge_of(t, corner));
        const Index a = s.triangle(t)[static_cast<std::size_t>(corner)],
                    b = s.triangle(t)[static_cast<std::size_t>((corner + 1) % 3)];
        EXPECT_EQ(edge.vertices, (std::array{std::min(a, b), std::max(a, b)}));
        ++count[static_cast<std::size_t>(s.edge_of(t, corner))];
        const std::span<const Index> sharing = s.edge_triangles(s.edge_of(t, corner));
        EXPECT_TRUE(std::find(sharing.begin(), sharing.end(), t) != sharing.end());
        EXPECT_TRUE(std::is_sorted(sharing.begin(), sharing.end()));
        EXPECT_EQ(s.neighbour(t, corner), sharing.size() != 2 ? -1 : sharing[sharing[0] == t ? 1 : 0]);
      }
    for (Index e = 0; e < s.edges(); ++e) EXPECT_EQ(s.edge(e).triangle_count, count[static_cast<std::size_t>(e)]);
  }
}

TEST(CollisionSurface, VerticesKnowTheirTrianglesAndNeighbours) {
  const CollisionSurface s = rigid(shapes::soup());
  for (Index v = 0; v < s.vertices(); ++v) {
    std::set<Index> triangles, neighbours;
    for (Index t = 0; t < s.triangles(); ++t) {
      const Triangle& corners = s.triangle(t);
      if (std::find(corners.begin(), corners.end(), v) == corners.end()) continue;
      triangles.insert(t);
      neighbours.insert(corners.begin(), corners.end());
    }
    neighbours.erase(v);
    const auto found = s.vertex_triangles(v), near = s.vertex_neighbours(v);
    EXPECT_TRUE(std::equal(found.begin(), found.end(), triangles.begin(), triangles.end()));
    EXPECT_TRUE(std::equal(near.begin(), near.end(), neighbours.begin(), neighbours.end()));
  }
}

TEST(CollisionSurface, AnOpenSurfaceHasBoundaryEdges) {
  SurfaceMesh mesh = shapes::sphere(Vec3::Zero(), 1.0, 1);
  mesh.triangles.pop_back();
  const CollisionSurface s = rigid(mesh);
  EXPECT_FALSE(s.closed());
  Index boundary = 0;
  for (Index e = 0; e < s.edges(); ++e) boundary += s.edge(e).boundary() ? 1 : 0;
  EXPECT_EQ(boundary, 3);
}

TEST(CollisionSurface, ATurnedTriangleOpensTheSurface) {
  SurfaceMesh mesh = shapes::sphere(Vec3::Zero(), 1.0, 1);
  std::swap(mesh.triangles[4][0], mesh.triangles[4][1]);
  EXPECT_FALSE(rigid(mesh).closed());
}

TEST(CollisionSurface, VerticesAtOnePlaceWithOneShapeAreOne) {
  // Every triangle of the sphere with corners of its own.
  const SurfaceMesh sphere = shapes::sphere(Vec3::Zero(), 1.0, 2);
  SurfaceMesh loose;
  for (const Triangle& t : sphere.triangles) {
    const auto first = static_cast<Index>(loose.vertices.size());
    for (const Index v : t) loose.vertices.push_back(sphere.vertices[static_cast<std::size_t>(v)]);
    loose.triangles.push_back({first, first + 1, first + 2});
  }
  const CollisionSurface s(testing::wavy_model(loose, 3)), whole(testing::wavy_model(sphere, 3));
  EXPECT_TRUE(s.closed());
  EXPECT_EQ(s.edges(), whole.edges());
  for (Index v = 0; v < s.vertices(); ++v) {
    EXPECT_LE(s.canonical_vertex(v), v);
    EXPECT_EQ(s.rest(s.canonical_vertex(v)), s.rest(v));
    EXPECT_EQ(s.canonical_vertex(s.canonical_vertex(v)), s.canonical_vertex(v));
  }
}

TEST(CollisionSurface, VerticesAtOnePlaceThatMoveApartStayTwo) {
  SurfaceMesh mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 0}, {0, 0, 1}, {0, 1, 1}}, {{0, 1, 2}, {3, 4, 5}}};
  ModalModelData data = testing::wavy_data(mesh, 2);
  data.render.basis.set(3, 1, Vec3f(9.0f, 0.0f, 0.0f));
  const CollisionSurface s(std::make_shared<const ModalModel>(std::move(data)));
  EXPECT_EQ(s.canonical_vertex(3), 3);
  EXPECT_FALSE(s.adjacent(0, 1));
}

TEST(CollisionSurface, FlatTrianglesAreKept) {
  const SurfaceMesh mesh{{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 1, 0}, {1, 0, 0}},
                         {{0, 1, 2}, {0, 1, 3}, {0, 1, 4}, {1, 1, 1}}};
  const CollisionSurface s = rigid(mesh);
  EXPECT_EQ(s.triangles(), 4);
  EXPECT_FALSE(s.closed());
}

TEST(CollisionSurface, ABoxIsAClosedSurfaceOfItsVolume) {
  const CollisionSurface s(Box{.half_extents = {1.0, 2.0, 3.0}});
  EXPECT_TRUE(s.closed());
  SurfaceMesh mesh;
  for (Index v = 0; v < s.vertices(); ++v) mesh.vertices.push_back(s.rest(v));
  for (Index t = 0; t < s.triangles(); ++t) mesh.triangles.push_back(s.triangle(t));
  EXPECT_DOUBLE_EQ(enclosed_volume(mesh), 48.0);
}

TEST(CollisionSurface, AHeightFieldFacesUpAndPassesThroughItsHeights) {
  const HeightField field{
      .columns = 4, .rows = 3, .spacing_x = 2.0, .spacing_y = 0.5, .heights = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}};
  const CollisionSurface s(field);
  EXPECT_EQ(s.triangles(), 12);
  EXPECT_EQ(s.rest(1 * 4 + 3), Vec3(6.0, 0.5, 7.0));
  for (Index t = 0; t < s.triangles(); ++t) {
    const auto& [a, b, c] = s.triangle(t);
    EXPECT_GT((s.rest(b) - s.rest(a)).cross(s.rest(c) - s.rest(a)).z(), 0.0);
  }
  EXPECT_TRUE(s.edge(s.edge_of(0, 2)).vertices == (std::array<Index, 2>{0, 5})) << "split from (0, 0) to (1, 1)";
}

TEST(CollisionSurface, TheTreeHoldsEveryTriangleOnceInFullLeaves) {
  for (const int leaf : {1, 3, 4, 8, 64}) {
    const SurfaceMesh mesh = shapes::sphere(Vec3::Zero(), 1.0, 3);
    const CollisionSurface s(TriangleMesh{mesh.vertices, mesh.triangles}, {.leaf_triangles = leaf});
    std::vector<Index> seen;
    Index short_leaves = 0;
    for (std::size_t n = 0; n < s.nodes().size(); ++n) {
      const TreeNode& node = s.nodes()[n];
      EXPECT_GT(node.count, 0);
      if (node.leaf()) {
        EXPECT_LE(node.count, leaf);
        short_leaves += node.count < leaf ? 1 : 0;
        for (const Index t : s.node_triangles(static_cast<Index>(n))) seen.push_back(t);
      } else {
        EXPECT_GT(node.child, static_cast<Index>(n));
        EXPECT_EQ(s.node(node.child).first, node.first);
        EXPECT_EQ(s.node(node.child).count + s.node(node.child + 1).count, node.count);
      }
    }
    EXPECT_LE(short_leaves, 1);
    std::sort(seen.begin(), seen.end());
    std::vector<Index> all(static_cast<std::size_t>(s.triangles()));
    std::iota(all.begin(), all.end(), 0);
    EXPECT_EQ(seen, all);
  }
}

TEST(CollisionSurface, LargestShapeBoundsEveryVertex) {
  const CollisionSurface s(testing::wavy_model(shapes::sphere(Vec3::Zero(), 1.0, 2), 6));
  for (Index mode = 0; mode < 6; ++mode)
    for (Index v = 0; v < s.vertices(); ++v)
      EXPECT_GE(s.largest_shape(mode), Vec3(s.row(v, 0)[mode], s.row(v, 1)[mode], s.row(v, 2)[mode]).norm());
}

TEST(CollisionSurface, RefusesWhatIsNoSurface) {
  EXPECT_THROW(CollisionSurface(std::shared_ptr<const ModalModel>()), InvalidArgument);
  EXPECT_THROW(CollisionSurface(TriangleMesh{}), InvalidArgument);
  EXPECT_THROW(CollisionSurface(TriangleMesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 3}}}), InvalidArgument);
  EXPECT_THROW(CollisionSurface(TriangleMesh{{{0, 0, 0}, {1e31, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}}), InvalidArgument);
  EXPECT_THROW(CollisionSurface(Box{}, {.leaf_triangles = 0}), InvalidArgument);
  EXPECT_THROW(CollisionSurface(Box{}, {.leaf_triangles = 65}), InvalidArgument);
}

}  // namespace
}  // namespace limber
