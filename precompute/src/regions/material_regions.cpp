#include "limber/precompute/material_regions.h"

#include <cmath>

#include "limber/core/error.h"

namespace limber {
namespace {

void check(bool holds, const std::string& region, const std::string& expected) {
  if (!holds) throw InvalidArgument("region \"" + region + "\": " + expected);
}

void check_shape(const Everywhere&, const std::string&) {}
void check_shape(const NearFaces& f, const std::string& region) {
  check(f.depth > 0.0, region, "depth is " + std::to_string(f.depth) + " m, expected above 0");
}
void check_shape(const InsideShells& s, const std::string& region) {
  SurfaceMesh welded = s.surface;
  weld(welded);
  const SurfaceQuality q = surface_quality(welded);
  check(!welded.triangles.empty() && q.closed_manifold(), region,
        "its shells are not closed: " + std::to_string(q.boundary_edges) + " edges of one triangle, " +
            std::to_string(q.non_manifold_edges) + " of three or more, " + std::to_string(q.misoriented_edges) +
            " that both triangles run through the same way");
}
void check_shape(const InsideBox& b, const std::string& region) {
  check(b.low.allFinite() && b.high.allFinite() && (b.low.array() < b.high.array()).all(), region,
        "the box's low corner is not below its high one");
}
void check_shape(const InsideBall& b, const std::string& region) {
  check(b.center.allFinite() && b.radius > 0.0 && std::isfinite(b.radius), region,
        "the ball's radius is " + std::to_string(b.radius) + " m, expected above 0");
}
void check_shape(const InsideHalfSpace& h, const std::string& region) {
  check(h.point.allFinite() && h.normal.allFinite() && h.normal.norm() > 0.0, region,
        "the half-space's normal is no direction");
}

}  // namespace

std::optional<Material> MaterialField::at(const Vec3& p) const {
  Material material = rest;
  const std::array<std::pair<const char*, double*>, 3> wanted{{{"youngs_modulus", &material.youngs_modulus},
                                                               {"poisson_ratio", &material.poisson_ratio},
                                                               {"density", &material.density}}};
  for (const auto& [name, number] : wanted) {
    const VoxelGrid::Field* field = grid.find(name);
    if (!field) continue;
    const std::optional<double> value = grid.value_at(*field, p);
    if (!value) return std::nullopt;
    *number = *value;
  }
  return material;
}

void MaterialRegion::validate() const {
  std::visit([&](const auto& s) { check_shape(s, name); }, shape);
  if (const auto* one = std::get_if<Material>(&material)) one->validate("material of region \"" + name + "\"");
}

}  // namespace limber
