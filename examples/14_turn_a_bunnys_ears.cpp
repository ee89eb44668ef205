// 14_turn_a_bunnys_ears: can a model of one piece have joints?
//   run:   14_turn_a_bunnys_ears bunny.obj
//   see:   the ears of a soft bunny turn in joints that are drawn into it (virtual joints): both are pulled apart and back in
//          steps, ears.obj is the last pose; the feet, which are held, stay
//   next:  docs/posing.md
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <fstream>

#include "limber/core/disjoint_sets.h"
#include "limber/mesh/read_mesh.h"
#include "limber/mesh/write_mesh.h"
#include "limber/posing/posing_session.h"

namespace {

using limber::Index;
using limber::Vec3;

Vec3 middle_of(const limber::SurfaceMesh& mesh, std::size_t triangle) {
  Vec3 sum = Vec3::Zero();
  for (const Index v : mesh.triangles[triangle]) sum += mesh.vertices[static_cast<std::size_t>(v)];
  return sum / 3.0;
}

/// The body, and each piece of the surface that stands above a height, joined to it by a ball in the middle of the cut.
limber::JointedModel with_ears(limber::SurfaceMesh mesh, double height) {
  limber::JointedModel out;
  limber::DisjointSets sets(mesh.vertices.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if (middle_of(mesh, t).y() > height)
      for (const Index v : mesh.triangles[t]) sets.join(mesh.triangles[t][0], v);
  out.parts = {{"body", {}}, {"first ear", {}}, {"second ear", {}}};
  std::vector<Index> roots;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    std::size_t part = 0;
    if (middle_of(mesh, t).y() > height) {
      const Index root = sets.root(mesh.triangles[t][0]);
      auto found = std::find(roots.begin(), roots.end(), root);
      if (found == roots.end()) found = roots.insert(roots.end(), root);
      part = static_cast<std::size_t>(found - roots.begin()) + 1;
    }
    out.parts.at(part).triangles.push_back(static_cast<Index>(t));
  }
  for (const Index ear : {1, 2}) {
    Vec3 seam = Vec3::Zero(), all = Vec3::Zero();
    double at_seam = 0.0, count = 0.0;
    for (const Index t : out.parts[static_cast<std::size_t>(ear)].triangles)
      for (const Index v : mesh.triangles[static_cast<std::size_t>(t)]) {
        const Vec3& p = mesh.vertices[static_cast<std::size_t>(v)];
        all += p, count += 1.0;
        if (p.y() < height) seam += p, at_seam += 1.0;
      }
    limber::ModelJoint joint{.a = 0, .b = ear};
    joint.joint.type = limber::JointType::kBall;
    joint.joint.frame.origin = seam / at_seam;
    // Its x axis along the ear: what a ball tells as its coordinate is how far that axis has turned.
    joint.joint.frame.axes =
        Eigen::Quaterniond::FromTwoVectors(Vec3::UnitX(), all / count - seam / at_seam).toRotationMatrix();
    out.joints.push_back(joint);
  }
  out.surface = std::move(mesh);
  return out;
}

/// The vertex of a part that lies furthest along a direction.
Vec3 extreme(const limber::JointedModel& model, Index part, const Vec3& way) {
  Vec3 best = model.joints.front().joint.frame.origin;
  double most = -1e300;
  for (const Index t : model.parts[static_cast<std::size_t>(part)].triangles)
    for (const Index v : model.surface.triangles[static_cast<std::size_t>(t)])
      if (const Vec3& p = model.surface.vertices[static_cast<std::size_t>(v)]; p.dot(way) > most)
        most = p.dot(way), best = p;
  return best;
}

}  // namespace

int main(int argc, char** argv) try {
  limber::Warnings warnings;
  limber::SurfaceMesh mesh = limber::read_surface_mesh(argc > 1 ? argv[1] : "bunny.obj", warnings);
  Eigen::AlignedBox3d box;
  for (const Vec3& p : mesh.vertices) box.extend(p);
  const double size = box.diagonal().norm();
  limber::PosingSession bunny(with_ears(std::move(mesh), box.min().y() + 0.8 * box.sizes().y()), {.tolerance = 1e-4});
  for (Index part = 0; part < 3; ++part)
    bunny.set_part(part, {.cells = limber::Subdivision::kUniform, .cell_size = 0.05 * size});

  std::vector<std::pair<limber::PoseHandle, Vec3>> feet;
  for (const auto& [x, z] : {std::pair(-1, -1), std::pair(-1, 1), std::pair(1, -1), std::pair(1, 1)}) {
    const Vec3 foot = extreme(bunny.model(), 0, Vec3(x, -3, z));
    feet.emplace_back(bunny.add_handle(0, foot), foot);
  }
  // Each ear by its tip, the end away from its joint.
  std::vector<std::pair<limber::PoseHandle, Vec3>> tips;
  std::vector<Vec3> arms;
  for (const Index ear : {1, 2}) {
    const Vec3 root = bunny.model().joints[static_cast<std::size_t>(ear) - 1].joint.frame.origin;
    Vec3 tip = root;
    for (const Vec3& way : {Vec3(1, 0, 0), Vec3(-1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1), Vec3(0, 0, -1)})
      if (const Vec3 p = extreme(bunny.model(), ear, way); (p - root).norm() > (tip - root).norm()) tip = p;
    tips.emplace_back(bunny.add_handle(ear, tip), tip);
    arms.push_back(tip - root);
  }
  double worst = 0.0;
  for (int frame = 1; frame <= 12; ++frame) {
    const double angle = 1.0 * frame / 12.0;  // up, about the axis across an ear and the vertical
    for (std::size_t ear = 0; ear < 2; ++ear) {
      const Vec3 about = arms[ear].cross(Vec3::UnitY()).normalized();
      const Vec3 target =
          tips[ear].second - arms[ear] + limber::quaternion_from_rotation_vector(angle * about) * arms[ear];
      bunny.move_handle(tips[ear].first, target);
    }
    const limber::PoseResult result = bunny.solve();
    worst = std::max(worst, result.joint_error);
    double slip = 0.0;
    for (const auto& [handle, foot] : feet) slip = std::max(slip, (bunny.handle_point(handle) - foot).norm() / size);
    std::printf("%2d  %-15s %2d iterations, tips off by %.4f, feet by %.1e, ears turned by %.3f and %.3f\n", frame,
                limber::to_string(result.status).data(), result.iterations, result.handle_error / size, slip,
                bunny.joint(0).coordinates.front(), bunny.joint(1).coordinates.front());
  }
  std::vector<Vec3> positions(bunny.model().surface.vertices.size());
  bunny.reconstruct(positions);
  std::ofstream("ears.obj") << limber::obj_text({.vertices = positions, .triangles = bunny.model().surface.triangles});
  std::printf("%zu cells; joints off by %.0e at most\n", bunny.cells().size(), worst);
  return worst < 1e-9 ? 0 : 1;
} catch (const std::exception& e) {
  std::fprintf(stderr, "14_turn_a_bunnys_ears: %s\n", e.what());
  return 1;
}
