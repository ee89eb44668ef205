# Highway's headers alone: with one instruction set its library has nothing to choose. The folder comes from the outer build.
if(NOT TARGET hwy::hwy)
  add_library(hwy::hwy INTERFACE IMPORTED)
  target_include_directories(hwy::hwy SYSTEM INTERFACE ${LIMBER_PAGE_HEADERS})
  target_compile_definitions(hwy::hwy INTERFACE HWY_COMPILE_ONLY_SCALAR)  # Highway 1.0 has no doubles for WebAssembly, and clang 14 compiles its EMU128 wrongly at -O3
endif()
set(hwy_FOUND TRUE)
