/// @file scene_reading.h
/// Readers for the parts of a scene file: numbers in ranges, words, poses, places and motions. All throw
/// InputError in one line: file, place, what was seen, what was expected.
#pragma once

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "limber/internal/strict_json.h"
#include "limber/scene/scene_file.h"

namespace limber::internal {

constexpr Index kMaxIndex = std::numeric_limits<Index>::max();
constexpr double kToTheEnd = std::numeric_limits<double>::infinity();

double positive(const JsonObject& o, const std::string& key);
double positive(const JsonObject& o, const std::string& key, double otherwise);
double non_negative(const JsonObject& o, const std::string& key, double otherwise);
/// Three numbers.
Vec3 vector_of(const nlohmann::json& value, const std::string& where);
/// A vector of any length > 0, made unit.
Vec3 direction_of(const nlohmann::json& value, const std::string& where);
Vec3 direction(const JsonObject& o, const std::string& key);
/// A time in [0, duration).
double time_inside(const JsonObject& o, const std::string& key, const Scene& scene);
/// How long something holds: a step at least; infinite where the key is missing. @param otherwise what to try instead
double held_duration(const JsonObject& o, const Scene& scene, const std::string& otherwise = "");

/// One of a few words. @return its number in `words`
std::size_t choice(const JsonObject& o, const std::string& key, const std::vector<std::string>& words,
                   const std::string& otherwise);
/// The same for constants that have a to_string().
template <class Word>
Word choice_of(const JsonObject& o, const std::string& key, const std::vector<Word>& all, Word otherwise) {
  std::vector<std::string> words;
  words.reserve(all.size());
  for (const Word word : all) words.emplace_back(to_string(word));
  return all[choice(o, key, words, std::string(to_string(otherwise)))];
}

/// Runs a check that throws InvalidArgument: what it says is said of a place in the file.
void check_input(const std::string& where, const std::function<void()>& check);

RigidTransform read_pose(const JsonObject& o);
SurfacePlace read_place(const JsonObject& parent);
/// `motion`, if it is there. @param turns whether its keys may have an orientation
FrameMovement read_movement(const JsonObject& parent, bool turns);

}  // namespace limber::internal
