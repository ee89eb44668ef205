// Contacts by the hulls of convex pieces, the paper's way.
#include <gtest/gtest.h>

#include <cmath>

#include "assemblies.h"
#include "grouped_parts.h"
#include "joint_scores.h"
#include "limber/core/error.h"
#include "limber/jobs_tbb/tbb_jobs.h"
#include "shapes.h"

namespace limber {
namespace {

DetectionOptions by_hulls() {
  DetectionOptions options;
  options.contact.method = ContactSearch::kHulls;
  options.contact.samples = 1500;
  return options;
}

// A hinge with its flanges, a drawer on its rails, a ball in its socket, parts that are stuck together.
TEST(HullContacts, SimpleAssembliesAreReadRight) {
  TbbJobs jobs;
  for (const char* name : {"lamp", "drawer", "hitch", "welded pair"}) {
    const auto score = assemblies::scored(assemblies::make(name, {.clearance = 0.005}), by_hulls(), jobs);
    for (const auto& joint : score.joints) {
      EXPECT_TRUE(joint.right()) << name << ", " << joint.name << ": " << joint.reason;
      EXPECT_LT(joint.axis_error, 0.1) << name << ", " << joint.name;
      EXPECT_LT(joint.origin_error, 1e-3) << name << ", " << joint.name;
    }
    EXPECT_TRUE(score.extra.empty()) << name;
  }
}

// Faces far apart are no contact, however much of them there is: hulls that do not reach each other hold nothing.
TEST(HullContacts, ReachNoFurtherThanTheyAreGrown) {
  ContactRegionOptions options = by_hulls().contact;
  const double gap = 0.02 * std::sqrt(3.0);  // 2 % of the diagonal
  GroupedSurface boxes;
  append_group(shapes::box({0, 0, 0}, {1, 1, 1}), "lower", boxes);
  append_group(shapes::box({0, 0, 1 + gap}, {1, 1, 2 + gap}), "upper", boxes);
  const Assembly assembly = find_components(boxes);
  options.hull_growth = 0.019;
  EXPECT_TRUE(find_contact_regions(assembly, options).empty());
  options.hull_growth = 0.021;
  const auto found = find_contact_regions(assembly, options);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NEAR(found[0].gap, gap, 1e-9);
}

TEST(HullContacts, WrongArgumentsAreRefused) {
  DetectionOptions options = by_hulls();
  options.contact.hull_growth = 0.5;  // beyond `search`
  EXPECT_THROW(options.validate(), InvalidArgument);
  options.contact.hull_growth = 0.01, options.contact.concavity = 0.0;
  EXPECT_THROW(options.validate(), InvalidArgument);
}

}  // namespace
}  // namespace limber
