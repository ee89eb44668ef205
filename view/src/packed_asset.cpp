#include "packed_asset.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "limber/model/glb.h"

namespace limber::internal {
namespace {

static_assert(std::endian::native == std::endian::little, "bytes are copied as they lie in memory");

constexpr int kBits = 15;  // beside the sign

/// The least exponent e for which a number of this size is less than 2^15 times 2^e.
int exponent_for(float largest) { return largest > 0.0f ? std::ilogb(largest) + 1 - kBits : 0; }

float rounded(float x, int exponent) {
  const double q = std::nearbyint(std::ldexp(static_cast<double>(x), -exponent));
  constexpr double kMost = (1 << kBits) - 1;
  return static_cast<float>(std::ldexp(std::clamp(q, -kMost, kMost), exponent)) + 0.0f;  // no −0
}

/// Rounded where asked, else as they are.
ModalBasis shapes_of(const ModalBasis& basis, bool round) {
  ModalBasis out(basis.vertices(), basis.modes());
  for (Index mode = 0; mode < basis.modes(); ++mode) {
    float largest = 0.0f;
    for (Index v = 0; v < basis.vertices(); ++v)
      largest = std::max(largest, basis.shape(v, mode).cwiseAbs().maxCoeff());
    const int exponent = exponent_for(largest);
    for (Index v = 0; v < basis.vertices(); ++v) {
      Vec3f u = basis.shape(v, mode);
      if (round)
        for (float& x : u) x = rounded(x, exponent);
      out.set(v, mode, u);
    }
  }
  return out;
}

ModalSurface surface_of(const ModalSurface& surface, bool round) {
  return {surface.rest, surface.triangles, shapes_of(surface.basis, round)};
}

void round_places(std::vector<Vec3f>& places) {
  float largest = 0.0f;
  for (const Vec3f& p : places) largest = std::max(largest, p.cwiseAbs().maxCoeff());
  const int exponent = exponent_for(largest);
  for (Vec3f& p : places)
    for (float& x : p) x = rounded(x, exponent);
}

ModalModelData data_for_a_page(const ModalModelData& all, bool volumes) {
  ModalModelData data;
  data.name = all.name;
  data.motion = all.motion;
  data.line_axis = all.line_axis;
  data.mass = all.mass;
  data.volume = all.volume;
  data.center_of_mass = all.center_of_mass;
  data.origin_in_input = all.origin_in_input;
  data.inertia = all.inertia;
  data.eigenvalues = all.eigenvalues;
  data.decays = all.decays;
  data.participation = all.participation;
  data.moments = all.moments;
  data.mode_scales = all.mode_scales;
  data.residual_compliance = all.residual_compliance;
  data.render = surface_of(all.render, true);
  if (all.collision) {
    data.collision = surface_of(*all.collision, false);
    round_places(data.render.rest);
  }
  if (const auto& v = all.volume_block; v && volumes)
    data.volume_block =
        ModalVolume{v->rest, v->tets, shapes_of(v->basis, false), shapes_of(v->mass_times_basis, false)};
  return data;
}

// Bytes ---------------------------------------------------------------------------------------------------------------

enum class Kind : std::uint32_t { kBytes, kWords, kHalves };

/// The exponent with which all floats are whole numbers of 16 bits, if there is one.
std::optional<int> common_exponent(std::string_view bytes) {
  float largest = 0.0f;
  std::vector<float> numbers(bytes.size() / sizeof(float));
  std::memcpy(numbers.data(), bytes.data(), bytes.size());
  for (const float x : numbers) {
    if (!std::isfinite(x)) return std::nullopt;
    largest = std::max(largest, std::abs(x));
  }
  if (largest < std::numeric_limits<float>::min()) return std::nullopt;  // whole numbers, read as floats
  const int exponent = exponent_for(largest);
  for (const float x : numbers)
    if (rounded(x, exponent) != x || (x == 0.0f && std::signbit(x))) return std::nullopt;
  return exponent;
}

/// Each number less the third before it, lowest bytes of all first.
template <class T>
void append_split(const std::vector<T>& numbers, std::string& out) {
  std::vector<T> less(numbers.size());
  for (std::size_t i = 0; i < numbers.size(); ++i)
    less[i] = static_cast<T>(numbers[i] - (i < 3 ? T{0} : numbers[i - 3]));
  for (std::size_t byte = 0; byte < sizeof(T); ++byte)
    for (const T x : less) out += static_cast<char>(x >> (8 * byte) & 0xFF);
}

class Packing {
 public:
  void add(std::string_view bytes) {
    if (bytes.empty()) return;
    if (bytes.size() % 4 != 0) return add(Kind::kBytes, bytes, 0);
    const std::optional<int> exponent = common_exponent(bytes);
    add(exponent ? Kind::kHalves : Kind::kWords, bytes, exponent.value_or(0));
  }
  void add(Kind kind, std::string_view bytes, int exponent) {
    heads_.push_back(static_cast<std::uint32_t>(kind));
    heads_.push_back(static_cast<std::uint32_t>(bytes.size()));
    heads_.push_back(static_cast<std::uint32_t>(exponent));
    if (kind == Kind::kBytes) {
      bodies_ += bytes;
      return;
    }
    std::vector<std::uint32_t> words(bytes.size() / 4);
    std::memcpy(words.data(), bytes.data(), bytes.size());
    if (kind == Kind::kWords) return append_split(words, bodies_);
    std::vector<std::uint16_t> halves;
    for (const std::uint32_t word : words)
      halves.push_back(static_cast<std::uint16_t>(
          static_cast<std::int16_t>(std::ldexp(static_cast<double>(std::bit_cast<float>(word)), -exponent))));
    append_split(halves, bodies_);
  }
  std::string bytes() const {
    std::string out = "LMBP";
    const auto count = static_cast<std::uint32_t>(heads_.size() / 3);
    out.append(reinterpret_cast<const char*>(&count), sizeof count);
    out.append(reinterpret_cast<const char*>(heads_.data()), heads_.size() * sizeof(std::uint32_t));
    return out + bodies_;
  }

 private:
  std::vector<std::uint32_t> heads_;
  std::string bodies_;
};

}  // namespace

Asset asset_for_a_page(const Asset& asset, bool volumes) {
  Asset out = asset;
  for (std::shared_ptr<const ModalModel>& body : out.bodies)
    body = std::make_shared<const ModalModel>(data_for_a_page(body->data(), volumes));
  return out;
}

std::string packed(std::string_view glb) {
  const GlbChunks chunks = glb_chunks(glb, "packed");
  const std::size_t head = static_cast<std::size_t>(chunks.binary.data() - glb.data());
  Packing packing;
  packing.add(Kind::kBytes, glb.substr(0, head), 0);
  const nlohmann::json json = nlohmann::json::parse(chunks.json);
  std::size_t end = 0;
  for (const nlohmann::json& view : json.at("bufferViews")) {
    const auto offset = view.at("byteOffset").get<std::size_t>(), size = view.at("byteLength").get<std::size_t>();
    packing.add(chunks.binary.substr(end, offset - end));
    packing.add(chunks.binary.substr(offset, size));
    end = offset + size;
  }
  packing.add(glb.substr(head + end));
  return packing.bytes();
}

}  // namespace limber::internal
