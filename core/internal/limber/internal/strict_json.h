/// @file limber/internal/strict_json.h
/// JSON documents read strictly: wrong types, missing keys and unknown keys are errors that name the place, what was
/// seen and what was expected; an unknown key names the nearest known one. Private to limber's own sources.
/// Who looks into a nlohmann::json includes <nlohmann/json.hpp> itself: it is too long to be parsed for all.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "limber/core/types.h"

namespace limber::internal {

/// Number of single-character insertions, removals and replacements between two words.
std::size_t edit_distance(std::string_view a, std::string_view b);

/// The word of `known` that is nearest to `word`; empty if `known` is.
std::string nearest_word(std::string_view word, const std::vector<std::string>& known);

/// Text from a file as messages show it: in quotes, on one line, not longer than a line.
std::string in_quotes(std::string_view text);

/// One line: place, what was seen, what was expected.
[[noreturn]] void refuse(const std::string& where, const std::string& seen, const std::string& expected);

/// Parses text as one JSON document. @param name shown in messages. @throws InputError with line and column; also for a
/// key that stands twice in one object (a plain parser would silently keep the last).
nlohmann::json parse_json(std::string_view text, const std::string& name);

nlohmann::json read_json(const std::filesystem::path& path);

/// One JSON object, read key by key. Call finish() last: it refuses the keys that nobody asked for.
class JsonObject {
 public:
  /// @param where the place for messages, such as `"scene.json" bodies[3]`
  JsonObject(const nlohmann::json& value, std::string where);

  const std::string& where() const { return where_; }
  std::string where(const std::string& key) const { return where_ + "." + key; }

  bool has(const std::string& key) const;
  const nlohmann::json& at(const std::string& key) const;

  double number(const std::string& key) const;
  double number(const std::string& key, double otherwise) const { return has(key) ? number(key) : otherwise; }

  /// An integer in [low, high].
  std::int64_t integer(const std::string& key, std::int64_t low, std::int64_t high) const;
  std::int64_t integer(const std::string& key, std::int64_t low, std::int64_t high, std::int64_t otherwise) const {
    return has(key) ? integer(key, low, high) : otherwise;
  }

  bool boolean(const std::string& key, bool otherwise) const;

  std::string text(const std::string& key) const;
  std::string text(const std::string& key, const std::string& otherwise) const {
    return has(key) ? text(key) : otherwise;
  }

  /// `count` finite numbers.
  std::vector<double> numbers(const std::string& key, std::size_t count) const;

  Vec3 vec3(const std::string& key) const;
  Vec3 vec3(const std::string& key, const Vec3& otherwise) const { return has(key) ? vec3(key) : otherwise; }

  /// The items of an array, each as (value, place).
  void for_each(const std::string& key,
                const std::function<void(const nlohmann::json&, const std::string&)>& visit) const;

  /// The members of an object whose keys are names that the user chose, each as (key, value). Instead of finish().
  void for_each_member(const std::function<void(const std::string&, const nlohmann::json&)>& visit) const;

  /// Refuses unknown keys, naming the nearest known one.
  void finish() const;

  /// A value as messages show it. Nested values are only counted: printing them would recurse as deep as a file asks.
  static std::string shown(const nlohmann::json& v);

 private:
  std::string similar_key(const std::string& key) const;

  const nlohmann::json* value_;
  std::string where_;
  mutable std::vector<std::string> known_;
};

}  // namespace limber::internal
