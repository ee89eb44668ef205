# Highway's headers alone: with one instruction set its library has nothing to choose. The folder comes from the outer build; what
# stands in for two of them is found before.
if(NOT TARGET hwy::hwy)
  add_library(hwy::hwy INTERFACE IMPORTED)
  target_include_directories(hwy::hwy SYSTEM INTERFACE ${LIMBER_PAGE_HEADERS})
  target_compile_options(hwy::hwy INTERFACE -I${CMAKE_CURRENT_LIST_DIR}/../highway)
  target_compile_definitions(hwy::hwy INTERFACE HWY_COMPILE_ONLY_STATIC HWY_BASELINE_TARGETS=HWY_SSSE3)
endif()
set(hwy_FOUND TRUE)
