// Without attributes for x86's features, which clang does not know for WebAssembly.
#pragma GCC system_header
#include_next <hwy/ops/set_macros-inl.h>
#undef HWY_BEFORE_NAMESPACE
#undef HWY_AFTER_NAMESPACE
#undef HWY_ATTR
#define HWY_BEFORE_NAMESPACE() static_assert(true, "for the semicolon")
#define HWY_AFTER_NAMESPACE() static_assert(true, "for the semicolon")
#define HWY_ATTR
