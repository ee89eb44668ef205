/// @file empty_page.h
/// The page without a scene, as it was built into this program.
#pragma once

#include <string>

namespace limber {

/// For page_with() of limber/view/page_file.h. @param poses with what poses a model, instead of what steps a scene
std::string empty_page(bool poses);

}  // namespace limber
