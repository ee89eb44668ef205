/// @file limber/model/glb.h
/// A small writer of GLB files (glTF 2.0 in one binary container): meshes with morph targets, nodes, animations, extras
/// and extensions. The asset file and recordings are made with it.
///
///   GlbBuilder glb;
///   const int position = glb.add_vertex_vectors(xyz), normal = glb.add_vertex_vectors(n);
///   const int faces = glb.add_triangles(t);
///   const int mesh = glb.add_mesh({.name = "bell", .position = position, .normal = normal, .triangles = faces});
///   glb.add_node({.name = "bell", .mesh = mesh});
///   write_file("bell.glb", glb.bytes());
///
/// Everything added gets the next index of its kind, from 0, in the order of the calls; what refers to something else
/// names its index, which must exist already. -1 means none. The same calls give the same bytes. Binary data lies in
/// the order of the calls, without gaps, every piece aligned to 4 bytes. All functions throw InvalidArgument naming the
/// object and the field: an index that does not exist or is of another kind, counts that do not fit together, a number
/// that is not finite, a quaternion or base normal that is not of length 1.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "limber/core/quaternion.h"
#include "limber/core/types.h"
#include "limber/model/modal_skin.h"

namespace limber {

/// A metallic-roughness material.
struct GlbMaterial {
  std::string name{};
  std::array<float, 4> base_color{0.8f, 0.8f, 0.8f, 1.0f};  ///< linear RGBA, each in [0, 1]
  float metallic = 0.0f;                                    ///< in [0, 1]
  float roughness = 0.5f;                                   ///< in [0, 1]
  bool double_sided = false;
};

/// One morph target: what weight 1 adds to each vertex.
struct GlbMorphTarget {
  std::string name{};  ///< shown by viewers; written to extras.targetNames
  int position = -1;   ///< from add_vertex_vectors()
  int normal = -1;     ///< the same, or -1; either every target of a mesh has it or none
};

/// A triangle mesh of one primitive.
struct GlbMesh {
  std::string name{};
  int position = -1;    ///< from add_vertex_vectors()
  int normal = -1;      ///< the same, unit vectors; -1: viewers shade flat
  int triangles = -1;   ///< from add_triangles()
  int influences = -1;  ///< from add_influences(), one per vertex; −1: the mesh hangs on no joints
  int material = -1;    ///< from add_material()
  std::vector<GlbMorphTarget> targets{};
  std::vector<float> weights{};  ///< at rest, one per target; empty: zeros
  std::string extras{};          ///< a JSON object as text, or empty; may not hold targetNames
  std::string extensions{};      ///< the same, one key per extension; each is added to extensionsUsed
};

/// A node of the scene graph: the transform of its content into its parent, scaled first, then turned, then moved.
struct GlbNode {
  std::string name{};
  int mesh = -1;  ///< from add_mesh()
  int skin =
      -1;  ///< from add_skin(), for a mesh with influences, which is then where its joints are, not where the node is
  std::vector<int> children{};           ///< from add_node(); a node has one parent at most
  std::optional<Vec3> translation{};     ///< m
  std::optional<Quaternion> rotation{};  ///< unit
  std::optional<double> scale{};         ///< uniform, > 0
  std::string extras{};                  ///< a JSON object as text, or empty
  std::string extensions{};              ///< the same, one key per extension; each is added to extensionsUsed
};

/// Property that a channel moves; it sets the number of values per key.
enum class GlbPath {
  kTranslation,  ///< 3, m
  kRotation,     ///< 4, unit quaternion in glTF's order x y z w
  kScale,        ///< 3
  kWeights,      ///< one per morph target of the node's mesh
};

struct GlbChannel {
  int node = -1;  ///< from add_node()
  GlbPath path = GlbPath::kTranslation;
  int times = -1;     ///< from add_times(); channels may share it
  int values = -1;    ///< from add_key_values(), as many values as keys times values per key
  bool step = false;  ///< hold each key until the next instead of linear interpolation
};

struct GlbAnimation {
  std::string name{};
  std::vector<GlbChannel> channels{};  ///< at least one
};

class GlbBuilder {
 public:
  GlbBuilder();
  ~GlbBuilder();
  GlbBuilder(GlbBuilder&&) noexcept;
  GlbBuilder& operator=(GlbBuilder&&) noexcept;

  // Numbers: each makes one bufferView and one accessor (float32 or uint32) with min and max, and returns the accessor.

  /// Positions, normals or what a morph target adds to them. @param xyz 3 per vertex; at least one vertex
  int add_vertex_vectors(std::span<const float> xyz);
  /// @param triangles at least one; indices ≥ 0, compared with the vertex count in add_mesh()
  int add_triangles(std::span<const Triangle> triangles);
  /// Influences of each vertex of a mesh: JOINTS_0 and WEIGHTS_0. @param influences at least one
  int add_influences(std::span<const SkinInfluences> influences);
  /// Key times of an animation, s. @param seconds at least one; the first ≥ 0, strictly ascending
  int add_times(std::span<const float> seconds);
  /// Key values of an animation: all of the first key, then all of the second, ….
  int add_key_values(std::span<const float> values, GlbPath path);

  /// Numbers that an extension names. @param numbers at least one, finite
  int add_scalars(std::span<const float> numbers);

  /// Bytes that only an extension knows: a bufferView without accessor. @return the bufferView (its number, unlike an
  /// accessor's, counts every piece of binary data). @param bytes a multiple of 4, at least one
  int add_raw(std::span<const std::byte> bytes);

  // Objects

  int add_material(const GlbMaterial& material);
  int add_mesh(const GlbMesh& mesh);
  int add_node(const GlbNode& node);
  /// Joint h is where node joints[h] takes the mesh as it is: no inverse bind matrices. @param joints from add_node()
  int add_skin(std::span<const int> joints);
  int add_animation(const GlbAnimation& animation);

  /// An extension of the file as a whole. @param name such as "LIMBER_modal". @param json an object as text
  void set_extension(const std::string& name, const std::string& json);
  /// Extras of the file as a whole. @param json an object as text
  void set_extras(const std::string& json);

  /// How many bufferViews there are: the number that the next piece of binary data will get.
  int views() const;
  /// The binary data so far.
  std::string_view binary() const;

  /// The file. Every node without a parent is a root of the one scene.
  /// @throws InvalidArgument if it would be larger than GLB allows, 4 GiB
  std::string bytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The two parts of a GLB, as views into its bytes.
struct GlbChunks {
  std::string_view json;    ///< padding included
  std::string_view binary;  ///< padding included; empty if the file has none
};

/// Takes a GLB apart after checking its header and every chunk length. @param name shown in messages, such as
/// `"bell.glb"`. @throws InputError if it is not a GLB of glTF 2.0 with a JSON chunk and at most a BIN chunk after it
GlbChunks glb_chunks(std::string_view bytes, const std::string& name);

}  // namespace limber
