#include <string_view>

#include "limber/collision/rigid_model.h"
#include "limber/model/morph_targets.h"
#include "limber/model/soft_bodies.h"
#include "objects.h"

namespace limber::c {

static Material to_cpp(const limber_material& m) {
  return {.youngs_modulus = m.youngs_modulus, .poisson_ratio = m.poisson_ratio, .density = m.density};
}

static limber_surface_data to_c(const ModalSurface& surface) {
  static_assert(sizeof(Vec3f) == 3 * sizeof(float) && sizeof(Triangle) == 3 * sizeof(std::int32_t));
  return {surface.vertices(), static_cast<std::int32_t>(surface.triangles.size()),
          surface.rest.empty() ? nullptr : surface.rest.front().data(),
          surface.triangles.empty() ? nullptr : surface.triangles.front().data()};
}

static std::filesystem::path path_of(const char* utf8) {
  return std::filesystem::path(reinterpret_cast<const char8_t*>(&required(utf8, "path")));
}

/// Makes the caller an object of its own.
template <class Object, class... Arguments>
void give(Object** out, const char* name, Arguments&&... arguments) {
  Object*& place = required(out, name);
  place = new Object{std::forward<Arguments>(arguments)...};
}

static limber_asset* new_asset(std::shared_ptr<const ModalModel> model) {
  return new limber_asset{Asset{.bodies = {std::move(model)}}};
}

static limber_result give_shape(limber_shape** out, Shape shape) {
  validate(shape);
  give(out, "shape", std::make_shared<const Shape>(std::move(shape)));
  return LIMBER_OK;
}

static std::vector<Vec3> points_of(const double* numbers, std::size_t count, const char* name) {
  const std::span<const double> all = array(numbers, 3 * count, name);
  std::vector<Vec3> points;
  points.reserve(count);
  for (std::size_t i = 0; i < all.size(); i += 3) points.emplace_back(all[i], all[i + 1], all[i + 2]);
  return points;
}

static limber_mass_properties to_c(const MassProperties& m) {
  limber_mass_properties out{m.mass, to_c(m.center_of_mass), {}};
  std::copy_n(m.inertia.data(), 9, out.inertia);
  return out;
}

}  // namespace limber::c

using namespace limber;
using namespace limber::c;

extern "C" {

limber_quat limber_quat_from_rotation_vector(limber_vec3 r) {
  return to_c(RigidTransform{.q = quaternion_from_rotation_vector(to_cpp(r))}).q;
}

limber_transform limber_identity(void) { return to_c(RigidTransform{}); }

limber_result limber_asset_read_file(const char* path, limber_asset** asset) {
  return guarded([&] {
    required(asset, "asset");
    give(asset, "asset", read_asset(path_of(path)));
  });
}

limber_result limber_asset_write_file(const limber_asset* asset, const char* path) {
  return guarded([&] { write_asset(path_of(path), required(asset, "asset").asset); });
}

limber_result limber_asset_read_memory(const void* bytes, size_t size, const char* name, limber_asset** asset) {
  return guarded([&] {
    const auto all = array(static_cast<const char*>(bytes), size, "bytes");
    required(asset, "asset");
    give(asset, "asset", asset_from_bytes({all.data(), all.size()}, name != nullptr ? name : "memory"));
  });
}

void limber_asset_destroy(limber_asset* asset) { delete asset; }

size_t limber_asset_body_count(const limber_asset* asset) { return asset != nullptr ? asset->asset.bodies.size() : 0; }

limber_result limber_asset_model(const limber_asset* asset, size_t body, const limber_model** model) {
  return guarded([&] {
    const auto& bodies = required(asset, "asset").asset.bodies;
    if (body >= bodies.size())
      throw InvalidArgument("limber_asset_model: body " + std::to_string(body) + " of an asset of " +
                            std::to_string(bodies.size()));
    required(model, "model") = to_c(*bodies[body]);
  });
}

limber_result limber_material_preset(const char* name, limber_material* material) {
  return guarded([&] {
    const Material& preset = material_preset(&required(name, "name"));
    required(material, "material") = {preset.youngs_modulus, preset.poisson_ratio, preset.density};
  });
}

limber_result limber_asset_create_soft_ball(double radius, int32_t cells, const limber_material* material,
                                            int32_t modes, double damping_ratio, limber_asset** asset) {
  return guarded([&] {
    limber_asset*& place = required(asset, "asset");
    place = new_asset(make_soft_ball(radius, cells, to_cpp(required(material, "material")), modes, damping_ratio));
  });
}

limber_result limber_asset_create_soft_box(limber_vec3 half_extents, const int32_t cells[3],
                                           const limber_material* material, int32_t modes, double damping_ratio,
                                           limber_asset** asset) {
  return guarded([&] {
    limber_asset*& place = required(asset, "asset");
    required(cells, "cells");
    place = new_asset(make_soft_box(to_cpp(half_extents), {cells[0], cells[1], cells[2]},
                                    to_cpp(required(material, "material")), modes, damping_ratio));
  });
}

limber_result limber_model_get_data(const limber_model* model, limber_model_data* data) {
  return guarded([&] {
    const ModalModel& m = to_cpp(required(model, "model"));
    const ModalModelData& d = m.data();
    limber_model_data out{};
    out.name = m.name().c_str();
    out.motion = static_cast<limber_frame_motion>(d.motion);
    out.modes = m.modes();
    out.mass = d.mass, out.volume = d.volume;
    out.center_of_mass = to_c(d.center_of_mass), out.origin_in_input = to_c(d.origin_in_input);
    std::copy_n(d.inertia.data(), 9, out.inertia);
    out.eigenvalue = d.eigenvalues.data(), out.decay = d.decays.data(), out.mode_scale = d.mode_scales.data();
    out.render = to_c(m.render()), out.collision = to_c(m.collision());
    out.has_modal_skin = d.skin.has_value(), out.has_volume = d.volume_block.has_value();
    required(data, "data") = out;
  });
}

limber_result limber_model_morph_target(const limber_model* model, int32_t mode, float* displacements) {
  return guarded([&] {
    const ModalModel& m = to_cpp(required(model, "model"));
    required(displacements, "displacements");
    if (mode < 0 || mode >= m.modes())
      throw InvalidArgument("limber_model_morph_target: mode " + std::to_string(mode) + " of a model of " +
                            std::to_string(m.modes()));
    const auto target = mode_displacements(m.render(), mode, m.data().mode_scales[static_cast<std::size_t>(mode)]);
    std::ranges::copy(target, displacements);
  });
}

limber_result limber_shape_create_half_space(limber_vec3 normal, double offset, limber_shape** shape) {
  return guarded([&] { give_shape(shape, HalfSpace{to_cpp(normal), offset}); });
}

limber_result limber_shape_create_sphere(double radius, limber_shape** shape) {
  return guarded([&] { give_shape(shape, Sphere{radius}); });
}

limber_result limber_shape_create_capsule(double radius, double half_length, limber_shape** shape) {
  return guarded([&] { give_shape(shape, Capsule{radius, half_length}); });
}

limber_result limber_shape_create_box(limber_vec3 half_extents, limber_shape** shape) {
  return guarded([&] { give_shape(shape, Box{to_cpp(half_extents)}); });
}

limber_result limber_shape_create_cylinder(double radius, double half_length, int32_t sides, limber_shape** shape) {
  return guarded([&] { give_shape(shape, cylinder_hull(radius, half_length, sides)); });
}

limber_result limber_shape_create_hull(const double* points, size_t count, limber_shape** shape) {
  return guarded([&] { give_shape(shape, ConvexHull{points_of(points, count, "points")}); });
}

limber_result limber_shape_create_mesh(const double* vertices, size_t vertex_count, const int32_t* corners,
                                       size_t triangle_count, limber_shape** shape) {
  return guarded([&] {
    TriangleMesh mesh{.vertices = points_of(vertices, vertex_count, "vertices"), .triangles = {}};
    const auto all = array(corners, 3 * triangle_count, "corners");
    for (std::size_t i = 0; i < all.size(); i += 3) mesh.triangles.push_back({all[i], all[i + 1], all[i + 2]});
    give_shape(shape, std::move(mesh));
  });
}

limber_result limber_shape_create_height_field(int32_t columns, int32_t rows, double spacing_x, double spacing_y,
                                               const float* heights, limber_shape** shape) {
  return guarded([&] {
    HeightField field{.columns = columns, .rows = rows, .spacing_x = spacing_x, .spacing_y = spacing_y, .heights = {}};
    if (columns < 2 || rows < 2)
      throw InvalidArgument("limber_shape_create_height_field: " + std::to_string(columns) + " columns and " +
                            std::to_string(rows) + " rows, expected 2 of each at least");
    const auto all = array(heights, static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), "heights");
    field.heights.assign(all.begin(), all.end());
    give_shape(shape, std::move(field));
  });
}

void limber_shape_destroy(limber_shape* shape) { delete shape; }

limber_result limber_shape_mass_properties(const limber_shape* shape, double density, limber_mass_properties* mass) {
  return guarded([&] { required(mass, "mass") = to_c(mass_properties(*shape_of(shape), density)); });
}

limber_result limber_parts_mass_properties(const limber_shape_part* parts, size_t count, double density,
                                           limber_mass_properties* mass) {
  return guarded([&] { required(mass, "mass") = to_c(mass_properties(parts_of(parts, count), density)); });
}

}  // extern "C"
