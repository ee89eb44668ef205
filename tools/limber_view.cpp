// limber-view: a scene or an asset as one HTML page in which one can take hold of it.

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>
#include <zlib.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>

#include "empty_page.h"
#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/mesh_assimp/read_surface_mesh.h"
#include "limber/view/page_file.h"
#include "program.h"

namespace limber::tools {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string input, page, joints, up;
  std::vector<std::string> bake;
};

/// How an assembly is baked where nothing is said; its material, where only that is not said.
constexpr std::size_t kMaterialWords = 2;
constexpr const char* kBake[] = {"--material", "nylon", "--modes", "6", "--damping-ratio", "0.03@50,500"};

std::string joined(std::span<const char* const> words) {
  std::string text;
  for (const char* word : words) text += (text.empty() ? "" : " ") + std::string(word);
  return text;
}

/// A folder that nobody else can write to.
fs::path temporary_folder() {
  std::string folder = (fs::temp_directory_path() / "limber-view-XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) throw InputError(folder + ": cannot be made; is TMPDIR a folder to write to?");
  return folder;
}

/// One that goes with what is in it.
struct ScratchFolder {
  fs::path path = temporary_folder();
  ScratchFolder() = default;
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  ~ScratchFolder() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
};

/// Runs a program; what it prints is printed. @return its exit code; none: it could not be started
std::optional<int> exit_code_of(const std::string& program, std::vector<std::string> arguments) {
  std::vector<char*> pointers;
  std::string name = program;
  pointers.push_back(name.data());
  for (std::string& argument : arguments) pointers.push_back(argument.data());
  pointers.push_back(nullptr);
  pid_t process = 0;
  if (posix_spawnp(&process, program.c_str(), nullptr, nullptr, pointers.data(), environ) != 0) return std::nullopt;
  int status = 0;
  if (waitpid(process, &status, 0) != process || !WIFEXITED(status)) return std::nullopt;
  return WEXITSTATUS(status);
}

/// The program of this name beside this one, or else on the PATH.
std::string neighbour(const char* name) {
  std::error_code failed;
  const fs::path self = fs::read_symlink("/proc/self/exe", failed);
  const fs::path beside = self.parent_path() / name;
  return !failed && fs::exists(beside, failed) ? beside.string() : name;
}

/// As asked, or else as the file of a mesh says; none where it does not.
std::optional<UpAxis> up_axis(const std::string& asked, char of_file) {
  if (asked.empty() && of_file == 0) return std::nullopt;
  return (asked.empty() ? of_file == 'y' : asked == "y") ? UpAxis::kY : UpAxis::kZ;
}

char up_axis_of_file(const fs::path& mesh) {
  Warnings told_by_the_bake;
  FileUnit unit;
  (void)read_any_grouped_surface(mesh, told_by_the_bake, &unit);
  return unit.up;
}

/// An assembly: its joints are found and its parts baked by limber-precompute, a program of its own because of the
/// licences of what it links.
PageContent page_of_assembly(const fs::path& input, const std::string& up, const std::vector<std::string>& bake) {
  const ScratchFolder folder;
  const fs::path asset = folder.path / (input.stem().string() + ".glb");
  std::vector<std::string> arguments{input.string(), "-o", asset.string()};
  if (std::find(bake.begin(), bake.end(), "--joints") == bake.end()) arguments.emplace_back("--auto-joints");
  const auto is_given = [&](const std::string& option) {
    return std::ranges::any_of(bake, [&](const std::string& word) { return word.starts_with(option); });
  };
  const bool material = is_given("--material") || is_given("--youngs-modulus");
  const std::span<const char* const> defaults(kBake);
  for (const char* word : bake.empty() ? defaults : defaults.first(material ? 0 : kMaterialWords))
    arguments.emplace_back(word);
  arguments.insert(arguments.end(), bake.begin(), bake.end());
  const std::optional<int> code = exit_code_of(neighbour("limber-precompute"), std::move(arguments));
  if (!code)
    throw InputError(
        fmt::format("{}: an assembly needs limber-precompute, which is neither beside limber-view nor on "
                    "the PATH; where it is, run limber-precompute {} --auto-joints -o machine.glb, then "
                    "limber-view machine.glb here",
                    input.string(), input.string()));
  if (*code != 0)
    throw InputError(
        fmt::format("{}: limber-precompute could not bake it (see above); its options go after --", input.string()));
  return page_of_asset(asset, up_axis(up, up_axis_of_file(input)));
}

PageContent content_of(Program& program, const Arguments& arguments) {
  const fs::path input = arguments.input;
  const std::string extension = input.extension().string();
  if (!arguments.joints.empty()) {
    program.add_input(arguments.joints);
    return page_of_pose(read_any_grouped_surface(input, program.warnings()), read_joints(arguments.joints),
                        input.stem().string(), "\"" + fs::path(arguments.joints).filename().string() + "\"");
  }
  if (extension == ".json") return page_of_scene(input);
  if (extension == ".glb" && arguments.bake.empty()) return page_of_asset(input, up_axis(arguments.up, 0));
  if (!fs::exists(input)) throw InputError(input.string() + ": is not there");
  return page_of_assembly(input, arguments.up, arguments.bake);
}

/// gzip's bytes (RFC 1952), which every browser reads.
std::string gzipped(std::string_view bytes) {
  z_stream stream{};
  constexpr int kGzip = 15 + 16;
  if (deflateInit2(&stream, Z_BEST_COMPRESSION, Z_DEFLATED, kGzip, 9, Z_DEFAULT_STRATEGY) != Z_OK)
    throw ComputationError("limber-view: zlib has no memory");
  std::string out(deflateBound(&stream, bytes.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  const int ended = deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  if (ended != Z_STREAM_END) throw ComputationError("limber-view: zlib cannot compress a file of the page");
  return out;
}

fs::path temporary_page(const fs::path& input) { return temporary_folder() / (input.stem().string() + ".html"); }

/// @return whether the desktop took it
bool opened(const std::string& page) { return exit_code_of("xdg-open", {page}) == 0; }

void view(Program& program, const Arguments& arguments) {
  program.add_input(arguments.input);
  const PageContent content = content_of(program, arguments);
  const std::string page = page_with(empty_page(!content.joints.empty()), content, gzipped);
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
  limber::tools::Program program(
      "limber-view",
      "Writes a scene, an asset or an assembly as one HTML page, engine inside, in which bodies are dragged, poked, "
      "pinned and dropped; or, with --joints, a model that is posed. The page needs no network and no server.");
  limber::tools::Arguments arguments;
  program.options()
      .add_option("INPUT", arguments.input,
                  "scene (.json), asset (.glb), or the surface of an assembly (OBJ, STL, PLY, glTF, ...), whose "
                  "joints are found and whose parts are baked first")
      ->required();
  program.options().add_option(
      "BAKE", arguments.bake,
      "after --: how limber-precompute bakes the assembly, by default of nylon; without any: " +
          limber::tools::joined(limber::tools::kBake));
  program.options()
      .add_option("-o,--output", arguments.page, "page to write; without it a temporary one is opened")
      ->type_name("FILE.html");
  program.options()
      .add_option("--joints", arguments.joints,
                  "joints file of a surface: a page in which it is posed, and its joints edited")
      ->type_name("JOINTS.json");
  program.options()
      .add_option("--up", arguments.up,
                  "of an asset or assembly: the axis of its mesh that points up; by default what an assembly's file "
                  "says, y for an asset baked from glTF, else z")
      ->check(CLI::IsMember({"y", "z"}));
  return program.run(argc, argv, [&] { limber::tools::view(program, arguments); });
}
