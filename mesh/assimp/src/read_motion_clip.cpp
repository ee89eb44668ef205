#include "limber/mesh_assimp/read_motion_clip.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "assimp_scene.h"
#include "limber/core/error.h"

namespace limber {
namespace {

RigidTransform transform_of(const aiQuaternion& q, const aiVector3D& p) {
  return {normalized(Quaternion{q.w, q.x, q.y, q.z}), Vec3(p.x, p.y, p.z)};
}

bool is_finite(const RigidTransform& X) { return X.p.allFinite() && std::isfinite(X.q.w + X.q.x + X.q.y + X.q.z); }

class ClipReader {
 public:
  ClipReader(const aiScene& scene, std::string name) : name_(std::move(name)), animation_(*scene.mAnimations[0]) {
    for (unsigned c = 0; c < animation_.mNumChannels; ++c) {
      const aiNodeAnim& channel = *animation_.mChannels[c];
      channels_[channel.mNodeName.C_Str()] = &channel;
      frames_ = std::max({frames_, channel.mNumRotationKeys, channel.mNumPositionKeys});
    }
    take_skeleton(*scene.mRootNode, -1);
  }

  MotionClip read() {
    const double rate = animation_.mTicksPerSecond > 0.0 ? animation_.mTicksPerSecond : 1.0;
    for (unsigned f = 0; f < frames_; ++f) {
      clip_.times.push_back(static_cast<double>(f) / rate);
      std::vector<RigidTransform>& poses = clip_.poses.emplace_back();
      for (std::size_t j = 0; j < local_.size(); ++j) {
        const RigidTransform own = local_at(j, f);
        const Index parent = clip_.joints[j].parent;
        poses.push_back(parent < 0 ? own : poses[static_cast<std::size_t>(parent)] * own);
        if (!is_finite(poses.back()))
          throw InputError(name_ + ": frame " + std::to_string(f) + " of joint \"" + clip_.joints[j].name +
                           "\" is not finite");
      }
    }
    return std::move(clip_);
  }

 private:
  void take_skeleton(const aiNode& node, Index parent) {
    aiVector3D scale, place;
    aiQuaternion turn;
    node.mTransformation.Decompose(scale, turn, place);
    const auto own = static_cast<Index>(clip_.joints.size());
    local_.push_back(transform_of(turn, place));
    const RigidTransform& local = local_.back();
    clip_.joints.push_back({.name = node.mName.C_Str(),
                            .parent = parent,
                            .rest = parent < 0 ? local : clip_.joints[static_cast<std::size_t>(parent)].rest * local});
    const auto found = channels_.find(clip_.joints.back().name);
    channel_.push_back(found == channels_.end() ? nullptr : found->second);
    for (unsigned i = 0; i < node.mNumChildren; ++i) take_skeleton(*node.mChildren[i], own);
  }

  /// BVH has a key for every frame, or one for all.
  unsigned key(unsigned keys, unsigned frame, std::size_t joint) const {
    if (keys == frames_) return frame;
    if (keys == 1) return 0;
    throw InputError(name_ + ": joint \"" + clip_.joints[joint].name + "\" has " + std::to_string(keys) +
                     " keys, expected one for each of the " + std::to_string(frames_) + " frames, as in BVH");
  }

  RigidTransform local_at(std::size_t joint, unsigned frame) const {
    const aiNodeAnim* channel = channel_[joint];
    if (channel == nullptr) return local_[joint];
    const aiQuatKey& turn = channel->mRotationKeys[key(channel->mNumRotationKeys, frame, joint)];
    const aiVectorKey& place = channel->mPositionKeys[key(channel->mNumPositionKeys, frame, joint)];
    return transform_of(turn.mValue, place.mValue);
  }

  std::string name_;
  const aiAnimation& animation_;
  std::map<std::string, const aiNodeAnim*> channels_;
  std::vector<const aiNodeAnim*> channel_;  // per joint
  std::vector<RigidTransform> local_;       // per joint, at rest
  unsigned frames_ = 0;
  MotionClip clip_;
};

void put(const RigidTransform& X, internal::MessageWriter& message) {
  for (const double c : {X.q.w, X.q.x, X.q.y, X.q.z}) message.put(c);
  message.put(X.p);
}

RigidTransform get_transform(internal::MessageReader& message) {
  RigidTransform X;
  for (double* c : {&X.q.w, &X.q.x, &X.q.y, &X.q.z}) *c = message.get<double>();
  X.p = message.get_vector();
  return X;
}

/// In the child: reads the file and hands on what was read.
void send_clip(const std::filesystem::path& path, const std::string& name, internal::MessageWriter& message) {
  Assimp::Importer importer;
  const aiScene& scene = internal::read_scene(importer, path, 0);
  if (scene.mNumAnimations == 0) throw InputError(name + ": holds no motion, expected a BVH file");
  const MotionClip clip = ClipReader(scene, name).read();
  message.put(clip.joints.size());
  for (const auto& joint : clip.joints) {
    message.put(joint.name);
    message.put(joint.parent);
    put(joint.rest, message);
  }
  message.put(clip.times.size());
  for (std::size_t f = 0; f < clip.times.size(); ++f) {
    message.put(clip.times[f]);
    for (const RigidTransform& X : clip.poses[f]) put(X, message);
  }
}

}  // namespace

MotionClip read_motion_clip(const std::filesystem::path& path) {
  const std::string name = internal::quoted_path(path);
  internal::MessageReader message = internal::in_child(name, internal::limits_for(path),
                                                       [&](internal::MessageWriter& to) { send_clip(path, name, to); });
  MotionClip clip;
  clip.joints.resize(message.get<std::size_t>());
  for (auto& joint : clip.joints) {
    joint.name = message.get_text();
    joint.parent = message.get<Index>();
    joint.rest = get_transform(message);
  }
  clip.times.resize(message.get<std::size_t>());
  for (double& time : clip.times) {
    time = message.get<double>();
    std::vector<RigidTransform>& poses = clip.poses.emplace_back();
    for (std::size_t j = 0; j < clip.joints.size(); ++j) poses.push_back(get_transform(message));
  }
  return clip;
}

}  // namespace limber
