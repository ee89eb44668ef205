/// @file limber/mesh/tet_locator.h
/// Which tetrahedron holds a point, and which is nearest to a point outside.
#pragma once

#include <array>
#include <memory>

#include "limber/core/types.h"
#include "limber/mesh/tet_mesh.h"

namespace limber {

/// Place of a point relative to a mesh. Barycentric weights belong to the corners of `tet` in their order and sum
/// to 1.
struct TetLocation {
  Index tet = 0;
  double distance = 0.0;  ///< to the mesh, m; 0 inside and on the boundary
  /// Weights of the point itself: Σ weight·corner is the point; some negative outside, unbounded.
  std::array<double, 4> weight{};
  /// Weights of the mesh's point nearest to it: all ≥ 0; the same as `weight` inside.
  std::array<double, 4> nearest{};
};

/// A tree of boxes over the tets of a mesh, of which it keeps what it needs. Queries are exact searches, run in time
/// logarithmic in the number of tets, allocate nothing and may run at the same time.
class TetLocator {
 public:
  /// @throws InvalidArgument if the mesh has no tets. @pre validated mesh (see validate())
  explicit TetLocator(const TetMesh& mesh);
  ~TetLocator();
  TetLocator(TetLocator&&) noexcept;
  TetLocator& operator=(TetLocator&&) noexcept;

  /// The tet that holds p: on shared faces, edges and nodes the one of lowest index. Outside, the tet nearest to p;
  /// where several are (an edge or a corner is nearest) the one whose largest weight is smallest, so that extrapolation
  /// avoids slivers, then the lowest index. "Holds" and "several" allow for round-off. @pre p is finite
  TetLocation locate(const Vec3& p) const;

 private:
  struct Tree;
  std::unique_ptr<const Tree> tree_;
};

}  // namespace limber
