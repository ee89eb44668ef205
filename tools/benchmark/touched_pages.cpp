#include "touched_pages.h"

#include <sys/mman.h>

#include <cstring>
#include <fstream>
#include <sstream>
#include <string>

namespace limber::tools {
namespace {

/// Makes the processor forget pages that it would not mark again: giving back a large mapping does so.
void flush_translations() {
  constexpr std::size_t kBytes = std::size_t{4} << 20;
  void* mapped = ::mmap(nullptr, kBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (mapped == MAP_FAILED) return;
  std::memset(mapped, 1, kBytes);
  ::munmap(mapped, kBytes);
}

/// Marks all pages as not touched.
bool forget_touches() {
  {
    std::ofstream file("/proc/self/clear_refs");
    file << "1\n";
    if (!file.flush()) return false;
  }
  flush_translations();
  return true;
}

/// Touched bytes of memory that is no part of a file: code is read in pieces that the kernel chooses.
std::optional<std::size_t> touched_since() {
  std::ifstream file("/proc/self/smaps");
  if (!file) return std::nullopt;
  constexpr std::size_t kKiB = 1024;
  std::size_t sum = 0;
  bool counts = false;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string first;
    words >> first;
    if (first.find('-') != std::string::npos &&
        first.back() != ':') {  // a mapping: addresses, rights, offset, device, inode
      std::string rights, offset, device, inode;
      words >> rights >> offset >> device >> inode;
      counts = inode == "0";
    } else if (counts && first == "Referenced:") {
      std::size_t kib = 0;
      words >> kib;
      sum += kib * kKiB;
    }
  }
  return sum;
}

std::optional<std::size_t> touched_by(const std::function<void()>& work) {
  if (!forget_touches()) return std::nullopt;
  work();
  return touched_since();
}

}  // namespace

std::optional<std::size_t> touched_bytes(const std::function<void()>& work) {
  const auto nothing = touched_by([] {}), something = touched_by(work);
  if (!nothing || !something) return std::nullopt;
  return *something > *nothing ? *something - *nothing : 0;
}

}  // namespace limber::tools
