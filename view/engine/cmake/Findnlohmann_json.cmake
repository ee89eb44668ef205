# Headers only; the folder comes from the outer build.
if(NOT TARGET nlohmann_json::nlohmann_json)
  add_library(nlohmann_json::nlohmann_json INTERFACE IMPORTED)
  target_include_directories(nlohmann_json::nlohmann_json SYSTEM INTERFACE ${LIMBER_PAGE_HEADERS})
endif()
set(nlohmann_json_FOUND TRUE)
