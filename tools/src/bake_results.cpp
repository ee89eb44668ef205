#include "bake_results.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <sstream>

#include "limber/core/error.h"
#include "limber/core/file.h"
#include "program.h"

namespace limber::tools {

using Json = nlohmann::ordered_json;

BakeResults::BakeResults(Program& program, std::string path) : program_(program), path_(std::move(path)) {
  if (path_.empty()) return;
  file_ = open(path_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  if (file_ < 0) refuse();
  char last = '\n';  // the end of a run may have cut off the last line
  if (lseek(file_, -1, SEEK_END) >= 0 && read(file_, &last, 1) == 1 && last != '\n' && write(file_, "\n", 1) != 1)
    refuse();
}

void BakeResults::refuse() const {
  throw InputError(fmt::format("{}: cannot be written: {}", path_, std::strerror(errno)));
}

BakeResults::~BakeResults() {
  if (file_ >= 0) close(file_);
}

void BakeResults::add(const Json& result) {
  const std::string line = result.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
  if (file_ < 0) return program_.print(line);
  if (write(file_, line.data(), line.size()) != static_cast<ssize_t>(line.size())) refuse();
}

bool is_good(const Json& result) { return result["status"] == "baked" || result["status"] == "cached"; }

std::map<std::string, Json> read_results(const std::filesystem::path& file) {
  std::map<std::string, Json> last;
  if (!std::filesystem::exists(file) || std::filesystem::file_size(file) == 0) return last;
  std::istringstream lines(read_file(file));
  for (std::string line; std::getline(lines, line);) {
    Json result = Json::parse(line, nullptr, false);
    if (!result.is_object() || !result.contains("output") || !result["output"].is_string() ||
        !result.contains("status"))
      continue;
    const auto output = result["output"].get<std::string>();
    last[output] = std::move(result);
  }
  return last;
}

}  // namespace limber::tools
