#include "limber/scene/soundtrack.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "limber/core/error.h"
#include "limber/scene/blows.h"
#include "limber/sound/synthesizer.h"

namespace limber {
namespace {

std::size_t part_of(const SceneBody& body, const Asset& asset) {
  const auto refuse_part = [&]() -> std::size_t {
    throw InvalidArgument(body.where + ".part: the asset has no such body");
  };
  if (const Index* number = std::get_if<Index>(&body.part))
    return *number >= 0 && static_cast<std::size_t>(*number) < asset.bodies.size() ? static_cast<std::size_t>(*number)
                                                                                   : refuse_part();
  for (std::size_t i = 0; i < asset.bodies.size(); ++i)
    if (asset.bodies[i]->name() == std::get<std::string>(body.part)) return i;
  return refuse_part();
}

class Orchestra {
 public:
  Orchestra(const Scene& scene, const std::map<std::string, Asset>& assets, const SoundtrackOptions& options)
      : scene_(scene),
        synthesizer_({.sample_rate = options.sample_rate,
                      .channels = static_cast<int>(scene.microphones.size()),
                      .max_strikes = kMostBlows,
                      .max_modes = kMostModes}),
        rate_(options.sample_rate) {
    for (const SceneBody& body : scene.bodies) add_body(body, assets);
  }

  std::int64_t silent_bodies() const { return std::count(number_.begin(), number_.end(), -1); }
  std::int64_t blows() const { return blows_; }
  bool silent() const { return synthesizer_.silent(); }

  void strike(const BlowRecord& record) {
    const Index body = number_[record.body];
    if (body < 0) return;
    const SoundingBody& model = *model_[record.body];
    const double start = record.time * rate_;
    render_until(static_cast<std::int64_t>(start));
    std::vector<double> gains;
    for (const Vec3& microphone : scene_.microphones)
      gains.push_back(1.0 / std::max((microphone - record.position).norm(), model.radius()));
    synthesizer_.set_gains(body, gains);
    const double delay = std::max(0.0, start - static_cast<double>(synthesizer_.samples())) / rate_;
    if (!synthesizer_.strike({.body = body,
                              .at = model.nearest(record.point),
                              .impulse = record.impulse,
                              .contact_time = duration_of(record, &model, model_of(record.other)),
                              .delay = delay}))
      throw ComputationError("make_soundtrack: more than " + std::to_string(kMostBlows) + " contacts at a time");
    ++blows_;
  }

  void render_until(std::int64_t sample) {
    const std::int64_t more = sample - synthesizer_.samples();
    if (more <= 0) return;
    const std::size_t begin = samples_.size();
    samples_.resize(begin + static_cast<std::size_t>(more) * scene_.microphones.size());
    synthesizer_.render(std::span(samples_).subspan(begin));
  }

  std::vector<float> take_samples() { return std::move(samples_); }
  std::int64_t samples() const { return synthesizer_.samples(); }

 private:
  static constexpr int kMostBlows = 1 << 16;
  static constexpr Index kMostModes = 1 << 20;

  void add_body(const SceneBody& body, const std::map<std::string, Asset>& assets) {
    const auto asset = assets.find(body.asset);
    if (asset == assets.end()) throw InvalidArgument("make_soundtrack: asset \"" + body.asset + "\" is not given");
    const std::size_t part = part_of(body, asset->second);
    const SoundModes* modes = asset->second.sound(part);
    if (!modes || modes->modes() == 0) {
      number_.push_back(-1), model_.push_back(nullptr);
      return;
    }
    auto [entry, fresh] = made_.try_emplace(std::pair(body.asset, part));
    Kind& kind = entry->second;
    if (fresh) {
      kind.body.emplace(asset->second.sounds[part], asset->second.bodies[part]->collision());
      kind.sound = std::make_shared<ModalSound>(*modes, kind.body->gains(), rate_);
    }
    number_.push_back(synthesizer_.add_body(kind.sound));
    model_.push_back(&*kind.body);
  }

  const SoundingBody* model_of(std::size_t body) const { return body < model_.size() ? model_[body] : nullptr; }

  struct Kind {
    std::optional<SoundingBody> body;
    std::shared_ptr<const ModalSound> sound;
  };

  const Scene& scene_;
  Synthesizer synthesizer_;
  double rate_;
  std::map<std::pair<std::string, std::size_t>, Kind> made_;
  std::vector<Index> number_;               // in the synthesizer, per Scene::bodies; −1: silent
  std::vector<const SoundingBody*> model_;  // the same; null: silent
  std::vector<float> samples_;
  std::int64_t blows_ = 0;
};

}  // namespace

void SoundtrackOptions::validate() const {
  if (!(sample_rate >= 8e3 && sample_rate <= 384e3))
    throw InvalidArgument("SoundtrackOptions::sample_rate is " + std::to_string(sample_rate) +
                          ", expected 8000 to 384000");
  if (!(tail >= 0.0 && tail <= 3600.0))
    throw InvalidArgument("SoundtrackOptions::tail is " + std::to_string(tail) + " s, expected 0 to 3600");
}

Soundtrack make_soundtrack(const Scene& scene, const std::map<std::string, Asset>& assets, const RunResult& run,
                           const SoundtrackOptions& options) {
  options.validate();
  if (run.trajectory.bodies.size() != scene.bodies.size())
    throw InvalidArgument("make_soundtrack: the run has " + std::to_string(run.trajectory.bodies.size()) +
                          " bodies, expected " + std::to_string(scene.bodies.size()) + ", as the scene");
  Orchestra orchestra(scene, assets, options);
  std::vector<BlowRecord> blows = run.trajectory.blows;
  std::stable_sort(blows.begin(), blows.end(), [](const auto& a, const auto& b) { return a.time < b.time; });
  for (const BlowRecord& blow : blows) orchestra.strike(blow);

  const double end = static_cast<double>(run.steps) * scene.step;
  orchestra.render_until(static_cast<std::int64_t>(std::ceil(end * options.sample_rate)));
  const auto last = static_cast<std::int64_t>(std::ceil((end + options.tail) * options.sample_rate));
  constexpr std::int64_t kPiece = 4800;
  while (!orchestra.silent() && orchestra.samples() < last)
    orchestra.render_until(std::min(last, orchestra.samples() + kPiece));

  Soundtrack track{.samples = orchestra.take_samples(),
                   .channels = static_cast<int>(scene.microphones.size()),
                   .sample_rate = options.sample_rate,
                   .blows = orchestra.blows(),
                   .silent_bodies = orchestra.silent_bodies()};
  for (const float p : track.samples) track.loudest = std::max(track.loudest, std::abs(static_cast<double>(p)));
  return track;
}

}  // namespace limber
