# ARPACK-NG with its C++ header (Debian: libarpack2-dev).
# Defines ARPACK::arpack.
find_path(ARPACK_INCLUDE_DIR arpack.hpp PATH_SUFFIXES arpack)
find_library(ARPACK_LIBRARY arpack)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(ARPACK REQUIRED_VARS ARPACK_LIBRARY ARPACK_INCLUDE_DIR)
if(ARPACK_FOUND AND NOT TARGET ARPACK::arpack)
  add_library(ARPACK::arpack UNKNOWN IMPORTED)
  set_target_properties(ARPACK::arpack PROPERTIES IMPORTED_LOCATION "${ARPACK_LIBRARY}")
  target_include_directories(ARPACK::arpack SYSTEM INTERFACE "${ARPACK_INCLUDE_DIR}")
endif()
mark_as_advanced(ARPACK_INCLUDE_DIR ARPACK_LIBRARY)
