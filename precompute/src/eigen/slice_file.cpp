#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/internal/strict_json.h"
#include "limber/model/sha256.h"
#include "limber/precompute/spectrum_slice.h"

namespace limber {
namespace {

using internal::JsonObject;

static_assert(std::endian::native == std::endian::little, "slices are written as they lie in memory");

constexpr int kFormat = 1;

void append(const std::vector<double>& values, std::string& bytes) {
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double));
}

std::vector<double> take(std::string_view& bytes, std::size_t count) {
  std::vector<double> values(count);
  std::memcpy(values.data(), bytes.data(), count * sizeof(double));
  bytes.remove_prefix(count * sizeof(double));
  return values;
}

int whole_number(const JsonObject& object, const std::string& key) {
  const double value = object.number(key);
  if (value >= 0.0 && value <= std::numeric_limits<int>::max() && value == std::floor(value))
    return static_cast<int>(value);
  throw InputError(object.where(key) + ": expected a whole number from 0 on");
}

SpectrumSlice read_head(const JsonObject& object) {
  SpectrumSlice slice{.band = {object.number("low_hz"), object.number("high_hz")},
                      .of = whole_number(object, "of"),
                      .below_low = whole_number(object, "below_low"),
                      .below_high = whole_number(object, "below_high"),
                      .counted = object.boolean("counted", true),
                      .problem = object.text("problem"),
                      .nodes = whole_number(object, "nodes")};
  object.finish();
  if (slice.below_high < slice.below_low) throw InputError(object.where("below_high") + ": is less than below_low");
  try {
    slice.band.validate();
  } catch (const InvalidArgument& e) {
    throw InputError(object.where() + ": " + e.what());
  }
  return slice;
}

}  // namespace

void FrequencyBand::validate() const {
  if (low >= 0.0 && low < high && std::isfinite(high)) return;
  std::ostringstream text;
  text << "FrequencyBand: from " << low << " to " << high << " Hz, expected 0 <= low < high";
  throw InvalidArgument(text.str());
}

std::string slice_bytes(std::span<const SpectrumSlice> slices) {
  nlohmann::ordered_json bodies = nlohmann::ordered_json::array();
  std::string numbers;
  for (const SpectrumSlice& slice : slices) {
    bodies.push_back({{"low_hz", slice.band.low},
                      {"high_hz", slice.band.high},
                      {"of", slice.of},
                      {"below_low", slice.below_low},
                      {"below_high", slice.below_high},
                      {"counted", slice.counted},
                      {"problem", slice.problem},
                      {"nodes", slice.nodes}});
    append(slice.eigenvalues, numbers);
    append(slice.shapes, numbers);
  }
  const nlohmann::ordered_json head{{"limber_slices", kFormat}, {"sha256", sha256_hex(numbers)}, {"bodies", bodies}};
  return head.dump() + '\n' + numbers;
}

std::vector<SpectrumSlice> read_slices(const std::filesystem::path& path) {
  const std::string bytes = read_file(path), file = "\"" + path.string() + "\"";
  const std::size_t line = bytes.find('\n');
  const nlohmann::json json = nlohmann::json::parse(bytes.substr(0, line), nullptr, false);
  if (line == std::string::npos || !json.is_object() || !json.contains("limber_slices"))
    throw InputError(file + ": is no file of slices, as limber-precompute --slice writes them");
  const JsonObject head(json, file);
  if (head.number("limber_slices") != kFormat)
    throw InputError(head.where("limber_slices") + ": expected " + std::to_string(kFormat));
  const std::string hash = head.text("sha256");
  std::vector<SpectrumSlice> slices;
  std::size_t count = 0;
  const auto modes = [](const SpectrumSlice& s) { return static_cast<std::size_t>(s.below_high - s.below_low); };
  const auto rows = [](const SpectrumSlice& s) { return 3 * static_cast<std::size_t>(s.nodes); };
  head.for_each("bodies", [&](const nlohmann::json& value, const std::string& where) {
    slices.push_back(read_head(JsonObject(value, where)));
    count += modes(slices.back()) * (1 + rows(slices.back()));
  });
  head.finish();
  std::string_view numbers = std::string_view(bytes).substr(line + 1);
  if (numbers.size() != count * sizeof(double))
    throw InputError(file + ": has " + std::to_string(numbers.size()) + " bytes behind its first line, expected " +
                     std::to_string(count * sizeof(double)) + ": the file was cut off");
  if (sha256_hex(numbers) != hash)
    throw InputError(file + ": its numbers do not have the hash that it states: damaged");
  for (SpectrumSlice& slice : slices) {
    slice.eigenvalues = take(numbers, modes(slice));
    slice.shapes = take(numbers, modes(slice) * rows(slice));
  }
  return slices;
}

}  // namespace limber
