/// @file glb_view.h
/// A GLB read back by a second route than limber's own readers: the JSON chunk as it is, accessors as numbers.
#pragma once

#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

namespace limber::testing {

class GlbView {
 public:
  explicit GlbView(const std::string& bytes) {
    const std::uint32_t json_bytes = word(bytes, 12);
    json = nlohmann::json::parse(bytes.substr(20, json_bytes));
    binary_ = bytes.substr(20 + json_bytes + 8);
  }

  /// All numbers of a float32 accessor.
  std::vector<float> floats(std::size_t accessor) const {
    const auto& a = json.at("accessors").at(accessor);
    if (a.at("componentType") != 5126) throw std::runtime_error("accessor is not float32");
    const std::string type = a.at("type");
    const std::size_t width = type == "SCALAR" ? 1 : type == "VEC3" ? 3 : 4;
    const auto& view = json.at("bufferViews").at(a.at("bufferView").get<std::size_t>());
    const std::size_t start = view.value("byteOffset", std::size_t{0}) + a.value("byteOffset", std::size_t{0});
    std::vector<float> out(width * a.at("count").get<std::size_t>());
    const std::string source = binary_.substr(start, 4 * out.size());
    if (source.size() != 4 * out.size()) throw std::runtime_error("accessor ends beyond the file");
    std::memcpy(out.data(), source.data(), source.size());
    return out;
  }

  /// The values of the animation channel that moves `path` of the node called `name`.
  std::vector<float> channel(const std::string& name, const std::string& path, std::size_t number = 0) const {
    const auto& animation = json.at("animations").at(number);
    for (const auto& c : animation.at("channels")) {
      const auto& target = c.at("target");
      if (json.at("nodes").at(target.at("node").get<std::size_t>()).at("name") != name || target.at("path") != path)
        continue;
      return floats(animation.at("samplers").at(c.at("sampler").get<std::size_t>()).at("output"));
    }
    throw std::runtime_error("no channel " + path + " of node " + name);
  }

  std::vector<float> times() const { return floats(json.at("animations").at(0).at("samplers").at(0).at("input")); }

  nlohmann::json json;

 private:
  static std::uint32_t word(const std::string& bytes, std::size_t at) {
    std::uint32_t w = 0;
    std::memcpy(&w, bytes.substr(at, 4).data(), 4);
    return w;
  }
  std::string binary_;
};

}  // namespace limber::testing
