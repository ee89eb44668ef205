# MUMPS in double precision, the sequential form without MPI (Debian: libmumps-seq-dev).
# Defines MUMPS::dmumps_seq.
find_path(MUMPS_INCLUDE_DIR dmumps_c.h)
find_library(MUMPS_LIBRARY dmumps_seq)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(MUMPS REQUIRED_VARS MUMPS_LIBRARY MUMPS_INCLUDE_DIR)
if(MUMPS_FOUND AND NOT TARGET MUMPS::dmumps_seq)
  add_library(MUMPS::dmumps_seq UNKNOWN IMPORTED)
  set_target_properties(MUMPS::dmumps_seq PROPERTIES IMPORTED_LOCATION "${MUMPS_LIBRARY}")
  target_include_directories(MUMPS::dmumps_seq SYSTEM INTERFACE "${MUMPS_INCLUDE_DIR}")
endif()
mark_as_advanced(MUMPS_INCLUDE_DIR MUMPS_LIBRARY)
