// What functions that JavaScript calls share: they are kept by the linker, and exceptions end in them.
#pragma once

#include <exception>
#include <string>

#ifdef __EMSCRIPTEN__
#include <emscripten.h>
#else
#define EMSCRIPTEN_KEEPALIVE
#endif

namespace limber {

/// @param error out: the line of what was thrown. @return 1, or 0 where something was
template <class F>
int guarded(std::string& error, F&& work) {
  try {
    work();
    return 1;
  } catch (const std::exception& e) {
    error = e.what();
    return 0;
  }
}

}  // namespace limber
