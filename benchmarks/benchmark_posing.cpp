// Poses at the sizes of [X09] Table 2: what an iteration costs, how many a drag takes, what the surface costs; the
// constrained form beside full Gauss–Newton on the paper's energies. Models are drawn ones and the bunny of
// glmark2-data, with cells chosen to be as many as the paper's, so that rows compare in size, not in shape.
// The bunny in the paper's form, some minutes, only if it is named. Tolerances: 1e-8 of the diagonal, and 1e-4, a tenth
// of a pixel, as for dragging.
//   benchmark_posing [--model NAME]
//   benchmark_posing --local-global [--model NAME]     local/global iterations beside, without limits,
//                                                    and drags with few iterations a frame
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <vector>

#include "assemblies.h"
#include "cpu_time.h"
#include "limber/mesh/read_mesh.h"
#include "limber/posing/posing_session.h"
#include "limber/posing_penalty/penalty_poses.h"
#include "local_global.h"
#include "true_joints.h"

namespace {

using limber::Index;
using limber::Vec3;

/// Time of this process, ms: the machine may be shared.
double now() { return 1e3 * limber::thread_seconds(); }

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

/// A model, which of its parts are soft with which cells, and where it is pulled.
struct Case {
  const char* name;
  limber::JointedModel model;
  Index pinned = 0, pulled = 0;  // pinned −1: held by handles at the corners of its lower side instead
  std::vector<Index> soft{};
  double cell = 0.0;
  const char* paper = "";  // solve and reconstruction there, ms
};

limber::JointedModel drawn(const std::string& name, int segments) {
  const auto made = limber::assemblies::make(name, {.segments = segments});
  return limber::jointed_model(made.surface, limber::assemblies::true_joints(made), name);
}

/// The bunny with its ears as parts: what lies above a plane and on either side of another, joined by balls.
limber::JointedModel bunny(const std::filesystem::path& path) {
  limber::Warnings warnings;
  limber::JointedModel out;
  out.surface = limber::read_surface_mesh(path, warnings);
  Eigen::AlignedBox3d box;
  for (const Vec3& p : out.surface.vertices) box.extend(p);
  const Vec3 size = box.sizes();
  const double ears = box.min().y() + 0.75 * size.y();
  out.parts = {{"body", {}}, {"ears", {}}};
  Vec3 seam = Vec3::Zero();
  double count = 0.0;
  for (std::size_t t = 0; t < out.surface.triangles.size(); ++t) {
    Vec3 middle = Vec3::Zero();
    for (const Index v : out.surface.triangles[t]) middle += out.surface.vertices[static_cast<std::size_t>(v)] / 3.0;
    const bool ear = middle.y() > ears;
    out.parts[ear ? 1 : 0].triangles.push_back(static_cast<Index>(t));
    if (std::abs(middle.y() - ears) < 0.01 * size.y()) seam += middle, count += 1.0;
  }
  limber::ModelJoint joint{.a = 0, .b = 1};
  joint.joint.type = limber::JointType::kBall;
  joint.joint.frame.origin = seam / count;
  out.joints.push_back(joint);
  return out;
}

Vec3 furthest(const limber::JointedModel& model, Index part) {
  Eigen::AlignedBox3d box;
  for (const Vec3& p : model.surface.vertices) box.extend(p);
  Vec3 best = box.center();
  for (const Index t : model.parts[static_cast<std::size_t>(part)].triangles)
    for (const Index v : model.surface.triangles[static_cast<std::size_t>(t)])
      if (const Vec3& p = model.surface.vertices[static_cast<std::size_t>(v)];
          (p - box.center()).norm() > (best - box.center()).norm())
        best = p;
  return best;
}

/// The vertex of a part that lies furthest along a direction.
Vec3 extreme(const limber::JointedModel& model, Index part, const Vec3& way) {
  Vec3 best = model.surface.vertices.front();
  double most = -1e300;
  for (const Index t : model.parts[static_cast<std::size_t>(part)].triangles)
    for (const Index v : model.surface.triangles[static_cast<std::size_t>(t)])
      if (const Vec3& p = model.surface.vertices[static_cast<std::size_t>(v)]; p.dot(way) > most)
        most = p.dot(way), best = p;
  return best;
}

void run(const Case& c, bool paper, double tolerance) {
  limber::PosingSession session(c.model, {.tolerance = tolerance, .starts = 0},
                                paper ? limber::penalty_poses() : nullptr);
  for (const Index p : c.soft) session.set_part(p, {.cells = limber::Subdivision::kUniform, .cell_size = c.cell});
  if (c.pinned >= 0) session.set_pinned(c.pinned, true);
  const Vec3 grip = furthest(c.model, c.pulled);
  Eigen::AlignedBox3d box;
  for (const Vec3& p : c.model.surface.vertices) box.extend(p);
  const double size = box.diagonal().norm();
  if (c.pinned < 0)
    for (const auto& [x, z] : {std::pair(-1, -1), std::pair(-1, 1), std::pair(1, -1), std::pair(1, 1)})
      session.add_handle(0, extreme(c.model, 0, Vec3(x, -3, z)));
  const limber::PoseHandle hand = session.add_handle(c.pulled, grip);
  const int frames = paper ? 3 : 10;
  std::vector<double> per_iteration, per_frame, surface;
  int iterations = 0;
  std::vector<Vec3> positions(c.model.surface.vertices.size()), normals(positions.size());
  for (int f = 1; f <= frames; ++f) {
    session.move_handle(hand, grip + 0.005 * f * size * Vec3(0.3, 0.5, -0.8));
    const double start = now();
    const limber::PoseResult r = session.solve();
    const double solved = now();
    session.reconstruct(positions);
    surface.push_back(now() - solved);
    per_frame.push_back(solved - start);
    per_iteration.push_back((solved - start) / r.iterations);
    iterations += r.iterations;
  }
  std::printf(
      "%-9s %-11s to %.0e %6zu cells %6zu vertices  iteration %8.3f ms  %5.1f iterations  frame %8.2f ms  surface "
      "%6.3f "
      "ms  paper %s\n",
      c.name, paper ? "penalty" : "constrained", tolerance, session.cells().size(), positions.size(),
      median(per_iteration), static_cast<double>(iterations) / frames, median(per_frame), median(surface), c.paper);
}

/// Places of the drag's hand, frame by frame.
struct Drag {
  std::vector<std::pair<Index, Vec3>> grips{};  // part, point at rest; the last is the hand
  std::vector<Vec3> targets{};                  // of the hand
};

Drag drag_of(const Case& c, int frames) {
  Drag out;
  Eigen::AlignedBox3d box;
  for (const Vec3& p : c.model.surface.vertices) box.extend(p);
  if (c.pinned < 0)
    for (const auto& [x, z] : {std::pair(-1, -1), std::pair(-1, 1), std::pair(1, -1), std::pair(1, 1)})
      out.grips.emplace_back(0, extreme(c.model, 0, Vec3(x, -3, z)));
  const Vec3 grip = furthest(c.model, c.pulled);
  out.grips.emplace_back(c.pulled, grip);
  for (int f = 1; f <= frames; ++f)
    out.targets.push_back(grip + 0.005 * f * box.diagonal().norm() * Vec3(0.3, 0.5, -0.8));
  return out;
}

void without_limits(limber::JointedModel& model) {
  for (limber::ModelJoint& j : model.joints) j.joint.limits = {};
}

limber::PosingSession session_of(const Case& c, const Drag& drag, const limber::PosingOptions& options,
                                 std::vector<limber::PoseHandle>& handles) {
  limber::PosingSession session(c.model, options);
  for (const Index p : c.soft) session.set_part(p, {.cells = limber::Subdivision::kUniform, .cell_size = c.cell});
  if (c.pinned >= 0) session.set_pinned(c.pinned, true);
  for (const auto& [part, point] : drag.grips) handles.push_back(session.add_handle(part, point));
  return session;
}

/// Iterations and time of each frame until all but 1e-6 of the energy that it begins with, less the least, is gone, for
/// the constrained form and for local/global iterations.
void compare(Case c) {
  using namespace limber::internal;
  constexpr int kFrames = 5, kMost = 2000;
  constexpr double kAsked = 1e-6;
  without_limits(c.model);
  const Drag drag = drag_of(c, kFrames);
  std::vector<limber::PoseHandle> handles, exact_handles;
  limber::PosingSession session = session_of(c, drag, {.tolerance = 1e-12, .energy_tolerance = kAsked}, handles),
                        exact = session_of(c, drag, {.tolerance = 1e-12, .energy_tolerance = 0.0}, exact_handles);
  std::vector<double> least, initial;
  int iterations = 0;
  double newton = 0.0, newton_off = 0.0;
  for (const Vec3& target : drag.targets) {
    exact.move_handle(exact_handles.back(), target);
    const limber::PoseResult to = exact.solve();
    least.push_back(to.energy), initial.push_back(to.initial_energy);
    session.move_handle(handles.back(), target);
    const double start = now();
    const limber::PoseResult r = session.solve();
    newton += now() - start;
    iterations += r.iterations;
    newton_off = std::max(newton_off, (r.energy - to.energy) / (to.initial_energy - to.energy));
  }
  std::printf("%-9s newton                  %7.1f iterations %9.2f ms a frame; energy off by %.0e\n", c.name,
              static_cast<double>(iterations) / kFrames, newton / kFrames, newton_off);
  std::vector<limber::PartOptions> parts(c.model.parts.size());
  std::vector<bool> pinned(c.model.parts.size(), false);
  for (const Index p : c.soft)
    parts[static_cast<std::size_t>(p)] = {.cells = limber::Subdivision::kUniform, .cell_size = c.cell};
  if (c.pinned >= 0) pinned[static_cast<std::size_t>(c.pinned)] = true;
  const PoseStructure s = build_structure(c.model, parts, pinned, limber::StrainWeights::kVolume);
  std::vector<HandleTerm> terms;
  for (const auto& [part, point] : drag.grips) {
    const Index body = cell_nearest(s, part, point).body;
    terms.push_back({body, point - s.bodies[static_cast<std::size_t>(body)].centre, point, 10.0 * s.size});
  }
  for (const double stiffness : {0.01, 0.03, 0.1, 0.3, 1.0}) {
    limber::benchmarks::LocalGlobal method(s, terms, stiffness);
    int all = 0;
    double spent = 0.0, off = 0.0, joints = 0.0, last = 0.0;
    for (int f = 0; f < kFrames; ++f) {
      method.set_target(terms.size() - 1, drag.targets[static_cast<std::size_t>(f)]);
      terms.back().target = drag.targets[static_cast<std::size_t>(f)];
      last = 0.0;
      for (int i = 0; i < kMost; ++i) {
        const double start = now();
        method.iterate();
        last += now() - start;
        ++all;
        const Pose pose{method.poses(), std::vector<double>(s.joints.size(), 0.0)};
        const std::vector<limber::Mat3> R = rotations_of(pose.bodies);
        const double e = least[static_cast<std::size_t>(f)];
        off = std::abs(strain_energy(s, pose.bodies, R) + handle_energy(terms, pose.bodies, R) - e) /
              (initial[static_cast<std::size_t>(f)] - e);
        joints = feasibility(s, pose).joints;
        if (off <= kAsked && joints <= kAsked) break;
      }
      spent += last;
    }
    std::printf(
        "%-9s local/global, rho %5.3f %7.1f iterations %9.2f ms a frame, %.3f an iteration; energy off by %.0e, "
        "joints by %.0e\n",
        c.name, stiffness, static_cast<double>(all) / kFrames, spent / kFrames, spent / all, off, joints);
  }
}

/// A drag whose frames have so many iterations and no more: their times, and how far vertices are from the pose sought.
void keep_time(const Case& c, int budget) {
  constexpr int kFrames = 40;
  const Drag drag = drag_of(c, kFrames);
  std::vector<limber::PoseHandle> handles, exact_handles;
  limber::PosingSession session = session_of(c, drag, {.energy_tolerance = 1e-6, .max_iterations = budget}, handles),
                        exact = session_of(c, drag, {.energy_tolerance = 1e-7}, exact_handles);
  std::vector<double> times;
  std::vector<Vec3> positions(c.model.surface.vertices.size()), sought(positions.size()), normals(positions.size());
  Eigen::AlignedBox3d box;
  for (const Vec3& p : c.model.surface.vertices) box.extend(p);
  double behind = 0.0, surface = 0.0;
  for (const Vec3& target : drag.targets) {
    session.move_handle(handles.back(), target);
    const double start = now();
    session.solve();
    times.push_back(now() - start);
    session.reconstruct(positions, normals);
    surface += now() - start - times.back();
    exact.move_handle(exact_handles.back(), target);
    exact.solve();
    exact.reconstruct(sought);
    for (std::size_t v = 0; v < positions.size(); ++v)
      behind = std::max(behind, (positions[v] - sought[v]).norm() / box.diagonal().norm());
  }
  times.erase(times.begin());
  const double late = static_cast<double>(std::count_if(times.begin(), times.end(), [](double t) { return t > 16.7; }));
  std::printf(
      "%-9s %d iterations a frame: median %.1f ms, longest but the first %.1f ms, %.0f of %zu over 16.7 ms; surface "
      "with normals %.2f ms; vertices behind by %.1e of the size at most\n",
      c.name, budget, median(times), *std::max_element(times.begin(), times.end()), late, times.size(),
      surface / kFrames, behind);
}

}  // namespace

int main(int argc, char** argv) {
  const bool beside = argc > 1 && std::strcmp(argv[1], "--local-global") == 0;
  if (beside) --argc, ++argv;
  const char* only = argc == 3 && std::strcmp(argv[1], "--model") == 0 ? argv[2] : nullptr;
  std::vector<Case> cases;
  const auto wanted = [&](const char* name) { return only == nullptr || std::strcmp(only, name) == 0; };
  if (wanted("lamp")) cases.push_back({"lamp", drawn("lamp", 128), 0, 4, {2, 3}, 0.025, "3.42, 10.40"});
  if (wanted("humanoid"))
    cases.push_back({"humanoid", drawn("humanoid", 64), 0, 9, {2, 3, 4, 5, 6, 7, 8, 9}, 0.035, "29.58, 13.20"});
  const std::filesystem::path rabbit = "/usr/share/glmark2/models/bunny.obj";
  if (wanted("bunny") && std::filesystem::exists(rabbit)) {
    Case c{"bunny", bunny(rabbit), -1, 1, {0, 1}, 0.0, "103.09, 35.74"};
    Eigen::AlignedBox3d box;
    for (const Vec3& p : c.model.surface.vertices) box.extend(p);
    c.cell = 0.0335 * box.diagonal().norm();
    cases.push_back(std::move(c));
  }
  for (const Case& c : cases) {
    if (beside) {
      compare(c);
      for (const int budget : {1, 2, 3}) keep_time(c, budget);
      continue;
    }
    for (const double tolerance : {1e-8, 1e-4}) run(c, false, tolerance);
    if (only != nullptr || std::strcmp(c.name, "bunny") != 0) run(c, true, 1e-8);
  }
}
