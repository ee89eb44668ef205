/// @file touched_pages.h
/// How much memory a piece of work reads or writes at all, as the kernel sees it.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>

namespace limber::tools {

/// Bytes of the pages of this process that `work` touched once or more, less those that doing nothing touches: its
/// working set without code, in steps of a page. None where /proc cannot tell (Linux alone can).
std::optional<std::size_t> touched_bytes(const std::function<void()>& work);

}  // namespace limber::tools
