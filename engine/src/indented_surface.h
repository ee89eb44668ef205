// How the indentations that contacts press into a body beyond its kept modes (residual_compliance.h) show on what is
// drawn: the collision surface moves by G f, and each vertex of the render surface with the point of it that was
// nearest at rest.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "limber/constraints/contact_constraint.h"
#include "limber/model/modal_model.h"

namespace limber::internal {

/// Of one model. Not for two threads at a time.
class IndentedSurface {
 public:
  /// Looks up all vertices of the render surface. @pre the model has a residual compliance, and outlives this
  explicit IndentedSurface(const ModalModel& model);

  /// Displacement of every vertex of the render surface, body frame, m; linear in the loads.
  /// @param before, now loads of two states, of which (1 − s) and s parts count
  void displacements(std::span<const IndentationLoad> before, std::span<const IndentationLoad> now, double s,
                     std::span<float> d);
  /// Of one material point, body frame, m. @pre it is valid
  Vec3 displacement(std::span<const IndentationLoad> loads, const SurfacePoint& at) const;

 private:
  /// A point of the collision surface by its vertices.
  struct Place {
    std::array<Index, 3> vertex{};
    std::array<float, 3> weight{};
  };
  void find_places();
  void add_forces(std::span<const IndentationLoad> loads, double part);
  void move_vertices();
  Place place(Index render_vertex) const;
  Vec3 displacement(std::span<const IndentationLoad> loads, Index vertex) const;

  const ModalModel* model_;
  std::vector<Place> places_;   // by render vertex; none where the render surface is what touches
  std::vector<Vec3> forces_;    // by vertex of the collision surface
  std::vector<Index> pressed_;  // those with a force
  std::vector<Vec3f> moved_;    // by vertex of the collision surface
};

}  // namespace limber::internal
