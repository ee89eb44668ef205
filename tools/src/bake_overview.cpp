#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "bake_results.h"
#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/internal/base64.h"
#include "limber/model/asset.h"
#include "program.h"
#include "thumbnail.h"

namespace limber::tools {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int kWidth = 96, kHeight = 72;  // of a picture, pixels

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '"')
      out += "&quot;";
    else
      out += c;
  }
  return out;
}

/// Empty where the asset is no longer there.
std::string picture_of(const std::string& asset) {
  try {
    return fmt::format("<img alt=\"\" width={} height={} src=\"data:image/png;base64,{}\">", kWidth, kHeight,
                       internal::base64(thumbnail(read_asset(asset), kWidth, kHeight)));
  } catch (const InputError&) {
    return "";
  }
}

std::string number(const Json& result, const char* key, double by, const char* digits) {
  if (!result.contains(key) || !result[key].is_number()) return "";
  return fmt::format(fmt::runtime(std::string("{:") + digits + "}"), by * result[key].get<double>());
}

std::string row_of(const Json& r) {
  const bool good = is_good(r);
  const auto mesh = r.value("mesh", ""), output = r.value("output", "");
  std::string warnings;
  for (const Json& warning : r.value("warnings", Json::array()))
    if (warning.is_string()) warnings += warning.get<std::string>() + "\n";
  return fmt::format(
      "<tr class=\"{}\"><td>{}<td title=\"{}\">{}<td>{}<td class=n>{}<td class=n>{}<td class=n>{}<td class=n>{}"
      "<td class=n>{}<td class=n>{}<td title=\"{}\">{}\n",
      good ? "good" : "bad", good ? picture_of(output) : "", escaped(mesh), escaped(fs::path(mesh).filename().string()),
      escaped(r.value("status", "")), number(r, "nodes", 1.0, ".0f"), number(r, "modes", 1.0, ".0f"),
      number(r, "lowest_hz", 1.0, ".4g"), number(r, "frequency_error", 100.0, ".2g"),
      number(r.value("seconds", Json::object()), "total", 1.0, ".3g"), number(r, "peak_memory_bytes", 1e-6, ".0f"),
      escaped(warnings), escaped(good ? (warnings.empty() ? "" : "warnings") : r.value("message", "")));
}

/// A message without what differs from file to file: names and numbers.
std::string kind_of(const std::string& message) {
  std::string kind;
  bool quoted = false;
  for (const char c : message) {
    if (c == '"') {
      quoted = !quoted;
      if (quoted) kind += "\"…\"";
    } else if (!quoted) {
      const bool digit = c >= '0' && c <= '9';
      if (!digit)
        kind += c;
      else if (!kind.ends_with('#'))
        kind += '#';
    }
  }
  return kind;
}

std::string failures(const std::map<std::string, Json>& results) {
  std::map<std::string, std::vector<std::string>> by_kind;
  for (const auto& [output, r] : results)
    if (!is_good(r))
      by_kind[r.value("status", "") + ": " + kind_of(r.value("message", ""))].push_back(
          fs::path(r.value("mesh", "")).filename().string() + ": " + r.value("message", ""));
  if (by_kind.empty()) return "";
  std::vector<const decltype(by_kind)::value_type*> kinds;
  for (const auto& kind : by_kind) kinds.push_back(&kind);
  std::ranges::stable_sort(kinds, [](const auto* a, const auto* b) { return a->second.size() > b->second.size(); });
  std::string text = "<h2>Failures by what they say</h2>\n";
  for (const auto* kind : kinds) {
    text += fmt::format("<details><summary>{} × {}</summary><ul>\n", kind->second.size(), escaped(kind->first));
    for (const std::string& one : kind->second) text += "<li>" + escaped(one) + "\n";
    text += "</ul></details>\n";
  }
  return text;
}

constexpr const char* kStyle =
    "body{font:14px sans-serif;margin:2em;color:#222;background:#fff}table{border-collapse:collapse}"
    "td,th{padding:2px 8px;border-bottom:1px solid #ddd;text-align:left}.n{text-align:right}.bad{background:#fee}"
    "details{margin:4px 0}";

}  // namespace

void write_overview(Program& program, const std::vector<std::string>& files, const std::string& page) {
  std::map<std::string, Json> results;
  for (const std::string& file : files) {
    program.add_input(file);
    (void)read_file(file);  // one that is not there is an error here
    for (auto& [output, result] : read_results(file)) results[output] = std::move(result);
  }
  const auto good = std::ranges::count_if(results, [](const auto& result) { return is_good(result.second); });
  std::string text = fmt::format(
      "<!doctype html><meta charset=utf-8><title>limber: {} assets</title><style>{}</style>\n<h1>{} of {} assets "
      "baked</h1>\n{}<table><tr><th>first mode<th>mesh<th>status<th class=n>nodes<th class=n>modes<th class=n>lowest, "
      "Hz<th class=n>error, %<th class=n>s<th class=n>MB<th>\n",
      good, kStyle, good, results.size(), failures(results));
  for (const auto& [output, result] : results) text += row_of(result);
  text += "</table>\n";
  program.write_file(page, text);
  program.print(fmt::format("{}: {} of {} assets baked\n", page, good, results.size()));
}

}  // namespace limber::tools
