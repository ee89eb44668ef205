// A recording of a body with a modal skin, played as glTF says: morph targets in the rest pose, then joints.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "glb_view.h"
#include "limber/dynamics/body_shape.h"
#include "limber/model/glb.h"
#include "limber/scene/recording.h"
#include "skinned_bar.h"

namespace limber::testing {
namespace {

std::vector<std::uint8_t> bytes_of(const std::string& glb, const nlohmann::json& json, std::size_t accessor) {
  const auto& a = json.at("accessors").at(accessor);
  const auto& view = json.at("bufferViews").at(a.at("bufferView").get<std::size_t>());
  const std::string_view binary = glb_chunks(glb, "recording").binary.substr(view.at("byteOffset").get<std::size_t>());
  return {binary.begin(), binary.begin() + 4 * a.at("count").get<std::ptrdiff_t>()};
}

/// One key of an animation of one body, less the turn that puts glTF's y axis up.
class Player {
 public:
  Player(const std::string& glb, const std::string& body, std::size_t animation = 0)
      : view_(glb), body_(body), animation_(animation) {
    const auto& node = view_.json.at("nodes").at(index_of(body + " surface"));
    const auto& primitive = view_.json.at("meshes").at(node.at("mesh").get<std::size_t>()).at("primitives").at(0);
    position_ = view_.floats(primitive.at("attributes").at("POSITION"));
    weights_ = view_.floats(primitive.at("attributes").at("WEIGHTS_0"));
    joints_ = bytes_of(glb, view_.json, primitive.at("attributes").at("JOINTS_0"));
    for (const auto& target : primitive.at("targets")) targets_.push_back(view_.floats(target.at("POSITION")));
    for (const auto& joint : view_.json.at("skins").at(node.at("skin").get<std::size_t>()).at("joints"))
      names_.push_back(view_.json.at("nodes").at(joint.get<std::size_t>()).at("name"));
  }

  std::vector<Vec3> vertices(std::size_t key) const {
    const bool moves = std::ranges::any_of(view_.json.at("animations").at(animation_).at("channels"),
                                           [&](const auto& c) { return c.at("target").at("node") == index_of(body_); });
    const std::vector<double> still = view_.json.at("nodes").at(index_of(body_)).at("translation");
    const RigidTransform X = moves ? pose(body_, key) : RigidTransform{.p = Vec3(still[0], still[1], still[2])};
    std::vector<RigidTransform> joints;
    for (const std::string& name : names_) joints.push_back(X * pose(name, key));
    const std::vector<float> w = view_.channel(body_ + " surface", "weights", animation_);
    std::vector<Vec3> out;
    for (std::size_t v = 0; v < position_.size() / 3; ++v) {
      Vec3 p = vector(position_, v), sum = Vec3::Zero();
      for (std::size_t t = 0; t < targets_.size(); ++t)
        p += static_cast<double>(w[key * targets_.size() + t]) * vector(targets_[t], v);
      for (std::size_t i = 0; i < 4; ++i)
        sum += static_cast<double>(weights_[4 * v + i]) * (joints[joints_[4 * v + i]] * p);
      out.push_back(sum);
    }
    return out;
  }

 private:
  static Vec3 vector(const std::vector<float>& numbers, std::size_t i) {
    return Eigen::Map<const Vec3f>(numbers.data() + 3 * i).cast<double>();
  }
  std::size_t index_of(const std::string& name) const {
    for (std::size_t i = 0; i < view_.json.at("nodes").size(); ++i)
      if (view_.json.at("nodes")[i].value("name", "") == name) return i;
    throw std::runtime_error("no node " + name);
  }
  RigidTransform pose(const std::string& name, std::size_t key) const {
    const std::vector<float> p = view_.channel(name, "translation", animation_),
                             q = view_.channel(name, "rotation", animation_);
    const auto turn = [&](std::size_t i) { return static_cast<double>(q[4 * key + i]); };
    return {normalized(Quaternion{turn(3), turn(0), turn(1), turn(2)}), vector(p, key)};
  }

  GlbView view_;
  std::string body_;
  std::size_t animation_;
  std::vector<float> position_, weights_;
  std::vector<std::uint8_t> joints_;
  std::vector<std::vector<float>> targets_;
  std::vector<std::string> names_;
};

TEST(RecordingOfASkin, AViewerShowsTheEnginesVertices) {
  for (const bool held : {true, false})
    for (const bool unsigned_weights : {true, false}) {
      const auto model = bar({.held = held});
      BodyTrack track;
      track.name = "bar";
      track.model = model;
      track.modal_skin = true;
      Trajectory trajectory;
      trajectory.step = trajectory.key_interval = 0.1;
      for (int key = 0; key < 4; ++key) {
        trajectory.times.push_back(0.1 * key);
        track.poses.push_back({quaternion_from_rotation_vector({0.1 * key, 0.2, 0.3 * key}), {1.0 * key, 2.0, 3.0}});
        track.angular_velocities.push_back(Vec3::Zero());
        for (const double z : bent(*model, 0.6 * key)) track.amplitudes.push_back(z);
      }
      trajectory.bodies = {track};
      const std::string glb = make_recording(trajectory, {.unsigned_weights = unsigned_weights, .invisible = 1e-7}).glb;
      const Player player(glb, "bar");
      SkinMemory memory(*model->data().skin);
      for (std::size_t key = 0; key < 4; ++key) {
        const std::vector<Vec3> shown = player.vertices(key);
        const BodyShape shape(*model, track.amplitudes_at(key), &memory);
        for (std::size_t t = 0; t < model->render().triangles.size(); ++t)
          for (std::size_t c = 0; c < 3; ++c) {
            SurfacePoint at{.surface = SurfacePoint::Surface::kRender,
                            .triangle = static_cast<Index>(t),
                            .weight = {0.0, 0.0, 0.0}};
            at.weight[c] = 1.0;
            const auto v = static_cast<std::size_t>(model->render().triangles[t][c]);
            EXPECT_LT((shown[v] - track.poses[key] * shape.position(at)).norm(), 1e-5 * kLength);
          }
      }
    }
}

/// By the energy of the softest mode that turns some handle by 60°, and as far as sliders at least.
TEST(ModeClips, SwingEachModeByTheSkin) {
  for (const bool held : {true, false}) {
    const auto model = bar({.held = held});
    const std::string glb = make_mode_clips({&model, 1});
    SkinMemory memory(*model->data().skin);
    SkinPose pose(*model->data().skin);
    const std::vector<double>& lambda = model->data().eigenvalues;
    std::vector<double> z;
    double least = kInfinity;  // twice the energy
    for (std::size_t m = 0; m < lambda.size(); ++m) {
      z = zeros(*model);
      z[m] = 1.0;
      pose.set(z);
      least = std::min(least, lambda[m] * std::pow(60.0 * kDegree / pose.largest_angle(), 2));
    }
    for (const std::size_t mode : {std::size_t{0}, std::size_t{3}}) {
      z = zeros(*model);
      z[mode] = std::max(std::sqrt(least / lambda[mode]), model->data().mode_scales[mode]);
      const BodyShape shape(*model, z, &memory);
      const std::vector<Vec3> shown = Player(glb, "bar", mode).vertices(12);  // a quarter of the swing
      for (std::size_t t = 0; t < model->render().triangles.size(); ++t) {
        const SurfacePoint at{
            .surface = SurfacePoint::Surface::kRender, .triangle = static_cast<Index>(t), .weight = {1.0, 0.0, 0.0}};
        const Vec3 expected = model->data().origin_in_input + shape.position(at);
        EXPECT_LT((shown[static_cast<std::size_t>(model->render().triangles[t][0])] - expected).norm(), 1e-5 * kLength);
      }
    }
  }
}

}  // namespace
}  // namespace limber::testing
