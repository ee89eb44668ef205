#include "live_tracks.h"

#include <utility>

namespace limber::internal {
namespace {

void add_state(const World& world, BodyId id, BodyTrack& track) {
  const BodyView view = world.body(id);
  track.poses.push_back(view.pose);
  track.angular_velocities.push_back(view.angular_velocity);
  track.amplitudes.insert(track.amplitudes.end(), view.amplitudes.begin(), view.amplitudes.end());
  track.rates.insert(track.rates.end(), view.rates.begin(), view.rates.end());
  track.energies.push_back(world.energy(id));
}

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

}  // namespace

void record_key(const World& world, std::span<const LiveScene::Body> bodies,
                std::span<const std::shared_ptr<const ModalModel>> kinds, Trajectory& recorded) {
  const std::size_t keys = recorded.times.size();
  for (std::size_t i = recorded.bodies.size(); i < bodies.size(); ++i) {
    BodyTrack track;
    track.name = bodies[i].name;
    track.model = kinds[bodies[i].model];
    track.modal_skin = world.has_modal_skin(bodies[i].id);
    recorded.bodies.push_back(std::move(track));
    if (keys > 1) add_state(world, bodies[i].id, recorded.bodies.back());
    while (recorded.bodies.back().poses.size() + 1 < keys) repeat_last(recorded.bodies.back());
  }
  for (std::size_t i = 0; i < recorded.bodies.size(); ++i)
    if (i < bodies.size())
      add_state(world, bodies[i].id, recorded.bodies[i]);
    else
      repeat_last(recorded.bodies[i]);
}

}  // namespace limber::internal
