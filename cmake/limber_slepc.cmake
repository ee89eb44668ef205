# limber-eigen, where MPI and SLEPc are found.
find_package(MPI QUIET COMPONENTS C)
find_package(PkgConfig QUIET)
if(PkgConfig_FOUND)
  pkg_check_modules(SLEPC QUIET IMPORTED_TARGET SLEPc PETSc)
endif()
find_library(LIMBER_PARALLEL_MUMPS dmumps)
if(LIMBER_SANITIZE)
  message(STATUS "limber-eigen is left out: MPI leaks what sanitizers tell")
elseif(NOT MPI_C_FOUND OR NOT SLEPC_FOUND OR NOT LIMBER_PARALLEL_MUMPS)
  message(STATUS "limber-eigen is left out: MPI, SLEPc or the parallel MUMPS is missing (scripts/install-dependencies --slepc)")
else()
  set(precompute ${PROJECT_SOURCE_DIR}/precompute)
  limber_add_program(limber-eigen
    SOURCES limber_eigen.cpp
            ${precompute}/slepc/distributed_body.cpp ${precompute}/slepc/mesh_share.cpp ${precompute}/slepc/parallel_factor.cpp
            ${precompute}/slepc/parallel_inverse.cpp ${precompute}/slepc/parallel_modes.cpp
            # Of limber::precompute what calls no solver.
            ${precompute}/src/eigen/slice_file.cpp ${precompute}/src/eigen/sparse_operations.cpp ${precompute}/src/eigen/stored_body.cpp
            ${precompute}/src/fem/element_rules.cpp ${precompute}/src/fem/fem.cpp
    LINK limber_program limber::model limber_internal_json fmt::fmt PkgConfig::SLEPC ${LIMBER_PARALLEL_MUMPS} MPI::MPI_C
    INSTALL)
  target_include_directories(limber-eigen PRIVATE ${precompute}/include ${precompute}/src ${precompute}/slepc)
  set_target_properties(limber-eigen PROPERTIES UNITY_BUILD OFF)
endif()
