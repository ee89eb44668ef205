#include "page_tracks.h"

#include <algorithm>

namespace limber::internal {
namespace {

void repeat_last(BodyTrack& track) {
  const auto modes = static_cast<std::ptrdiff_t>(track.model->modes());
  track.poses.push_back(track.poses.back());
  track.angular_velocities.push_back(Vec3::Zero());
  track.energies.push_back(track.energies.back());
  for (std::vector<double>* numbers : {&track.amplitudes, &track.rates}) {
    const std::vector<double> last(numbers->end() - modes, numbers->end());
    numbers->insert(numbers->end(), last.begin(), last.end());
  }
}

/// Blocks of so many numbers, the last one first.
void turn_blocks(std::vector<double>& numbers, std::size_t block) {
  std::reverse(numbers.begin(), numbers.end());
  for (std::size_t i = 0; block > 0 && i < numbers.size(); i += block)
    std::reverse(numbers.begin() + static_cast<std::ptrdiff_t>(i),
                 numbers.begin() + static_cast<std::ptrdiff_t>(i + block));
}

}  // namespace

void record_key(const World& world, std::span<const PageBody> bodies,
                std::span<const std::shared_ptr<const ModalModel>> kinds, std::vector<BodyTrack>& tracks) {
  for (std::size_t i = tracks.size(); i < bodies.size(); ++i) {
    tracks.emplace_back();
    tracks.back().name = bodies[i].name;
    tracks.back().model = kinds[static_cast<std::size_t>(bodies[i].model)];
    tracks.back().modal_skin = world.has_modal_skin(bodies[i].id);
  }
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const BodyView view = world.body(bodies[i].id);
    BodyTrack& track = tracks[i];
    track.poses.push_back(view.pose);
    track.angular_velocities.push_back(view.angular_velocity);
    track.amplitudes.insert(track.amplitudes.end(), view.amplitudes.begin(), view.amplitudes.end());
    track.rates.insert(track.rates.end(), view.rates.begin(), view.rates.end());
    track.energies.push_back(world.energy(bodies[i].id));
  }
  for (std::size_t i = bodies.size(); i < tracks.size(); ++i) repeat_last(tracks[i]);
}

void turn_round(BodyTrack& track) {
  std::reverse(track.poses.begin(), track.poses.end());
  std::reverse(track.angular_velocities.begin(), track.angular_velocities.end());
  std::reverse(track.energies.begin(), track.energies.end());
  for (std::vector<double>* numbers : {&track.amplitudes, &track.rates})
    turn_blocks(*numbers, static_cast<std::size_t>(track.model->modes()));
}

}  // namespace limber::internal
