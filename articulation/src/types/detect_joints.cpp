#include "limber/articulation/detect_joints.h"

#include <algorithm>
#include <cmath>

#include "limber/core/error.h"
#include "number_text.h"
#include "tuning.h"

namespace limber {
namespace {

/// Contacts' share of the time, as progress tells it.
constexpr double kContactsShare = 0.9;

std::vector<Vec3> points_of(const std::vector<ContactRegion>& regions) {
  std::vector<Vec3> points;
  for (const ContactRegion& region : regions)
    for (const auto* side : {&region.on_a, &region.on_b})
      for (const ContactSample& s : *side) points.push_back(s.point);
  return points;
}

OrientedBox box_around(const std::vector<Vec3>& points, const Mat3& axes) {
  Eigen::AlignedBox3d box;
  for (const Vec3& p : points) box.extend(Vec3(axes.transpose() * p));
  return {{axes * box.center(), axes}, box.sizes() / 2.0};
}

/// Surfaces that curve away from each other touch at a point or a line and hold nothing: their normals disagree over
/// what is near. Spheres and planes that lie in each other differ by noise alone.
bool conforms(const ContactRegion& region) {
  return region.normal_spread < internal::tuning().contacts.left_out.most_spread;
}

std::string contact_in_words(const std::vector<ContactRegion>& regions) {
  std::size_t samples = 0;
  double gap = 0.0;
  for (const ContactRegion& r : regions) samples += r.on_a.size() + r.on_b.size(), gap = std::max(gap, r.gap);
  return "the surfaces face each other at " + std::to_string(samples) + " samples, median gap " +
         internal::number_text(gap, 3);
}

DetectedJoint joint_of(const std::vector<ContactRegion>& regions, const SlippageOptions& options) {
  const Slippage slippage = analyse_slippage(regions, options);
  DetectedJoint out;
  out.a = regions.front().a, out.b = regions.front().b;
  out.joint = slippage.hypotheses.front().joint;
  out.confidence = slippage.hypotheses.front().confidence;
  out.reasons = {contact_in_words(regions), slippage.hypotheses.front().reason};
  for (std::size_t i = 1; i < slippage.hypotheses.size(); ++i)
    if (i == 1 || slippage.hypotheses[i].confidence > internal::tuning().types.others.worth_telling)
      out.other_hypotheses.push_back(slippage.hypotheses[i]);
  out.contact_points = points_of(regions);
  out.influence = box_around(out.contact_points, out.joint.frame.axes);
  for (const ContactRegion& r : regions) out.gap = std::max(out.gap, r.gap);
  return out;
}

}  // namespace

void DetectionOptions::validate() const {
  contact.validate();
  slippage.validate();
  if (!(min_confidence >= 0.0 && min_confidence <= 1.0))
    throw InvalidArgument("DetectionOptions: min_confidence is " + std::to_string(min_confidence) +
                          ", expected 0 to 1");
}

std::vector<DetectedJoint> detect_joints(const Assembly& assembly, const DetectionOptions& options, Jobs& jobs) {
  options.validate();
  const auto tell = [&](double part, std::string_view what) {
    if (options.progress) options.progress(part, what);
  };
  tell(0.0, "contacts");
  auto regions = find_contact_regions(assembly, options.contact, jobs,
                                      [&](double part) { tell(kContactsShare * part, "contacts"); });
  std::erase_if(regions, [](const ContactRegion& r) { return !conforms(r); });
  std::vector<std::vector<ContactRegion>> by_pair;
  for (ContactRegion& region : regions) {
    if (by_pair.empty() || by_pair.back().front().a != region.a || by_pair.back().front().b != region.b)
      by_pair.emplace_back();
    by_pair.back().push_back(std::move(region));
  }
  tell(kContactsShare, "joints");
  std::vector<DetectedJoint> joints(by_pair.size());
  jobs.parallel_for(by_pair.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) joints[i] = joint_of(by_pair[i], options.slippage);
  });
  std::erase_if(joints, [&](const DetectedJoint& j) { return j.confidence < options.min_confidence; });
  tell(1.0, "done");
  return joints;
}

}  // namespace limber
