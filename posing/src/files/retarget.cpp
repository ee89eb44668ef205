#include "limber/posing/retarget.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "files/part_division.h"
#include "limber/core/error.h"
#include "limber/core/file.h"
#include "pose_transfer.h"

namespace limber {
namespace {

using internal::in_quotes;
using internal::JsonObject;
using internal::refuse;
using Json = nlohmann::json;

/// x ↦ scale R x + t
struct Similarity {
  double scale = 1.0;
  Mat3 R = Mat3::Identity();
  Vec3 t = Vec3::Zero();
  Vec3 operator()(const Vec3& x) const { return scale * (R * x) + t; }
  Vec3 inverse(const Vec3& y) const { return R.transpose() * (y - t) / scale; }
};

/// Lays points x onto points y. @throws InputError if they are on one line
Similarity laid_onto(const std::vector<Vec3>& x, const std::vector<Vec3>& y, const std::string& name) {
  const auto n = static_cast<double>(x.size());
  Vec3 mean_x = Vec3::Zero(), mean_y = Vec3::Zero();
  for (std::size_t i = 0; i < x.size(); ++i) mean_x += x[i] / n, mean_y += y[i] / n;
  Mat3 product = Mat3::Zero();
  double spread = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    product += (y[i] - mean_y) * (x[i] - mean_x).transpose();
    spread += (x[i] - mean_x).squaredNorm();
  }
  constexpr double kThin = 1e-6;  // a rotation is told by what is across the longest direction
  const Vec3 values = Eigen::JacobiSVD<Mat3>(product).singularValues();
  if (!(values[1] > kThin * values[0]))
    throw InputError(name + " points: they or their joints lie on one line, expected three or more that do not");
  Similarity out{.R = internal::nearest_rotation(product)};
  out.scale = (out.R.transpose() * product).trace() / spread;
  out.t = mean_y - out.scale * (out.R * mean_x);
  return out;
}

std::size_t joint_named(const MotionClip& clip, const std::string& joint, const std::string& where) {
  std::vector<std::string> names;
  for (const MotionClip::Joint& j : clip.joints) names.push_back(j.name);
  const auto found = std::find(names.begin(), names.end(), joint);
  if (found == names.end())
    throw InputError(where + ": the clip has no joint " + in_quotes(joint) + "; the nearest is " +
                     in_quotes(internal::nearest_word(joint, names)));
  return static_cast<std::size_t>(found - names.begin());
}

/// Place of a joint at any time of the clip.
RigidTransform at_time(const MotionClip& clip, std::size_t joint, double time) {
  const auto after = std::upper_bound(clip.times.begin(), clip.times.end(), time);
  const auto next = static_cast<std::size_t>(std::min(after, clip.times.end() - 1) - clip.times.begin());
  const std::size_t before = next > 0 ? next - 1 : 0;
  const RigidTransform &a = clip.poses[before][joint], &b = clip.poses[next][joint];
  const double span = clip.times[next] - clip.times[before];
  const double s = span > 0.0 ? std::clamp((time - clip.times[before]) / span, 0.0, 1.0) : 0.0;
  return {slerp(a.q, b.q, s), a.p + s * (b.p - a.p)};
}

}  // namespace

MappingFile parse_mapping(std::string_view text, const std::string& name) {
  const Json root = internal::parse_json(text, name);
  const JsonObject o(root, name);
  MappingFile out;
  out.division = internal::read_division(o);
  o.for_each("points", [&](const Json& value, const std::string& where) {
    const JsonObject p(value, where);
    out.points.push_back({p.text("joint"), p.text("part"), p.vec3("point")});
    p.finish();
  });
  if (out.points.size() < 3) refuse(o.where("points"), std::to_string(out.points.size()) + " points", "three or more");
  out.frame_rate = o.number("frame_rate", out.frame_rate);
  if (!(out.frame_rate > 0.0)) refuse(o.where("frame_rate"), std::to_string(out.frame_rate), "a number > 0");
  out.begin = o.number("begin", out.begin);
  if (out.begin < 0.0) refuse(o.where("begin"), std::to_string(out.begin), "a time of 0 or later");
  out.end = o.number("end", out.end);
  if (out.end < out.begin) refuse(o.where("end"), std::to_string(out.end), "a time no earlier than \"begin\"");
  out.travels = o.boolean("travels", out.travels);
  o.finish();
  return out;
}

MappingFile read_mapping(const std::filesystem::path& path) {
  return parse_mapping(read_file(path), "\"" + path.filename().string() + "\"");
}

HandlesFile retarget(const MotionClip& clip, const MappingFile& mapping, const std::string& name) {
  if (clip.times.empty() || mapping.begin > clip.times.back())
    throw InputError(name + " begin: is " + std::to_string(mapping.begin) + " s, but the clip ends at " +
                     std::to_string(clip.times.empty() ? 0.0 : clip.times.back()) + " s");
  HandlesFile out{.division = mapping.division, .handles = {}, .frames = {}};
  std::vector<std::size_t> joints;
  std::vector<Vec3> skeleton, model;
  for (std::size_t i = 0; i < mapping.points.size(); ++i) {
    const MappingFile::Point& p = mapping.points[i];
    joints.push_back(joint_named(clip, p.joint, name + " points[" + std::to_string(i) + "].joint"));
    skeleton.push_back(clip.joints[joints.back()].rest.p);
    model.push_back(p.point);
    out.handles.push_back({"points[" + std::to_string(i) + "]", p.part, p.point});
  }
  const Similarity lay = laid_onto(skeleton, model, name);
  const Vec3 start = at_time(clip, 0, mapping.begin).p;
  const double length = std::min(mapping.end, clip.times.back()) - mapping.begin;
  const auto frames = static_cast<std::size_t>(std::floor(length * mapping.frame_rate + 1e-9)) + 1;
  for (std::size_t f = 0; f < frames; ++f) {
    const double time = static_cast<double>(f) / mapping.frame_rate, at = mapping.begin + time;
    const Vec3 root = clip.joints[0].rest.p - (mapping.travels ? start : at_time(clip, 0, at).p);
    HandlesFile::Frame& frame = out.frames.emplace_back();
    frame.time = time;
    for (std::size_t i = 0; i < joints.size(); ++i) {
      const RigidTransform moved = at_time(clip, joints[i], at) * clip.joints[joints[i]].rest.inverse();
      frame.targets.emplace_back(i, lay(moved * lay.inverse(model[i]) + root));
    }
  }
  return out;
}

}  // namespace limber
