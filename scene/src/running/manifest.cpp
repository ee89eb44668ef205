#include "limber/scene/manifest.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>

namespace limber {
namespace {

/// m, of bodies of metres: single precision of rest positions that come from another array.
constexpr double kRoundOff = 1e-6;

/// A scene played in one way.
struct Played {
  RunResult run;
  std::size_t bytes = 0;
  double processor_seconds = 0.0;
  double seconds() const { return processor_seconds / static_cast<double>(std::max<std::int64_t>(run.steps, 1)); }
};

/// The picture at a key by the modes of `shown`, vertex after vertex: bodies that were played with fewer modes or
/// another surface are put on the asset's.
std::vector<Vec3> vertices_at(const BodyTrack& track, const ModalModel& shown, std::span<const Index> kept,
                              std::size_t key) {
  const auto z = track.amplitudes_at(key);
  std::vector<Vec3> points;
  for (Index v = 0; v < shown.render().vertices(); ++v) {
    Vec3 p = shown.render().rest[static_cast<std::size_t>(v)].cast<double>();
    for (std::size_t i = 0; i < z.size(); ++i) p += z[i] * shown.render().basis.shape(v, kept[i]).cast<double>();
    points.push_back(track.poses[key] * p);
  }
  return points;
}

/// The modes of the asset that a model's manifest keeps.
std::vector<Index> kept_modes(const ModelManifest& manifest) {
  std::vector<Index> kept;
  for (Index i = 0; i < manifest.modes_in_asset; ++i)
    if (std::none_of(manifest.dropped.begin(), manifest.dropped.end(),
                     [&](const DroppedMode& d) { return d.mode == i; }))
      kept.push_back(i);
  return kept;
}

class Comparison {
 public:
  Comparison(const Scene& scene, const std::map<std::string, Asset>& assets, const SceneUse& use, RunOptions options)
      : scene_(scene), assets_(assets), use_(use), options_(std::move(options)) {
    lean_ = play(scene_, use_, false);
  }

  SceneManifest manifest() {
    SceneManifest out;
    out.bytes = lean_.bytes, out.seconds = lean_.seconds();
    for (int i = 0; i < kLeftOut; ++i) add_part(static_cast<LeftOut>(i), out);
    if (!use_.drawn) add("drawing", "nobody reads positions", play(scene_, use_, true), 0.0, out);
    if (scene_.sleep.enabled) add_sleep(out);
    add_methods(out);
    compare_with_all(out);
    out.steps = lean_.run.steps * static_cast<std::int64_t>(scene_.bodies.size());
    out.asleep_steps = lean_.run.asleep_steps;
    return out;
  }

 private:
  Played play(const Scene& scene, const SceneUse& use, bool draw) {
    SceneModels models = make_models(scene, assets_, use);
    RunOptions options = options_;
    options.reconstruct_every_step = draw;
    const std::clock_t began = std::clock();  // what other programs take does not count
    Played played{.run = run_scene(scene, models, options)};
    played.processor_seconds = static_cast<double>(std::clock() - began) / CLOCKS_PER_SEC;
    for (const ModelManifest& m : models.manifest) played.bytes += m.bytes;
    models_.push_back(std::move(models));
    return played;
  }

  void add(const std::string& what, const std::string& why, const Played& with, std::optional<double> bound,
           SceneManifest& out) {
    out.left_out.push_back({.what = what,
                            .why = why,
                            .bytes = static_cast<std::int64_t>(with.bytes) - static_cast<std::int64_t>(lean_.bytes),
                            .seconds = with.seconds() - lean_.seconds(),
                            .difference = difference(with, models_.back()),
                            .bound = bound});
  }

  void add_part(LeftOut what, SceneManifest& out) {
    const auto& manifests = models_.front().manifest;
    const auto has =
        std::find_if(manifests.begin(), manifests.end(), [&](const ModelManifest& m) { return m.leaves_out(what); });
    if (has == manifests.end()) return;
    const auto saving =
        std::find_if(has->left_out.begin(), has->left_out.end(), [&](const ModelSaving& s) { return s.what == what; });
    const std::string why = saving->why;
    const std::optional<double> bound = what == LeftOut::kModes ? modes_bound() : std::optional<double>(kRoundOff);
    SceneUse put_back = use_;
    put_back.keep.push_back(what);
    add(std::string(to_string(what)), why, play(scene_, put_back, false), bound, out);
  }

  /// The dropped modes' largest displacements bound what one force at a time can show of them; contacts, joints and
  /// several loads are forces beside it.
  std::optional<double> modes_bound() const {
    const bool one_force = !scene_.contacts.options && scene_.joints.empty() && scene_.handles.empty() &&
                           scene_.strikes.empty() && scene_.forces.size() <= 1;
    double bound = kRoundOff;
    for (const ModelManifest& m : models_.front().manifest) {
      if (m.dropped.empty()) continue;
      if (!m.dropped_displacement || !one_force) return std::nullopt;
      bound = std::max(bound, kRoundOff + *m.dropped_displacement);
    }
    for (const HeldForce& f : scene_.forces)
      if (!scene_.limits || f.force.norm() > scene_.limits->max_force) return std::nullopt;
    return bound;
  }

  void add_sleep(SceneManifest& out) {
    Scene awake = scene_;
    awake.sleep.enabled = false;
    const Played with = play(awake, use_, false);
    add("sleep", "bodies at rest that nothing happens to are left alone", with, std::nullopt, out);
  }

  void add_methods(SceneManifest& out) const {
    using Method = SceneContactRule::Method;
    for (const Method method :
         {Method::kComplementary, Method::kGapProgram, Method::kVelocityProgram, Method::kPenalty})
      if (!scene_.contacts.options || scene_.contacts.rule.method != method)
        out.unused_methods.emplace_back(to_string(method));
  }

  void compare_with_all(SceneManifest& out) {
    SceneUse all = use_;
    for (int i = 0; i < kLeftOut; ++i) all.keep.push_back(static_cast<LeftOut>(i));
    const Played with = play(scene_, all, !use_.drawn);
    out.bytes_with_all = with.bytes;
    out.seconds_with_all = with.seconds();
    out.difference_with_all = difference(with, models_.back());
  }

  /// Difference of all bodies at all keys, on the surfaces of the assets.
  double difference(const Played& with, const SceneModels& models) const {
    double largest = 0.0;
    for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
      const auto [shown, kept_lean] = shown_by(models_.front(), b);
      const auto [same, kept_with] = shown_by(models, b);
      const BodyTrack &track = lean_.run.trajectory.bodies[b], &other = with.run.trajectory.bodies[b];
      for (std::size_t key = 0; key < track.poses.size(); ++key) {
        const auto here = vertices_at(track, *shown, kept_lean, key), there = vertices_at(other, *same, kept_with, key);
        for (std::size_t v = 0; v < here.size(); ++v) largest = std::max(largest, (here[v] - there[v]).norm());
      }
    }
    return largest;
  }

  /// The asset's model behind a body, and which of its modes the body was played with.
  std::pair<const ModalModel*, std::vector<Index>> shown_by(const SceneModels& models, std::size_t body) const {
    const SceneBody& told = scene_.bodies[body];
    const std::string& name = models.of_body[body]->name();
    const Asset& asset = assets_.at(told.asset);
    const auto model =
        std::find_if(asset.bodies.begin(), asset.bodies.end(), [&](const auto& m) { return m->name() == name; });
    const auto manifest = std::find_if(models.manifest.begin(), models.manifest.end(),
                                       [&](const ModelManifest& m) { return m.asset == told.asset && m.body == name; });
    return {model->get(), kept_modes(*manifest)};
  }

  const Scene& scene_;
  const std::map<std::string, Asset>& assets_;
  const SceneUse& use_;
  RunOptions options_;
  std::vector<SceneModels> models_;  // of every play, the first is the lean one
  Played lean_;
};

}  // namespace

SceneManifest measure_manifest(const Scene& scene, const std::map<std::string, Asset>& assets, const SceneUse& use,
                               const RunOptions& options) {
  return Comparison(scene, assets, use, options).manifest();
}

}  // namespace limber
