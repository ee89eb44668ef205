#include "eigen/stored_body.h"

#include <bit>
#include <limits>
#include <nlohmann/json.hpp>

#include "limber/internal/strict_json.h"
#include "limber/model/sha256.h"

namespace limber::internal {
namespace {

static_assert(std::endian::native == std::endian::little, "bodies are written as they lie in memory");

constexpr int kFormat = 1;

nlohmann::ordered_json head(const StoredBody& body) {
  nlohmann::ordered_json materials = nlohmann::ordered_json::array();
  for (const Material& m : body.materials) materials.push_back({m.youngs_modulus, m.poisson_ratio, m.density});
  return {{"problem", body.problem},
          {"nodes", body.nodes},
          {"tets", body.tets},
          {"fixed", body.fixed},
          {"nodes_per_tet", body.nodes_per_tet},
          {"mass", body.mass == MassKind::kLumped ? "lumped" : "consistent"},
          {"stiffness_unit", body.stiffness_unit},
          {"mass_unit", body.mass_unit},
          {"zero_modes", body.zero_modes},
          {"pins", body.pins},
          {"materials", materials}};
}

StoredBody read_head(const JsonObject& object, std::uint64_t begin) {
  const auto count = [&](const char* key, std::int64_t low) {
    return static_cast<Index>(object.integer(key, low, std::numeric_limits<Index>::max()));
  };
  StoredBody body{.problem = object.text("problem"),
                  .nodes = count("nodes", 1),
                  .tets = count("tets", 1),
                  .fixed = count("fixed", 0),
                  .nodes_per_tet = static_cast<int>(object.integer("nodes_per_tet", 4, 10)),
                  .mass = object.text("mass") == "lumped" ? MassKind::kLumped : MassKind::kConsistent,
                  .stiffness_unit = object.number("stiffness_unit"),
                  .mass_unit = object.number("mass_unit"),
                  .zero_modes = count("zero_modes", 0),
                  .begin = begin};
  for (const double pin : object.numbers("pins", object.at("pins").size()))
    body.pins.push_back(static_cast<Index>(pin));
  object.for_each("materials", [&](const nlohmann::json& value, const std::string& where) {
    if (!value.is_array() || value.size() != 3) refuse(where, JsonObject::shown(value), "three numbers");
    body.materials.push_back({value[0].get<double>(), value[1].get<double>(), value[2].get<double>()});
  });
  object.finish();
  return body;
}

std::string hash_from(std::istream& file) {
  Sha256 hash;
  std::string piece(1 << 20, '\0');
  while (file.read(piece.data(), static_cast<std::streamsize>(piece.size())), file.gcount() > 0)
    hash.update(std::string_view(piece).substr(0, static_cast<std::size_t>(file.gcount())));
  return hash.hex();
}

}  // namespace

std::string stored_bodies_line(std::span<const StoredBody> bodies, const std::string& arrays) {
  nlohmann::ordered_json heads = nlohmann::ordered_json::array();
  for (const StoredBody& body : bodies) heads.push_back(head(body));
  return nlohmann::ordered_json{{"limber_bodies", kFormat}, {"sha256", sha256_hex(arrays)}, {"bodies", heads}}.dump() +
         '\n';
}

std::vector<StoredBody> read_stored_bodies(const std::filesystem::path& path) {
  const std::string name = "\"" + path.string() + "\"";
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(name + ": cannot be opened");
  std::string line;
  std::getline(file, line);
  const nlohmann::json json = nlohmann::json::parse(line, nullptr, false);
  if (!json.is_object() || !json.contains("limber_bodies"))
    throw InputError(name + ": is no file of bodies, as limber-precompute --bodies writes them");
  const JsonObject object(json, name);
  object.integer("limber_bodies", kFormat, kFormat);
  const std::string hash = object.text("sha256");
  std::vector<StoredBody> bodies;
  std::uint64_t begin = line.size() + 1;
  object.for_each("bodies", [&](const nlohmann::json& value, const std::string& where) {
    bodies.push_back(read_head(JsonObject(value, where), begin));
    begin = bodies.back().end();
  });
  object.finish();
  const std::uint64_t size = std::filesystem::file_size(path);
  if (size != begin)
    throw InputError(name + ": has " + std::to_string(size) + " bytes, expected " + std::to_string(begin) +
                     ": it was cut off");
  if (hash_from(file) != hash) throw InputError(name + ": its arrays do not have the hash that it states: damaged");
  return bodies;
}

}  // namespace limber::internal
