// What the asset's writer and reader share: names, limits, and the content hash. docs/formats/asset.md describes the
// file.
#pragma once

#include <bit>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "limber/model/asset.h"
#include "limber/model/sha256.h"

namespace limber::internal::asset_format {

static_assert(std::endian::native == std::endian::little,
              "the file is little-endian and is copied from memory as it is");

inline constexpr char kExtension[] = "LIMBER_modal";
inline constexpr int kFormatVersion = 1;
inline constexpr int kSkinVersion = 1;
inline constexpr std::string_view kHashPrefix = "sha256:";

/// The content hash: provenance, then the numbers of every body, then the whole BIN chunk. It does not depend on how
/// the JSON is laid out, only on what it says.
class ContentHash {
 public:
  ContentHash(const Provenance& provenance, std::size_t bodies) {
    hash_.update("LIMBER_modal 1\n");
    for (const std::string* text : {&provenance.tool, &provenance.input, &provenance.input_hash, &provenance.options})
      add(*text);
    add(std::uint64_t{bodies});
  }

  void add_body(const ModalModelData& body) {
    add(body.name);
    add(to_string(body.motion));
    if (body.motion == FrameMotion::kLine) add(body.line_axis);
    add(body.mass);
    add(body.volume);
    add(body.center_of_mass);
    add(body.origin_in_input);
    add(body.inertia);
    add(std::uint64_t{body.eigenvalues.size()});
    for (const double x : body.eigenvalues) add(x);
    for (const double x : body.decays) add(x);
    for (const Vec3& x : body.participation) add(x);
    for (const Mat3& x : body.moments) add(x);
    for (const double x : body.mode_scales) add(x);
    add_counts(body.render);
    add(std::uint64_t{body.collision.has_value()});
    if (body.collision) add_counts(*body.collision);
    add(std::uint64_t{body.volume_block.has_value()});
    if (body.volume_block) {
      add(std::uint64_t{body.volume_block->rest.size()});
      add(std::uint64_t{body.volume_block->tets.size()});
    }
    if (body.residual_compliance) {
      add(to_string(body.residual_compliance->form()));
      add(static_cast<std::uint64_t>(body.residual_compliance->vertices()));
    }
    if (body.skin) {
      add(std::string_view("skin"));
      add(static_cast<std::uint64_t>(kSkinVersion));
      add(static_cast<std::uint64_t>(body.skin->handles));
    }
  }

  /// As the file holds it. Call once, last.
  std::string finish(std::string_view binary) {
    hash_.update(binary);
    return std::string(kHashPrefix) + hash_.hex();
  }

 private:
  template <class T>
  requires(sizeof(T) == 8) void add(T number) { hash_.update({reinterpret_cast<const char*>(&number), sizeof number}); }
  void add(std::string_view text) {
    add(std::uint64_t{text.size()});
    hash_.update(text);
  }
  void add(const std::string& text) { add(std::string_view(text)); }
  void add(const Vec3& v) {
    for (int a = 0; a < 3; ++a) add(v[a]);
  }
  void add(const Mat3& m) {
    for (int row = 0; row < 3; ++row) add(Vec3(m.row(row)));
  }
  void add_counts(const ModalSurface& surface) {
    add(std::uint64_t{surface.rest.size()});
    add(std::uint64_t{surface.triangles.size()});
  }

  Sha256 hash_;
};

}  // namespace limber::internal::asset_format
