/// @file live_sound.h
/// What a synthesizer is told of a live scene: kinds of bodies that one hears, and blows on them.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "limber/view/live_scene.h"

namespace limber::internal {

class LiveSound {
 public:
  /// Forgets all blows. @param sounds per kind; null: one does not hear it. @param kinds outlive this
  void begin(std::vector<std::shared_ptr<const SoundModes>> sounds,
             std::span<const std::shared_ptr<const ModalModel>> kinds);
  void listen(bool on);
  bool listens() const { return listens_; }
  const SoundModes* modes(std::size_t kind) const { return sounds_[kind].get(); }
  /// Null: one does not hear it.
  const SoundingBody* sounding(std::size_t kind);

  /// The blows of the step that `player` took last.
  void note_step(const Scene& scene, const ScenePlayer& player, std::span<const LiveScene::Body> bodies);
  void note(const BlowRecord& blow, double delay, std::span<const LiveScene::Body> bodies);
  /// LiveScene::take_blows()
  std::span<const double> take();

 private:
  const SoundingBody* sounding_of(std::size_t body, std::span<const LiveScene::Body> bodies);

  std::vector<std::shared_ptr<const SoundModes>> sounds_;
  std::span<const std::shared_ptr<const ModalModel>> kinds_;
  std::vector<std::unique_ptr<SoundingBody>> sounding_;  // per kind, made as it is asked for
  bool listens_ = false;
  std::vector<BlowRecord> blows_;
  std::vector<double> noted_, taken_;
};

}  // namespace limber::internal
