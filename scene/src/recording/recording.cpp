#include "limber/scene/recording.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>

#include "largest_shape.h"
#include "limber/collision/shape_surface.h"
#include "limber/core/error.h"
#include "limber/model/glb.h"
#include "limber/model/morph_targets.h"
#include "limber/model/pose_keys.h"
#include "limber/model/skin_pose.h"

namespace limber {
namespace {

/// Linear colours that stay apart from each other, one per model in turn.
constexpr std::array<std::array<float, 4>, 6> kPalette{{{0.80f, 0.52f, 0.25f, 1.0f},
                                                        {0.22f, 0.45f, 0.69f, 1.0f},
                                                        {0.35f, 0.60f, 0.30f, 1.0f},
                                                        {0.70f, 0.27f, 0.27f, 1.0f},
                                                        {0.50f, 0.38f, 0.62f, 1.0f},
                                                        {0.62f, 0.62f, 0.58f, 1.0f}}};

float narrow(double x) { return static_cast<float>(x); }

double diagonal(const ModalSurface& surface) {
  Vec3f low = surface.rest.front(), high = low;
  for (const Vec3f& p : surface.rest) low = low.cwiseMin(p), high = high.cwiseMax(p);
  return (high - low).cast<double>().norm();
}

/// All bodies of one model that bend in the same way.
struct Cast {
  std::shared_ptr<const ModalModel> model;
  bool modal_skin = false;
  std::vector<std::size_t> bodies;  // of the trajectory
  RecordedModel record;
  int mesh = -1;
};

std::vector<Cast> group_by_model(const Trajectory& trajectory) {
  std::vector<Cast> casts;
  for (std::size_t b = 0; b < trajectory.bodies.size(); ++b) {
    const auto& model = trajectory.bodies[b].model;
    const bool skin = trajectory.bodies[b].modal_skin;
    auto found = std::find_if(casts.begin(), casts.end(),
                              [&](const Cast& c) { return c.model == model && c.modal_skin == skin; });
    if (found == casts.end()) {
      casts.push_back({.model = model, .modal_skin = skin, .bodies = {}, .record = {}});
      found = casts.end() - 1;
    }
    found->bodies.push_back(b);
  }
  return casts;
}

double largest_amplitude(const Trajectory& trajectory, const Cast& cast, Index mode) {
  double largest = 0.0;
  const auto k = static_cast<std::size_t>(cast.model->modes());
  for (const std::size_t b : cast.bodies) {
    const auto& z = trajectory.bodies[b].amplitudes;
    for (std::size_t i = static_cast<std::size_t>(mode); i < z.size(); i += k)
      largest = std::max(largest, std::abs(z[i]));
  }
  return largest;
}

/// Half the key rate is the fastest that keys can follow.
bool too_fast(const ModalModelData& model, std::size_t mode, double key_interval) {
  const double square = model.eigenvalues[mode] - model.decays[mode] * model.decays[mode];
  return square > 0.0 && std::sqrt(square) / (2.0 * std::numbers::pi) > 0.5 / key_interval;
}

RecordedModel choose_modes(const Trajectory& trajectory, const Cast& cast, const RecordingOptions& options) {
  RecordedModel record;
  record.name = cast.model->name();
  record.modes = cast.model->modes();
  const double visible = options.invisible * diagonal(cast.model->render());
  for (Index m = 0; m < cast.model->modes(); ++m) {
    const double largest = largest_amplitude(trajectory, cast, m);
    if (!(largest * internal::largest_shape(cast.model->render(), m) > visible)) continue;
    record.recorded.push_back(m);
    record.scales.push_back(largest);
    if (too_fast(cast.model->data(), static_cast<std::size_t>(m), trajectory.key_interval))
      record.too_fast.push_back(m);
  }
  return record;
}

/// A mesh's numbers before they go into the file: signed or unsigned, the same shapes and the same shading directions.
struct MorphedSurface {
  std::vector<float> position, normal;
  std::vector<std::vector<float>> target_position, target_normal;  // the latter empty: targets without normals
};

MorphedSurface signed_targets(const ModalSurface& surface, const RecordedModel& record) {
  MorphedSurface out;
  out.position = rest_positions(surface);
  out.normal = unit_normals(out.position, surface.triangles);
  const bool with_normals = record.recorded.size() <= static_cast<std::size_t>(kMaxTargetsWithNormals);
  for (std::size_t i = 0; i < record.recorded.size(); ++i) {
    out.target_position.push_back(mode_displacements(surface, record.recorded[i], record.scales[i]));
    if (with_normals)
      out.target_normal.push_back(normal_changes(out.position, out.target_position.back(), surface.triangles));
  }
  return out;
}

/// base − Σ targets, with weights ½ ± ½ on doubled targets.
std::vector<float> shifted(const std::vector<float>& base, std::vector<std::vector<float>>& targets) {
  std::vector<double> sum(base.begin(), base.end());
  for (auto& target : targets)
    for (std::size_t i = 0; i < sum.size(); ++i) {
      sum[i] -= static_cast<double>(target[i]);
      target[i] *= 2.0f;
    }
  return {sum.begin(), sum.end()};
}

/// A base normal must be of length 1 in the file. A viewer normalises base plus targets, so dividing all of a vertex by
/// the same number changes nothing that is seen. The length is at least 1: changes of a unit normal are across it.
void make_base_normals_unit(MorphedSurface& s) {
  for (std::size_t i = 0; i + 2 < s.normal.size(); i += 3) {
    const double length = Vec3(s.normal[i], s.normal[i + 1], s.normal[i + 2]).norm();
    const auto divide = [&](float& x) { x = narrow(static_cast<double>(x) / length); };
    for (std::size_t a = i; a < i + 3; ++a) {
      divide(s.normal[a]);
      for (auto& target : s.target_normal) divide(target[a]);
    }
  }
}

MorphedSurface unsigned_targets(const ModalSurface& surface, const RecordedModel& record) {
  MorphedSurface s = signed_targets(surface, record);
  s.position = shifted(s.position, s.target_position);
  if (s.target_normal.empty()) return s;  // lit as at rest
  s.normal = shifted(s.normal, s.target_normal);
  make_base_normals_unit(s);
  return s;
}

/// A surface with Ũ in place of U: what its joints turn and carry.
ModalSurface undeformed(const ModalModel& model) {
  const ModalSurface& shown = model.render();
  ModalSurface surface{shown.rest, shown.triangles, ModalBasis(shown.vertices(), model.modes())};
  const ModalSkin& skin = *model.data().skin;
  SkinPose pose(skin);
  std::vector<double> unit(static_cast<std::size_t>(model.modes()), 0.0);
  for (Index m = 0; m < model.modes(); ++m) {
    unit[static_cast<std::size_t>(m)] = 1.0;
    pose.set(unit);
    for (Index v = 0; v < surface.vertices(); ++v) {
      const auto at = static_cast<std::size_t>(v);
      const Vec3 r = surface.rest[at].cast<double>(), u = shown.basis.shape(v, m).cast<double>();
      surface.basis.set(v, m, (pose.undeformed_part(skin.render[at], r, u) - r).cast<float>());
    }
    unit[static_cast<std::size_t>(m)] = 0.0;
  }
  return surface;
}

int add_mesh(GlbBuilder& glb, const Cast& cast, std::size_t number, const RecordingOptions& options) {
  ModalSurface carried;  // by joints
  if (cast.modal_skin) carried = undeformed(*cast.model);
  const ModalSurface& surface = cast.modal_skin ? carried : cast.model->render();
  const MorphedSurface s =
      options.unsigned_weights ? unsigned_targets(surface, cast.record) : signed_targets(surface, cast.record);
  GlbMesh mesh{.name = cast.model->name()};
  mesh.material = glb.add_material({.name = cast.model->name(),
                                    .base_color = kPalette[number % kPalette.size()],
                                    .roughness = 0.6f,
                                    .double_sided = true});
  mesh.position = glb.add_vertex_vectors(s.position);
  mesh.normal = glb.add_vertex_vectors(s.normal);
  mesh.triangles = glb.add_triangles(surface.triangles);
  if (cast.modal_skin) mesh.influences = glb.add_influences(cast.model->data().skin->render);
  for (std::size_t i = 0; i < s.target_position.size(); ++i) {
    const Index mode = cast.record.recorded[i];
    GlbMorphTarget target{.name = mode_target_name(mode, cast.model->modes(), cast.model->frequency_hz(mode))};
    target.position = glb.add_vertex_vectors(s.target_position[i]);
    if (!s.target_normal.empty()) target.normal = glb.add_vertex_vectors(s.target_normal[i]);
    mesh.targets.push_back(std::move(target));
    mesh.weights.push_back(options.unsigned_weights ? 0.5f : 0.0f);
  }
  return glb.add_mesh(mesh);
}

/// A ball that holds all bodies at all keys.
struct Extent {
  Vec3 centre = Vec3::Zero();
  double radius = 0.0;
};

Extent extent_of(const Trajectory& trajectory) {
  Vec3 low = trajectory.bodies.front().poses.front().p, high = low;
  double reach = 0.0;
  for (const BodyTrack& body : trajectory.bodies) {
    reach = std::max(reach, diagonal(body.model->render()));
    for (const RigidTransform& X : body.poses) low = low.cwiseMin(X.p), high = high.cwiseMax(X.p);
  }
  return {0.5 * (low + high), 0.5 * (high - low).norm() + reach};
}

/// Statics: a node with a mesh each, all of one grey.
std::vector<int> add_statics(GlbBuilder& glb, const Trajectory& trajectory) {
  std::vector<int> nodes;
  if (trajectory.statics.empty()) return nodes;
  constexpr double kBeyond = 1.5;  // a plane is seen to go on beyond the bodies
  const int material = glb.add_material(
      {.name = "static", .base_color = {0.55f, 0.56f, 0.58f, 1.0f}, .roughness = 0.9f, .double_sided = true});
  const Extent extent = extent_of(trajectory);
  for (const StaticShape& s : trajectory.statics) {
    const TriangleMesh surface = surface_of(*s.shape, s.pose.inverse() * extent.centre, kBeyond * extent.radius);
    std::vector<float> positions;
    for (const Vec3& p : surface.vertices)
      for (int a = 0; a < 3; ++a) positions.push_back(narrow(p[a]));
    const int mesh = glb.add_mesh({.name = s.name,
                                   .position = glb.add_vertex_vectors(positions),
                                   .normal = glb.add_vertex_vectors(unit_normals(positions, surface.triangles)),
                                   .triangles = glb.add_triangles(surface.triangles),
                                   .material = material});
    nodes.push_back(
        glb.add_node({.name = s.name, .mesh = mesh, .translation = s.pose.p, .rotation = normalized(s.pose.q)}));
  }
  return nodes;
}

std::vector<float> weights(const BodyTrack& body, const RecordedModel& record, bool unsigned_weights) {
  std::vector<float> out;
  for (std::size_t key = 0; key < body.poses.size(); ++key) {
    const auto z = body.amplitudes_at(key);
    for (std::size_t i = 0; i < record.recorded.size(); ++i) {
      const double w = z[static_cast<std::size_t>(record.recorded[i])] / record.scales[i];
      out.push_back(narrow(unsigned_weights ? 0.5 + 0.5 * w : w));
    }
  }
  return out;
}

/// A body's nodes: its own, one per handle of its skin (the skin's joints), and the one that holds the mesh.
struct BodyNodes {
  int body = -1, surface = -1;
  std::vector<int> joints{};
};

/// Places of a body's handles in its frame. @return [handle][key]
std::vector<std::vector<RigidTransform>> joint_poses(const BodyTrack& body) {
  SkinPose pose(*body.model->data().skin);
  std::vector<std::vector<RigidTransform>> out(pose.handles().size());
  for (std::size_t key = 0; key < body.poses.size(); ++key) {
    pose.set(body.amplitudes_at(key));
    for (std::size_t h = 0; h < out.size(); ++h) {
      const SkinPose::Handle& handle = pose.handles()[h];
      out[h].push_back({normalized(quaternion_from_matrix(Mat3::Identity() + handle.turn)), handle.shift});
    }
  }
  return out;
}

/// As the body stands at its first key.
BodyNodes add_nodes(GlbBuilder& glb, const Cast& cast, const BodyTrack& body) {
  BodyNodes nodes;
  if (cast.modal_skin)
    for (const std::vector<RigidTransform>& joint : joint_poses(body))
      nodes.joints.push_back(glb.add_node({.name = body.name + " handle " + std::to_string(nodes.joints.size()),
                                           .translation = joint.front().p,
                                           .rotation = joint.front().q}));
  nodes.body = glb.add_node({.name = body.name,
                             .mesh = cast.modal_skin ? -1 : cast.mesh,
                             .children = nodes.joints,
                             .translation = body.poses.front().p,
                             .rotation = normalized(body.poses.front().q)});
  // Where a skinned mesh is told by its joints alone; viewers want its node at the root.
  nodes.surface =
      cast.modal_skin
          ? glb.add_node({.name = body.name + " surface", .mesh = cast.mesh, .skin = glb.add_skin(nodes.joints)})
          : nodes.body;
  return nodes;
}

/// Keys of how a body bends: its joints and its weights.
void add_bends(GlbBuilder& glb, const Cast& cast, const BodyTrack& body, const BodyNodes& nodes, int times,
               bool unsigned_weights, GlbAnimation& animation) {
  const auto add = [&](int node, GlbPath path, const std::vector<float>& values) {
    animation.channels.push_back({node, path, times, glb.add_key_values(values, path)});
  };
  if (cast.modal_skin) {
    const auto joints = joint_poses(body);
    for (std::size_t h = 0; h < joints.size(); ++h) {
      add(nodes.joints[h], GlbPath::kTranslation, translation_keys(joints[h]));
      add(nodes.joints[h], GlbPath::kRotation, rotation_keys(joints[h]));
    }
  }
  if (!cast.record.recorded.empty())
    add(nodes.surface, GlbPath::kWeights, weights(body, cast.record, unsigned_weights));
}

std::vector<float> shown_times(const Trajectory& trajectory, double slow_motion) {
  std::vector<float> out;
  for (const double t : trajectory.times) out.push_back(narrow(t * slow_motion));
  return out;
}

/// World axes have z up, glTF has y up: a quarter turn about x.
int add_root(GlbBuilder& glb, const std::string& name, std::vector<int> children) {
  const double half = std::numbers::sqrt2 / 2.0;
  return glb.add_node({.name = name.empty() ? "scene" : name,
                       .children = std::move(children),
                       .rotation = Quaternion{half, -half, 0.0, 0.0}});
}

std::string extras_of(const Trajectory& trajectory, const std::vector<Cast>& casts, const RecordingOptions& options) {
  nlohmann::ordered_json models = nlohmann::ordered_json::array();
  for (const Cast& cast : casts)
    models.push_back({{"name", cast.record.name}, {"modes", cast.record.recorded}, {"scales", cast.record.scales}});
  const nlohmann::ordered_json recording{{"scene", trajectory.scene},
                                         {"step", trajectory.step},
                                         {"key_interval", trajectory.key_interval},
                                         {"slow_motion", options.slow_motion},
                                         {"weights", options.unsigned_weights ? "unsigned" : "signed"},
                                         {"models", models}};
  return nlohmann::ordered_json{{"limber_recording", recording}}.dump(-1, ' ', false,
                                                                      nlohmann::json::error_handler_t::replace);
}

std::string hertz(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g Hz", x);
  return text;
}

void warn_of_fast_modes(const Trajectory& trajectory, const RecordedModel& record, Warnings& warnings) {
  if (record.too_fast.empty()) return;
  warnings.push_back(
      "Recording of \"" + record.name + "\": " + std::to_string(record.too_fast.size()) + " of " +
      std::to_string(record.recorded.size()) + " modes are faster than " + hertz(0.5 / trajectory.key_interval) +
      ", half the key rate: right at the keys, they look slower or flicker between them; raise "
      "--slow-motion (and lower the scene's step) to see them, or set limits.frame_rate to leave them out.");
}

void warn_of_many_targets(const RecordedModel& record, Warnings& warnings) {
  if (record.recorded.size() <= static_cast<std::size_t>(kMaxMorphTargets)) return;
  warnings.push_back("Recording of \"" + record.name + "\": " + std::to_string(record.recorded.size()) +
                     " morph targets, but many viewers hold at most " + std::to_string(kMaxMorphTargets) + ".");
}

void warn_of_fast_turns(const Trajectory& trajectory, Warnings& warnings) {
  for (const BodyTrack& body : trajectory.bodies) {
    double fastest = 0.0;
    for (const Vec3& omega : body.angular_velocities) fastest = std::max(fastest, omega.norm());
    if (fastest * trajectory.key_interval < std::numbers::pi) continue;
    warnings.push_back(
        "Recording of \"" + body.name +
        "\": turns more than half a turn between keys, so a viewer shows it turning the wrong way; raise "
        "--record-frame-rate or --slow-motion.");
  }
}

void check(const Trajectory& trajectory) {
  if (trajectory.times.empty() || trajectory.bodies.empty())
    throw InvalidArgument("make_recording: the trajectory has no keys or no bodies, expected at least one of each");
  for (const BodyTrack& body : trajectory.bodies) {
    const auto keys = trajectory.times.size();
    if (!body.model || body.poses.size() != keys ||
        body.amplitudes.size() != keys * static_cast<std::size_t>(body.model->modes()))
      throw InvalidArgument("make_recording: the track of \"" + body.name + "\" does not have a state per key");
  }
}

}  // namespace

void RecordingOptions::validate() const {
  if (!(slow_motion > 0.0) || !std::isfinite(slow_motion))
    throw InvalidArgument("RecordingOptions.slow_motion: is " + std::to_string(slow_motion) +
                          ", expected a finite number > 0");
  if (!(invisible >= 0.0) || !std::isfinite(invisible))
    throw InvalidArgument("RecordingOptions.invisible: is " + std::to_string(invisible) +
                          ", expected a finite number >= 0");
}

Recording make_recording(const Trajectory& trajectory, const RecordingOptions& options) {
  options.validate();
  check(trajectory);
  Recording recording;
  GlbBuilder glb;
  std::vector<Cast> casts = group_by_model(trajectory);
  std::vector<int> nodes;
  GlbAnimation animation{.name = trajectory.scene.empty() ? "simulation" : trajectory.scene};
  const int times = glb.add_times(shown_times(trajectory, options.slow_motion));
  for (std::size_t c = 0; c < casts.size(); ++c) {
    Cast& cast = casts[c];
    cast.record = choose_modes(trajectory, cast, options);
    cast.mesh = add_mesh(glb, cast, c, options);
    for (const std::size_t b : cast.bodies) {
      const BodyTrack& body = trajectory.bodies[b];
      const auto add = [&](int node, GlbPath path, const std::vector<float>& values) {
        animation.channels.push_back({node, path, times, glb.add_key_values(values, path)});
      };
      const BodyNodes own = add_nodes(glb, cast, body);
      nodes.push_back(own.body);
      add(own.body, GlbPath::kTranslation, translation_keys(body.poses));
      add(own.body, GlbPath::kRotation, rotation_keys(body.poses));
      add_bends(glb, cast, body, own, times, options.unsigned_weights, animation);
    }
    warn_of_fast_modes(trajectory, cast.record, recording.warnings);
    warn_of_many_targets(cast.record, recording.warnings);
    recording.models.push_back(cast.record);
  }
  warn_of_fast_turns(trajectory, recording.warnings);
  glb.add_animation(animation);
  for (const int node : add_statics(glb, trajectory)) nodes.push_back(node);
  add_root(glb, trajectory.scene, std::move(nodes));
  glb.set_extras(extras_of(trajectory, casts, options));
  recording.glb = glb.bytes();
  return recording;
}

namespace {

constexpr double kClipBend = std::numbers::pi / 3.0;
constexpr double kClipSeconds = 2.0;
constexpr std::size_t kClipKeys = 49;  // 24 a second: rotations between keys go along straight lines

/// Largest turn of a handle, rad per unit of a mode's amplitude.
double turn_of_mode(const ModalSkin& skin, Index mode) {
  double largest = 0.0;
  for (Index h = 0; h < skin.handles; ++h) {
    const auto turn = [&](int axis) { return static_cast<double>(skin.rotation_row(h, axis)[mode]); };
    largest = std::max(largest, Vec3(turn(0), turn(1), turn(2)).norm());
  }
  return largest;
}

/// How far each mode swings: with the energy that bends the softest by kClipBend, and as far as its slider at least.
std::vector<double> clip_amplitudes(const ModalModel& model) {
  std::vector<double> out = model.data().mode_scales;
  if (!model.data().skin) return out;
  const std::vector<double>& stiffness = model.data().eigenvalues;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < out.size(); ++i) {
    const double z = kClipBend / turn_of_mode(*model.data().skin, static_cast<Index>(i));
    if (stiffness[i] > 0.0) least = std::min(least, stiffness[i] * z * z);
  }
  for (std::size_t i = 0; i < out.size(); ++i)
    if (stiffness[i] > 0.0 && std::isfinite(least)) out[i] = std::max(out[i], std::sqrt(least / stiffness[i]));
  return out;
}

/// One mode from rest to either side and back.
BodyTrack swing(const std::shared_ptr<const ModalModel>& model, Index mode, double amplitude) {
  BodyTrack track;
  track.name = model->name(), track.model = model;
  track.modal_skin = model->data().skin.has_value();
  for (std::size_t key = 0; key < kClipKeys; ++key) {
    const double part = static_cast<double>(key) / static_cast<double>(kClipKeys - 1);
    track.poses.push_back({.p = model->data().origin_in_input});
    for (Index i = 0; i < model->modes(); ++i)
      track.amplitudes.push_back(i == mode ? amplitude * std::sin(2.0 * std::numbers::pi * part) : 0.0);
  }
  return track;
}

std::vector<float> clip_times() {
  std::vector<float> out;
  for (std::size_t key = 0; key < kClipKeys; ++key)
    out.push_back(narrow(kClipSeconds * static_cast<double>(key) / static_cast<double>(kClipKeys - 1)));
  return out;
}

}  // namespace

std::string make_mode_clips(std::span<const std::shared_ptr<const ModalModel>> models) {
  GlbBuilder glb;
  const int times = glb.add_times(clip_times());
  for (std::size_t b = 0; b < models.size(); ++b) {
    const auto& model = models[b];
    Cast cast{.model = model, .modal_skin = model->data().skin.has_value(), .bodies = {}, .record = {}};
    cast.record.scales = clip_amplitudes(*model);
    for (Index i = 0; i < model->modes(); ++i) cast.record.recorded.push_back(i);
    cast.mesh = add_mesh(glb, cast, b, {});
    const BodyNodes nodes = add_nodes(glb, cast, swing(model, 0, 0.0));
    for (Index i = 0; i < model->modes(); ++i) {
      const std::string mode = mode_target_name(i, model->modes(), model->frequency_hz(i));
      GlbAnimation clip{.name = models.size() > 1 ? model->name() + " " + mode : mode};
      add_bends(glb, cast, swing(model, i, cast.record.scales[static_cast<std::size_t>(i)]), nodes, times, false, clip);
      glb.add_animation(clip);
    }
  }
  return glb.bytes();
}

}  // namespace limber
