#include <BulletSoftBody/BulletReducedDeformableBody/btReducedDeformableBody.h>
#include <BulletSoftBody/BulletReducedDeformableBody/btReducedDeformableBodySolver.h>
#include <BulletSoftBody/btDeformableMultiBodyConstraintSolver.h>
#include <BulletSoftBody/btDeformableMultiBodyDynamicsWorld.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <cmath>
#include <variant>

#include "cpu_time.h"
#include "limber/core/error.h"
#include "peers.h"
#include "scene_cost.h"

namespace limber::tools {
namespace {

btVector3 bullet(const Vec3& v) {
  return {static_cast<btScalar>(v.x()), static_cast<btScalar>(v.y()), static_cast<btScalar>(v.z())};
}
btScalar bullet(double x) { return static_cast<btScalar>(x); }
Vec3 vector(const btVector3& v) {
  return {static_cast<double>(v.x()), static_cast<double>(v.y()), static_cast<double>(v.z())};
}

std::unique_ptr<btCollisionShape> bullet_shape(const Shape& shape) {
  if (const auto* box = std::get_if<Box>(&shape)) return std::make_unique<btBoxShape>(bullet(box->half_extents));
  if (const auto* ball = std::get_if<Sphere>(&shape)) return std::make_unique<btSphereShape>(bullet(ball->radius));
  if (const auto* c = std::get_if<Capsule>(&shape))
    return std::make_unique<btCapsuleShapeZ>(bullet(c->radius), bullet(2.0 * c->half_length));
  throw InvalidArgument("bullet_pile: expected boxes, balls and capsules");
}

class BulletPile final : public PileEngine {
 public:
  explicit BulletPile(const RigidPile& pile) : step_(pile.step) {
    world_.setGravity(bullet(pile.gravity));
    // Bullet multiplies the coefficients of two bodies.
    const btScalar friction = bullet(std::sqrt(pile.friction));
    for (const RigidPile::Plane& p : pile.planes) {
      shapes_.push_back(std::make_unique<btStaticPlaneShape>(bullet(p.normal), bullet(p.offset)));
      add(0.0, btTransform::getIdentity(), {0, 0, 0}, friction);
    }
    for (const RigidPile::Body& b : pile.bodies) {
      shapes_.push_back(bullet_shape(*b.shape));
      const btTransform pose({bullet(b.pose.q.x), bullet(b.pose.q.y), bullet(b.pose.q.z), bullet(b.pose.q.w)},
                             bullet(b.pose.p));
      add(b.mass, pose, bullet(b.inertia), friction);
      moving_.push_back(bodies_.back().get());
    }
  }
  ~BulletPile() override {
    for (const auto& body : bodies_) world_.removeRigidBody(body.get());
  }

  PileStep step() override {
    const double began = thread_seconds();
    world_.stepSimulation(bullet(step_), 0, bullet(step_));
    PileStep out{.seconds = thread_seconds() - began};
    for (int i = 0; i < dispatcher_.getNumManifolds(); ++i) {
      const btPersistentManifold* manifold = dispatcher_.getManifoldByIndexInternal(i);
      for (int j = 0; j < manifold->getNumContacts(); ++j) {
        ++out.contacts;
        out.deepest = std::max(out.deepest, -static_cast<double>(manifold->getContactPoint(j).getDistance()));
      }
    }
    return out;
  }
  PileMotion motion(std::size_t body) const override {
    const btRigidBody& b = *moving_[body];
    const btQuaternion q = b.getWorldTransform().getRotation();
    return {.pose = {{static_cast<double>(q.w()), static_cast<double>(q.x()), static_cast<double>(q.y()),
                      static_cast<double>(q.z())},
                     vector(b.getWorldTransform().getOrigin())},
            .velocity = vector(b.getLinearVelocity()),
            .angular_velocity = vector(b.getAngularVelocity())};
  }

 private:
  void add(double mass, const btTransform& pose, const btVector3& inertia, btScalar friction) {
    btRigidBody::btRigidBodyConstructionInfo info(bullet(mass), nullptr, shapes_.back().get(), inertia);
    info.m_startWorldTransform = pose;
    bodies_.push_back(std::make_unique<btRigidBody>(info));
    btRigidBody& body = *bodies_.back();
    body.setFriction(friction);
    body.setActivationState(DISABLE_DEACTIVATION);
    world_.addRigidBody(&body);
  }

  double step_;
  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_{&configuration_};
  btDbvtBroadphase broad_phase_;
  btSequentialImpulseConstraintSolver solver_;
  btDiscreteDynamicsWorld world_{&dispatcher_, &broad_phase_, &solver_, &configuration_};
  std::vector<std::unique_ptr<btCollisionShape>> shapes_;
  std::vector<std::unique_ptr<btRigidBody>> bodies_;
  std::vector<btRigidBody*> moving_;
};

/// Set up as Bullet's own benchmark of reduced bodies: explicit, margin 0.01 m, 100 iterations. Bodies are all of one
/// size, as a larger one that is added after a smaller one is stepped wrongly.
class ReducedWorld {
 public:
  ReducedWorld(const ReducedBody& body, const ReducedRun& run) : body_(body), run_(run) {
    constraints_.setDeformableSolver(&solver_);
    world_ = std::make_unique<btDeformableMultiBodyDynamicsWorld>(&dispatcher_, &broad_phase_, &constraints_,
                                                                  &configuration_, &solver_);
    const btVector3 gravity(0, 0, run.on_ground ? bullet(-9.80665) : 0);
    world_->setGravity(gravity);
    world_->getWorldInfo().m_gravity = gravity;
    world_->getWorldInfo().m_sparsesdf.setDefaultVoxelsz(bullet(0.25));
    world_->getWorldInfo().m_sparsesdf.Reset();
    world_->setImplicit(false);
    world_->setLineSearch(false);
    world_->setUseProjection(false);
    auto& info = world_->getSolverInfo();
    info.m_deformable_erp = info.m_deformable_cfm = bullet(0.2);
    info.m_friction = bullet(0.5);
    info.m_deformable_maxErrorReduction = 200;
    info.m_leastSquaresResidualThreshold = bullet(1e-3);
    info.m_splitImpulse = false;
    info.m_numIterations = 100;
    if (run.on_ground) add_ground();
    for (int i = 0; i < run.bodies; ++i) add_body(i);
  }
  ~ReducedWorld() {
    for (const auto& body : bodies_) world_->removeSoftBody(body.get());
    if (ground_) world_->removeRigidBody(ground_.get());
  }
  ReducedWorld(const ReducedWorld&) = delete;
  ReducedWorld& operator=(const ReducedWorld&) = delete;

  ReducedCost play() {
    std::vector<double> seconds;
    double contacts = 0.0;
    for (int n = 0; n < run_.steps; ++n) {
      const double began = thread_seconds();
      world_->stepSimulation(bullet(run_.step), 0);
      if (n < run_.steps / 2) continue;
      seconds.push_back(thread_seconds() - began);
      for (const auto& body : bodies_) contacts += static_cast<double>(body->m_nodeRigidContacts.size());
    }
    ReducedCost cost{.seconds = quantile(seconds, 0.5),
                     .contacts = contacts / static_cast<double>(seconds.size()) / run_.bodies};
    for (const auto& body : bodies_)
      cost.is_finite = cost.is_finite && std::isfinite(static_cast<double>(body->m_nodes[0].m_x.z()));
    return cost;
  }

 private:
  void add_ground() {
    constexpr double kHalf = 100.0;
    ground_shape_ = std::make_unique<btBoxShape>(btVector3(bullet(kHalf), bullet(kHalf), 2));
    btRigidBody::btRigidBodyConstructionInfo info(0, nullptr, ground_shape_.get());
    info.m_startWorldTransform = btTransform(btQuaternion::getIdentity(), btVector3(0, 0, -2));
    ground_ = std::make_unique<btRigidBody>(info);
    world_->addRigidBody(ground_.get());
  }

  void add_body(int number) {
    const auto nodes = static_cast<int>(body_.nodes.size()), k = static_cast<int>(body_.modes.size());
    std::vector<btVector3> places;
    double low = 0.0;
    for (const Vec3& p : body_.nodes) places.push_back(bullet(p)), low = std::min(low, p.z());
    bodies_.push_back(
        std::make_unique<btReducedDeformableBody>(&world_->getWorldInfo(), nodes, places.data(), nullptr));
    btReducedDeformableBody& s = *bodies_.back();
    for (const Tet& t : body_.tets) s.appendTetra(t[0], t[1], t[2], t[3]);
    for (const Triangle& t : body_.triangles) s.appendFace(t[0], t[1], t[2]);
    for (int i = 0; i < nodes; ++i) s.m_nodes[i].index = i;
    if (!body_.tets.empty()) {
      s.initializeDmInverse();
      s.m_tetraScratches.resize(s.m_tetras.size());
      s.m_tetraScratchesTn.resize(s.m_tetras.size());
    }
    s.setReducedModes(k, nodes);
    s.m_eigenvalues.resize(k), s.m_Kr.resize(k), s.m_modes.resize(k);
    for (int r = 0; r < k; ++r) {
      const auto mode = static_cast<std::size_t>(r);
      s.m_eigenvalues[r] = s.m_Kr[r] = bullet(body_.eigenvalues[mode]);
      s.m_modes[r].resize(3 * nodes);
      for (int i = 0; i < 3 * nodes; ++i)
        s.m_modes[r][i] = bullet(body_.modes[mode][static_cast<std::size_t>(i / 3)][i % 3]);
    }
    btAlignedObjectArray<btScalar> mass;
    for (const double m : body_.masses) mass.push_back(bullet(m));
    s.setMassProps(mass);
    s.setInertiaProps();
    s.internalInitialization();
    s.disableReducedModes(false);
    world_->addSoftBody(&s);
    s.getCollisionShape()->setMargin(bullet(0.01));
    constexpr double kGap = 0.002;  // m: within the margin from the first step
    s.transformTo(
        btTransform(btQuaternion::getIdentity(), btVector3(0, number, run_.on_ground ? bullet(kGap - low) : 10)));
    s.setStiffnessScale(1);
    s.setDamping(0, bullet(run_.damping));
    s.m_cfg.kKHR = s.m_cfg.kCHR = 1;
    s.m_cfg.kDF = 0;
    s.m_cfg.collisions = btSoftBody::fCollision::SDF_RD | btSoftBody::fCollision::SDF_RDN;
    s.m_sleepingThreshold = 0;
    constexpr double kRinging = 0.002;
    for (int r = 0; r < k; ++r) s.m_reducedDofs[r] = s.m_reducedDofsBuffer[r] = bullet(kRinging / (1 + r));
  }

  const ReducedBody& body_;
  const ReducedRun& run_;
  btSoftBodyRigidBodyCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_{&configuration_};
  btDbvtBroadphase broad_phase_;
  btReducedDeformableBodySolver solver_;
  btDeformableMultiBodyConstraintSolver constraints_;
  std::unique_ptr<btDeformableMultiBodyDynamicsWorld> world_;
  std::unique_ptr<btBoxShape> ground_shape_;
  std::unique_ptr<btRigidBody> ground_;
  std::vector<std::unique_ptr<btReducedDeformableBody>> bodies_;
};

}  // namespace

std::unique_ptr<PileEngine> bullet_pile(const RigidPile& pile) { return std::make_unique<BulletPile>(pile); }

ReducedCost run_bullet(const ReducedBody& body, const ReducedRun& run) {
  // The packaged library profiles itself; without listeners it is a little faster.
  btSetCustomEnterProfileZoneFunc([](const char*) {});
  btSetCustomLeaveProfileZoneFunc([] {});
  return ReducedWorld(body, run).play();
}

}  // namespace limber::tools
