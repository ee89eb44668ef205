// Time of finding which triangles of two deforming bodies may touch: by boxes from amplitudes, and FCL. See
// README.md.
#include <benchmark/benchmark.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/narrowphase/collision.h>

#include <cmath>
#include <memory>
#include <numbers>
#include <numeric>
#include <string>
#include <vector>

#include "cpu_time.h"
#include "limber/collision/tree_traversal.h"
#include "limber/dynamics/reconstruct.h"
#include "wavy_model.h"

namespace limber {
namespace {

using Surface = std::shared_ptr<const CollisionSurface>;

/// A plate over [−1, 1]² of `cells` × `cells` squares, facing up, with `bumps` round bumps of height 0.1 below or
/// above.
SurfaceMesh plate(Index cells, int bumps, double height) {
  SurfaceMesh mesh;
  const int rows = std::max(1, static_cast<int>(std::ceil(std::sqrt(bumps))));
  const auto bump = [&](double x, double y) {
    if (bumps == 0) return 0.0;
    double z = 0.0;
    for (int b = 0; b < bumps; ++b) {
      const double dx = x - (2.0 * (b % rows) + 1.0 - rows) / rows, dy = y - (2.0 * (b / rows) + 1.0 - rows) / rows;
      z = std::max(z, std::exp(-4.0 * rows * rows * (dx * dx + dy * dy)));
    }
    return height * z;
  };
  for (Index j = 0; j <= cells; ++j)
    for (Index i = 0; i <= cells; ++i) {
      const double x = 2.0 * i / cells - 1.0, y = 2.0 * j / cells - 1.0;
      mesh.vertices.emplace_back(x, y, bump(x, y));
    }
  for (Index j = 0; j < cells; ++j)
    for (Index i = 0; i < cells; ++i) {
      const Index v = j * (cells + 1) + i;
      mesh.triangles.push_back({v, v + 1, v + cells + 2});
      mesh.triangles.push_back({v, v + cells + 2, v + cells + 1});
    }
  return mesh;
}

/// A ball of radius 1: `rings` × 2·rings quads, split.
SurfaceMesh ball(Index rings) {
  SurfaceMesh mesh;
  const Index around = 2 * rings;
  const double pi = std::numbers::pi;
  for (Index j = 1; j < rings; ++j)
    for (Index i = 0; i < around; ++i) {
      const double polar = pi * j / rings, turn = 2.0 * pi * i / around;
      mesh.vertices.emplace_back(std::sin(polar) * std::cos(turn), std::sin(polar) * std::sin(turn), std::cos(polar));
    }
  const auto top = static_cast<Index>(mesh.vertices.size());
  mesh.vertices.emplace_back(0, 0, 1);
  mesh.vertices.emplace_back(0, 0, -1);
  for (Index i = 0; i < around; ++i) {
    const Index next = (i + 1) % around, last = (rings - 2) * around;
    mesh.triangles.push_back({top, i, next});
    mesh.triangles.push_back({top + 1, last + next, last + i});
    for (Index j = 0; j + 2 < rings; ++j) {
      const Index v = j * around;
      mesh.triangles.push_back({v + i, v + around + i, v + around + next});
      mesh.triangles.push_back({v + i, v + around + next, v + next});
    }
  }
  return mesh;
}

std::vector<double> amplitudes(Index modes, double size) {
  std::vector<double> z;
  for (Index i = 0; i < modes; ++i) z.push_back(size * std::sin(1.0 + i) / (1.0 + 0.6 * i));
  return z;
}

/// States of two bodies.
enum Scene { kFar, kNearBalls, kTouchingBalls, kOnePlace, kTenPlaces, kHundredPlaces, kEverywhere };
constexpr const char* kSceneNames[] = {"far",       "near, gap 2 %", "touching, 1 % deep", "1 place",
                                       "10 places", "100 places",    "everywhere"};

/// A second of 30 steps, in which both bodies vibrate and one moves there and back: by 2 % of the balls' diameter, so
/// that they come near and touch in turn, by a tenth of the bumps' height, or of flat plates as far as they vibrate.
constexpr int kSteps = 30;

struct State {
  RigidTransform X_AB;
  std::vector<double> z_a, z_b;
};

struct Pair {
  Surface a, b;
  RigidTransform X_AB;
  std::vector<double> z_a, z_b;
  Vec3 way;  // from the middle of the motion to its end

  Pair(Scene scene, bool large, Index modes, int leaf_triangles = 4) {
    const bool balls = scene <= kTouchingBalls;
    const SurfaceMesh below = balls ? ball(large ? 71 : 26) : plate(large ? 100 : 36, 0, 0.0);
    const int bumps = scene == kOnePlace ? 1 : scene == kTenPlaces ? 10 : scene == kHundredPlaces ? 100 : 0;
    const CollisionSurfaceOptions options{.leaf_triangles = leaf_triangles};
    a = std::make_shared<const CollisionSurface>(testing::wavy_model(below, modes), options);
    b = balls ? a
              : std::make_shared<const CollisionSurface>(
                    testing::wavy_model(plate(large ? 100 : 36, bumps, -0.1), modes), options);
    // Balls are bent by some 5 %; plates hardly, so that the places stay what they are.
    z_a = amplitudes(modes, balls ? 0.02 : 1e-4);
    z_b = amplitudes(modes, balls ? -0.02 : 1e-4);
    way = balls ? Vec3(0.04, 0.0, 0.0) : Vec3(0.0, 0.0, scene == kEverywhere ? 1e-4 : 0.01);
    if (balls) {
      X_AB.q = quaternion_from_rotation_vector({0.0, 0.0, 0.7});
      X_AB.p = Vec3(scene == kFar ? 16.0 : gap_free_distance() + (scene == kNearBalls ? 0.04 : -0.02), 0.0, 0.0);
    } else {
      X_AB.p = Vec3(0.0, 0.0, scene == kEverywhere ? 1e-5 : 0.085);
    }
  }

  State at(int step) const {
    const double t = step / double{kSteps}, swing = std::sin(2.0 * std::numbers::pi * t);
    State s{X_AB, z_a, z_b};
    for (std::size_t i = 0; i < z_a.size(); ++i) {
      const double omega = std::sqrt(a->model()->data().eigenvalues[i]);
      s.z_a[i] *= std::cos(omega * t), s.z_b[i] *= std::sin(omega * t);
    }
    s.X_AB.q = quaternion_from_rotation_vector({0.0, 0.0, 0.1 * swing}) * X_AB.q;
    s.X_AB.p += swing * way;
    return s;
  }

  /// Distance of the balls' centres along x at which they touch, by bisection on the triangles' own pairs.
  double gap_free_distance() const {
    DeformedSurface first, second;
    first.bind(a, z_a);
    second.bind(b, z_b);
    double low = 0.0, high = 4.0;
    while (high - low > 1e-4) {
      RigidTransform X = X_AB;
      X.p = Vec3(0.5 * (low + high), 0.0, 0.0);
      std::vector<TrianglePair> pairs;
      find_triangle_pairs(first, second, X, 0.0, pairs);
      (pairs.empty() ? high : low) = 0.5 * (low + high);
    }
    return high;
  }
};

/// One way of answering, as a body meets the same other one in step after step.
struct Query {
  DeformedSurface a, b;
  std::vector<TrianglePair> pairs;

  void run(const Pair& pair, const State& state) {
    a.bind(pair.a, state.z_a);
    b.bind(pair.b, state.z_b);
    pairs.clear();
    find_triangle_pairs(a, b, state.X_AB, 0.0, pairs);
  }
};

template <class Pass>
double least_seconds(benchmark::State& state, const Pass& pass, int repeats) {
  LeastTime time;
  (void)state;
  for (int i = 0; i < 15; ++i)
    time.measure([&] {
      for (int r = 0; r < repeats; ++r) pass();
    });
  return time.seconds() / repeats;
}

/// FCL's tree of oriented boxes over the same triangles: new vertices, refit, and the query that lists contacts.
class FclPair {
 public:
  using Model = fcl::BVHModel<fcl::OBBRSS<double>>;
  explicit FclPair(const Pair& pair) : pair_(pair), a_(make(*pair.a, pair.z_a)), b_(make(*pair.b, pair.z_b)) {
    X_.translation() = pair.X_AB.p;
    X_.linear() = to_matrix(pair.X_AB.q);
  }
  void refit() {
    replace(*a_, *pair_.a, pair_.z_a);
    replace(*b_, *pair_.b, pair_.z_b);
  }
  void collide() {
    fcl::CollisionRequest<double> request(1000000, false);
    fcl::CollisionResult<double> result;
    fcl::collide(a_.get(), fcl::Transform3<double>::Identity(), b_.get(), X_, request, result);
    contacts = result.numContacts();
  }
  std::size_t contacts = 0;

 private:
  static std::vector<fcl::Vector3<double>> positions(const CollisionSurface& s, const std::vector<double>& z) {
    std::vector<float> xyz(3 * static_cast<std::size_t>(s.vertices()));
    const ReconstructionTarget target{.amplitudes = z.data(), .positions = xyz.data()};
    reconstruct(s.model()->collision(), std::span(&target, 1));
    std::vector<fcl::Vector3<double>> out;
    for (std::size_t v = 0; v + 2 < xyz.size(); v += 3) out.emplace_back(xyz[v], xyz[v + 1], xyz[v + 2]);
    return out;
  }
  static std::shared_ptr<Model> make(const CollisionSurface& s, const std::vector<double>& z) {
    auto model = std::make_shared<Model>();
    std::vector<fcl::Triangle> triangles;
    for (Index t = 0; t < s.triangles(); ++t) {
      const auto& [i, j, k] = s.triangle(t);
      triangles.emplace_back(i, j, k);
    }
    model->beginModel();
    model->addSubModel(positions(s, z), triangles);
    model->endModel();
    return model;
  }
  static void replace(Model& model, const CollisionSurface& s, const std::vector<double>& z) {
    model.beginReplaceModel();
    model.replaceSubModel(positions(s, z));
    model.endReplaceModel(true);
  }

  const Pair& pair_;
  std::shared_ptr<Model> a_, b_;
  fcl::Transform3<double> X_ = fcl::Transform3<double>::Identity();
};

/// range(0) scene, range(1) large, range(2) modes.
void pair(benchmark::State& state) {
  const auto scene = static_cast<Scene>(state.range(0));
  const Pair bodies(scene, state.range(1) != 0, static_cast<Index>(state.range(2)));
  std::vector<State> states;
  for (int step = 0; step < kSteps; ++step) states.push_back(bodies.at(step));
  Query query;
  for (auto _ : state) {
    LeastTime all;
    for (int round = 0; round < 4; ++round)
      all.measure([&] {
        for (const State& now : states) query.run(bodies, now);
      });
    state.counters["us"] = 1e6 * all.seconds() / kSteps;
  }
  state.SetLabel(kSceneNames[scene]);
}

void fcl_pair(benchmark::State& state) {
  const auto scene = static_cast<Scene>(state.range(0));
  const Pair bodies(scene, state.range(1) != 0, static_cast<Index>(state.range(2)));
  const State now{bodies.X_AB, bodies.z_a, bodies.z_b};
  FclPair fcl(bodies);
  Query query;
  double refit = 0.0, collide = 0.0, own = 0.0;
  for (auto _ : state) {
    LeastTime refit_time, collide_time;
    for (int i = 0; i < 3; ++i) refit_time.measure([&] { fcl.refit(); });
    for (int i = 0; i < 3; ++i) collide_time.measure([&] { fcl.collide(); });
    refit = refit_time.seconds(), collide = collide_time.seconds();
    own = least_seconds(
        state, [&] { query.run(bodies, now); }, 3);
  }
  state.SetLabel(kSceneNames[scene]);
  state.counters["fcl_refit_us"] = 1e6 * refit;
  state.counters["fcl_collide_us"] = 1e6 * collide;
  state.counters["us"] = 1e6 * own;
  state.counters["fcl_over_limber"] = (refit + collide) / own;
  state.counters["contacts"] = static_cast<double>(fcl.contacts);
}

/// range(0) modes, range(1) triangles per leaf, range(2) large: one box, one vertex.
void boxes(benchmark::State& state) {
  const Pair bodies(kFar, state.range(2) != 0, static_cast<Index>(state.range(0)), static_cast<int>(state.range(1)));
  DeformedSurface body;
  const auto nodes = static_cast<Index>(bodies.a->nodes().size());
  double all = 0.0, vertices = 0.0;
  for (auto _ : state) {
    all = least_seconds(
        state,
        [&] {
          body.bind(bodies.a, bodies.z_a);
          for (Index n = 0; n < nodes; ++n) benchmark::DoNotOptimize(body.bounds(n));
        },
        3);
    vertices = least_seconds(
        state,
        [&] {
          body.bind(bodies.a, bodies.z_a);
          for (Index v = 0; v < bodies.a->vertices(); ++v) benchmark::DoNotOptimize(body.vertex(v));
        },
        3);
  }
  state.counters["box_ns"] = 1e9 * all / nodes;
  state.counters["vertex_ns"] = 1e9 * vertices / bodies.a->vertices();
  state.counters["triangles"] = bodies.a->triangles();
}

/// range(0) modes, range(1) bodies: balls of 2,600 triangles on a cubic grid, each tested with its three neighbours
/// ahead, 5 % of the diameter apart or (range(2)) touching: flexing, with states of their own, and the same surface
/// rigid.
void crowd(benchmark::State& state) {
  const auto modes = static_cast<Index>(state.range(0));
  const auto count = static_cast<Index>(state.range(1));
  const Surface flexing = std::make_shared<const CollisionSurface>(testing::wavy_model(ball(26), modes));
  const SurfaceMesh mesh = ball(26);
  const Surface rigid = std::make_shared<const CollisionSurface>(TriangleMesh{mesh.vertices, mesh.triangles});
  std::vector<std::vector<double>> z;
  for (Index b = 0; b < count; ++b) {
    z.emplace_back();
    for (Index i = 0; i < modes; ++i) z.back().push_back(0.004 * std::sin(1.0 + i + 3.7 * b) / (1.0 + 0.6 * i));
  }
  DeformedSurface a, b;
  std::vector<TrianglePair> pairs;
  const double spacing = state.range(2) != 0 ? 2.0 : 2.1;
  const auto all = [&](const Surface& surface, bool flexes) {
    const auto amplitudes_of = [&](Index body) {
      return flexes ? std::span<const double>(z[static_cast<std::size_t>(body % count)]) : std::span<const double>();
    };
    for (Index body = 0; body < count; ++body) {
      a.bind(surface, amplitudes_of(body));
      for (int axis = 0; axis < 3; ++axis) {
        b.bind(surface, amplitudes_of(body + 1 + 10 * axis));
        pairs.clear();
        const Quaternion turned = quaternion_from_rotation_vector(Vec3(0.1 * (body % 7), 0.2, 0.3 * axis));
        find_triangle_pairs(a, b, {.q = turned, .p = Vec3(spacing * Vec3::Unit(axis))}, 0.0, pairs);
      }
    }
  };
  double seconds[2] = {};
  for (auto _ : state) {
    seconds[0] = least_seconds(
        state, [&] { all(flexing, true); }, 1);
    seconds[1] = least_seconds(
        state, [&] { all(rigid, false); }, 1);
  }
  state.counters["flexing_us_per_body"] = 1e6 * seconds[0] / count;
  state.counters["rigid_us_per_body"] = 1e6 * seconds[1] / count;
  state.counters["flexing_over_rigid"] = seconds[0] / seconds[1];
}

BENCHMARK(crowd)->ArgNames({"modes", "bodies", "touching"})->ArgsProduct({{8, 32}, {2000}, {0, 1}})->Iterations(1);
BENCHMARK(boxes)->ArgNames({"modes", "leaf", "large"})->ArgsProduct({{8, 32, 64}, {1, 2, 4, 8}, {0, 1}})->Iterations(1);
BENCHMARK(pair)
    ->ArgNames({"scene", "large", "modes"})
    ->ArgsProduct({{kFar, kNearBalls, kTouchingBalls, kOnePlace, kTenPlaces, kHundredPlaces, kEverywhere},
                   {0, 1},
                   {8, 32, 64}})
    ->Iterations(1);
BENCHMARK(fcl_pair)
    ->ArgNames({"scene", "large", "modes"})
    ->ArgsProduct({{kFar, kNearBalls, kTouchingBalls, kHundredPlaces}, {0, 1}, {32}})
    ->Iterations(1);

}  // namespace
}  // namespace limber
