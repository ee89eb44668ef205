#include "limber/articulation/detect_joints.h"

#include <algorithm>
#include <cmath>

#include "limber/core/error.h"
#include "number_text.h"
#include "tuning.h"
#include "types/common_line.h"
#include "types/mechanism.h"
#include "types/other_hypotheses.h"

namespace limber {
namespace {

using internal::Bend;
using internal::PairOfParts;

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

/// The line along a flat contact's normal about which surfaces of both parts near it turn into themselves.
void look_for_line(const Assembly& assembly, const std::vector<std::vector<Bend>>& bends, PairOfParts& pair) {
  const JointHypothesis& first = pair.slippage.hypotheses.front();
  const auto a = static_cast<std::size_t>(pair.a()), b = static_cast<std::size_t>(pair.b());
  const double size = std::min(assembly.components[a].diagonal, assembly.components[b].diagonal);
  const auto point = internal::common_line(bends[a], bends[b], first.joint.frame.axes.col(2), first.joint.frame.origin,
                                           internal::tuning().types.line.near * size);
  if (point) internal::add_hypothesis_of_line(*point, pair.slippage);
}

/// Bends of the components that a flat contact asks for; of the others none.
std::vector<std::vector<Bend>> bends_at_flat_contacts(const Assembly& assembly, const std::vector<PairOfParts>& pairs,
                                                      double crease_angle, Jobs& jobs) {
  std::vector<bool> asked(assembly.components.size(), false);
  for (const PairOfParts& pair : pairs)
    if (pair.is_flat()) asked[static_cast<std::size_t>(pair.a())] = asked[static_cast<std::size_t>(pair.b())] = true;
  std::vector<std::vector<Bend>> out(asked.size());
  jobs.parallel_for(out.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t c = begin; c < end; ++c)
      if (asked[c]) out[c] = internal::bends_of(assembly.components[c].surface, crease_angle);
  });
  return out;
}

/// Hypotheses of all pairs: of each contact, then with what is around it, then of all together.
void analyse(const Assembly& assembly, const DetectionOptions& options, Jobs& jobs, std::vector<PairOfParts>& pairs) {
  jobs.parallel_for(pairs.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) pairs[i].slippage = analyse_slippage(pairs[i].regions, options.slippage);
  });
  if (options.slippage.method == SlippageMethod::kFixedRatio) return;
  const auto bends = bends_at_flat_contacts(assembly, pairs, options.contact.crease_angle, jobs);
  jobs.parallel_for(pairs.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      if (pairs[i].is_flat()) look_for_line(assembly, bends, pairs[i]);
  });
  internal::explain_flanges(assembly, pairs);
}

DetectedJoint joint_of(const PairOfParts& pair) {
  const std::vector<JointHypothesis>& hypotheses = pair.slippage.hypotheses;
  DetectedJoint out;
  out.a = pair.a(), out.b = pair.b();
  out.joint = hypotheses.front().joint;
  out.confidence = hypotheses.front().confidence;
  out.reasons = {contact_in_words(pair.regions), hypotheses.front().reason};
  for (std::size_t i = 1; i < hypotheses.size(); ++i)
    if (i == 1 || hypotheses[i].confidence > internal::tuning().types.others.worth_telling)
      out.other_hypotheses.push_back(hypotheses[i]);
  out.contact_points = points_of(pair.regions);
  out.influence = box_around(out.contact_points, out.joint.frame.axes);
  for (const ContactRegion& r : pair.regions) out.gap = std::max(out.gap, r.gap);
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
  std::vector<PairOfParts> pairs;
  for (ContactRegion& region : regions) {
    if (pairs.empty() || pairs.back().a() != region.a || pairs.back().b() != region.b) pairs.emplace_back();
    pairs.back().regions.push_back(std::move(region));
  }
  tell(kContactsShare, "joints");
  analyse(assembly, options, jobs, pairs);
  std::vector<DetectedJoint> joints(pairs.size());
  jobs.parallel_for(pairs.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) joints[i] = joint_of(pairs[i]);
  });
  std::erase_if(joints, [&](const DetectedJoint& j) { return j.confidence < options.min_confidence; });
  tell(1.0, "done");
  return joints;
}

}  // namespace limber
