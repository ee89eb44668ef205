/// @file limber/core/state_archive.h
/// Writes the state of objects to bytes and reads it back, to the bit: what World::save_state() is made of.
///
/// A type says what its state is once, for both directions, as a tuple of references:
///
///   class Pendulum {
///     friend struct limber::StateFields;
///     template <class Self>
///     static auto state_fields(Self& s) { return std::tie(s.angle_, s.rate_); }
///   };
///
/// or, for a plain struct, as a function `state_fields(Self&)` in its namespace. Numbers, enumerations, Vec3, Mat3,
/// Quaternion, RigidTransform, arrays and vectors of such are known. Numbers are written as they stand in memory, so
/// that bytes are for machines of the same byte order and builds of the same version of limber.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <tuple>
#include <type_traits>
#include <vector>

#include "limber/core/error.h"
#include "limber/core/quaternion.h"
#include "limber/core/rigid_transform.h"
#include "limber/core/types.h"

namespace limber {

/// The fields of a type, wherever it says so; a friend of those that keep them private.
struct StateFields {
  template <class Self>
  static auto of(Self& self) {
    if constexpr (requires { std::remove_const_t<Self>::state_fields(self); })
      return std::remove_const_t<Self>::state_fields(self);
    else
      return state_fields(self);
  }
};

template <class Self>
requires std::is_same_v<std::remove_const_t<Self>, Quaternion>
auto state_fields(Self& q) { return std::tie(q.w, q.x, q.y, q.z); }

template <class Self>
requires std::is_same_v<std::remove_const_t<Self>, RigidTransform>
auto state_fields(Self& X) { return std::tie(X.q, X.p); }

namespace internal {

template <class T>
inline constexpr bool kIsNumber = std::is_arithmetic_v<T> || std::is_enum_v<T>;
template <class T>
inline constexpr bool kIsMatrix = std::is_same_v<T, Vec3> || std::is_same_v<T, Mat3>;

}  // namespace internal

/// Appends to bytes that are the caller's. Allocates where they have no room left.
class StateWriter {
 public:
  explicit StateWriter(std::vector<std::byte>& bytes) : bytes_(bytes) {}

  template <class... Fields>
  void operator()(const Fields&... fields) {
    (field(fields), ...);
  }
  void numbers(std::span<const double> values) { raw(values.data(), values.size_bytes()); }

 private:
  template <class T>
  void field(const T& value) {
    if constexpr (std::is_same_v<T, bool>)
      field(static_cast<std::uint8_t>(value));
    else if constexpr (internal::kIsNumber<T>)
      raw(&value, sizeof(T));
    else if constexpr (internal::kIsMatrix<T>)
      raw(value.data(), sizeof(double) * static_cast<std::size_t>(value.size()));
    else
      std::apply([this](const auto&... parts) { (*this)(parts...); }, StateFields::of(value));
  }
  template <class T>
  void field(const std::vector<T>& values) {
    field(static_cast<std::uint64_t>(values.size()));
    for (const T& value : values) field(value);
  }
  template <class T, std::size_t n>
  void field(const std::array<T, n>& values) {
    for (const T& value : values) field(value);
  }
  void raw(const void* from, std::size_t size) {
    const auto* first = static_cast<const std::byte*>(from);
    bytes_.insert(bytes_.end(), first, first + size);
  }

  std::vector<std::byte>& bytes_;
};

/// Takes back what a StateWriter wrote, in the same order. Vectors keep their memory.
/// @throws InvalidArgument where the bytes end too early
class StateReader {
 public:
  explicit StateReader(std::span<const std::byte> bytes) : bytes_(bytes) {}

  template <class... Fields>
  void operator()(Fields&... fields) {
    (field(fields), ...);
  }
  template <class T>
  T read() {
    T value{};
    field(value);
    return value;
  }
  void numbers(std::span<double> values) { raw(values.data(), values.size_bytes()); }
  std::size_t left() const { return bytes_.size(); }

 private:
  template <class T>
  void field(T& value) {
    if constexpr (std::is_same_v<T, bool>) {
      value = read<std::uint8_t>() != 0;
    } else if constexpr (internal::kIsNumber<T>) {
      raw(&value, sizeof(T));
    } else if constexpr (internal::kIsMatrix<T>) {
      raw(value.data(), sizeof(double) * static_cast<std::size_t>(value.size()));
    } else {
      std::apply([this](auto&... parts) { (*this)(parts...); }, StateFields::of(value));
    }
  }
  template <class T>
  void field(std::vector<T>& values) {
    const auto size = read<std::uint64_t>();
    if (size > bytes_.size()) end_too_early();  // each element takes a byte at least
    values.resize(static_cast<std::size_t>(size));
    for (T& value : values) field(value);
  }
  template <class T, std::size_t n>
  void field(std::array<T, n>& values) {
    for (T& value : values) field(value);
  }
  void raw(void* to, std::size_t size) {
    if (size > bytes_.size()) end_too_early();
    if (size > 0) std::memcpy(to, bytes_.data(), size);
    bytes_ = bytes_.subspan(size);
  }
  [[noreturn]] static void end_too_early() {
    throw InvalidArgument("StateReader: the bytes end within a field; expected those of a whole state");
  }

  std::span<const std::byte> bytes_;
};

}  // namespace limber
