// What touches of one geometry at game speed, made once and shared by all its bodies: samples of the surface, its
// edges, the signed distance of its rest shape and the lattice that displaces the space about it (Barbič and James,
// *Six-DoF Haptic Rendering of Contact Between Geometrically Complex Reduced Deformable Models*, IEEE Transactions on
// Haptics 1(1), 2008).
//
//   Pointshell          what never changes
//   DeformedPointshell  one body of it in one state
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "field/displacement_lattice.h"
#include "field/field_kernels.h"
#include "field/signed_distance_grid.h"
#include "limber/collision/collision_surface.h"
#include "limber/collision/narrow_phase.h"
#include "limber/core/aligned_array.h"
#include "limber/core/jobs.h"

namespace limber::internal {

/// Samples are all vertices of the surface, eight to a cluster, near each other; so are the edges that stick out.
///
/// Coordinates of a body, x = rest + U z in single precision, one column of numbers:
///   clusters of samples, x[8] y[8] z[8] each; their centres, by eights, alike; the centres of the clusters of edges;
///   displacements of the lattice's nodes, xyz each; zeros up to a whole tile of rows
class Pointshell {
 public:
  /// Of a modal or rigid surface.
  explicit Pointshell(std::shared_ptr<const CollisionSurface> surface);
  /// Of a rigid shape with triangles. Distances of a box are in closed form. @pre geometry.surface()
  explicit Pointshell(const RigidGeometry& geometry);

  /// Whether distances can stand for the surface: it is closed, does not bend by a skin, and no more than
  /// FieldTuning::thin_area of it bounds walls thinner than two cells. What is not is left to triangles.
  bool resolved() const { return resolved_; }
  const CollisionSurface& surface() const { return *surface_; }
  Index modes() const { return surface_->modes(); }

  /// Distances of the rest shape. @pre resolved()
  DistanceView distance() const;
  /// They are looked up in a grid; otherwise they are those of a box.
  bool has_grid() const { return grid_ != nullptr; }
  double cell() const { return cell_; }  ///< m, of the grid; of a box, of what it is looked at by
  double longest_side() const { return longest_side_; }
  /// A triangle near the foot of a point of the rest shape.
  Index triangle_near(const FieldHit& hit) const;
  /// Triangles that are nearest to points next to it: of more than one side where these are about as near.
  std::array<Index, 8> triangles_about(const FieldHit& hit) const;

  Index sample_vertex(std::int32_t sample) const { return sample_vertex_[static_cast<std::size_t>(sample)]; }
  Index edge(std::int32_t entry) const { return edges_[static_cast<std::size_t>(entry)]; }
  /// Whether the surface turns outwards at an edge at rest: others touch no edge.
  bool sticks_out(Index edge) const { return sticks_out_[static_cast<std::size_t>(edge)]; }
  /// The part of the surface, between edges that stick out, that a triangle belongs to.
  Index facet(Index triangle) const { return facets_[static_cast<std::size_t>(triangle)]; }
  std::size_t clusters() const { return sample_clusters_.count; }
  std::size_t bytes() const;  ///< of memory, the surface not counted

 private:
  friend class DeformedPointshell;

  void make_distance(const RigidGeometry* geometry);
  /// Clusters of eight, and where their centres and radii stand.
  struct Clusters {
    std::size_t count = 0, groups = 0, centres = 0, radii = 0;
  };
  void order_samples();
  void order_edges();
  void lay_out();
  void make_rows();
  void make_ball(const Clusters& of, std::size_t cluster, std::span<const Index> vertices);
  void set_row(std::size_t row, double rest, const std::vector<double>& u);
  bool turns_outwards(Index edge) const;

  std::shared_ptr<const CollisionSurface> surface_;
  bool resolved_ = false;
  double cell_ = 0.0, longest_side_ = 0.0;
  std::unique_ptr<const SignedDistanceGrid> grid_;
  Vec3f half_extents_ = Vec3f::Zero();    ///< of a box
  std::array<Index, 6> side_triangle_{};  ///< of a box: one of +x, −x, +y, −y, +z, −z
  std::unique_ptr<const DisplacementLattice> lattice_;
  std::vector<std::int32_t> lattice_place_;  ///< per node of its grid, in the coordinates

  Clusters sample_clusters_{}, edge_clusters_{};
  std::size_t lattice_rows_ = 0, rows_ = 0;
  AlignedArray<float> none_;          ///< zeros, as many as samples have rows, up to a whole tile
  std::vector<Index> sample_vertex_;  ///< by cluster; the last ones may be repeated
  std::vector<std::int32_t> slot_;    ///< of vertices: where x stands in the coordinates; −1: of no triangle
  std::vector<std::array<std::int32_t, 3>> corner_slots_;  ///< of triangles: those of its vertices
  std::vector<bool> sticks_out_;                           ///< of edges of the surface
  std::vector<Index> facets_;                              ///< of triangles
  std::vector<Index> edges_;                               ///< by cluster; the last ones may be repeated
  std::vector<std::int32_t> edge_ends_;                    ///< see ShellView
  AlignedArray<float> rest_, U_;                           ///< U in tiles, see multiply_rows()
  /// Per cluster of samples and then of edges: r + Σ |z_i| s_i, how far from its centre it gets.
  AlignedArray<float> radius_, spread_;
  std::vector<float> largest_shape_;  ///< per mode, of any vertex
};

/// Where the samples of one body are. Keeps its numbers from deform() to deform().
class DeformedPointshell {
 public:
  explicit DeformedPointshell(std::shared_ptr<const Pointshell> shell);

  const Pointshell& shell() const { return *shell_; }
  /// The amplitudes of the next deform(), and those expected at the step's end; none: the same.
  /// @pre as many as the shell has modes
  void set_amplitudes(std::span<const double> z, std::span<const double> end = {});

  Vec3f vertex(Index v) const { return at(shell_->slot_[static_cast<std::size_t>(v)]); }
  std::array<Vec3f, 3> corners(Index triangle) const {
    const auto& slots = shell_->corner_slots_[static_cast<std::size_t>(triangle)];
    return {at(slots[0]), at(slots[1]), at(slots[2])};
  }
  /// How a vertex is expected to move as the modes take it, body frame.
  Vec3f swing(Index v) const {
    if (!swings_about_) return Vec3f::Zero();
    const float* u = swings_.data() + shell_->slot_[static_cast<std::size_t>(v)];
    return {u[0], u[kFieldLanes], u[2 * kFieldLanes]};
  }
  float largest_swing() const { return largest_swing_; }  ///< of any vertex, m
  float last_bend() const { return last_bend_; }          ///< how far the last deform() took any vertex, m
  /// Back to the state that it was in after a deform(). @pre of a modal body
  void restore(std::span<const double> z);
  /// Encloses the surface, body frame.
  const Vec3f& low() const { return low_; }
  const Vec3f& high() const { return high_; }
  /// No point of the surface, nor of the space about it, is displaced farther, m.
  float flex() const { return flex_; }
  ShellView view() const;
  /// What carries points back into the rest shape; nothing where the way is short beside a cell.
  LatticeView lattice() const;

 private:
  friend void deform(std::span<DeformedPointshell* const> bodies, Jobs& jobs);
  static void deform_together(std::span<DeformedPointshell* const> bodies);
  void find_extent();
  void find_flex();
  Vec3f at(std::int32_t slot) const {
    const float* x = coordinates_ + slot;
    return {x[0], x[kFieldLanes], x[2 * kFieldLanes]};
  }

  std::shared_ptr<const Pointshell> shell_;
  AlignedArray<float> own_, swings_, radii_;  ///< none of a rigid one
  AlignedArray<float> space_;                 ///< displacements of all nodes of the lattice's grid, see LatticeView
  AlignedArray<float> amplitudes_;            ///< then their magnitudes, then how they are expected to change
  const float* coordinates_ = nullptr;
  Vec3f low_ = Vec3f::Zero(), high_ = Vec3f::Zero();
  float flex_ = 0.0f, largest_swing_ = 0.0f, last_bend_ = 0.0f;
  bool swings_about_ = false;  ///< some amplitude is expected to change
  bool carries_back_ = false;  ///< the lattice's displacements are known, and long beside a cell
};

/// Coordinates of all bodies from their amplitudes: bodies of one shell that follow each other are computed together.
void deform(std::span<DeformedPointshell* const> bodies, Jobs& jobs);

}  // namespace limber::internal
