// C structs to C++ ones and back, field by field: neither's layout is the other's.
#pragma once

#include <algorithm>
#include <span>

#include "guard.h"
#include "limber/engine/world.h"
#include "limber/limber.h"

namespace limber::c {

inline Vec3 to_cpp(const limber_vec3& v) { return {v.x, v.y, v.z}; }
inline limber_vec3 to_c(const Vec3& v) { return {v.x(), v.y(), v.z()}; }
inline RigidTransform to_cpp(const limber_transform& t) {
  return {.q = {t.q.w, t.q.x, t.q.y, t.q.z}, .p = to_cpp(t.p)};
}
inline limber_transform to_c(const RigidTransform& t) { return {{t.q.w, t.q.x, t.q.y, t.q.z}, to_c(t.p)}; }

inline BodyId to_cpp(limber_body_id id) { return {id.index, id.generation}; }
inline HandleId to_cpp(limber_handle_id id) { return {id.index, id.generation}; }
inline JointId to_cpp(limber_joint_id id) { return {id.index, id.generation}; }
inline limber_body_id to_c(BodyId id) { return {id.index, id.generation}; }
inline limber_handle_id to_c(HandleId id) { return {id.index, id.generation}; }
inline limber_joint_id to_c(JointId id) { return {id.index, id.generation}; }

inline CollisionFilter to_cpp(const limber_filter& f) { return {.layers = f.layers, .mask = f.mask, .self = f.self}; }
inline Interval to_cpp(const limber_interval& i) { return {i.low, i.high}; }
inline limber_interval to_c(const Interval& i) { return {i.low, i.high}; }

/// @throws InvalidArgument for a number that is none of the enumeration's: C takes any
template <class Enum>
Enum checked_enum(int value, int count, const char* name) {
  if (value < 0 || value >= count)
    throw InvalidArgument(std::string(name) + " is " + std::to_string(value) + ", expected 0 to " +
                          std::to_string(count - 1));
  return static_cast<Enum>(value);
}
inline SurfacePoint::Surface to_cpp(limber_surface s) { return checked_enum<SurfacePoint::Surface>(s, 2, "surface"); }
inline Axes to_cpp(limber_axes a) { return checked_enum<Axes>(a, 2, "axes"); }
inline SurfacePoint to_cpp(const limber_surface_point& at) {
  return {.surface = to_cpp(at.surface), .triangle = at.triangle, .weight = {at.weight[0], at.weight[1], at.weight[2]}};
}
inline limber_surface_point to_c(const SurfacePoint& at) {
  const auto surface = at.surface == SurfacePoint::Surface::kRender ? LIMBER_SURFACE_RENDER : LIMBER_SURFACE_COLLISION;
  return {surface, at.triangle, {at.weight[0], at.weight[1], at.weight[2]}};
}

/// An array of the caller. @throws InvalidArgument for NULL, unless it holds nothing
template <class T>
std::span<T> array(T* first, std::size_t count, const char* name) {
  if (count > 0) required(first, name);
  return {first, count};
}

/// Answers a list: at most `capacity` items, and how many there are.
template <class Items, class Item, class Convert>
void answer(const Items& items, Item* out, std::size_t capacity, std::size_t* count, Convert&& convert) {
  std::size_t& size = required(count, "count");
  const std::span<Item> into = array(out, capacity, "the array of answers");
  const std::size_t written = std::min(capacity, std::size(items));
  for (std::size_t i = 0; i < written; ++i) into[i] = convert(items[i]);
  size = std::size(items);
}

}  // namespace limber::c
