#include "limber/internal/strict_json.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <set>

#include "limber/core/error.h"
#include "limber/core/file.h"

namespace limber::internal {

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({row[j] + 1, row[j + 1] + 1, replaced});
    }
  }
  return row.back();
}

std::string nearest_word(std::string_view word, const std::vector<std::string>& known) {
  const auto best = std::min_element(known.begin(), known.end(), [&](const auto& a, const auto& b) {
    return edit_distance(word, a) < edit_distance(word, b);
  });
  return best == known.end() ? std::string() : *best;
}

std::string in_quotes(std::string_view text) {
  constexpr std::size_t kLongest = 60;
  const bool cut = text.size() > kLongest;
  const std::string kept(text.substr(0, cut ? kLongest : text.size()));
  // Control characters and broken UTF-8 come out as escapes and replacement characters.
  const std::string out = nlohmann::json(kept).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  return cut ? out.substr(0, out.size() - 1) + "...\"" : out;
}

void refuse(const std::string& where, const std::string& seen, const std::string& expected) {
  throw InputError(where + ": is " + seen + ", expected " + expected);
}

nlohmann::json parse_json(std::string_view text, const std::string& name) {
  std::vector<std::set<std::string>> open;
  std::optional<std::string> doubled;
  const auto watch = [&](int, nlohmann::json::parse_event_t event, nlohmann::json& value) {
    using E = nlohmann::json::parse_event_t;
    if (event == E::object_start) open.emplace_back();
    if (event == E::object_end && !open.empty()) open.pop_back();
    if (event == E::key && !open.empty() && !open.back().insert(value.get<std::string>()).second && !doubled)
      doubled = value.get<std::string>();
    return true;
  };
  try {
    auto document = nlohmann::json::parse(text, watch);
    if (doubled) throw InputError(name + ": the key " + in_quotes(*doubled) + " stands twice in one object");
    return document;
  } catch (const nlohmann::json::exception& e) {
    std::string what = e.what();
    // Keep the library's place and reason, drop its tag and anything that would break the one line.
    if (const auto tag = what.find("] "); tag != std::string::npos) what.erase(0, tag + 2);
    std::replace_if(
        what.begin(), what.end(), [](unsigned char c) { return c < 32 || c > 126; }, '?');
    throw InputError(name + ": not valid JSON: " + what);
  }
}

nlohmann::json read_json(const std::filesystem::path& path) {
  return parse_json(read_file(path, std::size_t{256} << 20), "\"" + path.string() + "\"");
}

namespace {

double number_of(const nlohmann::json& v, const std::string& place) {
  if (!v.is_number() || !std::isfinite(v.get<double>()))
    throw InputError(place + ": is " + JsonObject::shown(v) + ", expected a finite number");
  return v.get<double>();
}

}  // namespace

JsonObject::JsonObject(const nlohmann::json& value, std::string where) : value_(&value), where_(std::move(where)) {
  if (!value.is_object()) throw InputError(where_ + ": is " + shown(value) + ", expected an object { … }");
}

bool JsonObject::has(const std::string& key) const {
  known_.push_back(key);
  return value_->contains(key);
}

const nlohmann::json& JsonObject::at(const std::string& key) const {
  if (!has(key)) throw InputError(where_ + ": the key \"" + key + "\" is missing" + similar_key(key));
  return (*value_)[key];
}

double JsonObject::number(const std::string& key) const { return number_of(at(key), where(key)); }

std::int64_t JsonObject::integer(const std::string& key, std::int64_t low, std::int64_t high) const {
  const auto& v = at(key);
  // The library compares an unsigned number beyond 2⁶³ as if it were negative.
  const bool too_large = v.is_number_unsigned() && v.get<std::uint64_t>() > std::uint64_t{INT64_MAX};
  if (!v.is_number_integer() || too_large || v < low || v > high)
    throw InputError(where(key) + ": is " + shown(v) + ", expected an integer from " + std::to_string(low) + " to " +
                     std::to_string(high));
  return v.get<std::int64_t>();
}

bool JsonObject::boolean(const std::string& key, bool otherwise) const {
  if (!has(key)) return otherwise;
  const auto& v = at(key);
  if (!v.is_boolean()) throw InputError(where(key) + ": is " + shown(v) + ", expected true or false");
  return v.get<bool>();
}

std::string JsonObject::text(const std::string& key) const {
  const auto& v = at(key);
  if (!v.is_string()) throw InputError(where(key) + ": is " + shown(v) + ", expected text");
  return v.get<std::string>();
}

std::vector<double> JsonObject::numbers(const std::string& key, std::size_t count) const {
  const auto& v = at(key);
  if (!v.is_array() || v.size() != count)
    throw InputError(where(key) + ": is " + shown(v) + ", expected an array of " + std::to_string(count) + " numbers");
  std::vector<double> out;
  out.reserve(count);
  for (std::size_t i = 0; i < count; ++i) out.push_back(number_of(v[i], where(key) + "[" + std::to_string(i) + "]"));
  return out;
}

Vec3 JsonObject::vec3(const std::string& key) const {
  const auto n = numbers(key, 3);
  return {n[0], n[1], n[2]};
}

void JsonObject::for_each(const std::string& key,
                          const std::function<void(const nlohmann::json&, const std::string&)>& visit) const {
  const auto& v = at(key);
  if (!v.is_array()) throw InputError(where(key) + ": is " + shown(v) + ", expected an array [ … ]");
  for (std::size_t i = 0; i < v.size(); ++i) visit(v[i], where(key) + "[" + std::to_string(i) + "]");
}

void JsonObject::for_each_member(const std::function<void(const std::string&, const nlohmann::json&)>& visit) const {
  for (const auto& [key, value] : value_->items()) visit(key, value);
}

void JsonObject::finish() const {
  for (const auto& [key, unused] : value_->items()) {
    if (std::find(known_.begin(), known_.end(), key) != known_.end()) continue;
    std::string message = where_ + ": the key " + in_quotes(key) + " is unknown";
    if (const auto near = nearest_word(key, known_); !near.empty()) message += "; did you mean \"" + near + "\"?";
    throw InputError(message);
  }
}

std::string JsonObject::shown(const nlohmann::json& v) {
  constexpr std::size_t kFew = 8;
  const bool flat =
      v.size() <= kFew && std::none_of(v.begin(), v.end(), [](const auto& i) { return i.is_structured(); });
  if (v.is_object()) return "an object of " + std::to_string(v.size()) + " keys";
  if (v.is_array() && !flat) return "an array of " + std::to_string(v.size()) + " items";
  if (v.is_string()) return in_quotes(v.get_ref<const std::string&>());
  const std::string s = v.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  return s.size() > 60 ? s.substr(0, 57) + "..." : s;
}

/// For a key that is missing, perhaps because it is misspelt: what stands there that is like it and not known yet.
std::string JsonObject::similar_key(const std::string& key) const {
  constexpr std::size_t kFewEdits = 2;
  std::vector<std::string> others;
  for (const auto& [other, unused] : value_->items())
    if (std::find(known_.begin(), known_.end(), other) == known_.end()) others.push_back(other);
  const auto near = nearest_word(key, others);
  if (near.empty() || edit_distance(key, near) > kFewEdits) return "";
  return "; what stands there is " + in_quotes(near);
}

}  // namespace limber::internal
