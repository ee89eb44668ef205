#include "growing_table.h"

#include <cerrno>
#include <cstring>

#include "limber/core/error.h"
#include "program.h"

namespace limber::tools {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path) {
  throw InputError("write \"" + path.string() + "\": " + std::strerror(errno));
}

}  // namespace

GrowingTable::GrowingTable(const std::filesystem::path& path, std::string_view head) : path_(path), part_(path) {
  if (path_.empty()) return;
  part_ += ".part";
  file_.reset(std::fopen(part_.c_str(), "w"));
  if (!file_) fail(part_);
  add(head);
}

void GrowingTable::add(std::string_view row) {
  if (!file_) return;
  const std::size_t begin = text_.size();
  text_ += row;
  text_ += '\n';
  const std::size_t size = text_.size() - begin;
  if (std::fwrite(text_.data() + begin, 1, size, file_.get()) != size || std::fflush(file_.get()) != 0) fail(part_);
}

void GrowingTable::finish(Program& program) {
  if (!file_) return;
  program.write_file(path_, text_);
  file_.reset();
  std::filesystem::remove(part_);
}

}  // namespace limber::tools
