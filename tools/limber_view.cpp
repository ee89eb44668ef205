// limber-view: a scene or an asset as one HTML page in which one can take hold of it.

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "empty_page.h"
#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/view/page_file.h"
#include "program.h"

namespace limber::tools {
namespace {

struct Arguments {
  std::string input, page, up = "z";
};

PageContent content_of(const Arguments& arguments) {
  const std::filesystem::path input = arguments.input;
  const std::string extension = input.extension().string();
  if (extension == ".json") return page_of_scene(input);
  if (extension == ".glb") return page_of_asset(input, arguments.up == "y" ? UpAxis::kY : UpAxis::kZ);
  throw InputError(fmt::format("{}: expected a scene (.json) or an asset (.glb); bake meshes with limber-precompute",
                               input.string()));
}

/// A folder that nobody else can write to.
std::filesystem::path temporary_page(const std::filesystem::path& input) {
  std::string folder = (std::filesystem::temp_directory_path() / "limber-view-XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) throw InputError(folder + ": cannot be made; give the page's place by -o");
  return std::filesystem::path(folder) / (input.stem().string() + ".html");
}

/// @return whether the desktop took it
bool opened(const std::string& page) {
  std::string program = "xdg-open", argument = page;
  char* const arguments[] = {program.data(), argument.data(), nullptr};
  pid_t process = 0;
  if (posix_spawnp(&process, "xdg-open", nullptr, nullptr, arguments, environ) != 0) return false;
  int status = 0;
  return waitpid(process, &status, 0) == process && WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

void view(Program& program, const Arguments& arguments) {
  program.add_input(arguments.input);
  const PageContent content = content_of(arguments);
  const std::string page = page_with(empty_page(), content);
  program.report()["files"] = content.files.size();
  program.report()["bytes"] = page.size();
  if (!arguments.page.empty()) {
    program.write_file(arguments.page, page);
    program.print(fmt::format("{}  {:.1f} MB, a page by itself: open it in a browser\n", arguments.page,
                              static_cast<double>(page.size()) * 1e-6));
    return;
  }
  const std::filesystem::path place = temporary_page(arguments.input);
  write_file(place, page);
  program.print(place.string() + "\n");
  if (!opened(place.string())) program.warnings().push_back("no program opens pages here: open the file by hand");
}

}  // namespace
}  // namespace limber::tools

int main(int argc, char** argv) {
  limber::tools::Program program("limber-view",
                                 "Writes a scene or an asset as one HTML page, engine inside, in which bodies are "
                                 "dragged, poked, pinned and dropped. It needs no network and no server.");
  limber::tools::Arguments arguments;
  program.options().add_option("INPUT", arguments.input, "scene (.json) or asset (.glb)")->required();
  program.options()
      .add_option("-o,--output", arguments.page, "page to write; without it a temporary one is opened")
      ->type_name("FILE.html");
  program.options()
      .add_option("--up", arguments.up, "of an asset: the axis of its mesh that points up")
      ->check(CLI::IsMember({"y", "z"}))
      ->capture_default_str();
  return program.run(argc, argv, [&] { limber::tools::view(program, arguments); });
}
