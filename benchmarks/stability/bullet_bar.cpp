// One bar by Bullet's reduced deformable body, set up as in its ReducedBenchmark example: explicit, error reduction
// 0.2, 100 iterations, one internal step per call.
#include <BulletSoftBody/BulletReducedDeformableBody/btReducedDeformableBody.h>
#include <BulletSoftBody/BulletReducedDeformableBody/btReducedDeformableBodySolver.h>
#include <BulletSoftBody/btDeformableMultiBodyConstraintSolver.h>
#include <BulletSoftBody/btDeformableMultiBodyDynamicsWorld.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "constants.h"
#include "limber/core/quaternion.h"
#include "stability_bars.h"

namespace limber::testing {
namespace {

btVector3 of(const Vec3& v) {
  return {static_cast<btScalar>(v.x()), static_cast<btScalar>(v.y()), static_cast<btScalar>(v.z())};
}
Vec3 of(const btVector3& v) { return {double{v.x()}, double{v.y()}, double{v.z()}}; }

/// Data of a bar for both engines.
struct LumpedBar {
  std::shared_ptr<const ModalModel> model;
  TetMesh mesh;
  std::vector<Vec3> rest;  // about the mass centre
  std::vector<double> masses;

  explicit LumpedBar(const StabilityCase& at)
      : model(baked_bar(at, 1.0, MassKind::kLumped)), mesh(bar_mesh(at)), masses(mesh.nodes.size(), 0.0) {
    for (const Tet& t : mesh.tets) {
      const auto corner = [&](std::size_t i) { return mesh.nodes[static_cast<std::size_t>(t[i])]; };
      const double volume = (corner(1) - corner(0)).cross(corner(2) - corner(0)).dot(corner(3) - corner(0)) / 6.0;
      for (const Index n : t) masses[static_cast<std::size_t>(n)] += 0.25 * at.density * volume;
    }
    for (const Vec3& x : mesh.nodes) rest.push_back(x - model->data().origin_in_input);
  }
};

class BulletWorld {
 public:
  BulletWorld(const StabilityCase& at, const LumpedBar& bar) : at_(at), bar_(bar) {
    solver_.setDeformableSolver(&bodies_solver_);
    world_ = std::make_unique<btDeformableMultiBodyDynamicsWorld>(&dispatcher_, &broad_phase_, &solver_,
                                                                  &configuration_, &bodies_solver_);
    const btVector3 gravity = of(Vec3(at.gravity * kDown));
    world_->setGravity(gravity);
    world_->getWorldInfo().m_gravity = gravity;
    world_->getWorldInfo().m_sparsesdf.setDefaultVoxelsz(static_cast<btScalar>(0.25 * at.size));
    world_->getWorldInfo().m_sparsesdf.Reset();
    world_->setImplicit(false);
    world_->setLineSearch(false);
    world_->setUseProjection(false);
    btContactSolverInfo& options = world_->getSolverInfo();
    options.m_deformable_erp = 0.2f, options.m_deformable_cfm = 0.2f, options.m_deformable_maxErrorReduction = 200;
    options.m_friction = static_cast<btScalar>(at.friction);
    options.m_leastSquaresResidualThreshold = 1e-3f;
    options.m_splitImpulse = false;
    options.m_numIterations = 100;
    if (at.scene == StabilityScene::kGround) add_ground();
    add_bar();
  }
  ~BulletWorld() {
    world_->removeSoftBody(body_.get());
    if (ground_) world_->removeRigidBody(ground_.get());
  }
  BulletWorld(const BulletWorld&) = delete;
  BulletWorld& operator=(const BulletWorld&) = delete;

  void step(double seconds) { world_->stepSimulation(static_cast<btScalar>(seconds), 0); }

  void start(const Vec3& velocity, const Vec3& spin) {
    body_->setRigidVelocity(of(velocity));
    body_->setRigidAngularVelocity(of(spin));
  }
  /// A blow at a node at the start, body axes as those of the world.
  void strike_modes(std::size_t node, const Vec3& blow) {
    for (int m = 0; m < modes(); ++m)
      body_->m_reducedVelocity[m] = body_->m_reducedVelocityBuffer[m] =
          static_cast<btScalar>(shape(static_cast<Index>(node), m).dot(blow));
  }

  /// J, of nodes and modes.
  double energy() const {
    double sum = 0.0;
    for (int n = 0; n < body_->m_nodes.size(); ++n) {
      const double mass = bar_.masses[static_cast<std::size_t>(n)];
      sum += 0.5 * mass * of(body_->m_nodes[n].m_v).squaredNorm() -
             mass * (at_.gravity * kDown).dot(of(body_->m_nodes[n].m_x));
    }
    for (int m = 0; m < modes(); ++m) sum += 0.5 * eigenvalue(m) * std::pow(double{body_->m_reducedDofs[m]}, 2);
    return sum;
  }
  std::pair<double, double> heights() const {
    double low = 1e300, high = -1e300;
    for (int n = 0; n < body_->m_nodes.size(); ++n) {
      const double z{body_->m_nodes[n].m_x.z()};
      low = std::min(low, z), high = std::max(high, z);
    }
    return {low, high};
  }

 private:
  int modes() const { return static_cast<int>(bar_.model->modes()); }
  double eigenvalue(int m) const { return bar_.model->data().eigenvalues[static_cast<std::size_t>(m)]; }
  Vec3 shape(Index node, int m) const { return bar_.model->data().volume_block->basis.shape(node, m).cast<double>(); }

  void add_ground() {
    constexpr double kHalf = 1e3;  // times the size
    box_ = std::make_unique<btBoxShape>(of(Vec3(kHalf, kHalf, 10.0) * at_.size));
    btRigidBody::btRigidBodyConstructionInfo info(0, nullptr, box_.get());
    info.m_startWorldTransform.setIdentity();
    info.m_startWorldTransform.setOrigin(of(Vec3(0.0, 0.0, -10.0 * at_.size)));
    info.m_friction = static_cast<btScalar>(at_.friction);
    ground_ = std::make_unique<btRigidBody>(info);
    world_->addRigidBody(ground_.get());
  }

  void add_bar() {
    std::vector<btVector3> places;
    for (const Vec3& r : bar_.rest) places.push_back(of(r));
    body_ = std::make_unique<btReducedDeformableBody>(&world_->getWorldInfo(), static_cast<int>(places.size()),
                                                      places.data(), nullptr);
    for (const Tet& t : bar_.mesh.tets) body_->appendTetra(t[0], t[1], t[2], t[3]);
    for (const Triangle& t : bar_.model->render().triangles)
      body_->appendFace(node_of(t[0]), node_of(t[1]), node_of(t[2]));
    for (int n = 0; n < body_->m_nodes.size(); ++n) body_->m_nodes[n].index = n;
    body_->initializeDmInverse();
    body_->m_tetraScratches.resize(body_->m_tetras.size());
    body_->m_tetraScratchesTn.resize(body_->m_tetras.size());
    body_->setReducedModes(modes(), body_->m_nodes.size());
    body_->m_eigenvalues.resize(modes());
    body_->m_Kr.resize(modes());
    body_->m_modes.resize(modes());
    for (int m = 0; m < modes(); ++m) {
      body_->m_eigenvalues[m] = body_->m_Kr[m] = static_cast<btScalar>(eigenvalue(m));
      body_->m_modes[m].resize(3 * body_->m_nodes.size());
      for (int n = 0; n < body_->m_nodes.size(); ++n)
        for (int axis = 0; axis < 3; ++axis)
          body_->m_modes[m][3 * n + axis] = static_cast<btScalar>(shape(static_cast<Index>(n), m)[axis]);
    }
    btAlignedObjectArray<btScalar> masses;
    for (const double mass : bar_.masses) masses.push_back(static_cast<btScalar>(mass));
    body_->setMassProps(masses);
    body_->setInertiaProps();
    body_->internalInitialization();
    body_->disableReducedModes(false);
    world_->addSoftBody(body_.get());
    body_->getCollisionShape()->setMargin(static_cast<btScalar>(margin()));
    btTransform at;
    at.setIdentity();
    if (at_.scene == StabilityScene::kGround) at.setOrigin(of(Vec3(0.0, 0.0, 0.25 * at_.size)));
    const Quaternion q = quaternion_from_rotation_vector({0.3, 0.5, 0.1});
    at.setRotation(btQuaternion(static_cast<btScalar>(q.x), static_cast<btScalar>(q.y), static_cast<btScalar>(q.z),
                                static_cast<btScalar>(q.w)));
    body_->transformTo(at);
    body_->setStiffnessScale(1);
    const double stiffness_damping =
        at_.damping_ratio == 0.0 ? 0.0 : 2.0 * at_.damping_ratio / std::sqrt(eigenvalue(0));
    body_->setDamping(0, static_cast<btScalar>(stiffness_damping));
    body_->m_cfg.kKHR = 1, body_->m_cfg.kCHR = 1;
    body_->m_cfg.kDF = static_cast<btScalar>(at_.friction);
    body_->m_cfg.collisions = btSoftBody::fCollision::SDF_RD | btSoftBody::fCollision::SDF_RDN;
    body_->m_sleepingThreshold = 0;
  }
  double margin() const { return 0.01 * at_.size; }

  /// Node of the mesh for a vertex of the surface.
  int node_of(Index vertex) const {
    const Vec3 at = bar_.model->render().rest[static_cast<std::size_t>(vertex)].cast<double>();
    const auto nearer = [&](const Vec3& a, const Vec3& b) { return (a - at).norm() < (b - at).norm(); };
    return static_cast<int>(std::min_element(bar_.rest.begin(), bar_.rest.end(), nearer) - bar_.rest.begin());
  }

  const StabilityCase& at_;
  const LumpedBar& bar_;
  btSoftBodyRigidBodyCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_{&configuration_};
  btDbvtBroadphase broad_phase_;
  btReducedDeformableBodySolver bodies_solver_;
  btDeformableMultiBodyConstraintSolver solver_;
  std::unique_ptr<btDeformableMultiBodyDynamicsWorld> world_;
  std::unique_ptr<btBoxShape> box_;
  std::unique_ptr<btRigidBody> ground_;
  std::unique_ptr<btReducedDeformableBody> body_;
};

}  // namespace

bool has_bullet() { return true; }

StabilityResult run_by_bullet(const StabilityCase& at, int steps) {
  const LumpedBar bar(at);
  BulletWorld world(at, bar);
  const double root = std::sqrt(at.size), mass = bar.model->data().mass;
  std::mt19937 random(1);
  const auto step = [&] {
    const double share = at.varying_step ? std::uniform_real_distribution<double>(0.1, 1.0)(random) : 1.0;
    world.step(at.step * share);
  };
  if (at.scene == StabilityScene::kFlight) {
    world.start(root * Vec3(1.0, 0.5, 3.0), at.spin * Vec3(0.6, 0.64, 0.48));
    world.strike_modes(bar.rest.size() - 1, mass * root * Vec3(0.3, 0.2, 1.0));
    step();
  } else {
    world.start(root * Vec3(1.0, 0.0, -1.0) - at.speed * Vec3::UnitZ(), Vec3(0.0, 3.0, 2.0) / root);
  }
  // Energies over the largest of motion and shape at first and m g times the diagonal, as limber's.
  const double potential =
      -mass * at.gravity * kDown.z() * (at.scene == StabilityScene::kGround ? 0.25 * at.size : 0.0);
  const double scale = std::max(std::abs(world.energy() - potential),
                                mass * std::max(at.gravity, 1e-3) * kGravity * at.size * kBarSize.norm());
  StabilityResult result;
  const double first = world.energy();
  double before = first;
  for (; result.steps < steps && result.finite; ++result.steps) {
    step();
    const double now = world.energy();
    result.finite = std::isfinite(now);
    result.worst_rise = std::max(result.worst_rise, (now - before) / scale);
    result.total_rise = std::max(result.total_rise, (now - first) / scale);
    before = now;
    if (at.scene != StabilityScene::kGround) continue;
    const auto [low, high] = world.heights();
    const double length = kBarSize.x() * at.size;
    result.rest_overlap = std::max(0.0, -low / length);
    result.overlap = std::max(result.overlap, result.rest_overlap);
    result.passed = result.passed || high < 0.0;
  }
  result.node_worst_rise = result.worst_rise, result.node_total_rise = result.total_rise;
  return result;
}

}  // namespace limber::testing
