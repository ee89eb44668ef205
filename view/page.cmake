# limber_page: the page without a scene, empty_page(). The engine is compiled by em++ in a
# build tree of its own, the scripts are bundled by esbuild; all of it in the build tree.
include(ExternalProject)

find_program(LIMBER_EMXX em++)
find_program(LIMBER_NODE node)
find_program(LIMBER_NPM npm)
mark_as_advanced(LIMBER_EMXX LIMBER_NODE LIMBER_NPM)
set(node_version 0)
if(LIMBER_NODE)
  execute_process(COMMAND ${LIMBER_NODE} --version OUTPUT_VARIABLE node_version OUTPUT_STRIP_TRAILING_WHITESPACE)
  string(REGEX REPLACE "^v" "" node_version "${node_version}")
endif()
if(NOT LIMBER_EMXX OR NOT LIMBER_NPM OR node_version VERSION_LESS 18)
  message(FATAL_ERROR "LIMBER_BUILD_VIEWER is ON, but emscripten (em++), Node 18 or newer, or npm is missing: scripts/install-dependencies --viewer installs them, or switch it OFF")
endif()
execute_process(COMMAND em-config EMSCRIPTEN_ROOT OUTPUT_VARIABLE emscripten_root OUTPUT_STRIP_TRAILING_WHITESPACE)

# Headers that em++ is to find without the rest of the folder that they stand in.
find_path(LIMBER_HWY_INCLUDE hwy/highway.h REQUIRED)
find_path(LIMBER_JSON_INCLUDE nlohmann/json.hpp REQUIRED)
mark_as_advanced(LIMBER_HWY_INCLUDE LIMBER_JSON_INCLUDE)
set(page_headers ${CMAKE_CURRENT_BINARY_DIR}/headers)
file(MAKE_DIRECTORY ${page_headers})
file(CREATE_LINK ${LIMBER_HWY_INCLUDE}/hwy ${page_headers}/hwy SYMBOLIC)
file(CREATE_LINK ${LIMBER_JSON_INCLUDE}/nlohmann ${page_headers}/nlohmann SYMBOLIC)

# Debian's emscripten looks for Node packages where Node of elsewhere does not.
set(page_engine ${CMAKE_CURRENT_BINARY_DIR}/engine)
set(page_package limber.js native.js posing.js posing.wasm posing_wasm.js scene.js scene.wasm scene_wasm.js source.js)
list(TRANSFORM page_package PREPEND ${page_engine}/npm/package/)
set(with_node_path ${CMAKE_COMMAND} -E env NODE_PATH=/usr/share/nodejs)
ExternalProject_Add(limber_page_engine
  SOURCE_DIR ${CMAKE_CURRENT_SOURCE_DIR}/engine
  BINARY_DIR ${page_engine}
  CONFIGURE_COMMAND ${with_node_path} ${CMAKE_COMMAND} -G ${CMAKE_GENERATOR} -S <SOURCE_DIR> -B <BINARY_DIR>
    -DCMAKE_TOOLCHAIN_FILE=${emscripten_root}/cmake/Modules/Platform/Emscripten.cmake -DCMAKE_BUILD_TYPE=Release
    "-DCMAKE_CXX_FLAGS_RELEASE=-O3 -DNDEBUG" -DEigen3_DIR=${Eigen3_DIR} -DLIMBER_PAGE_HEADERS=${page_headers}
    -DLIMBER_WARNINGS_AS_ERRORS=OFF
  BUILD_COMMAND ${with_node_path} ${CMAKE_COMMAND} --build <BINARY_DIR> --target page_sound limber_npm
  BUILD_BYPRODUCTS ${page_engine}/page_sound.wasm ${page_package}
  INSTALL_COMMAND ""
  BUILD_ALWAYS ON
  USES_TERMINAL_BUILD ON)

# Node looks for packages beside the script, so all of it lies in the build tree.
set(page_web ${CMAKE_CURRENT_BINARY_DIR}/web)
file(GLOB page_sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/web/*)
set(page_copies "")
foreach(file IN LISTS page_sources)
  cmake_path(GET file FILENAME name)
  if(NOT IS_DIRECTORY ${file})
    configure_file(${file} ${page_web}/${name} COPYONLY)
    list(APPEND page_copies ${page_web}/${name})
  endif()
endforeach()
add_custom_command(OUTPUT ${page_web}/node_modules/.installed
  COMMAND ${CMAKE_COMMAND} -P ${PROJECT_SOURCE_DIR}/cmake/npm_install.cmake
  WORKING_DIRECTORY ${page_web}
  DEPENDS ${page_web}/package-lock.json
  COMMENT "npm packages of the page")
add_custom_command(OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/empty_page.cpp
  COMMAND ${LIMBER_NODE} build.mjs ${page_engine} ${CMAKE_CURRENT_BINARY_DIR}/empty_page.cpp
  WORKING_DIRECTORY ${page_web}
  DEPENDS ${page_copies} ${page_web}/node_modules/.installed ${page_engine}/page_sound.wasm ${page_package}
  COMMENT "The page without a scene")
add_library(limber_page STATIC ${CMAKE_CURRENT_BINARY_DIR}/empty_page.cpp)
add_dependencies(limber_page limber_page_engine)
target_include_directories(limber_page PUBLIC ${CMAKE_CURRENT_SOURCE_DIR}/page)
target_compile_features(limber_page PUBLIC cxx_std_20)
limber_compile_options(limber_page)
