#include "limber/model/pose_keys.h"

namespace limber {

std::vector<float> translation_keys(std::span<const RigidTransform> poses, double metres_per_unit) {
  std::vector<float> out;
  for (const RigidTransform& X : poses)
    for (int a = 0; a < 3; ++a) out.push_back(static_cast<float>(metres_per_unit * X.p[a]));
  return out;
}

std::vector<float> rotation_keys(std::span<const RigidTransform> poses) {
  std::vector<float> out;
  Quaternion last;
  for (const RigidTransform& X : poses) {
    Quaternion q = normalized(X.q);
    if (q.w * last.w + q.x * last.x + q.y * last.y + q.z * last.z < 0.0) q = {-q.w, -q.x, -q.y, -q.z};
    for (const double number : {q.x, q.y, q.z, q.w}) out.push_back(static_cast<float>(number));
    last = q;
  }
  return out;
}

}  // namespace limber
