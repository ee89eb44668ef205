#include "live_sound.h"

#include <algorithm>
#include <utility>

namespace limber::internal {

void LiveSound::begin(std::vector<std::shared_ptr<const SoundModes>> sounds,
                      std::span<const std::shared_ptr<const ModalModel>> kinds) {
  sounds_ = std::move(sounds);
  kinds_ = kinds;
  sounding_.clear();
  sounding_.resize(kinds.size());
  noted_.clear();
}

void LiveSound::listen(bool on) {
  listens_ = on;
  noted_.clear();
}

const SoundingBody* LiveSound::sounding(std::size_t kind) {
  if (kind >= sounds_.size() || !sounds_[kind]) return nullptr;
  if (!sounding_[kind]) sounding_[kind] = std::make_unique<SoundingBody>(sounds_[kind], kinds_[kind]->collision());
  return sounding_[kind].get();
}

const SoundingBody* LiveSound::sounding_of(std::size_t body, std::span<const LiveScene::Body> bodies) {
  return body < bodies.size() ? sounding(bodies[body].model) : nullptr;
}

void LiveSound::note_step(const Scene& scene, const ScenePlayer& player, std::span<const LiveScene::Body> bodies) {
  std::vector<BodyId> ids;
  std::vector<std::size_t> number_of;
  for (const LiveScene::Body& body : bodies) {
    number_of.resize(std::max<std::size_t>(number_of.size(), body.id.index + 1), bodies.size());
    number_of[body.id.index] = ids.size();
    ids.push_back(body.id);
  }
  for (const BodyId still : player.statics())
    number_of.resize(std::max<std::size_t>(number_of.size(), still.index + 1), bodies.size());
  blows_.clear();
  list_blows(scene, player, ids, number_of, blows_);
  const double start = static_cast<double>(player.steps_taken() - 1) * scene.step;
  for (const BlowRecord& blow : blows_) note(blow, blow.time - start, bodies);
}

void LiveSound::note(const BlowRecord& blow, double delay, std::span<const LiveScene::Body> bodies) {
  const SoundingBody* body = sounding_of(blow.body, bodies);
  if (!body) return;
  const StruckPoint at = body->nearest(blow.point);
  noted_.push_back(static_cast<double>(blow.body));
  for (const Index v : at.vertices) noted_.push_back(v);
  noted_.insert(noted_.end(), at.weights.begin(), at.weights.end());
  noted_.insert(noted_.end(), blow.impulse.begin(), blow.impulse.end());
  noted_.push_back(duration_of(blow, body, sounding_of(blow.other, bodies)));
  noted_.push_back(delay);
  noted_.insert(noted_.end(), blow.position.begin(), blow.position.end());
}

std::span<const double> LiveSound::take() {
  taken_.swap(noted_);
  noted_.clear();
  return taken_;
}

}  // namespace limber::internal
