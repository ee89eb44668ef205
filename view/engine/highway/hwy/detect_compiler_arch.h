// Highway 1.0 has no doubles for WebAssembly, whose SIMD has. emscripten has the intrinsics of SSSE3 as WebAssembly's,
// so Highway is told that this is x86. Found before Highway's own header of this name.
#pragma once
#pragma GCC system_header

#define __SSE__ 1
#define __SSE2__ 1
#define __SSE3__ 1
#define __SSSE3__ 1
#include <tmmintrin.h>
#undef __SSE__  // Eigen and others go on as before
#undef __SSE2__
#undef __SSE3__
#undef __SSSE3__

#pragma push_macro("__EMSCRIPTEN__")
#pragma push_macro("__wasm__")
#undef __EMSCRIPTEN__
#undef __wasm__
#define __x86_64__ 1
#include_next <hwy/detect_compiler_arch.h>
#undef __x86_64__
#pragma pop_macro("__EMSCRIPTEN__")
#pragma pop_macro("__wasm__")
