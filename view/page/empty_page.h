/// @file empty_page.h
/// The page without a scene, as it was built into this program.
#pragma once

#include <string_view>

namespace limber {

/// For page_with() of limber/view/page_file.h.
std::string_view empty_page();

}  // namespace limber
