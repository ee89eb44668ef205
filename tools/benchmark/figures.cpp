#include "figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "limber/core/error.h"
#include "limber/internal/strict_json.h"
#include "program.h"

namespace limber::tools {
namespace {

struct Limits {
  double least = -std::numeric_limits<double>::infinity(), most = std::numeric_limits<double>::infinity();
};

Limits read_limits(const nlohmann::json& value, const std::string& where) {
  const internal::JsonObject o(value, where);
  Limits limits;
  limits.least = o.number("least", limits.least);
  limits.most = o.number("most", limits.most);
  o.finish();
  return limits;
}

}  // namespace

void hold_to_limits(Program& program, const std::vector<Figure>& figures, const std::filesystem::path& limits) {
  const nlohmann::json document = internal::read_json(limits);
  program.add_input(limits);
  const std::string file = internal::in_quotes(limits.string());
  std::string beyond;
  for (const Figure& f : figures) {
    if (!document.contains(f.name)) throw InputError(file + ": has no limit for " + f.name + ", expected one");
    const Limits allowed = read_limits(document.at(f.name), file + " " + f.name);
    const bool is_within = f.value >= allowed.least && f.value <= allowed.most;
    program.print(fmt::format("{:<32} {:>12.6g}  {:>10.6g} to {:<10.6g} {}\n", f.name, f.value, allowed.least,
                              allowed.most, is_within ? "" : "BEYOND"));
    if (!is_within)
      beyond += fmt::format("{}{} is {:.6g}, expected {:.6g} to {:.6g}", beyond.empty() ? "" : "; ", f.name, f.value,
                            allowed.least, allowed.most);
  }
  for (const auto& [name, unused] : document.items())
    if (std::none_of(figures.begin(), figures.end(), [&](const Figure& f) { return f.name == name; }))
      throw InputError(file + ": has a limit for " + name + ", which was not measured");
  if (!beyond.empty()) throw ComputationError("beyond the limits of " + file + ": " + beyond);
}

}  // namespace limber::tools
