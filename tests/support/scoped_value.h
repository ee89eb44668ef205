/// @file scoped_value.h
/// Another value in a variable for as long as a scope lasts, such as another tuning of a module.
#pragma once

#include <utility>

namespace limber::testing {

/// Puts `value` into `variable` and what was there back at the end. The variable outlives this, and nothing reads it in
/// another thread while one is made or goes.
template <typename T>
class ScopedValue {
 public:
  ScopedValue(T& variable, T value) : variable_(variable), before_(std::exchange(variable, std::move(value))) {}
  ~ScopedValue() { variable_ = std::move(before_); }
  ScopedValue(const ScopedValue&) = delete;
  ScopedValue& operator=(const ScopedValue&) = delete;

 private:
  T& variable_;
  T before_;
};

}  // namespace limber::testing
