// 12_pose_a_lamp: what does a desk lamp do when its shade is pulled?
//   bake:  make_assembly lamp --out lamp.obj
//   run:   12_pose_a_lamp lamp.obj lamp.joints.json
//   see:   ten frames of a drag: iterations, how far the shade is from the hand, the joints' angles; the last frames
//          stretch the soft arm and still settle when their iterations are over, and nothing comes apart
//   next:  docs/posing.md
#include <cmath>
#include <cstdio>
#include <exception>

#include "limber/posing/posing_session.h"

int main(int argc, char** argv) try {
  limber::Warnings warnings;
  const char* model = argc > 1 ? argv[1] : "lamp.obj";
  const char* joints = argc > 2 ? argv[2] : "lamp.joints.json";
  limber::PosingSession lamp(
      limber::jointed_model(limber::read_grouped_surface(model, warnings), limber::read_joints(joints), joints));
  const limber::Index base = lamp.model().part_named("base"), shade = lamp.model().part_named("shade");
  lamp.set_pinned(base, true);
  lamp.set_part(lamp.model().part_named("arm 2"), {.cells = limber::Subdivision::kUniform, .cell_size = 0.02});

  // The first vertex of the shade is gripped, and pulled 0.05 further in each frame.
  const limber::Index triangle = lamp.model().parts[static_cast<std::size_t>(shade)].triangles.front();
  const auto vertex = static_cast<std::size_t>(lamp.model().surface.triangles[static_cast<std::size_t>(triangle)][0]);
  const limber::Vec3 grip = lamp.model().surface.vertices[vertex];
  const limber::PoseHandle hand = lamp.add_handle(shade, grip);
  double worst = 0.0;
  for (int frame = 1; frame <= 10; ++frame) {
    lamp.move_handle(hand, grip + 0.05 * frame * limber::Vec3(0.8, 0.2, 0.56));
    const limber::PoseResult result = lamp.solve();
    worst = std::max({worst, result.joint_error, result.limit_violation});
    std::printf("%2d  %-15s %3d iterations, hand off by %.4f, angles", frame, limber::to_string(result.status).data(),
                result.iterations, result.handle_error);
    for (limber::Index j = 0; j < static_cast<limber::Index>(lamp.model().joints.size()); ++j)
      std::printf(" %6.3f", lamp.joint(j).coordinates.front());
    std::printf("\n");
  }
  std::printf("joints and limits off by %.0e at most\n", worst);
  return worst < 1e-9 ? 0 : 1;
} catch (const std::exception& e) {
  std::fprintf(stderr, "12_pose_a_lamp: %s\n", e.what());
  return 1;
}
