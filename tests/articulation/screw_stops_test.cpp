// Screws that end at a collar or a head, of other sizes, hands and pitches than the drawn assemblies have.
#include <gtest/gtest.h>

#include <cmath>

#include "assemblies.h"
#include "assembly_builder.h"
#include "constants.h"
#include "grouped_parts.h"
#include "limber/articulation/range_of_motion.h"
#include "limber/jobs_tbb/tbb_jobs.h"
#include "shapes.h"

namespace limber {
namespace {

using assemblies::Builder;
using assemblies::MadeAssembly;
using assemblies::Variant;
using testing::kDegree;
using testing::kPi;

/// What a recipe draws, with each part's shells under its name.
MadeAssembly drawn(const Variant& variant, void (*recipe)(Builder&)) {
  Builder builder(variant);
  recipe(builder);
  MadeAssembly made;
  made.compound = true;
  for (const auto& part : builder.parts) {
    SurfaceMesh whole;
    for (const assemblies::Shell& shell : part.shells) shapes::append({shell.vertices, shell.triangles}, whole);
    append_group(whole, part.name, made.surface);
  }
  made.joints = builder.joints;
  Eigen::AlignedBox3d box;
  for (const Vec3& p : made.surface.surface.vertices) box.extend(p);
  made.diagonal = box.diagonal().norm();
  return made;
}

/// A nut on a right-handed thread between two discs.
void jack(Builder& b) {
  const double r = 0.02, depth = 0.004, pitch = 0.009 / (2 * kPi), end = 0.07, low = -0.011, high = 0.015;
  b.add("screw", assemblies::thread(r, depth, pitch, -end, end, b.n(), 0.0, false));
  for (const double side : {-1.0, 1.0}) {
    const double z = side * (end + 0.004), half = 0.006;
    b.add("screw", assemblies::lathe({{0, z - half}, {0.031, z - half}, {0.031, z + half}, {0, z + half}}, b.n()));
  }
  b.add("nut", assemblies::thread(r + b.gap(2 * r), depth, pitch, low, high, b.n(), b.v.phase, true, 0.034));
  b.truth("screw", "nut", JointType::kCylindrical, assemblies::at({0, 0, 0}), pitch);
  b.turns((-end + 0.002 - low) / pitch, (end - 0.002 - high) / pitch);
}

/// A nut that runs up against a bolt's head, which has six sides, and off the other end.
void headed_bolt(Builder& b) {
  const double r = 0.005, depth = 0.0013, pitch = 0.0015 / (2 * kPi), low = -0.018, high = -0.0105;
  b.add("bolt", assemblies::thread(r, depth, pitch, -0.03, 0.001, b.n(), 0.0, false));
  b.add("bolt", assemblies::lathe({{0, 0}, {0.009, 0}, {0.009, 0.006}, {0, 0.006}}, 6));
  b.add("nut", assemblies::thread(r + b.gap(2 * r), depth, pitch, low, high, b.n(), b.v.phase, true, 0.0092));
  b.truth("bolt", "nut", JointType::kCylindrical, assemblies::at({0, 0, 0}), pitch);
  b.turns(-assemblies::kOpen, -high / pitch);
}

/// About the true axis with the true pitch: what detection errs on these is up to 0.1 % of the way.
Interval range_about_true_axis(const MadeAssembly& made) {
  TbbJobs jobs;
  const Assembly assembly = find_components(made.surface, {.rule = ComponentRule::kGroups});
  auto joints = detect_joints(assembly, {.contact = {.samples = 1000}}, jobs);
  const auto& truth = made.joints.front();
  if (joints.size() != 1 || joints[0].joint.type != truth.type || joints[0].joint.pitch == 0.0) return {0.0, 0.0};
  const Vec3 across = truth.axis.unitOrthogonal();
  joints[0].joint.frame.origin = truth.origin;
  joints[0].joint.frame.axes << truth.axis, across, truth.axis.cross(across);
  joints[0].joint.pitch = truth.pitch;
  const Interval range = range_of_motion(assembly, joints, 0).joint.limits.rotation;
  return assembly.components[static_cast<std::size_t>(joints[0].b)].name == "nut" ? range
                                                                                  : Interval{-range.high, -range.low};
}

// Facets of the thread that overlap just before a stop, and the sliver at which a thread is cut off, belong to no stop.
TEST(RangeOfMotion, NutsStopWhereTheirFaceMeetsADiscOrAHead) {
  const Variant coarse{.segments = 16}, aligned{.segments = 16, .phase = 0.0};
  for (const MadeAssembly& made :
       {drawn(coarse, jack), drawn(aligned, headed_bolt), assemblies::make("spindle", coarse)}) {
    SCOPED_TRACE(made.joints.front().a);
    const Interval right = made.joints.front().ranges.front().range, found = range_about_true_axis(made);
    EXPECT_NEAR(found.high, right.high, 0.01 * kDegree);
    if (std::isfinite(right.low))
      EXPECT_NEAR(found.low, right.low, 0.01 * kDegree);
    else
      EXPECT_EQ(found.low, right.low);
  }
}

}  // namespace
}  // namespace limber
