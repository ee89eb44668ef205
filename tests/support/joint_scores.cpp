#include "joint_scores.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace limber::assemblies {
namespace {

constexpr int kNone = 6;

void measure(const TrueJoint& truth, const JointSpec& found, double diagonal, JointScore& score) {
  const bool axial = found.type != JointType::kBall && found.type != JointType::kFixed;
  const Vec3 axis = found.frame.axes.col(found.type == JointType::kPlanar ? 2 : 0);
  if (axial)
    score.axis_error =
        std::atan2(axis.cross(truth.axis).norm(), std::abs(axis.dot(truth.axis))) * 180.0 / std::numbers::pi;
  const Vec3 off = found.frame.origin - truth.origin;
  double distance = 0.0;
  if (found.type == JointType::kBall) distance = off.norm();
  if (found.type == JointType::kRevolute || found.type == JointType::kCylindrical)
    distance = (off - truth.axis * truth.axis.dot(off)).norm();
  if (found.type == JointType::kPlanar) distance = std::abs(truth.axis.dot(off));
  score.origin_error = distance / diagonal;
  score.pitch_right = std::abs(found.pitch - truth.pitch) <= 0.02 * std::abs(truth.pitch);
}

}  // namespace

Score scored(const MadeAssembly& made, const DetectionOptions& options, Jobs& jobs) {
  const Assembly assembly =
      find_components(made.surface, {.rule = made.compound ? ComponentRule::kGroups : ComponentRule::kConnectivity});
  const auto found = detect_joints(assembly, options, jobs);
  std::vector<char> matched(found.size(), 0);
  Score out;
  for (const TrueJoint& truth : made.joints) {
    JointScore score;
    score.name = truth.a + " - " + truth.b;
    score.truth = static_cast<int>(truth.type);
    score.found = kNone;
    for (std::size_t i = 0; i < found.size(); ++i) {
      const auto name = [&](Index c) -> const std::string& {
        return assembly.components[static_cast<std::size_t>(c)].name;
      };
      const auto pair = std::minmax(name(found[i].a), name(found[i].b));
      if (pair != std::minmax(truth.a, truth.b)) continue;
      matched[i] = 1;
      score.found = static_cast<int>(found[i].joint.type);
      score.confidence = found[i].confidence;
      score.reason = found[i].reasons.back();
      if (score.found == score.truth) measure(truth, found[i].joint, made.diagonal, score);
    }
    out.joints.push_back(score);
  }
  for (std::size_t i = 0; i < found.size(); ++i)
    if (!matched[i])
      out.extra.push_back(assembly.components[static_cast<std::size_t>(found[i].a)].name + " - " +
                          assembly.components[static_cast<std::size_t>(found[i].b)].name + " " +
                          std::string(to_string(found[i].joint.type)) + "; " + found[i].reasons.front() + "; " +
                          found[i].reasons.back());
  return out;
}

std::vector<VariantClass> variant_classes() {
  const auto of = [](std::initializer_list<int> segments, std::initializer_list<double> clearances, auto change) {
    std::vector<Variant> out;
    for (const int n : segments)
      for (const double c : clearances)
        for (const double phase : {0.0, 0.5}) {
          Variant v{.segments = n, .clearance = c, .phase = phase};
          change(v);
          out.push_back(v);
        }
    return out;
  };
  const auto same = [](Variant&) {};
  std::vector<VariantClass> out;
  out.push_back({"32-64 segments, gap 0, 0.5 %", of({32, 48, 64}, {0.0, 0.005}, same)});
  out.push_back({"32-64 segments, gap 2 %", of({32, 64}, {0.02}, same), 1.0});
  out.push_back({"32-64 segments, overlap 0.5, 1 %", of({32, 64}, {-0.005, -0.01}, same), 1.0});
  out.push_back({"16, 24 segments", of({16, 24}, {0.0, 0.005, 0.02, -0.005}, same), 1.0});
  out.push_back({"8 segments, without balls", of({8}, {0.0, 0.005, 0.02, -0.005}, same), 1.0, false});
  for (const double jitter : {0.0003, 0.001}) {
    std::vector<Variant> noisy;
    for (const unsigned seed : {1u, 2u, 3u})
      for (Variant v : of({32}, {0.0, 0.005, 0.02}, [&](Variant& x) { x.jitter = jitter, x.seed = seed; }))
        noisy.push_back(v);
    out.push_back({jitter < 0.0005 ? "0.03 % jitter" : "0.1 % jitter", noisy, 2.0});
  }
  out.push_back({"soup", of({32}, {0.0, 0.005, 0.02}, [](Variant& v) { v.soup = true; })});
  out.push_back({"open shells", of({32}, {0.0, 0.005, 0.02}, [](Variant& v) { v.open = true; })});
  std::vector<Variant> moved;
  const Vec3 axis = Vec3(0.3, -0.8, 0.5).normalized();
  for (const double scale : {1e-3, 1.0, 1e3})
    for (const double angle : {0.7, 2.1})
      moved.push_back({.segments = 32,
                       .clearance = 0.005,
                       .swapped = angle > 1.0,
                       .shuffled = angle > 1.0,
                       .scale = scale,
                       .rotation = Eigen::AngleAxisd(angle, axis).toRotationMatrix(),
                       .translation = 3.0 * scale * Vec3(1, 2, -1)});
  out.push_back({"rotated, scaled, shuffled", moved});
  return out;
}

}  // namespace limber::assemblies
