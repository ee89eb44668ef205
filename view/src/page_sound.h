/// @file page_sound.h
/// What a page's synthesizer is told: kinds of bodies that one hears, and blows on them.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "description.h"
#include "limber/scene/blows.h"
#include "limber/view/page_world.h"

namespace limber::internal {

class PageSound {
 public:
  /// Forgets all blows. @param shown, kinds outlive this
  void begin(std::span<const PageModel> shown, std::span<const std::shared_ptr<const ModalModel>> kinds);
  void listen(bool on);
  bool listens() const { return listens_; }
  /// @throws InvalidArgument for a model without a sound
  const SoundingBody& sounding(int model);

  /// The blows of the step that `player` took last.
  void note_step(const Scene& scene, const ScenePlayer& player, std::span<const PageBody> bodies);
  void note(const BlowRecord& blow, double delay, std::span<const PageBody> bodies);
  /// PageWorld::take_blows()
  std::span<const double> take();

 private:
  const SoundingBody* sounding_of(std::size_t body, std::span<const PageBody> bodies);

  std::span<const PageModel> shown_;
  std::span<const std::shared_ptr<const ModalModel>> kinds_;
  std::vector<std::unique_ptr<SoundingBody>> sounding_;  // per kind, made as it is asked for
  bool listens_ = false;
  std::vector<BlowRecord> blows_;
  std::vector<double> noted_, taken_;
};

}  // namespace limber::internal
