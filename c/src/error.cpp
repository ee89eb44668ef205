#include <cstdio>
#include <exception>
#include <new>

#include "guard.h"
#include "limber/core/version.h"

namespace {

// Of fixed size, so that a failure to allocate can be told too.
thread_local char last_error[1024] = "";

}  // namespace

namespace limber::c {

limber_result failed(limber_result result, const char* text) noexcept {
  std::snprintf(last_error, sizeof last_error, "%s", text);
  return result;
}

limber_result failure() noexcept {
  try {
    throw;
  } catch (const InvalidArgument& e) {
    return failed(LIMBER_INVALID_ARGUMENT, e.what());
  } catch (const InputError& e) {
    return failed(LIMBER_INPUT_ERROR, e.what());
  } catch (const ComputationError& e) {
    return failed(LIMBER_COMPUTATION_ERROR, e.what());
  } catch (const std::bad_alloc&) {
    return failed(LIMBER_OUT_OF_MEMORY, "out of memory");
  } catch (const std::exception& e) {
    return failed(LIMBER_INTERNAL_ERROR, e.what());
  } catch (...) {
    return failed(LIMBER_INTERNAL_ERROR, "an exception of unknown type");
  }
}

}  // namespace limber::c

extern "C" {

const char* limber_last_error(void) { return last_error; }
const char* limber_version(void) { return LIMBER_VERSION_STRING; }

}  // extern "C"
