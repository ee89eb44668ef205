// 18_pose_by_penalties: how do the paper's weighted energies pose the lamp that constraints pose exactly?
//   bake:  make_assembly lamp --out lamp.obj
//   run:   18_pose_by_penalties lamp.obj lamp.joints.json
//   see:   one drag of the shade, within its reach, by either form: both bring it there, penalties with fifty times as many
//          iterations
//   next:  docs/papers.md
#include <cstdio>
#include <exception>
#include <memory>

#include "limber/posing/posing_session.h"
#include "limber/posing_penalty/penalty_poses.h"

namespace {

void drag(const char* name, const limber::JointedModel& model, std::shared_ptr<const limber::PoseMethod> method) {
  limber::PosingSession lamp(model, {.max_iterations = 3000}, std::move(method));
  const limber::Index shade = model.part_named("shade");
  lamp.set_pinned(model.part_named("base"), true);
  const limber::Index triangle = model.parts[static_cast<std::size_t>(shade)].triangles.front();
  const auto vertex = static_cast<std::size_t>(model.surface.triangles[static_cast<std::size_t>(triangle)][0]);
  const limber::Vec3 grip = model.surface.vertices[vertex];
  const limber::PoseHandle hand = lamp.add_handle(shade, grip);
  lamp.move_handle(hand, grip + 0.05 * limber::Vec3(0.8, 0.2, 0.56));
  const limber::PoseResult r = lamp.solve();
  std::printf("%-11s %-15s %4d iterations, hand off by %.1e, joints by %.1e\n", name,
              limber::to_string(r.status).data(), r.iterations, r.handle_error, r.joint_error);
}

}  // namespace

int main(int argc, char** argv) try {
  limber::Warnings warnings;
  const char* surface = argc > 1 ? argv[1] : "lamp.obj";
  const char* joints = argc > 2 ? argv[2] : "lamp.joints.json";
  const limber::JointedModel model =
      limber::jointed_model(limber::read_grouped_surface(surface, warnings), limber::read_joints(joints), joints);
  drag("constraints", model, nullptr);
  drag("penalties", model, limber::penalty_poses());
} catch (const std::exception& e) {
  std::fprintf(stderr, "18_pose_by_penalties: %s\n", e.what());
  return 1;
}
