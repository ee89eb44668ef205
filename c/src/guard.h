// Where exceptions end: every C function that can fail runs its body through guarded().
#pragma once

#include <string>
#include <utility>

#include "limber/c/base.h"
#include "limber/core/error.h"

namespace limber::c {

/// Keeps the text of limber_last_error() and returns `result`.
limber_result failed(limber_result result, const char* text) noexcept;
/// Tells the exception that is being handled apart. @pre called from a catch block
limber_result failure() noexcept;

template <class Body>
limber_result guarded(Body&& body) noexcept {
  try {
    std::forward<Body>(body)();
    return LIMBER_OK;
  } catch (...) {
    return failure();
  }
}

/// The object behind a pointer of the caller. @throws InvalidArgument for NULL
template <class T>
T& required(T* pointer, const char* name) {
  if (pointer == nullptr) throw InvalidArgument(std::string(name) + " is NULL");
  return *pointer;
}

}  // namespace limber::c
