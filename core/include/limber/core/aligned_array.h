/// @file limber/core/aligned_array.h
/// An array of plain numbers that begins on a cache line, for the loops that load whole vectors.
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <new>
#include <type_traits>

namespace limber {

/// `size` elements, 64-byte aligned, as made all zero. Moves, does not copy: such arrays are large.
template <class T>
class AlignedArray {
  static_assert(std::is_trivially_copyable_v<T>, "elements are plain numbers or structs of them");

 public:
  static constexpr std::size_t kAlignment = 64;

  AlignedArray() = default;
  explicit AlignedArray(std::size_t size)
      : data_(static_cast<T*>(
            ::operator new[](std::max<std::size_t>(size, 1) * sizeof(T), std::align_val_t{kAlignment}))),
        size_(size) {
    std::fill_n(data_.get(), size, T{});
  }

  std::size_t size() const { return size_; }
  T* data() { return data_.get(); }
  const T* data() const { return data_.get(); }
  T& operator[](std::size_t i) { return data_.get()[i]; }
  const T& operator[](std::size_t i) const { return data_.get()[i]; }

 private:
  struct Free {
    void operator()(T* p) const { ::operator delete[](p, std::align_val_t{kAlignment}); }
  };
  std::unique_ptr<T[], Free> data_;
  std::size_t size_ = 0;
};

}  // namespace limber
