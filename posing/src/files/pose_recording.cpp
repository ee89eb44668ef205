#include "limber/posing/pose_recording.h"

#include <algorithm>
#include <cmath>

#include "limber/core/error.h"
#include "limber/model/glb.h"
#include "limber/model/morph_targets.h"
#include "limber/model/pose_keys.h"

namespace limber {
namespace {

struct Part {
  std::string name{};
  std::vector<Index> vertices{};  // of the model
  std::vector<Triangle> triangles{};
  bool bends = false;
  std::vector<RigidTransform> motions{};     // from rest, per frame
  std::vector<std::vector<float>> shapes{};  // displacements from rest, per frame
};

}  // namespace

struct PoseRecording::Impl {
  double scale = 1.0;
  std::vector<Vec3> rest{};
  std::vector<Part> parts{};
  std::vector<float> times{};

  std::vector<float> rest_of(const Part& part) const {
    std::vector<float> out;
    for (const Index v : part.vertices)
      for (int k = 0; k < 3; ++k) out.push_back(static_cast<float>(scale * rest[static_cast<std::size_t>(v)][k]));
    return out;
  }

  void add_rigid(GlbBuilder& glb, GlbAnimation& animation, const Part& part, int mesh, int keys) const {
    const int node = glb.add_node({.name = part.name, .mesh = mesh});
    animation.channels.push_back({node, GlbPath::kTranslation, keys,
                                  glb.add_key_values(translation_keys(part.motions, scale), GlbPath::kTranslation)});
    animation.channels.push_back(
        {node, GlbPath::kRotation, keys, glb.add_key_values(rotation_keys(part.motions), GlbPath::kRotation)});
  }

  void add_bending(GlbBuilder& glb, GlbAnimation& animation, const Part& part, int mesh, int keys) const {
    const std::size_t frames = times.size();
    std::vector<float> weights(frames * frames, 0.0f);
    for (std::size_t f = 0; f < frames; ++f) weights[f * frames + f] = 1.0f;
    const int node = glb.add_node({.name = part.name, .mesh = mesh});
    animation.channels.push_back({node, GlbPath::kWeights, keys, glb.add_key_values(weights, GlbPath::kWeights)});
  }
};

PoseRecording::PoseRecording(const PosingSession& session, double metres_per_unit) : impl_(std::make_unique<Impl>()) {
  if (!(metres_per_unit > 0.0) || !std::isfinite(metres_per_unit))
    throw InvalidArgument("PoseRecording: metres_per_unit is " + std::to_string(metres_per_unit) + ", expected > 0");
  const JointedModel& model = session.model();
  impl_->scale = metres_per_unit;
  impl_->rest = model.surface.vertices;
  for (std::size_t p = 0; p < model.parts.size(); ++p) {
    Part part{.name = model.parts[p].name, .bends = !session.motion(static_cast<Index>(p)).has_value()};
    std::vector<Index> own(model.surface.vertices.size(), -1);
    for (const Index t : model.parts[p].triangles) {
      Triangle triangle = model.surface.triangles[static_cast<std::size_t>(t)];
      for (Index& v : triangle) {
        Index& number = own[static_cast<std::size_t>(v)];
        if (number < 0) {
          number = static_cast<Index>(part.vertices.size());
          part.vertices.push_back(v);
        }
        v = number;
      }
      part.triangles.push_back(triangle);
    }
    impl_->parts.push_back(std::move(part));
  }
}
PoseRecording::~PoseRecording() = default;
PoseRecording::PoseRecording(PoseRecording&&) noexcept = default;
PoseRecording& PoseRecording::operator=(PoseRecording&&) noexcept = default;

void PoseRecording::add(double time, const PosingSession& session) {
  const auto key = static_cast<float>(time);
  if (!(key >= 0.0f) || (!impl_->times.empty() && key <= impl_->times.back()))
    throw InvalidArgument("PoseRecording.add: time is " + std::to_string(time) +
                          ", expected one after the frames before");
  std::vector<Vec3> positions(impl_->rest.size());
  session.reconstruct(positions);
  for (std::size_t p = 0; p < impl_->parts.size(); ++p) {
    Part& part = impl_->parts[p];
    const auto motion = session.motion(static_cast<Index>(p));
    if (motion.has_value() == part.bends)
      throw InvalidArgument("PoseRecording.add: part \"" + part.name + "\" became rigid or deformable between frames");
    if (motion) {
      part.motions.push_back(*motion);
      continue;
    }
    std::vector<float>& shape = part.shapes.emplace_back();
    for (const Index v : part.vertices) {
      const Vec3 moved =
          impl_->scale * (positions[static_cast<std::size_t>(v)] - impl_->rest[static_cast<std::size_t>(v)]);
      for (int k = 0; k < 3; ++k) shape.push_back(static_cast<float>(moved[k]));
    }
  }
  impl_->times.push_back(key);
}

std::string PoseRecording::glb() const {
  if (impl_->times.empty()) throw InvalidArgument("PoseRecording.glb: there is no frame");
  GlbBuilder glb;
  GlbAnimation animation{.name = "poses"};
  const int keys = glb.add_times(impl_->times);
  for (std::size_t p = 0; p < impl_->parts.size(); ++p) {
    const Part& part = impl_->parts[p];
    const std::vector<float> rest = impl_->rest_of(part), normals = unit_normals(rest, part.triangles);
    GlbMesh mesh{.name = part.name};
    mesh.material = glb.add_material({.name = part.name,
                                      .base_color = kPartColors[p % kPartColors.size()],
                                      .roughness = 0.6f,
                                      .double_sided = true});
    mesh.position = glb.add_vertex_vectors(rest);
    mesh.normal = glb.add_vertex_vectors(normals);
    mesh.triangles = glb.add_triangles(part.triangles);
    for (std::size_t f = 0; f < part.shapes.size(); ++f)
      mesh.targets.push_back({.name = "frame " + std::to_string(f),
                              .position = glb.add_vertex_vectors(part.shapes[f]),
                              .normal = glb.add_vertex_vectors(normal_changes(rest, part.shapes[f], part.triangles))});
    const int number = glb.add_mesh(mesh);
    part.bends ? impl_->add_bending(glb, animation, part, number, keys)
               : impl_->add_rigid(glb, animation, part, number, keys);
  }
  glb.add_animation(animation);
  return glb.bytes();
}

std::size_t PoseRecording::most_targets() const {
  std::size_t out = 0;
  for (const Part& part : impl_->parts) out = std::max(out, part.shapes.size());
  return out;
}

}  // namespace limber
