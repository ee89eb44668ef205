// 13_a_robot_boxes: can a jointed doll box like the man whose motion was recorded?
//   bake:  make_assembly humanoid --out humanoid.obj
//   run:   13_a_robot_boxes humanoid.obj humanoid.joints.json /usr/share/assimp/models/BVH/Boxing_Toes.bvh
//   see:   four seconds of boxing in boxing.glb (any glTF viewer), and how near the doll comes: its arms are not as long as
//          the man's, and it has no waist and no wrists
//   next:  docs/formats/mapping.md, limber-pose --clip
#include <algorithm>
#include <cstdio>
#include <exception>
#include <fstream>

#include "limber/mesh_assimp/read_motion_clip.h"
#include "limber/posing/pose_recording.h"
#include "limber/posing/retarget.h"

int main(int argc, char** argv) try {
  limber::Warnings warnings;
  const char* model = argc > 1 ? argv[1] : "humanoid.obj";
  const char* joints = argc > 2 ? argv[2] : "humanoid.joints.json";
  const char* clip = argc > 3 ? argv[3] : "/usr/share/assimp/models/BVH/Boxing_Toes.bvh";
  limber::JointedModel doll =
      limber::jointed_model(limber::read_grouped_surface(model, warnings), limber::read_joints(joints), joints);
  // Its ball joints sit deep in their sockets: a boxer's shoulders need more than 16 degrees.
  for (limber::ModelJoint& joint : doll.joints) joint.joint.limits = {};

  limber::MappingFile mapping;
  mapping.end = 4.0;
  mapping.points = {{"Hips", "torso", {0.0, 0.0, 0.95}},
                    {"Neck", "torso", {0.0, 0.0, 1.4}},
                    {"LeftShoulder", "torso", {-0.12, 0.0, 1.36}},
                    {"RightShoulder", "torso", {0.12, 0.0, 1.36}},
                    {"Head", "head", {0.0, 0.0, 1.55}},
                    {"LeftElbow", "left arm", {-0.47, 0.0, 1.36}},
                    {"LeftWrist", "left forearm", {-0.75, 0.0, 1.408}},
                    {"RightElbow", "right arm", {0.47, 0.0, 1.36}},
                    {"RightWrist", "right forearm", {0.75, 0.0, 1.408}},
                    {"LeftKnee", "left thigh", {-0.08, 0.0, 0.53}},
                    {"LeftAnkle", "left shin", {-0.05, 0.0, 0.08}},
                    {"RightKnee", "right thigh", {0.08, 0.0, 0.53}},
                    {"RightAnkle", "right shin", {0.11, 0.0, 0.08}}};
  const limber::HandlesFile pulls = limber::retarget(limber::read_motion_clip(clip), mapping, "mapping");

  limber::PosingSession session(std::move(doll));
  const std::vector<limber::PoseHandle> handles = limber::apply_handles(pulls, "mapping", session);
  limber::PoseRecording recording(session);
  double worst_joint = 0.0, furthest = 0.0;
  for (const limber::HandlesFile::Frame& frame : pulls.frames) {
    for (const auto& [handle, target] : frame.targets) session.move_handle(handles[handle], target);
    const limber::PoseResult result = session.solve();
    worst_joint = std::max(worst_joint, result.joint_error);
    furthest = std::max(furthest, result.handle_error);
    recording.add(frame.time, session);
  }
  const std::string glb = recording.glb();
  std::ofstream("boxing.glb", std::ios::binary).write(glb.data(), static_cast<std::streamsize>(glb.size()));
  std::printf("%zu poses; joints off by %.0e at most, a point from where the man has it by %.3f\n", pulls.frames.size(),
              worst_joint, furthest);
  return worst_joint < 1e-9 ? 0 : 1;
} catch (const std::exception& e) {
  std::fprintf(stderr, "13_a_robot_boxes: %s\n", e.what());
  return 1;
}
