/// Bodies whose frequencies are known, on meshes that are refined: with consistent mass linear tets must come down to
/// them as h², ten-node tets as h⁴ where sides are flat, and not pass them.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <numbers>

#include "limber/mesh/ten_node_tet.h"
#include "limber/precompute/modal_analysis.h"
#include "tet_box.h"

namespace limber {
namespace {

using std::numbers::pi;
using testing::tet_box;
using Field = std::function<Vec3(const Vec3&)>;

std::vector<double> frequencies(const ModalAnalysis& found) {
  std::vector<double> f;
  for (const double lambda : found.eigenvalues) f.push_back(std::sqrt(lambda) / (2 * pi));
  return f;
}

ModalAnalysis analyse(const TetMesh& mesh, const Material& material, int modes) {
  Warnings warnings;
  return analyse_modes(mesh, std::span(&material, 1), {}, {.modes = modes, .mass = MassKind::kConsistent}, warnings);
}

/// The frequency of the mode most like a field, by the M inner product.
double frequency_of(const ModalAnalysis& found, const TetMesh& mesh, const Field& field) {
  double best = -1.0, frequency = 0.0;
  for (std::size_t k = 0; k < found.eigenvalues.size(); ++k) {
    double overlap = 0.0;
    for (std::size_t i = 0; i < mesh.nodes.size(); ++i)
      for (int axis = 0; axis < 3; ++axis)
        overlap += found.mass_times_shapes[3 * mesh.nodes.size() * k + 3 * i + axis] * field(mesh.nodes[i])[axis];
    if (std::abs(overlap) > best) best = std::abs(overlap), frequency = std::sqrt(found.eigenvalues[k]) / (2 * pi);
  }
  return frequency;
}

TetMesh with_ten_nodes(TetMesh mesh) {
  add_mid_edge_nodes(mesh);
  return mesh;
}

/// Errors of two meshes, the second twice as fine: both from above, their order within a band for higher terms.
void expect_order_from_above(double coarse, double fine, double exact, double from = 1.75, double to = 2.25) {
  EXPECT_GT(fine, exact);
  EXPECT_GT(coarse, fine);
  const double order = std::log2((coarse - exact) / (fine - exact));
  EXPECT_GT(order, from);
  EXPECT_LT(order, to);
}

TEST(ExactSolution, BarWithoutPoissonEffectTendsToHalfWaves) {
  // ν = 0: u = cos(mπx/L) e_x, f = m/(2L) √(E/ρ), whatever the section.
  const Material m{.youngs_modulus = 70e9, .poisson_ratio = 0.0, .density = 2700.0};
  const double exact = std::sqrt(m.youngs_modulus / m.density) / 2.0;
  const Field field = [](const Vec3& x) { return Vec3(std::cos(pi * x.x()), 0, 0); };
  std::array<double, 2> f{};
  for (int level = 0; level < 2; ++level) {
    const int n = 8 << level;
    const TetMesh mesh = tet_box(n, n / 4, n / 4, {1.0, 0.25, 0.25});
    f[level] = frequency_of(analyse(mesh, m, 12), mesh, field);
  }
  expect_order_from_above(f[0], f[1], exact);
}

/// A cube [0, 1]³ of cells³ cells, each cut into 24 tets around its centre and the centres of its faces: as symmetric
/// as a cube is, so that modes which are equal in the continuum are equal on the mesh.
inline TetMesh symmetric_cube(int cells) {
  TetMesh mesh;
  mesh.regions = {{.name = "*"}};
  std::map<std::array<int, 3>, Index> number;  // by place in half cells
  const auto node = [&](const std::array<int, 3>& at) {
    const auto [entry, is_new] = number.try_emplace(at, static_cast<Index>(mesh.nodes.size()));
    if (is_new) mesh.nodes.emplace_back(Vec3(at[0], at[1], at[2]) / (2.0 * cells));
    return entry->second;
  };
  for (int cell = 0; cell < cells * cells * cells; ++cell) {
    const std::array<int, 3> centre{2 * (cell % cells) + 1, 2 * (cell / cells % cells) + 1,
                                    2 * (cell / cells / cells) + 1};
    for (int face = 0; face < 6; ++face) {
      const int axis = face / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
      auto middle = centre;
      middle[axis] += face % 2 ? 1 : -1;
      constexpr std::array<std::array<int, 2>, 4> kRound{{{1, 1}, {-1, 1}, {-1, -1}, {1, -1}}};
      for (int side = 0; side < 4; ++side) {
        auto first = middle, second = middle;
        first[u] += kRound[side][0], first[v] += kRound[side][1];
        second[u] += kRound[(side + 1) % 4][0], second[v] += kRound[(side + 1) % 4][1];
        mesh.tets.push_back({node(centre), node(middle), node(first), node(second)});
        mesh.tet_region.push_back(0);
      }
    }
  }
  Warnings warnings;
  validate(mesh, "cube", warnings);
  return mesh;
}

/// u = (cos πx sin πy, −sin πx cos πy, 0): no normal stress on any face, f = √(μ/2ρ)/L, three of them.
void expect_lame_modes(const std::array<TetMesh, 2>& meshes, std::initializer_list<double> poisson_ratios, double from,
                       double to) {
  for (const double nu : poisson_ratios) {
    const Material m{.youngs_modulus = 70e9, .poisson_ratio = nu, .density = 2700.0};
    const double exact = std::sqrt(m.shear_modulus() / (2.0 * m.density));
    const std::array found{analyse(meshes[0], m, 18), analyse(meshes[1], m, 18)};
    for (int normal = 0; normal < 3; ++normal) {
      const int a = (normal + 1) % 3, b = (normal + 2) % 3;
      const Field field = [a, b](const Vec3& x) {
        Vec3 u = Vec3::Zero();
        u[a] = std::cos(pi * x[a]) * std::sin(pi * x[b]);
        u[b] = -std::sin(pi * x[a]) * std::cos(pi * x[b]);
        return u;
      };
      expect_order_from_above(frequency_of(found[0], meshes[0], field), frequency_of(found[1], meshes[1], field), exact,
                              from, to);
    }
  }
}

// With ν > 0 the dilatation that linear elements cannot avoid costs extra, and h⁴ still counts.
TEST(ExactSolution, LameModesOfACubeAtAnyPoissonRatio) {
  expect_lame_modes({symmetric_cube(4), symmetric_cube(8)}, {0.0, 0.3, 0.45}, 1.7, 2.1);
}
TEST(ExactSolution, LameModesOfACubeByTenNodeTetsAreOfOrderFour) {
  expect_lame_modes({with_ten_nodes(symmetric_cube(2)), with_ten_nodes(symmetric_cube(4))}, {0.499}, 3.5, 4.5);
}

/// A ball of radius 1: a box of cells about the origin whose shells are drawn out to spheres. The cells' diagonals run
/// outwards, so that no tet lies across an edge of the box.
TetMesh ball(int cells) {
  TetMesh octant = tet_box(cells, 1.0), mesh;
  mesh.regions = octant.regions;
  const auto place = [](const Vec3& x) { return x.norm() > 0.0 ? Vec3(x * (x.maxCoeff() / x.norm())) : x; };
  std::vector<Vec3> corner;  // before drawing out, to tell nodes apart
  for (int mirror = 0; mirror < 8; ++mirror) {
    const Vec3 sign(mirror & 1 ? -1 : 1, mirror & 2 ? -1 : 1, mirror & 4 ? -1 : 1);
    std::vector<Index> number;
    for (const Vec3& x : octant.nodes) {
      const Vec3 y = sign.cwiseProduct(x);
      const auto same =
          std::find_if(corner.begin(), corner.end(), [&](const Vec3& z) { return (y - z).norm() < 1e-9; });
      number.push_back(static_cast<Index>(same - corner.begin()));
      if (same != corner.end()) continue;
      corner.push_back(y);
      mesh.nodes.push_back(sign.cwiseProduct(place(x)));
    }
    for (const Tet& t : octant.tets) {
      mesh.tets.push_back({number[t[0]], number[t[1]], number[t[2]], number[t[3]]});
      mesh.tet_region.push_back(0);
    }
  }
  Warnings warnings;
  validate(mesh, "ball", warnings);
  return mesh;
}

TEST(ExactSolution, TorsionOfAFreeSphere) {
  // ₀T₂: tan η = η(12 − η²)/(12 − 5η²), η = 2.501132620409396 = 2πf R/√(μ/ρ); five of them, below all others.
  // The polyhedra are inscribed, so the domain itself comes up to the ball as h².
  const Material m{.youngs_modulus = 70e9, .poisson_ratio = 0.33, .density = 2700.0};
  const double exact = 2.501132620409396 * std::sqrt(m.shear_modulus() / m.density) / (2 * pi);
  const auto coarse = frequencies(analyse(ball(3), m, 6)), fine = frequencies(analyse(ball(6), m, 6));
  for (int i = 0; i < 5; ++i) {
    expect_order_from_above(coarse[i], fine[i], exact);
    EXPECT_NEAR((4.0 * fine[i] - coarse[i]) / 3.0, exact, 0.005 * exact);  // Richardson
  }
  // What facets cost stays, of order 2, with ten-node tets.
  const auto few = frequencies(analyse(with_ten_nodes(ball(2)), m, 6)),
             many = frequencies(analyse(with_ten_nodes(ball(4)), m, 6));
  for (int i = 0; i < 5; ++i) expect_order_from_above(few[i], many[i], exact);
}

TEST(ExactSolution, RefinementLowersEveryFrequencyOfNestedMeshes) {
  // The coarse displacements are among the fine ones, so every Rayleigh quotient's minimum can only fall.
  const Material m{.youngs_modulus = 70e9, .poisson_ratio = 0.33, .density = 2700.0};
  const auto coarse = frequencies(analyse(tet_box(4, 2, 2, {1.0, 0.5, 0.4}), m, 20));
  const auto fine = frequencies(analyse(tet_box(8, 4, 4, {1.0, 0.5, 0.4}), m, 20));
  for (int i = 0; i < 20; ++i) EXPECT_LT(fine[i], coarse[i]) << i;
}

}  // namespace
}  // namespace limber
