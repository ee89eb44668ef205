#include "page_sound.h"

#include <algorithm>
#include <string>

#include "limber/core/error.h"

namespace limber::internal {

void PageSound::begin(std::span<const PageModel> shown, std::span<const std::shared_ptr<const ModalModel>> kinds) {
  shown_ = shown;
  kinds_ = kinds;
  sounding_.clear();
  sounding_.resize(kinds.size());
  noted_.clear();
}

void PageSound::listen(bool on) {
  listens_ = on;
  noted_.clear();
}

const SoundingBody& PageSound::sounding(int model) {
  const auto kind = static_cast<std::size_t>(model);
  if (kind >= shown_.size() || !shown_[kind].sound)
    throw InvalidArgument("PageWorld: model " + std::to_string(model) + " has no sound");
  if (!sounding_[kind]) sounding_[kind] = std::make_unique<SoundingBody>(shown_[kind].sound, kinds_[kind]->collision());
  return *sounding_[kind];
}

const SoundingBody* PageSound::sounding_of(std::size_t body, std::span<const PageBody> bodies) {
  return body < bodies.size() && shown_[static_cast<std::size_t>(bodies[body].model)].sound
             ? &sounding(bodies[body].model)
             : nullptr;
}

void PageSound::note_step(const Scene& scene, const ScenePlayer& player, std::span<const PageBody> bodies) {
  std::vector<BodyId> ids;
  std::vector<std::size_t> number_of;
  for (const PageBody& body : bodies) {
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

void PageSound::note(const BlowRecord& blow, double delay, std::span<const PageBody> bodies) {
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

std::span<const double> PageSound::take() {
  taken_.swap(noted_);
  noted_.clear();
  return taken_;
}

}  // namespace limber::internal
