#include "limber/collision/rigid_model.h"

#include <cmath>
#include <numbers>
#include <string>
#include <type_traits>
#include <utility>

#include "convex/convex_core.h"
#include "limber/collision/collision_surface.h"
#include "limber/collision/shape_surface.h"
#include "limber/core/error.h"
#include "limber/mesh/surface_mesh.h"

namespace limber {
namespace {

using std::numbers::pi;

/// The solid that a shape bounds, of density 1.
struct Solid {
  SolidProperties operator()(const Sphere& s) const {
    const double volume = 4.0 / 3.0 * pi * s.radius * s.radius * s.radius;
    return {volume, Vec3::Zero(), 0.4 * volume * s.radius * s.radius * Mat3::Identity()};
  }
  /// A cylinder, and a ball whose halves are moved apart; a half-ball's centroid is 3/8 r from its flat side.
  SolidProperties operator()(const Capsule& c) const {
    const double r2 = c.radius * c.radius, h = c.half_length;
    const double tube = 2.0 * pi * r2 * h, ball = 4.0 / 3.0 * pi * r2 * c.radius;
    const double across = tube * (r2 / 4.0 + h * h / 3.0) + ball * (0.4 * r2 + h * h + 0.75 * h * c.radius);
    const double along = 0.5 * tube * r2 + 0.4 * ball * r2;
    return {tube + ball, Vec3::Zero(), Vec3(across, across, along).asDiagonal()};
  }
  SolidProperties operator()(const Box& b) const {
    const Vec3 square = b.half_extents.cwiseAbs2();
    const double volume = 8.0 * b.half_extents.prod();
    return {volume, Vec3::Zero(), Mat3((volume / 3.0 * (Vec3::Constant(square.sum()) - square)).asDiagonal())};
  }
  SolidProperties operator()(const ConvexHull& h) const { return of(internal::triangulated(internal::convex_core(h))); }
  SolidProperties operator()(const TriangleMesh& m) const {
    if (!CollisionSurface(m).closed()) refuse("is an open mesh");
    return of(m);
  }
  SolidProperties operator()(const HalfSpace&) const { refuse("is a half-space"); }
  SolidProperties operator()(const HeightField&) const { refuse("is a height field"); }

 private:
  [[noreturn]] static void refuse(const char* seen) {
    throw InvalidArgument(std::string("mass_properties: the shape ") + seen + ", expected one that bounds a solid");
  }
  static SolidProperties of(const TriangleMesh& mesh) {
    const SolidProperties solid = solid_properties({mesh.vertices, mesh.triangles});
    if (!(solid.volume > 0.0)) refuse("has no inside");
    return solid;
  }
};

SolidProperties solid_of(const Shape& shape) {
  validate(shape);
  return std::visit(Solid{}, shape);
}

/// The same points, told from another origin.
struct About {
  const Vec3& origin;

  Shape operator()(ConvexHull hull) const {
    for (Vec3& p : hull.points) p -= origin;
    return hull;
  }
  Shape operator()(TriangleMesh mesh) const {
    for (Vec3& p : mesh.vertices) p -= origin;
    return mesh;
  }
  Shape operator()(const Box& box) const { return (*this)(ConvexHull{internal::convex_core(box).points}); }
  template <class Round>
  Shape operator()(const Round&) const {
    throw InvalidArgument(
        "make_rigid_model: center_of_mass is not the middle of a sphere or capsule, expected it there");
  }
};

/// Of a shape, or of parts, as they are drawn.
void make_model(RigidModel& made, const char* name, double volume, ModalModelData data) {
  data.name = name;
  data.volume = volume;
  const auto draw = [&](const Shape& shape, const RigidTransform& pose) {
    const TriangleMesh drawn = surface_of(shape, Vec3::Zero(), 1.0);
    const auto first = static_cast<Index>(data.render.rest.size());
    for (const Vec3& p : drawn.vertices) data.render.rest.push_back((pose * p).cast<float>());
    for (const Triangle& t : drawn.triangles)
      data.render.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  };
  if (made.shape) draw(*made.shape, {});
  for (const ShapePart& part : made.parts) draw(*part.shape, part.pose);
  data.render.basis = ModalBasis(static_cast<Index>(data.render.rest.size()), 0);
  made.model = std::make_shared<const ModalModel>(std::move(data));
}

/// About another point than the centre of mass, by the parallel axes: m (d² 1 − d dᵀ).
Mat3 moved_inertia(double mass, const Vec3& by) {
  return mass * (by.squaredNorm() * Mat3::Identity() - by * by.transpose());
}

constexpr double kWater = 1000.0;  // kg/m³, of what is led: nothing asks how heavy it is, but for its energy

void make_led_model(RigidModel& made, const char* name, const MassProperties& mass) {
  ModalModelData data;
  data.motion = FrameMotion::kKinematic;
  data.mass = mass.mass;
  data.inertia = mass.inertia + moved_inertia(mass.mass, mass.center_of_mass);
  make_model(made, name, mass.mass / kWater, std::move(data));
}

void require_parts(std::span<const ShapePart> parts, const char* function) {
  if (parts.empty()) throw InvalidArgument(std::string(function) + ": there are no parts, expected one or more");
  for (const ShapePart& part : parts) {
    if (!part.shape) throw InvalidArgument(std::string(function) + ": the shape of a part is null");
    if (!part.pose.p.allFinite() || !(std::abs(part.pose.q.norm() - 1.0) <= 1e-6))
      throw InvalidArgument(std::string(function) + ": a part's pose is not finite or its quaternion not of length 1");
  }
}

constexpr std::array<const char*, std::variant_size_v<Shape>> kNames{"half-space", "ball", "capsule",     "box",
                                                                     "hull",       "mesh", "height field"};

}  // namespace

MassProperties mass_properties(const Shape& shape, double density) {
  if (!(density > 0.0 && std::isfinite(density)))
    throw InvalidArgument("mass_properties: density is " + std::to_string(density) +
                          " kg/m^3, expected a finite number above 0");
  const SolidProperties solid = solid_of(shape);
  return {density * solid.volume, solid.centroid, density * solid.inertia};
}

MassProperties mass_properties(std::span<const ShapePart> parts, double density) {
  require_parts(parts, "mass_properties");
  MassProperties sum;
  for (const ShapePart& part : parts) {
    const MassProperties own = mass_properties(*part.shape, density);
    sum.mass += own.mass;
    sum.center_of_mass += own.mass * (part.pose * own.center_of_mass);
  }
  sum.center_of_mass /= sum.mass;
  for (const ShapePart& part : parts) {
    const MassProperties own = mass_properties(*part.shape, density);
    const Mat3 R = to_matrix(part.pose.q);
    sum.inertia +=
        R * own.inertia * R.transpose() + moved_inertia(own.mass, part.pose * own.center_of_mass - sum.center_of_mass);
  }
  return sum;
}

ConvexHull cylinder_hull(double radius, double half_length, int sides) {
  if (!(radius > 0.0 && std::isfinite(radius)) || !(half_length > 0.0 && std::isfinite(half_length)) || sides < 3)
    throw InvalidArgument("cylinder_hull: radius " + std::to_string(radius) + " m, half_length " +
                          std::to_string(half_length) + " m, " + std::to_string(sides) +
                          " sides, expected lengths above 0 and 3 sides or more");
  ConvexHull hull;
  for (int i = 0; i < sides; ++i) {
    const double angle = 2.0 * pi * i / sides;
    for (const double z : {-half_length, half_length})
      hull.points.emplace_back(radius * std::cos(angle), radius * std::sin(angle), z);
  }
  return hull;
}

RigidModel make_rigid_model(const std::shared_ptr<const Shape>& shape, const MassProperties& mass) {
  if (!shape) throw InvalidArgument("make_rigid_model: the shape is null");
  if (!mass.center_of_mass.allFinite()) throw InvalidArgument("make_rigid_model: center_of_mass is not finite");
  RigidModel made{nullptr, shape};
  ModalModelData data;
  const double volume = solid_of(*shape).volume;
  if (!mass.center_of_mass.isZero(0.0))
    made.shape = std::make_shared<const Shape>(std::visit(About{mass.center_of_mass}, *shape));
  data.mass = mass.mass;
  data.inertia = mass.inertia;
  data.origin_in_input = mass.center_of_mass;
  make_model(made, kNames[shape->index()], volume, std::move(data));
  return made;
}

RigidModel make_rigid_model(std::span<const ShapePart> parts, const MassProperties& mass) {
  require_parts(parts, "make_rigid_model");
  if (!mass.center_of_mass.allFinite()) throw InvalidArgument("make_rigid_model: center_of_mass is not finite");
  RigidModel made;
  double volume = 0.0;
  for (const ShapePart& part : parts) {
    volume += solid_of(*part.shape).volume;
    made.parts.push_back({part.shape, {part.pose.q, part.pose.p - mass.center_of_mass}});
  }
  ModalModelData data;
  data.mass = mass.mass;
  data.inertia = mass.inertia;
  data.origin_in_input = mass.center_of_mass;
  make_model(made, "compound", volume, std::move(data));
  return made;
}

RigidModel make_kinematic_model(const std::shared_ptr<const Shape>& shape) {
  if (!shape) throw InvalidArgument("make_kinematic_model: the shape is null");
  RigidModel made{nullptr, shape};
  make_led_model(made, kNames[shape->index()], mass_properties(*shape, kWater));
  return made;
}

RigidModel make_kinematic_model(std::span<const ShapePart> parts) {
  RigidModel made;
  const MassProperties mass = mass_properties(parts, kWater);
  made.parts.assign(parts.begin(), parts.end());
  make_led_model(made, "compound", mass);
  return made;
}

}  // namespace limber
