// Scenes of many bodies for the tests and benchmarks of ContactFinder.
#pragma once

#include <cmath>
#include <memory>
#include <vector>

#include "limber/collision/contact_finder.h"
#include "random_states.h"
#include "shapes.h"
#include "wavy_model.h"

namespace limber::testing {

/// Bodies with their states, which hold amplitudes of their own.
struct ContactScene {
  std::vector<BodyGeometry> geometries;
  std::vector<RigidTransform> poses;
  std::vector<std::vector<double>> amplitudes;
  std::vector<double> reaches;
  std::vector<bool> asleep;

  Index add(const BodyGeometry& geometry, const RigidTransform& pose, std::vector<double> z = {}) {
    geometries.push_back(geometry);
    poses.push_back(pose);
    amplitudes.push_back(std::move(z));
    reaches.push_back(0.0);
    asleep.push_back(false);
    return static_cast<Index>(geometries.size()) - 1;
  }
  Index add(const Shape& shape, const RigidTransform& pose = {}) {
    return add(BodyGeometry{.model = {}, .shape = std::make_shared<const Shape>(shape)}, pose);
  }
  void add_all_to(ContactSource& finder) const {
    for (std::size_t i = 0; i < geometries.size(); ++i) finder.add_body(static_cast<Index>(i), geometries[i], {});
  }
  const std::vector<BodyState>& states() const {
    states_.clear();
    for (std::size_t i = 0; i < geometries.size(); ++i)
      states_.push_back({.pose = poses[i], .amplitudes = amplitudes[i], .reach = reaches[i], .asleep = asleep[i]});
    return states_;
  }

 private:
  mutable std::vector<BodyState> states_;
};

inline std::vector<ContactPoint> contacts_of(ContactSource& finder, const ContactScene& scene, double margin,
                                             const Vec3& origin = Vec3::Zero(), Jobs& jobs = serial_jobs()) {
  std::vector<ContactPoint> contacts;
  finder.find_contacts({.states = scene.states(), .margin = margin, .origin = origin}, contacts, jobs);
  return contacts;
}

/// A heap of bent balls (radius about 0.5 m, `modes` modes), boxes and capsules on a floor, in layers that overlap a
/// little.
inline ContactScene heap(int bodies, Index modes = 6, int splits = 2) {
  Random random(7);
  ContactScene scene;
  scene.add(HalfSpace{}, {{}, {0.0, 0.0, 0.0}});
  const auto ball = wavy_model(shapes::sphere(Vec3::Zero(), 0.5, splits), modes);
  const auto box = std::make_shared<const Shape>(Box{{0.45, 0.4, 0.35}});
  const auto capsule = std::make_shared<const Shape>(Capsule{0.3, 0.3});
  const int per_side = static_cast<int>(std::ceil(std::sqrt(bodies / 3.0)));
  for (int i = 0; i < bodies; ++i) {
    const int layer = i / (per_side * per_side), x = i % per_side, y = i / per_side % per_side;
    const Vec3 place(0.92 * x + 0.3 * (layer % 2), 0.92 * y + 0.3 * (layer % 2), 0.46 + 0.85 * layer);
    const RigidTransform pose{random.pose(1.0).q, place + random.vector(0.03)};
    if (i % 4 == 1) {
      scene.add(BodyGeometry{.model = {}, .shape = box}, pose);
    } else if (i % 4 == 3) {
      scene.add(BodyGeometry{.model = {}, .shape = capsule}, pose);
    } else {
      scene.add(BodyGeometry{.model = ball, .shape = {}}, pose, random.amplitudes(modes, 0.02));
    }
  }
  return scene;
}

}  // namespace limber::testing
