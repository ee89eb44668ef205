// What a body with a modal skin does under load, λ z = J(z)ᵀ f, against nonlinear finite elements of all its nodes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <optional>

#include "constants.h"
#include "limber/mesh/read_mesh.h"
#include "limber/model/skin_pose.h"
#include "limber/precompute/tetrahedralise.h"
#include "nonlinear_fem.h"

namespace limber {
namespace {

using namespace limber::testing;
using Vector = Eigen::VectorXd;

/// One body, some nodes of which are held and some, its tip, loaded.
class Loaded {
 public:
  Loaded(TetMesh mesh, const std::function<bool(const Vec3&)>& held, const std::function<bool(const Vec3&)>& tip,
         int modes = 20, Index handles = 16)
      : body_(limber::testing::skinned(mesh, nodes_where(mesh, held), modes, handles)),
        tip_(nodes_where(mesh, tip)),
        pose_(body_->skin.skin) {}

  const SkinnedBody& body() const { return *body_; }
  std::span<const Index> tip() const { return tip_; }
  double stiffness(Eigen::Index i) const { return body_->body->eigenvalues[static_cast<std::size_t>(i)]; }
  Eigen::Index modes() const { return static_cast<Eigen::Index>(body_->modes()); }

  Vec3 mean_tip(std::span<const Vec3> x) const {
    Vec3 sum = Vec3::Zero();
    for (const Index v : tip_) sum += x[static_cast<std::size_t>(v)];
    return sum / static_cast<double>(tip_.size());
  }
  /// Jᵀ f of a force spread over the tip.
  Vector modal_force(const Vector& z, const Vec3& f) {
    pose_.set({z.data(), static_cast<std::size_t>(z.size())});
    pose_.differentiate();
    std::vector<double> g(static_cast<std::size_t>(z.size()), 0.0);
    for (const Index node : tip_) {
      const auto v = static_cast<std::size_t>(node);
      const Vec3 share = f / static_cast<double>(tip_.size());
      const Vec3 by_modes =
          pose_.add_rows(body_->skin.nodes[v], body_->rest(v), body_->linear(v, numbers(z)), share, g);
      for (std::size_t i = 0; i < g.size(); ++i) g[i] += body_->shape(v, static_cast<Index>(i)).dot(by_modes);
    }
    return Eigen::Map<const Vector>(g.data(), z.size());
  }
  /// Λ − ∂(Jᵀ f)/∂z, its second part by central differences.
  Eigen::MatrixXd tangent(const Vector& z, const Vec3& f) {
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(modes(), modes());
    for (Eigen::Index i = 0; i < modes(); ++i) {
      const double step = 1e-5 / std::sqrt(stiffness(i) / stiffness(0));
      H.col(i) =
          -(modal_force(z + step * Vector::Unit(modes(), i), f) - modal_force(z - step * Vector::Unit(modes(), i), f)) /
          (2.0 * step);
      H(i, i) += stiffness(i);
    }
    return H;
  }
  Vector elastic(const Vector& z) const {
    Vector out(modes());
    for (Eigen::Index i = 0; i < modes(); ++i) out[i] = stiffness(i) * z[i];
    return out;
  }

  /// λ z = Jᵀ f, the load raised in steps.
  Vector under_dead_load(const Vec3& force) {
    Vector z = Vector::Zero(modes());
    constexpr int kSteps = 12;
    for (int s = 1; s <= kSteps; ++s) {
      const Vec3 f = force * (static_cast<double>(s) / kSteps);
      for (int round = 0; round < 20; ++round) z += tangent(z, f).partialPivLu().solve(modal_force(z, f) - elastic(z));
    }
    return z;
  }
  /// The least elastic energy with the tip's mean at the last of some places, reached by way of the others, and the
  /// force that holds it there: Newton's method on the Lagrangian.
  std::pair<Vector, Vec3> pulled_along(std::span<const Vec3> path) {
    Vector z = Vector::Zero(modes());
    Vec3 f = Vec3::Zero();
    for (const Vec3& target : path)
      for (int round = 0; round < 12; ++round) {
        Eigen::MatrixXd KKT = Eigen::MatrixXd::Zero(modes() + 3, modes() + 3);
        KKT.topLeftCorner(modes(), modes()) = tangent(z, f);
        for (int axis = 0; axis < 3; ++axis) {
          KKT.block(0, modes() + axis, modes(), 1) = -modal_force(z, Vec3::Unit(axis));
          KKT.block(modes() + axis, 0, 1, modes()) = KKT.block(0, modes() + axis, modes(), 1).transpose();
        }
        Vector rhs(modes() + 3);
        rhs << modal_force(z, f) - elastic(z), mean_tip(places(z)) - target;
        const Vector step = KKT.partialPivLu().solve(rhs);
        z += step.head(modes());
        f += step.tail<3>();
        if (step.head(modes()).norm() <= 1e-10 * z.norm()) break;
      }
    return {z, f};
  }
  std::vector<Vec3> places(const Vector& z) const { return body_->places(numbers(z)); }

 private:
  static std::span<const double> numbers(const Vector& z) { return {z.data(), static_cast<std::size_t>(z.size())}; }

  std::unique_ptr<SkinnedBody> body_;
  std::vector<Index> tip_;
  SkinPose pose_;
};

/// What is asked of a bend: largest errors over the length, and of the hand's force. Dead loads that may err by
/// anything are not tried.
struct Bend {
  double degrees, dead_load, hand, hand_force;
};

/// @param normal the load's direction at rest @param axis about which the tip turns
void expect_bends(Loaded& body, double length, const Vec3& normal, const Vec3& axis, double small,
                  std::span<const Bend> bends) {
  for (const Bend& bend : bends) {
    SCOPED_TRACE(bend.degrees);
    // Tilted with the tip by half its turn, so that it bends more than it pulls.
    const Vec3 direction = Eigen::AngleAxisd(0.5 * bend.degrees * kDegree, axis) * normal;
    const auto exact = bend_by_load(body.body(), body.tip(), body.tip(), direction, small, bend.degrees * kDegree);
    ASSERT_FALSE(exact.empty());
    const std::vector<Vec3>& places = exact.back().places;
    std::vector<Vec3> path;
    for (const BentByLoad& at : exact) path.push_back(body.mean_tip(at.places));
    const auto [z, f] = body.pulled_along(path);
    if (bend.dead_load < kInfinity) {
      const auto loaded = body.places(body.under_dead_load(exact.back().force * direction));
      EXPECT_LE(largest_distance(loaded, places) / length, bend.dead_load);
    }
    EXPECT_LE(largest_distance(body.places(z), places) / length, bend.hand);
    EXPECT_NEAR(f.norm() / exact.back().force, 1.0, bend.hand_force);
  }
}

TEST(SkinStatics, BarBendsAsNonlinearFiniteElementsDo) {
  Loaded bar(
      mirrored_box(20, 2, 2, {10.0, 1.5, 1.0}), [](const Vec3& x) { return x.x() < 1e-9; },
      [](const Vec3& x) { return x.x() > 10.0 - 1e-9; });
  expect_bends(bar, 10.0, Vec3::UnitZ(), -Vec3::UnitY(), 10.0,
               std::vector<Bend>{{60.0, 0.04, 0.006, 0.1}, {90.0, 0.1, 0.015, 0.15}, {120.0, kInfinity, 0.027, 0.3}});
}

/// The Stanford bunny, 2 m long, held below its ears, and the ear whose tip stands highest. None where Debian's package
/// glmark2-data is not installed.
class BunnyEar {
 public:
  static std::optional<TetMesh> mesh() {
    const std::filesystem::path file = "/usr/share/glmark2/models/bunny.obj";
    if (!std::filesystem::exists(file)) return std::nullopt;
    Warnings warnings;
    return tetrahedralise(read_surface_mesh(file, warnings), {.cell_size = 0.16, .max_nodes = 1}, warnings).mesh;
  }
  explicit BunnyEar(TetMesh mesh) : top_(highest(mesh)), loaded_(std::move(mesh), is_held, is_tip(top_), 40, 24) {
    const SkinnedBody& b = loaded_.body();
    // The two lowest modes bend an ear each.
    const Index mode = shift(0).norm() > shift(1).norm() ? 0 : 1;
    const Vec3 along = top_ - kRoot;
    length_ = along.norm();
    normal_ = shift(mode) - along * (shift(mode).dot(along) / along.squaredNorm());
    if (normal_.z() > 0.0) normal_ = -normal_;
    // What moves the tip by a tenth of the ear if nothing but that mode gives way.
    small_force_ = 0.1 * length_ * b.body->eigenvalues[static_cast<std::size_t>(mode)] / normal_.squaredNorm();
    normal_.normalize();
    axis_ = along.cross(normal_).normalized();
  }
  Loaded& loaded() { return loaded_; }
  double length() const { return length_; }
  const Vec3& normal() const { return normal_; }
  const Vec3& axis() const { return axis_; }
  double small_force() const { return small_force_; }

 private:
  inline static const Vec3 kRoot{-0.4, 0.45, -0.1};  // of the ears
  static bool is_held(const Vec3& x) { return x.y() < kRoot.y(); }
  static Vec3 highest(const TetMesh& mesh) {
    return *std::ranges::max_element(mesh.nodes, {}, [](const Vec3& x) { return x.y(); });
  }
  static std::function<bool(const Vec3&)> is_tip(const Vec3& top) {
    return [top](const Vec3& x) { return (x - top).norm() < 0.25; };
  }
  Vec3 shift(Index mode) const {
    Vec3 sum = Vec3::Zero();
    for (const Index v : loaded_.tip()) sum += loaded_.body().shape(static_cast<std::size_t>(v), mode);
    return sum / static_cast<double>(loaded_.tip().size());
  }

  Vec3 top_;
  Loaded loaded_;
  double length_ = 0.0, small_force_ = 0.0;
  Vec3 normal_, axis_;
};

/// Modes from the third on bend one ear or both in waves.
TEST(SkinStatics, BunnysEarsAreWhereRotationStrainWarpingHasThem) {
  std::optional<TetMesh> mesh = BunnyEar::mesh();
  if (!mesh) GTEST_SKIP() << "Debian package glmark2-data is not installed";
  BunnyEar ear(std::move(*mesh));
  const SkinnedBody& b = ear.loaded().body();
  for (Index mode = 0; mode < 6; ++mode) {
    SCOPED_TRACE(mode);
    const std::vector<double> z = turned_by(b, mode, 120.0 * kDegree);
    const std::vector<Vec3> places = b.places(z);
    EXPECT_LE(largest_distance(places, rotation_strain(b, z)), 0.04 * ear.length());
    for (const Index v : b.fixed) EXPECT_EQ(places[static_cast<std::size_t>(v)], b.rest(static_cast<std::size_t>(v)));
  }
}

TEST(SkinStatics, BunnysEarIsPulledAsNonlinearFiniteElementsAre) {
  std::optional<TetMesh> mesh = BunnyEar::mesh();
  if (!mesh) GTEST_SKIP() << "Debian package glmark2-data is not installed";
  BunnyEar ear(std::move(*mesh));
  const std::vector<Bend> bends{{60.0, kInfinity, 0.02, 0.15}};
  for (const double side : {1.0, -1.0}) {
    SCOPED_TRACE(side);
    expect_bends(ear.loaded(), ear.length(), side * ear.normal(), side * ear.axis(), ear.small_force(), bends);
  }
}

}  // namespace
}  // namespace limber
