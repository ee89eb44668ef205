#include "soak_scene.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "../cpu_time.h"

namespace limber::testing {
namespace {

constexpr double kHalfWidth = 1.0, kSlope = 0.6;        // m, rad, of the pit
constexpr double kSpeed = 1.5;                          // m/s, of hands
constexpr double kForce = 1000.0;                       // N, of hands: some four weights of a box
constexpr double kStiffness = 4000.0, kDamping = 60.0;  // N/m, N s/m, of spring hands
constexpr double kBoxSize = 0.3, kBarLength = 0.5;      // m
constexpr double kHookHeight = 1.6;                     // m, of the chain's first joint
constexpr double kLimit = 0.6;                          // rad, of the chain's last hinge
constexpr int kHands = 2;

/// Each vertex once, as a corner of a triangle.
std::vector<SurfacePoint> vertices_of(const ModalSurface& surface) {
  std::vector<SurfacePoint> points(static_cast<std::size_t>(surface.vertices()));
  for (std::size_t t = 0; t < surface.triangles.size(); ++t)
    for (std::size_t c = 0; c < 3; ++c) {
      SurfacePoint& point = points[static_cast<std::size_t>(surface.triangles[t][c])];
      point = {.triangle = static_cast<Index>(t), .weight = {0.0, 0.0, 0.0}};
      point.weight[c] = 1.0;
    }
  return points;
}

}  // namespace

SoakScene::SoakScene(const SoakBodies& bodies, unsigned seed, const ContactOptions& options)
    : random_(seed), hands_(kHands) {
  world_.set_contact_source(&finder_, options);
  make_pit();
  add_loose(bodies);
  hang_chain(bodies);
  for (Hand& hand : hands_) hand.left = whole(10, 60);
  seen_hands_.reserve(kHands);
  for (const BodyId id : bodies_) {
    const ModalModelData& data = world_.model(id).data();
    seen_.weight += data.mass * world_.options().gravity.norm();
    seen_.energy_scale += data.mass * world_.options().gravity.norm() * kBoxSize;
    if (!data.residual_compliance) continue;
    indented_.push_back({id, vertices_of(world_.model(id).collision())});
    indentations_.push_back({.body = static_cast<Index>(id.index), .compliance = largest_compliance(world_.model(id))});
  }
  seen_.length = world_.options().step;
  seen_.friction = options.friction;
  seen_.energy = energy();
}

void SoakScene::make_pit() {
  world_.add_static(std::make_shared<Shape>(HalfSpace{}));
  for (int side = 0; side < 4; ++side) {
    const Quaternion turn = quaternion_from_rotation_vector({0.0, 0.0, 0.5 * std::numbers::pi * side});
    const Quaternion tilt = quaternion_from_rotation_vector({0.0, kSlope, 0.0});
    world_.add_static(std::make_shared<Shape>(HalfSpace{}), {turn * tilt, turn * Vec3(-kHalfWidth, 0.0, 0.0)});
  }
}

BodyId SoakScene::add(std::shared_ptr<const ModalModel> model, const Vec3& at, std::shared_ptr<const Shape> shape) {
  bodies_.push_back(world_.add_body(std::move(model), {.pose = {{}, at}, .shape = std::move(shape)}));
  return bodies_.back();
}

void SoakScene::add_loose(const SoakBodies& bodies) {
  const auto brick = std::make_shared<const Shape>(Box{.half_extents = {0.15, 0.12, 0.09}});
  const auto ball = std::make_shared<const Shape>(Sphere{.radius = 0.12});
  const auto capsule = std::make_shared<const Shape>(Capsule{.radius = 0.08, .half_length = 0.1});
  for (int i = 0; i < 12; ++i) {
    const Vec3 at(-0.6 + 0.6 * (i % 3), -0.3 + 0.6 * (i / 3 % 2), 0.25 + 0.45 * (i / 6));
    if (i % 4 == 0) add(bodies.box, at);
    if (i % 4 == 1) add(bodies.bar, at);
    if (i % 4 == 2) add(bodies.rigid, at, i == 6 ? capsule : ball);
    if (i % 4 == 3) add(bodies.rigid, at, brick);
  }
}

void SoakScene::hang_chain(const SoakBodies& bodies) {
  BodyId last{};
  for (int i = 0; i < 3; ++i) {
    const double x = -0.75 + kBarLength * i;
    const BodyId link = add(bodies.bar, {x + 0.5 * kBarLength, 0.9, kHookHeight});
    JointSpec joint{.type = i == 1 ? JointType::kBall : JointType::kRevolute};
    joint.frame.origin = Vec3(x, 0.9, kHookHeight);
    joint.frame.axes << 0, 0, 1, 1, 0, 0, 0, 1, 0;  // hinges turn about y
    if (i == 2) joint.limits.rotation = {-kLimit, kLimit};
    joints_.push_back(world_.add_joint(last, link, joint, {.radius = 0.08}, {.radius = 0.08}));
    last = link;
  }
}

void SoakScene::take_hold(Hand& hand) {
  hand.body = bodies_[static_cast<std::size_t>(whole(0, static_cast<int>(bodies_.size()) - 1))];
  const std::size_t triangles = world_.model(hand.body).collision().triangles.size();
  hand.at = {.triangle = static_cast<Index>(whole(0, static_cast<int>(triangles) - 1)), .weight = {0.3, 0.3, 0.4}};
  hand.max_force = kForce;
  HandleOptions options{.max_force = kForce};
  if (whole(0, 1) == 1) options.stiffness = kStiffness, options.damping = kDamping;
  hand.handle = world_.add_handle(hand.body, hand.at, options);
  hand.target = hand.goal = world_.position(hand.body, hand.at);
  hand.left = whole(30, 240);
}

void SoakScene::guide(Hand& hand) {
  if (hand.left-- == 0) {
    if (hand.handle) {
      world_.remove_handle(*hand.handle);
      hand.handle.reset();
      hand.left = whole(5, 60);
    } else {
      take_hold(hand);
    }
  }
  if (!hand.handle) return;
  if ((hand.goal - hand.target).norm() < 1e-3)
    hand.goal = Vec3(uniform(-kHalfWidth, kHalfWidth), uniform(-kHalfWidth, kHalfWidth), uniform(0.05, 1.4));
  const Vec3 way = hand.goal - hand.target;
  hand.target += std::min(1.0, kSpeed * seen_.length / way.norm()) * way;
  world_.set_handle_target(*hand.handle, {.position = hand.target});
}

const SoakStep& SoakScene::step() {
  for (Hand& hand : hands_) guide(hand);
  seen_.energy_before = seen_.energy;
  const double begin = thread_seconds();
  world_.step();
  seconds_ = thread_seconds() - begin;
  see_hands();
  see_indentations();
  seen_.contacts = world_.contact_events();
  seen_.finite = all_finite();
  seen_.energy = energy();
  return seen_;
}

void SoakScene::see_hands() {
  seen_hands_.clear();
  for (const Hand& hand : hands_)
    if (hand.handle) {
      const HandleView view = world_.handle(*hand.handle);
      seen_hands_.push_back({.force = view.force, .work = view.work, .max_force = hand.max_force});
    }
  seen_.hands = seen_hands_;
}

void SoakScene::see_indentations() {
  for (std::size_t i = 0; i < indentations_.size(); ++i) {
    indentations_[i].largest = 0.0;
    for (const SurfacePoint& vertex : indented_[i].vertices)
      indentations_[i].largest = std::max(indentations_[i].largest, world_.indentation(indented_[i].id, vertex).norm());
  }
  seen_.indentations = indentations_;
}

bool SoakScene::all_finite() const {
  const auto body_is = [this](BodyId id) {
    const BodyView body = world_.body(id);
    return body.pose.p.allFinite() && body.velocity.allFinite() && body.angular_velocity.allFinite() &&
           std::ranges::all_of(body.amplitudes, [](double z) { return std::isfinite(z); });
  };
  const auto joint_is = [this](JointId id) {
    const JointView joint = world_.joint(id);
    return joint.lock_force.allFinite() && std::isfinite(joint.distance_error);
  };
  return std::ranges::all_of(bodies_, body_is) && std::ranges::all_of(joints_, joint_is);
}

double SoakScene::energy() const {
  double sum = 0.0;
  for (const BodyId id : bodies_) sum += world_.energy(id).total();
  return sum;
}

}  // namespace limber::testing
