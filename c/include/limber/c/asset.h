/// @file limber/c/asset.h
/// What bodies are made of, in the C interface: assets (baked, or soft ones made on the spot), models and rigid shapes.
#pragma once

#include "limber/c/base.h"

#ifdef __cplusplus
extern "C" {
#endif

/// One or more bodies that were baked together: docs/formats/asset.md. Does not change.
typedef struct limber_asset limber_asset;
/// One body of an asset or of a world: lives as long as that does. Does not change.
typedef struct limber_model limber_model;
/// A rigid shape. Does not change.
typedef struct limber_shape limber_shape;

/// Reads a GLB that limber-precompute wrote. @param path UTF-8
/// @return LIMBER_INPUT_ERROR also for a file whose contents do not match their hash
LIMBER_API limber_result limber_asset_read_file(const char* path, limber_asset** asset);
/// The same from memory, which is not needed afterwards. @param name shown in messages; NULL: "memory"
LIMBER_API limber_result limber_asset_read_memory(const void* bytes, size_t size, const char* name,
                                                  limber_asset** asset);
/// Writes the GLB, whole or not at all.
LIMBER_API limber_result limber_asset_write_file(const limber_asset* asset, const char* path);
LIMBER_API void limber_asset_destroy(limber_asset* asset);
LIMBER_API size_t limber_asset_body_count(const limber_asset* asset);
/// @param body below limber_asset_body_count() @param model out: lives as long as the asset
LIMBER_API limber_result limber_asset_model(const limber_asset* asset, size_t body, const limber_model** model);

/// An isotropic linear elastic material.
typedef struct limber_material {
  double youngs_modulus;  ///< Pa, > 0
  double poisson_ratio;   ///< in (−1, 0.5)
  double density;         ///< kg/m³, > 0
} limber_material;

/// By name: "steel", "rubber", "jelly", "wood", "glass", …: docs/formats/materials.md.
LIMBER_API limber_result limber_material_preset(const char* name, limber_material* material);

/// An asset of one free body without a file, for first programs and prototypes: a ball. Takes a tenth of a second for
/// six cells. @param radius m, > 0 @param cells across, ≥ 2 @param modes the lowest so many, ≥ 1
/// @param damping_ratio of each mode, ≥ 0; 1 is critical
LIMBER_API limber_result limber_asset_create_soft_ball(double radius, int32_t cells, const limber_material* material,
                                                       int32_t modes, double damping_ratio, limber_asset** asset);
/// The same of a box about its middle. @param half_extents m, > 0 @param cells along each axis, ≥ 1
LIMBER_API limber_result limber_asset_create_soft_box(limber_vec3 half_extents, const int32_t cells[3],
                                                      const limber_material* material, int32_t modes,
                                                      double damping_ratio, limber_asset** asset);

/// How a body's frame moves, decided by the nodes that were fixed when it was baked.
typedef enum limber_frame_motion LIMBER_ENUM {
  LIMBER_FRAME_FREE = 0,       ///< six degrees of freedom; origin at the centre of mass
  LIMBER_FRAME_POINT = 1,      ///< turns about one fixed point, its origin
  LIMBER_FRAME_LINE = 2,       ///< turns about one fixed line
  LIMBER_FRAME_KINEMATIC = 3,  ///< moves only as limber_world_set_kinematic_frame() says
} limber_frame_motion;

/// A triangulated surface at rest, body frame.
typedef struct limber_surface_data {
  int32_t vertices, triangles;
  const float* rest;      ///< 3 per vertex, m
  const int32_t* corner;  ///< 3 per triangle: vertices, counter-clockwise seen from outside
} limber_surface_data;

/// A model's numbers; arrays lie in the model.
typedef struct limber_model_data {
  const char* name;
  limber_frame_motion motion;
  int32_t modes;                  ///< k
  double mass;                    ///< kg
  double volume;                  ///< m³
  limber_vec3 center_of_mass;     ///< body frame, m
  limber_vec3 origin_in_input;    ///< the body's origin in the coordinates of the mesh or shape it was made of, m
  double inertia[9];              ///< about the body's origin, body axes, kg·m²; symmetric
  const double* eigenvalue;       ///< k: λ = (2πf)², rad²/s²
  const double* decay;            ///< k: ξ, 1/s: a mode's amplitude falls as exp(−ξt)
  const double* mode_scale;       ///< k: s, kg^½·m: z = s · weight of the morph target
  limber_surface_data render;     ///< what is drawn
  limber_surface_data collision;  ///< what touches
  bool has_modal_skin;            ///< docs/large-bends.md
  bool has_volume;                ///< limber_world_set_node_displacements() may be called
} limber_model_data;

LIMBER_API limber_result limber_model_get_data(const limber_model* model, limber_model_data* data);
/// The morph target of a mode, for a caller that deforms on its GPU: vertex v of the render surface is
/// rest_v + Σ weight_i target_i,v, with limber_world_interpolated_weights().
/// @param mode below k @param displacements out, 3 per vertex of the render surface, m
LIMBER_API limber_result limber_model_morph_target(const limber_model* model, int32_t mode, float* displacements);

// Shapes, in the frame of the body that wears them; lengths in m.
/// All points with normal · x ≤ offset are solid. @param normal unit
LIMBER_API limber_result limber_shape_create_half_space(limber_vec3 normal, double offset, limber_shape** shape);
LIMBER_API limber_result limber_shape_create_sphere(double radius, limber_shape** shape);
/// Within `radius` of the segment from (0, 0, −half_length) to (0, 0, half_length).
LIMBER_API limber_result limber_shape_create_capsule(double radius, double half_length, limber_shape** shape);
LIMBER_API limber_result limber_shape_create_box(limber_vec3 half_extents, limber_shape** shape);
/// A prism about the z axis whose corners lie on the cylinder. @param sides ≥ 3
LIMBER_API limber_result limber_shape_create_cylinder(double radius, double half_length, int32_t sides,
                                                      limber_shape** shape);
/// The convex hull of points, four at least. @param points 3 numbers each; not all in one plane, which what takes the
/// shape tells
LIMBER_API limber_result limber_shape_create_hull(const double* points, size_t count, limber_shape** shape);
/// A surface that does not deform. @param vertices 3 numbers each @param corners 3 a triangle, counter-clockwise seen
/// from outside. An open surface is one-sided
LIMBER_API limber_result limber_shape_create_mesh(const double* vertices, size_t vertex_count, const int32_t* corners,
                                                  size_t triangle_count, limber_shape** shape);
/// Heights over a grid in the xy plane, solid below; vertex (i, j) is at (i·spacing_x, j·spacing_y,
/// heights[j·columns + i]). @param columns, rows ≥ 2 each
LIMBER_API limber_result limber_shape_create_height_field(int32_t columns, int32_t rows, double spacing_x,
                                                          double spacing_y, const float* heights, limber_shape** shape);
LIMBER_API void limber_shape_destroy(limber_shape* shape);

/// How heavy a rigid body is, where its mass is and how hard it is to turn; in the frame of its shape.
typedef struct limber_mass_properties {
  double mass;                 ///< kg, > 0
  limber_vec3 center_of_mass;  ///< m
  double inertia[9];           ///< about the centre of mass, kg·m²; symmetric positive definite
} limber_mass_properties;

/// Those of a solid of even density, kg/m³, > 0.
/// @return LIMBER_INVALID_ARGUMENT for a shape that bounds no solid: a half-space, a height field, an open mesh
LIMBER_API limber_result limber_shape_mass_properties(const limber_shape* shape, double density,
                                                      limber_mass_properties* mass);

/// A part of a compound: a shape that bounds a solid, and where it is in the frame of the compound.
typedef struct limber_shape_part {
  const limber_shape* shape;
  limber_transform pose;
} limber_shape_part;
/// Of parts together, in the frame of the compound; what parts share counts for each of them.
LIMBER_API limber_result limber_parts_mass_properties(const limber_shape_part* parts, size_t count, double density,
                                                      limber_mass_properties* mass);

#ifdef __cplusplus
}
#endif
