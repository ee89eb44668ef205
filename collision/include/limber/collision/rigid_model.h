/// @file limber/collision/rigid_model.h
/// Rigid bodies from shapes, without a bake: mass properties, and a model of no modes.
///
///   const auto crate = std::make_shared<const Shape>(Box{{0.5, 0.5, 0.5}});
///   const RigidModel wooden = make_rigid_model(crate, mass_properties(*crate, 700.0));
///   world.add_body(wooden.model, {.shape = wooden.shape});
///
/// World::add_rigid() is these lines.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "limber/core/rigid_transform.h"
#include "limber/core/types.h"
#include "limber/model/modal_model.h"
#include "limber/model/shape.h"

namespace limber {

/// How heavy a body is, where its mass is and how hard it is to turn; in the frame of its shape.
struct MassProperties {
  double mass = 0.0;                   ///< kg, > 0
  Vec3 center_of_mass = Vec3::Zero();  ///< m
  Mat3 inertia = Mat3::Zero();         ///< about the centre of mass, kg·m²; symmetric positive definite
};

/// Those of a solid of even density: in closed form for spheres, capsules and boxes, by the divergence theorem for
/// hulls and closed meshes.
/// @param density kg/m³, > 0
/// @throws InvalidArgument for a shape that bounds no solid: a half-space, a height field, a mesh that is open or seen
/// from inside
MassProperties mass_properties(const Shape& shape, double density);

/// A part of a compound: a shape that bounds a solid, and where it is.
struct ShapePart {
  std::shared_ptr<const Shape> shape{};
  RigidTransform pose{};  ///< of the shape, in the frame of the compound
};

/// Of all parts together, in the frame of the compound: masses add up, and moments by the parallel axes. What parts
/// share counts for each of them. @throws InvalidArgument also for no parts
MassProperties mass_properties(std::span<const ShapePart> parts, double density);

/// A cylinder about the z axis as the prism of so many sides whose corners lie on it. limber has no round one. The
/// middles of its sides are radius · (1 − cos(π/sides)) inside: 0.5 % at 32.
/// @param radius, half_length m, > 0 @param sides 3 or more @throws InvalidArgument
ConvexHull cylinder_hull(double radius, double half_length, int sides = 32);

/// What World::add_body() takes of a rigid body.
struct RigidModel {
  /// Free, of no modes, drawn as surface_of() has the shape. Its origin is the centre of mass, which origin_in_input
  /// tells in the frame of the shape; its axes are those of the shape.
  std::shared_ptr<const ModalModel> model{};
  /// The shape about that origin: the given one, where its own origin is the centre of mass; null for a compound.
  std::shared_ptr<const Shape> shape{};
  std::vector<ShapePart> parts{};  ///< of a compound, about that origin
};

/// @throws InvalidArgument as mass_properties() does; for properties that no solid has; and for a sphere or capsule
/// whose centre of mass is not its middle, which no shape tells about another origin
RigidModel make_rigid_model(const std::shared_ptr<const Shape>& shape, const MassProperties& mass);

/// A compound. Loads and handles take the surface of all its parts; with World::add_rigid(), others meet the parts.
RigidModel make_rigid_model(std::span<const ShapePart> parts, const MassProperties& mass);

/// One that is led: World::add_kinematic(). Its origin is the shape's own. @throws InvalidArgument as
/// mass_properties() does
RigidModel make_kinematic_model(const std::shared_ptr<const Shape>& shape);
/// The same of a compound.
RigidModel make_kinematic_model(std::span<const ShapePart> parts);

}  // namespace limber
