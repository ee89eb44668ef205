#include "plot.h"

#include <fmt/format.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>

#include "limber/core/file.h"
#include "program.h"

namespace limber::tools {

std::string svg_by_gnuplot(PlotSize size, std::string_view data, std::string_view commands) {
  const auto folder = std::filesystem::temp_directory_path() /
                      fmt::format("limber-benchmark-{}", std::chrono::steady_clock::now().time_since_epoch().count());
  std::filesystem::create_directory(folder);
  write_file(folder / "data.csv", data);
  write_file(folder / "plot.gp",
             fmt::format("set terminal svg size {},{} font 'sans-serif,13' background rgb 'white' name 'limber'\n"
                         "set output 'out.svg'\n{}\n",
                         size.width, size.height, commands));
  const int code = std::system(("cd '" + folder.string() + "' && gnuplot plot.gp >/dev/null 2>&1").c_str());
  std::string svg = code == 0 ? read_file(folder / "out.svg") : "";
  std::filesystem::remove_all(folder);
  return svg;
}

void write_plot(Program& program, const std::string& path, const std::string& svg) {
  if (svg.empty())
    program.warnings().push_back("No plot was made: gnuplot is missing or failed; apt-get install gnuplot-nox.");
  else
    program.write_file(path, svg);
}

}  // namespace limber::tools
