// make_assembly: writes drawn assemblies as OBJ, a group for each part, with their true joints beside them.

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <map>

#include "assemblies.h"
#include "limber/core/error.h"
#include "program.h"
#include "true_joints.h"

namespace limber::assemblies {
namespace {

namespace fs = std::filesystem;
using tools::Program;

struct Arguments {
  std::string name, out;
  bool all = false, list = false;
  Variant variant;
};

std::vector<std::string> all_names() {
  std::vector<std::string> names = tuning_names();
  names.insert(names.end(), held_out_names().begin(), held_out_names().end());
  return names;
}

CLI::Validator whole_number_of_segments() {
  return CLI::Validator(
      [](const std::string& text) {
        int n = 0;
        const bool good = CLI::detail::lexical_cast(text, n) && n >= 8 && n <= 1024 && n % 8 == 0;
        return good ? std::string() : "is " + text + ", expected a multiple of 8 from 8 to 1024";
      },
      "", "a multiple of 8");
}

void declare(CLI::App& options, Arguments& a) {
  Variant& v = a.variant;
  auto* name = options.add_option("ASSEMBLY", a.name, "which to draw; see --list");
  auto* all = options.add_flag("--all", a.all, "draw all of them")->excludes(name);
  options.add_flag("--list", a.list, "print the names and joints of all and stop")->excludes(name)->excludes(all);
  options
      .add_option("-o,--out", a.out,
                  "the OBJ to write, its joints beside it in FILE.joints.json; or the folder for both (made if it is "
                  "not there), named after the assembly")
      ->type_name("FILE.obj|DIR");
  options.add_option("--segments", v.segments, "of a full circle: a multiple of 8")
      ->type_name("N")
      ->check(whole_number_of_segments())
      ->capture_default_str();
  options.add_option("--clearance", v.clearance, "gap on each side of a bearing; less than 0: the parts overlap")
      ->type_name("PART_OF_DIAMETER")
      ->check(tools::number_between(-0.02, 0.05))
      ->capture_default_str();
  options.add_option("--phase", v.phase, "by which shafts are turned against their holes")
      ->type_name("PART_OF_SEGMENT")
      ->check(tools::number_between(0.0, 1.0))
      ->capture_default_str();
  options.add_option("--jitter", v.jitter, "RMS noise on the vertices")
      ->type_name("PART_OF_DIAGONAL")
      ->check(tools::number_between(0.0, 0.01))
      ->capture_default_str();
  options.add_option("--seed", v.seed, "of noise and of the order of faces")->capture_default_str();
  options.add_option("--scale", v.scale, "of all lengths")->check(tools::positive_number())->capture_default_str();
  options.add_flag("--soup", v.soup, "no two triangles share a vertex");
  options.add_flag("--open", v.open, "leave out surfaces that bear nothing");
  options.add_flag("--swapped", v.swapped, "parts in reverse order");
  options.add_flag("--shuffled", v.shuffled, "faces of each part in random order");
}

/// The options that draw this variant again; those left at their defaults too where they are numbers.
std::string options_text(const Variant& v) {
  std::string text = fmt::format("--segments {} --clearance {} --phase {} --jitter {} --seed {} --scale {}", v.segments,
                                 v.clearance, v.phase, v.jitter, v.seed, v.scale);
  for (const auto& [set, option] :
       {std::pair(v.soup, " --soup"), {v.open, " --open"}, {v.swapped, " --swapped"}, {v.shuffled, " --shuffled"}})
    if (set) text += option;
  return text;
}

/// Numbers read back to the same bits.
std::string obj_text(const GroupedSurface& surface, const std::string& remark) {
  std::string text = "# " + remark + "\n";
  const auto to = std::back_inserter(text);
  for (const Vec3& p : surface.surface.vertices) fmt::format_to(to, "v {} {} {}\n", p.x(), p.y(), p.z());
  for (const SurfaceGroup& g : surface.groups) {
    fmt::format_to(to, "g {}\n", g.name);
    for (Index i = g.first; i < g.first + g.count; ++i) {
      const Triangle& t = surface.surface.triangles[static_cast<std::size_t>(i)];
      fmt::format_to(to, "f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
    }
  }
  return text;
}

/// "3 revolute, 1 ball"
std::string joints_in_words(const MadeAssembly& made) {
  std::map<JointType, int> counts;
  for (const TrueJoint& joint : made.joints) ++counts[joint.type];
  std::string text;
  for (const auto& [type, count] : counts)
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, to_string(type));
  return text.empty() ? "no joint" : text;
}

void list(Program& program) {
  for (const std::string& name : all_names())
    program.print(fmt::format("{:<14} {}\n", name, joints_in_words(make(name))));
}

struct Drawn {
  fs::path obj, joints;
  std::string obj_text, joints_text, summary;
};

fs::path with_joints_ending(fs::path obj) { return obj.replace_extension(".joints.json"); }

Drawn draw(const Arguments& a, const std::string& name, const fs::path& obj) {
  const MadeAssembly made = make(name, a.variant);
  return {obj, with_joints_ending(obj),
          obj_text(made.surface, fmt::format("make_assembly \"{}\" {}", name, options_text(a.variant))),
          joints_text(true_joints(made)),
          fmt::format("{}: {} parts, {} triangles; {}\n", name, made.surface.groups.size(),
                      made.surface.surface.triangles.size(), joints_in_words(made))};
}

std::string file_name(std::string assembly) {
  std::replace(assembly.begin(), assembly.end(), ' ', '_');
  return assembly + ".obj";
}

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directory(folder, error);
  if (!fs::is_directory(folder))
    throw InputError("\"" + folder.string() + "\": cannot make the folder" + (error ? ": " + error.message() : ""));
}

void write(Program& program, const Arguments& a) {
  if (a.list) return list(program);
  if (a.name.empty() && !a.all) throw InvalidArgument("which assembly? Give its name, --all or --list; see --help");
  if (a.out.empty()) throw InvalidArgument("where to? --out FILE.obj or --out DIR is needed");
  const std::vector<std::string> known = all_names();
  if (!a.all && std::find(known.begin(), known.end(), a.name) == known.end())
    throw InvalidArgument("there is no assembly \"" + a.name + "\"; see --list");
  const fs::path out(a.out);
  const bool one_file = out.extension() == ".obj";
  if (one_file && a.all)
    throw InvalidArgument("--all writes many files: --out is \"" + a.out + "\", expected a folder");
  if (!one_file && out.has_extension() && !fs::is_directory(out))
    throw InvalidArgument("--out is \"" + a.out + "\", expected FILE.obj or a folder");

  std::vector<Drawn> drawn;
  for (const std::string& name : a.all ? known : std::vector{a.name})
    drawn.push_back(draw(a, name, one_file ? out : out / file_name(name)));
  if (!one_file) make_folder(out);
  for (const Drawn& d : drawn) {
    program.write_file(d.obj, d.obj_text);
    program.write_file(d.joints, d.joints_text);
    program.print(d.summary);
  }
}

}  // namespace
}  // namespace limber::assemblies

int main(int argc, char** argv) {
  using namespace limber;
  tools::Program program("make_assembly",
                         "Draws an assembly whose joints are known: an OBJ with a group for each part, and its true "
                         "joints as a joints file. Lengths in m before --scale.");
  assemblies::Arguments arguments;
  assemblies::declare(program.options(), arguments);
  return program.run(argc, argv, [&] { assemblies::write(program, arguments); });
}
