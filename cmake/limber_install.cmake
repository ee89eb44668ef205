# What `cmake --install` lays down: headers, libraries, one export file per component, and the package config.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(limber_cmake_dir ${CMAKE_INSTALL_LIBDIR}/cmake/limber)
get_property(limber_modules GLOBAL PROPERTY LIMBER_MODULES)
set(limber_components "")

foreach(module IN LISTS limber_modules)
  get_target_property(component limber_${module} LIMBER_COMPONENT)
  list(APPEND limber_components ${component})
  install(TARGETS limber_${module} EXPORT limber_${component}
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}
    RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  # Every include root is a folder that holds limber/<module>/*.h; generated headers come from the build tree's.
  get_target_property(roots limber_${module} INTERFACE_INCLUDE_DIRECTORIES)
  foreach(root IN LISTS roots)
    if(root MATCHES "^\\$<BUILD_INTERFACE:(.*)>$")
      install(DIRECTORY "${CMAKE_MATCH_1}/limber" DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")
    endif()
  endforeach()
endforeach()

list(REMOVE_DUPLICATES limber_components)
foreach(component IN LISTS limber_components)
  install(EXPORT limber_${component} NAMESPACE limber:: FILE limber-${component}.cmake DESTINATION ${limber_cmake_dir})
endforeach()

configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/limberConfig.cmake.in ${PROJECT_BINARY_DIR}/limberConfig.cmake
  INSTALL_DESTINATION ${limber_cmake_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/limberConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/limberConfig.cmake ${PROJECT_BINARY_DIR}/limberConfigVersion.cmake
  DESTINATION ${limber_cmake_dir})
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})
file(GLOB limber_find_modules ${PROJECT_SOURCE_DIR}/cmake/Find*.cmake)
if(limber_find_modules)
  install(FILES ${limber_find_modules} DESTINATION ${limber_cmake_dir})
endif()
