#include "page_motion.h"

namespace limber::internal {

std::vector<BodyMotion> motions(const World& world, std::span<const PageBody> bodies) {
  std::vector<BodyMotion> out;
  for (const PageBody& body : bodies) {
    const BodyView view = world.body(body.id);
    out.push_back({view.pose,
                   view.velocity,
                   view.angular_velocity,
                   {view.amplitudes.begin(), view.amplitudes.end()},
                   {view.rates.begin(), view.rates.end()}});
  }
  return out;
}

void set_motions(std::span<const BodyMotion> motions, std::span<const PageBody> bodies, World& world) {
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const BodyId id = bodies[i].id;
    const BodyMotion& motion = motions[i];
    world.set_pose(id, motion.pose);
    world.set_velocity(id, motion.velocity, motion.angular_velocity);
    if (motion.amplitudes.size() == world.body(id).amplitudes.size())
      world.set_amplitudes(id, motion.amplitudes, motion.rates);
  }
}

}  // namespace limber::internal
