// The tuning sheet, and the one crease angle that reaches contacts and ranges.
#include "tuning.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "limber/articulation/contact_region.h"
#include "limber/articulation/range_of_motion.h"
#include "limber/core/error.h"
#include "ranges/orbit_faces.h"
#include "scoped_value.h"
#include "shapes.h"

namespace limber::internal {
namespace {

TEST(Tuning, IsReplacedForAsLongAsAScopeLasts) {
  const double usual = tuning().types.others.stop_share;
  {
    Tuning other = tuning();
    other.types.others.stop_share = 0.5 * usual;
    const testing::ScopedValue scoped(tuning_in_use, other);
    EXPECT_EQ(tuning().types.others.stop_share, 0.5 * usual);
  }
  EXPECT_EQ(tuning().types.others.stop_share, usual);
}

TEST(CreaseAngle, IsTheSameForContactsAndRanges) {
  EXPECT_EQ(ContactRegionOptions{}.crease_angle, FreeMotionOptions{}.crease_angle);
  FreeMotionOptions wrong;
  wrong.crease_angle = 4.0;
  EXPECT_THROW(wrong.validate(), InvalidArgument);
}

/// How many faces of two boxes are stops for a slide of the first towards the second.
std::ptrdiff_t stops(double crease) {
  const SurfaceMesh moving = shapes::box(Vec3::Zero(), Vec3::Ones()), fixed = shapes::box({2, 0, 0}, {3, 1, 1});
  const std::vector<OrbitBody> a{orbit_body({&moving})}, b{orbit_body({&fixed})};
  const PathFrame frame({.kind = MotionPath::Kind::kTranslation});
  const auto sides = faces_that_meet(frame, a, b, 0.0, crease);
  return std::count_if(sides.first.begin(), sides.first.end(), [](const OrbitFace& f) { return f.one_sided; });
}

// A cube's face that looks along the motion stands against it: four triangles on two sides. Where the crease angle is
// above a right angle, the faces that slide continue it, and nothing tells it from a facet that slides.
TEST(CreaseAngle, TellsWhatContinuesAFaceThatStopsAMotion) {
  EXPECT_EQ(stops(kDefaultCreaseAngle), 4);
  EXPECT_EQ(stops(1.6), 0);
}

}  // namespace
}  // namespace limber::internal
