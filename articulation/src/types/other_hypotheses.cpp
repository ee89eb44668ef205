#include "types/other_hypotheses.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <string>
#include <utility>

#include "tuning.h"

namespace limber::internal {
namespace {

/// The middle of a flat contact whose outline is a circle, as far as facets and samples tell.
std::optional<Vec3> middle_of_round_face(const std::vector<ContactRegion>& regions, const JointFrame& plane) {
  const TypesTuning& t = tuning().types;
  using Plane = Eigen::Vector2d;
  std::vector<std::pair<Plane, double>> points;  // with area
  for (const ContactRegion& r : regions)
    for (const auto* side : {&r.on_a, &r.on_b})
      for (const ContactSample& s : *side)
        points.emplace_back((plane.axes.transpose() * (s.point - plane.origin)).head<2>(), s.area);
  Plane middle = Plane::Zero();
  double area = 0.0;
  for (const auto& [p, weight] : points) middle += weight * p, area += weight;
  if (!(area > 0.0)) return std::nullopt;
  middle /= area;
  Eigen::Matrix2d moments = Eigen::Matrix2d::Zero();
  std::vector<double> outline(t.others.round_sectors, 0.0);
  const auto sectors = static_cast<double>(t.others.round_sectors);
  for (const auto& [p, weight] : points) {
    const Plane d = p - middle;
    moments += weight * d * d.transpose();
    const double turn = 0.5 + 0.5 * std::atan2(d.y(), d.x()) / std::numbers::pi;
    double& radius = outline[std::min(static_cast<std::size_t>(turn * sectors), outline.size() - 1)];
    radius = std::max(radius, d.norm());
  }
  const Eigen::Vector2d along =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>().computeDirect(moments, Eigen::EigenvaluesOnly).eigenvalues();
  const auto [least, most] = std::minmax_element(outline.begin(), outline.end());
  if (along[1] - along[0] > t.others.round_moments * (along[1] + along[0]) || *least < t.others.round_radii * *most)
    return std::nullopt;
  return plane.origin + plane.axes.leftCols<2>() * middle;
}

bool is_turn(const JointHypothesis& hypothesis) { return hypothesis.joint.type == JointType::kRevolute; }

/// A turn about a flat contact's normal in place of any other turn, with a share of the confidence in all.
void add_turn(const Vec3& through, std::string reason, Slippage& out) {
  JointHypothesis& first = out.hypotheses.front();
  for (const JointHypothesis& other : out.hypotheses)
    if (is_turn(other)) first.confidence += other.confidence;
  std::erase_if(out.hypotheses, is_turn);
  JointHypothesis turns = first;
  turns.joint.type = JointType::kRevolute;
  const Mat3& plane = first.joint.frame.axes;
  turns.joint.frame.origin = through;
  turns.joint.frame.axes << plane.col(2), plane.col(0), plane.col(1);
  turns.reason = std::move(reason);
  turns.confidence = share_of_first(tuning().types.others.round_share, out);
  replace_hypothesis(std::move(turns), out);
}

}  // namespace

double share_of_first(double share, Slippage& out) {
  double& first = out.hypotheses.front().confidence;
  const double second = out.hypotheses.size() > 1 ? out.hypotheses[1].confidence : 0.0;
  const double taken = std::min(share * first, first - second);
  first -= taken;
  return taken;
}

void replace_hypothesis(JointHypothesis hypothesis, Slippage& out) {
  const auto others = out.hypotheses.begin() + 1;
  out.hypotheses.erase(std::remove_if(others, out.hypotheses.end(),
                                      [&](const JointHypothesis& h) { return h.joint.type == hypothesis.joint.type; }),
                       out.hypotheses.end());
  out.hypotheses.push_back(std::move(hypothesis));
  std::stable_sort(out.hypotheses.begin() + 1, out.hypotheses.end(),
                   [](const JointHypothesis& x, const JointHypothesis& y) { return x.confidence > y.confidence; });
}

void add_hypothesis_of_flange(const std::vector<ContactRegion>& regions, Slippage& out) {
  const JointHypothesis& first = out.hypotheses.front();
  if (first.joint.type != JointType::kPlanar) return;
  if (const auto middle = middle_of_round_face(regions, first.joint.frame))
    add_turn(*middle,
             "the face is round: if it is the flange of a bearing that is not drawn, one part turns about its middle",
             out);
}

void add_hypothesis_of_line(const Vec3& point, Slippage& out) {
  const JointFrame& plane = out.hypotheses.front().joint.frame;
  const Vec3 normal = plane.axes.col(2);
  add_turn(point + normal * normal.dot(plane.origin - point),
           "symmetry: surfaces of both parts turn into themselves about one line", out);
}

void prefer_turn(Slippage& out) {
  const double worth = tuning().types.others.worth_telling;
  auto turn = std::find_if(out.hypotheses.begin(), out.hypotheses.end(), is_turn);
  if (turn == out.hypotheses.end() || turn->confidence < worth) {
    add_turn(out.hypotheses.front().joint.frame.origin, "the middle of the contact stands for its axis", out);
    turn = std::find_if(out.hypotheses.begin(), out.hypotheses.end(), is_turn);
  }
  std::swap(turn->confidence, out.hypotheses.front().confidence);
  turn->reason =
      "chain: flat contacts that look different ways do not rest on each other, so bearings hold them; " + turn->reason;
  std::rotate(out.hypotheses.begin(), turn, turn + 1);
}

}  // namespace limber::internal
