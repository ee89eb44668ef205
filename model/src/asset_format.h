// Shared by the asset's writer and reader: names, limits, and the content hash. docs/formats/asset.md describes the
// file.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
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
inline constexpr int kMachineVersion = 1;
inline constexpr int kSoundVersion = 1;
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

  /// @param frequency_errors per mode, or empty. @param sound null: none
  void add_body(const ModalModelData& body, const std::vector<double>& frequency_errors, const SoundModes* sound) {
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
    if (!body.captured.empty()) {
      add(std::string_view("captured"));
      add(std::uint64_t{body.captured.size()});
      for (const CapturedLoad& load : body.captured) add(load.at), add(load.share);
    }
    if (!frequency_errors.empty()) {
      add(std::string_view("frequency_errors"));
      for (const double x : frequency_errors) add(std::isnan(x) ? std::numeric_limits<double>::quiet_NaN() : x);
    }
    if (body.skin) {
      add(std::string_view("skin"));
      add(static_cast<std::uint64_t>(kSkinVersion));
      add(static_cast<std::uint64_t>(body.skin->handles));
    }
    if (sound) add_sound(*sound);
  }

  /// After all bodies; nothing where there are neither joints nor pairs.
  void add_machine(const std::vector<AssetJoint>& joints, const std::vector<std::array<Index, 2>>& apart) {
    if (joints.empty() && apart.empty()) return;
    add(std::string_view("machine"));
    add(static_cast<std::uint64_t>(kMachineVersion));
    add(std::uint64_t{joints.size()});
    for (const AssetJoint& joint : joints) add_joint(joint);
    add(std::uint64_t{apart.size()});
    for (const auto& pair : apart)
      for (const Index body : pair) add(static_cast<std::int64_t>(body));
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
  void add(const Interval& i) {
    add(i.low);
    add(i.high);
  }
  void add_joint(const AssetJoint& joint) {
    add(static_cast<std::int64_t>(joint.a));
    add(static_cast<std::int64_t>(joint.b));
    add(to_string(joint.spec.type));
    add(joint.spec.frame.origin);
    add(joint.spec.frame.axes);
    add(joint.spec.pitch);
    add(joint.spec.limits.rotation);
    for (const Interval& i : joint.spec.limits.translation) add(i);
    add(joint.spec.limits.cone);
    for (const Interval& i : joint.spec.limits.euler) add(i);
    add(joint.patch_radius);
    add(std::uint64_t{joint.collide});
    add(std::uint64_t{joint.coordinates.size()});
    for (const JointActuation& a : joint.coordinates)
      for (const double x :
           {a.motor_velocity, a.motor_max_force, a.drive_target, a.drive_stiffness, a.drive_damping, a.friction})
        add(x);
  }
  void add_sound(const SoundModes& sound) {
    add(std::string_view("sound"));
    add(static_cast<std::uint64_t>(kSoundVersion));
    add(static_cast<std::uint64_t>(sound.modes()));
    add(static_cast<std::uint64_t>(sound.vertices));
    add(sound.contact_modulus);
    for (const double x : sound.eigenvalues) add(x);
    for (const double x : sound.decays) add(x);
  }
  void add_counts(const ModalSurface& surface) {
    add(std::uint64_t{surface.rest.size()});
    add(std::uint64_t{surface.triangles.size()});
  }

  Sha256 hash_;
};

}  // namespace limber::internal::asset_format
