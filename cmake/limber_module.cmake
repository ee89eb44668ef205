# Helpers that every module's CMakeLists.txt is written in. They refuse arguments they do not know.

# Warnings, sanitizers and the language level: for our own targets only, never for those who link limber.
function(limber_compile_options target)
  target_compile_features(${target} PUBLIC cxx_std_20)
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF POSITION_INDEPENDENT_CODE ON)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Wold-style-cast
                                           -Woverloaded-virtual -Wunused)
  # Sums of products round as they are written, so that compilers give the same bits; kernels say where they fuse them.
  target_compile_options(${target} PRIVATE -ffp-contract=off)
  # Sources compiled together are included by their whole path: without the clone's part of it in __FILE__, clones share the results.
  target_compile_options(${target} PRIVATE -fmacro-prefix-map=${PROJECT_SOURCE_DIR}/=)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
    # GCC 12 sees an overlap in every optimised `"text" + string` (its bug 105651).
    target_compile_options(${target} PRIVATE -Wno-restrict)
  endif()
  get_target_property(together ${target} UNITY_BUILD)
  if(together)
    # Of files compiled together: what one file's anonymous namespace holds is neither shared nor shadowed by another's.
    target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage> -Wno-shadow)
  endif()
  if(LIMBER_WARNINGS_AS_ERRORS)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
endfunction()

# Files named so are compiled by themselves, also where others are compiled together.
function(limber_compile_alone sources pattern)
  list(FILTER sources INCLUDE REGEX "${pattern}")
  set_source_files_properties(${sources} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()

# Checks that another one makes as well are left out, since they take half of the time to compile: null pointers, ends of objects and
# pointers that wrap around stop a program by AddressSanitizer where they are used, and Eigen's assertions check the alignment of all
# that is aligned by more than a double.
function(limber_sanitize target)
  if(LIMBER_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=${LIMBER_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
    if(LIMBER_SANITIZE MATCHES address AND LIMBER_SANITIZE MATCHES undefined)
      target_compile_options(${target} PRIVATE -fno-sanitize=null,alignment,object-size,pointer-overflow)
    endif()
    target_link_options(${target} PUBLIC $<BUILD_INTERFACE:-fsanitize=${LIMBER_SANITIZE}>)
  endif()
endfunction()

# limber_add_module(name SOURCES ... [PUBLIC ...] [PRIVATE ...] [COMPONENT runtime|precompute|scene|...] [FOLDER dir] [NO_SANITIZE])
# makes target limber_<name>, alias limber::<name>, with include root <dir>/include and private headers in <dir>/src. Sources are
# named as seen from the caller's folder; FOLDER is where include/ and src/ lie in it, the folder itself by default.
function(limber_add_module name)
  cmake_parse_arguments(arg "NO_SANITIZE" "COMPONENT;FOLDER" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "limber_add_module(${name}): unknown argument(s) ${arg_UNPARSED_ARGUMENTS}")
  endif()
  if(NOT arg_COMPONENT)
    message(FATAL_ERROR "limber_add_module(${name}): COMPONENT is missing")
  endif()
  if(NOT arg_FOLDER)
    set(arg_FOLDER .)
  endif()
  cmake_path(ABSOLUTE_PATH arg_FOLDER NORMALIZE OUTPUT_VARIABLE folder)
  add_library(limber_${name} ${arg_SOURCES})
  limber_compile_alone("${arg_SOURCES}" "_kernels\\.cpp$")  # they include themselves once for every instruction set
  add_library(limber::${name} ALIAS limber_${name})
  set_target_properties(limber_${name} PROPERTIES EXPORT_NAME ${name} LIMBER_COMPONENT ${arg_COMPONENT})
  target_include_directories(limber_${name}
    PUBLIC $<BUILD_INTERFACE:${folder}/include> $<INSTALL_INTERFACE:include>
    PRIVATE ${folder}/src)
  target_link_libraries(limber_${name} PUBLIC ${arg_PUBLIC} PRIVATE ${arg_PRIVATE})
  limber_compile_options(limber_${name})
  if(NOT arg_NO_SANITIZE)
    limber_sanitize(limber_${name})
  endif()
  set_property(GLOBAL APPEND PROPERTY LIMBER_MODULES ${name})
endfunction()

# Tools, drawn assemblies, examples and tests do little themselves: what they call is in the libraries, at -O3. Optimising them takes
# two fifths of a build.
set(LIMBER_CALLER_OPTIONS $<$<CONFIG:Release>:-O1>)
if(LIMBER_SANITIZE MATCHES address AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # The same checks, by calls: a fifth less to compile.
  list(APPEND LIMBER_CALLER_OPTIONS --param=asan-instrumentation-with-call-threshold=0)
endif()

# limber_add_program(name SOURCES ... LINK ... [OPTIONS ...] [INSTALL]) makes an executable called <name> in build/<preset>/bin.
function(limber_add_program name)
  cmake_parse_arguments(arg "INSTALL" "" "SOURCES;LINK;OPTIONS" ${ARGN})
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "limber_add_program(${name}): unknown argument(s) ${arg_UNPARSED_ARGUMENTS}")
  endif()
  add_executable(${name} ${arg_SOURCES})
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/bin")
  target_link_libraries(${name} PRIVATE ${arg_LINK})
  limber_compile_options(${name})
  target_compile_options(${name} PRIVATE ${arg_OPTIONS})
  limber_sanitize(${name})
  if(arg_INSTALL AND LIMBER_INSTALL)
    install(TARGETS ${name} RUNTIME)
  endif()
endfunction()

# limber_add_precompiled(name HEADERS <...> LINK ... [OPTIONS ...]): large headers that many programs include, parsed once. A
# program takes them by target_precompile_headers(program REUSE_FROM name); its own compile options must be the same. Headers of
# other projects only: the compiler knows a precompiled header's files by their bytes, a compiler cache by their tokens, so a comment
# that changes in a cached one defeats `#pragma once`.
function(limber_add_precompiled name)
  cmake_parse_arguments(arg "" "" "HEADERS;LINK;OPTIONS" ${ARGN})
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "limber_add_precompiled(${name}): unknown argument(s) ${arg_UNPARSED_ARGUMENTS}")
  endif()
  # A program of its own, as it has the flags of programs, and no definitions but those of the headers' libraries.
  file(CONFIGURE OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/${name}.cpp CONTENT "int main() { return 0; }\n")
  add_executable(${name} EXCLUDE_FROM_ALL ${CMAKE_CURRENT_BINARY_DIR}/${name}.cpp)
  target_link_libraries(${name} PRIVATE ${arg_LINK})
  limber_compile_options(${name})
  target_compile_options(${name} PRIVATE ${arg_OPTIONS})
  limber_sanitize(${name})
  target_precompile_headers(${name} PRIVATE ${arg_HEADERS})
endfunction()

# limber_add_tests(module SOURCES ... LINK ... [TIMEOUT seconds]): one GoogleTest program per module, one CTest entry per test;
# under sanitizers one per program, as an instrumented program takes longer to start than most tests to run.
function(limber_add_tests module)
  cmake_parse_arguments(arg "" "TIMEOUT;PROCESSORS" "SOURCES;LINK" ${ARGN})
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "limber_add_tests(${module}): unknown argument(s) ${arg_UNPARSED_ARGUMENTS}")
  endif()
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 120)
  endif()
  if(NOT arg_PROCESSORS)
    set(arg_PROCESSORS 1)
  endif()
  add_executable(test_${module} ${arg_SOURCES})
  # Seen beside their callers, operator new and delete draw warnings of mismatched pairs.
  limber_compile_alone("${arg_SOURCES}" "counted_new\\.cpp$")
  # Compiled together, thirteen files at most and as many in each batch, what Eigen and GoogleTest are asked for is made once: half the
  # time of a build from nothing.
  list(LENGTH arg_SOURCES files)
  set(batch 13)
  if(files GREATER batch)
    math(EXPR batches "(${files} + ${batch} - 1) / ${batch}")
    math(EXPR batch "(${files} + ${batches} - 1) / ${batches}")
  endif()
  set_target_properties(test_${module} PROPERTIES
    RUNTIME_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/tests" UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE ${batch})
  target_link_libraries(test_${module} PRIVATE ${arg_LINK} GTest::gmock GTest::gtest_main)
  target_include_directories(test_${module} PRIVATE ${PROJECT_SOURCE_DIR}/tests/support ${PROJECT_BINARY_DIR}/tests/support)
  limber_compile_options(test_${module})
  target_compile_options(test_${module} PRIVATE ${LIMBER_CALLER_OPTIONS})
  limber_sanitize(test_${module})
  target_precompile_headers(test_${module} REUSE_FROM limber_test_headers)
  if(LIMBER_SANITIZE)
    add_test(NAME ${module} COMMAND test_${module})
    set_tests_properties(${module} PROPERTIES TIMEOUT 900 ENVIRONMENT "OPENBLAS_NUM_THREADS=1")
  else()
    gtest_discover_tests(test_${module} TEST_PREFIX "${module}." DISCOVERY_TIMEOUT 60
      PROPERTIES TIMEOUT ${arg_TIMEOUT} PROCESSORS ${arg_PROCESSORS} ENVIRONMENT "OPENBLAS_NUM_THREADS=1")
  endif()
endfunction()
