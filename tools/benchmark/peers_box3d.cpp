#include <box3d/box3d.h>

#include <algorithm>
#include <variant>
#include <vector>

#include "cpu_time.h"
#include "limber/core/error.h"
#include "peers.h"

namespace limber::tools {
namespace {

constexpr int kSubsteps = 4;         // as Box3D's own samples take
constexpr double kHalfDepth = 5.0;   // m, of the boxes that stand for planes
constexpr double kHalfWidth = 60.0;  // m

b3Vec3 box3d(const Vec3& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}
b3Quat box3d(const Quaternion& q) {
  return {{static_cast<float>(q.x), static_cast<float>(q.y), static_cast<float>(q.z)}, static_cast<float>(q.w)};
}
Vec3 vector(const b3Vec3& v) { return {static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)}; }

b3BoxHull box_hull(const Vec3& half) {
  const b3Vec3 h = box3d(half);
  return b3MakeBoxHull(h.x, h.y, h.z);
}

void add_shape(b3BodyId body, const b3ShapeDef& definition, const Shape& shape) {
  if (const auto* box = std::get_if<Box>(&shape)) {
    const b3BoxHull hull = box_hull(box->half_extents);
    b3CreateHullShape(body, &definition, &hull.base);
  } else if (const auto* ball = std::get_if<Sphere>(&shape)) {
    const b3Sphere sphere{.center = {}, .radius = static_cast<float>(ball->radius)};
    b3CreateSphereShape(body, &definition, &sphere);
  } else if (const auto* c = std::get_if<Capsule>(&shape)) {
    const Vec3 end(0.0, 0.0, c->half_length);
    const b3Capsule capsule{.center1 = box3d(-end), .center2 = box3d(end), .radius = static_cast<float>(c->radius)};
    b3CreateCapsuleShape(body, &definition, &capsule);
  } else {
    throw InvalidArgument("box3d_pile: expected boxes, balls and capsules");
  }
}

class Box3dPile final : public PileEngine {
 public:
  explicit Box3dPile(const RigidPile& pile) : step_(static_cast<float>(pile.step)) {
    b3WorldDef definition = b3DefaultWorldDef();
    definition.gravity = box3d(pile.gravity);
    definition.enableSleep = false;
    world_ = b3CreateWorld(&definition);
    b3ShapeDef shape = b3DefaultShapeDef();
    shape.baseMaterial.friction = static_cast<float>(pile.friction);
    for (const RigidPile::Plane& p : pile.planes) add_plane(p, shape);
    for (const RigidPile::Body& b : pile.bodies) add(b, shape);
  }
  ~Box3dPile() override { b3DestroyWorld(world_); }
  Box3dPile(const Box3dPile&) = delete;
  Box3dPile& operator=(const Box3dPile&) = delete;

  PileStep step() override {
    const double began = thread_seconds();
    b3World_Step(world_, step_, kSubsteps);
    PileStep out{.seconds = thread_seconds() - began};
    for (const b3BodyId body : bodies_) count_contacts(body, out);
    return out;
  }
  PileMotion motion(std::size_t body) const override {
    const b3BodyId id = bodies_[body];
    const b3Pos p = b3Body_GetPosition(id);
    const b3Quat q = b3Body_GetRotation(id);
    const Vec3 axis = vector(q.v);
    return {.pose = {{static_cast<double>(q.s), axis.x(), axis.y(), axis.z()}, Vec3(p.x, p.y, p.z)},
            .velocity = vector(b3Body_GetLinearVelocity(id)),
            .angular_velocity = vector(b3Body_GetAngularVelocity(id))};
  }

 private:
  /// A box whose face is the plane.
  void add_plane(const RigidPile::Plane& plane, const b3ShapeDef& shape) {
    b3BodyDef definition = b3DefaultBodyDef();
    const Vec3 center = (plane.offset - kHalfDepth) * plane.normal;
    definition.position = {static_cast<float>(center.x()), static_cast<float>(center.y()),
                           static_cast<float>(center.z())};
    const auto turn = Eigen::Quaterniond::FromTwoVectors(Vec3::UnitZ(), plane.normal);
    definition.rotation = box3d(Quaternion{turn.w(), turn.x(), turn.y(), turn.z()});
    const b3BoxHull hull = box_hull({kHalfWidth, kHalfWidth, kHalfDepth});
    b3CreateHullShape(b3CreateBody(world_, &definition), &shape, &hull.base);
  }
  void add(const RigidPile::Body& b, const b3ShapeDef& shape) {
    b3BodyDef definition = b3DefaultBodyDef();
    definition.type = b3_dynamicBody;
    const b3Vec3 p = box3d(b.pose.p);
    definition.position = {p.x, p.y, p.z};
    definition.rotation = box3d(b.pose.q);
    bodies_.push_back(b3CreateBody(world_, &definition));
    add_shape(bodies_.back(), shape, *b.shape);
    b3MassData mass = b3Body_GetMassData(bodies_.back());
    mass.mass = static_cast<float>(b.mass);
    mass.inertia = {.cx = {static_cast<float>(b.inertia.x()), 0.0f, 0.0f},
                    .cy = {0.0f, static_cast<float>(b.inertia.y()), 0.0f},
                    .cz = {0.0f, 0.0f, static_cast<float>(b.inertia.z())}};
    b3Body_SetMassData(bodies_.back(), mass);
  }
  /// Each contact is told by both its bodies, if both move: the owner of its first shape counts it, or else the other.
  void count_contacts(b3BodyId body, PileStep& out) {
    const auto capacity = static_cast<std::size_t>(b3Body_GetContactCapacity(body));
    if (seen_.size() < capacity) seen_.resize(capacity);
    const int count = b3Body_GetContactData(body, seen_.data(), static_cast<int>(capacity));
    for (int i = 0; i < count; ++i) {
      const b3ContactData& contact = seen_[static_cast<std::size_t>(i)];
      const b3BodyId first = b3Shape_GetBody(contact.shapeIdA);
      const bool counts = B3_ID_EQUALS(first, body) || b3Body_GetType(first) != b3_dynamicBody;
      for (int m = 0; counts && m < contact.manifoldCount; ++m)
        for (int k = 0; k < contact.manifolds[m].pointCount; ++k) {
          ++out.contacts;
          out.deepest = std::max(out.deepest, -static_cast<double>(contact.manifolds[m].points[k].separation));
        }
    }
  }

  float step_;
  b3WorldId world_{};
  std::vector<b3BodyId> bodies_;
  std::vector<b3ContactData> seen_;
};

}  // namespace

std::unique_ptr<PileEngine> box3d_pile(const RigidPile& pile) { return std::make_unique<Box3dPile>(pile); }

}  // namespace limber::tools
