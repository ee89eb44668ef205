#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>

#include "limber/core/error.h"
#include "limber/mesh/ten_node_tet.h"
#include "limber/model/asset.h"
#include "limber/precompute/bake.h"
#include "limber/precompute/fem.h"
#include "limber/sound/modal_sound.h"
#include "limber/sound/radiation.h"
#include "limber/sound/synthesizer.h"
#include "tet_box.h"

namespace limber {
namespace {

using std::numbers::pi;
using Complex = std::complex<double>;

BakeOptions sounding(const Material& material, double loss_factor) {
  BakeOptions options;
  options.materials = {{"*", material}};
  options.analysis.modes = 6;
  options.analysis.mass = MassKind::kConsistent;
  options.sound = {.make = true, .loss_factor = loss_factor};
  return options;
}

BakeResult bake_mesh(const TetMesh& mesh, const BakeOptions& options) {
  Warnings warnings;
  return bake({.name = "body", .mesh = mesh}, options, warnings);
}

/// The k-th bending frequency of a free bar by Timoshenko's theory, Hz, between 0.85 and 1.02 of Bernoulli's. With
/// w = A cosh µx + B cos νx about the middle (or sinh and sin), neither moment nor shear at the ends.
double timoshenko_hz(int k, double length, double thickness, const Material& m) {
  const double half = length / 2.0, radius2 = thickness * thickness / 12.0;
  const double G = m.youngs_modulus / (2.0 * (1.0 + m.poisson_ratio));
  const double kappa = 10.0 * (1.0 + m.poisson_ratio) / (12.0 + 11.0 * m.poisson_ratio);  // Cowper, rectangle
  const auto condition = [&](double omega) {
    const double a = m.density * omega * omega / (kappa * G), b = m.density * omega * omega / m.youngs_modulus;
    const double c = kappa * G / (m.youngs_modulus * radius2);
    const double root = std::sqrt((a - b) * (a - b) + 4.0 * a * c);
    const double mu = std::sqrt((root - a - b) / 2.0), nu = std::sqrt((root + a + b) / 2.0);
    const double P = mu * mu + a, Q = a - nu * nu;
    // Both over cosh µ l, so that nothing overflows.
    if (k % 2 == 1) return P * std::sin(nu * half) / nu - Q * std::cos(nu * half) * std::tanh(mu * half) / mu;
    return P * std::tanh(mu * half) * std::cos(nu * half) / nu + Q * std::sin(nu * half) / mu;
  };
  const double beta = k == 1 ? 4.730040745 : (k + 0.5) * pi;
  const double bernoulli = beta * beta / (length * length) * std::sqrt(m.youngs_modulus * radius2 / m.density);
  double low = 0.85 * bernoulli, high = 1.02 * bernoulli;
  EXPECT_LT(condition(low) * condition(high), 0.0);
  for (int i = 0; i < 100; ++i) {
    const double middle = (low + high) / 2.0;
    (condition(low) * condition(middle) <= 0.0 ? high : low) = middle;
  }
  return low / (2.0 * pi);
}

Eigen::MatrixXd dense(const SparseMatrix& A) {
  Eigen::MatrixXd D = Eigen::MatrixXd::Zero(A.size, A.size);
  for (Index column = 0; column < A.size; ++column)
    for (Index i = A.column_start[column]; i < A.column_start[column + 1]; ++i) D(A.row[i], column) = A.value[i];
  return D;
}

struct Struck {
  std::vector<float> samples;
  double rate = 48e3;

  /// Fourier transform at a frequency.
  Complex spectrum(double hz, std::size_t begin = 0, std::size_t end = ~std::size_t{0}) const {
    Complex sum = 0.0;
    end = std::min(end, samples.size());
    for (std::size_t n = begin; n < end; ++n)
      sum += static_cast<double>(samples[n]) * std::polar(1.0, -2.0 * pi * hz * static_cast<double>(n) / rate);
    return sum / rate;
  }
  /// The loudest frequency within 2 % of one.
  double peak_near(double hz) const {
    double best = hz, most = 0.0, width = 0.02 * hz;
    for (int pass = 0; pass < 4; ++pass, width /= 12.0) {
      const double center = best;
      for (int i = -20; i <= 20; ++i) {
        const double f = center + width * i / 20.0;
        if (const double size = std::abs(spectrum(f)); size > most) most = size, best = f;
      }
    }
    return best;
  }
};

Struck strike(const SoundModes& modes, const std::vector<double>& gains, Index vertex, const Vec3& impulse, double tau,
              double seconds) {
  Struck struck;
  Synthesizer synthesizer({.channels = 1, .floor = 1e-12});
  synthesizer.add_body(std::make_shared<ModalSound>(modes, gains, struck.rate));
  synthesizer.strike({.at = {.vertices = {vertex, vertex, vertex}}, .impulse = impulse, .contact_time = tau});
  struck.samples.resize(static_cast<std::size_t>(seconds * struck.rate));
  synthesizer.render(struck.samples);
  return struck;
}

Index nearest_vertex(const ModalSurface& surface, const Vec3& at) {
  Index best = 0;
  for (Index v = 0; v < surface.vertices(); ++v)
    if ((surface.rest[v].cast<double>() - at).norm() < (surface.rest[best].cast<double>() - at).norm()) best = v;
  return best;
}

// A bar of 8 × 1 × 1/4 inch of cold-rolled steel. Builders of metallophones cut theirs by 209,100 T/L² Hz, in inches
// (Vance, Mechanical Music Digest, 19 November 2003), which makes this one 816.8 Hz.
TEST(Sound, AGlockenspielBarSoundsAtItsPitchAndDiesAwayAsItsLossFactorSays) {
  constexpr double inch = 0.0254, length = 8 * inch, thickness = inch / 4;
  const Material steel = material_preset("steel");
  TetMesh mesh = testing::tet_box(48, 3, 1, {length, inch, thickness});
  add_mid_edge_nodes(mesh);
  constexpr double loss = 2e-3;
  const BakeResult baked = bake_mesh(mesh, sounding(steel, loss));
  const SoundModes& modes = *baked.asset.sounds.at(0);
  const ModalModel& model = *baked.asset.bodies.at(0);
  EXPECT_EQ(model.modes(), 6);
  EXPECT_EQ(modes.vertices, model.collision().vertices());
  EXPECT_EQ(baked.bodies[0].sound.audible, modes.modes());
  EXPECT_LT(std::sqrt(modes.eigenvalues.back()), 2.0 * pi * 20e3);

  // Struck near its end, on its face.
  const Index vertex = nearest_vertex(model.collision(), {-0.46 * length, 0.0, thickness / 2});
  const auto gains = monopole_gains(modes, model.collision().rest, model.collision().triangles);
  const Struck struck = strike(modes, gains, vertex, {0, 0, -0.02}, 5e-5, 1.0);
  // From the fourth partial on the width is more than a quarter of the wave, and the bar bends as a plate.
  constexpr double kOnePerCent = 0.01;
  EXPECT_NEAR(struck.peak_near(816.8) / 816.8, 1.0, kOnePerCent);
  for (int k = 1; k <= 3; ++k) {
    const double expected = timoshenko_hz(k, length, thickness, steel);
    EXPECT_NEAR(struck.peak_near(expected) / expected, 1.0, kOnePerCent) << "partial " << k;
  }

  // Amplitude of the fundamental in two windows of whole periods: e^{−ξ Δt}, ξ = ηω/2.
  const double hz = struck.peak_near(816.8);
  const auto window = static_cast<std::size_t>(std::lround(100.0 / hz * struck.rate));
  const std::size_t first = 9600, second = 38400;
  const double decay = std::log(std::abs(struck.spectrum(hz, first, first + window)) /
                                std::abs(struck.spectrum(hz, second, second + window))) /
                       (static_cast<double>(second - first) / struck.rate);
  constexpr double kFivePerCent = 0.05;
  EXPECT_NEAR(decay / (0.5 * loss * 2.0 * pi * hz), 1.0, kFivePerCent);
}

/// Square prongs of 8 mm, 100 mm long and 10 mm apart, on a yoke 12 mm high and a handle of 6 × 8 × 40 mm.
TetMesh tuning_fork() {
  constexpr std::array x{0.0, 4.0, 8.0, 10.0, 13.0, 16.0, 18.0, 22.0, 26.0};  // mm
  constexpr int handle = 4, yoke = 2, prongs = 12;                            // cells along
  const auto z = [](int k) {
    return k < handle          ? 10.0 * k - 52.0
           : k < handle + yoke ? 6.0 * (k - handle - yoke)
                               : 100.0 / prongs * (k - handle - yoke);
  };
  TetMesh mesh = testing::tet_box(8, 2, handle + yoke + prongs, {8.0, 2.0, 1.0 * (handle + yoke + prongs)});
  std::erase_if(mesh.tets, [&](const Tet& tet) {
    Vec3 middle = Vec3::Zero();
    for (const Index node : tet) middle += 0.25 * mesh.nodes[static_cast<std::size_t>(node)];
    const int i = static_cast<int>(middle.x()), k = static_cast<int>(middle.z());
    return k < handle ? i != 3 && i != 4 : k >= handle + yoke && i > 1 && i < 6;
  });
  mesh.tet_region.resize(mesh.tets.size());
  drop_unused_nodes(mesh);
  for (Vec3& p : mesh.nodes)
    p = 1e-3 *
        Vec3(x[static_cast<std::size_t>(std::lround(p.x()))], 4.0 * p.y(), z(static_cast<int>(std::lround(p.z()))));
  add_mid_edge_nodes(mesh);
  return mesh;
}

// CalculiX 2.20 has the lowest five at these, Hz, with 2,152 cubes of 2 mm of twenty nodes (C3D20).
TEST(Sound, ATuningForkSoundsAsAnotherProgramSays) {
  constexpr std::array by_calculix{581.129, 783.259, 1833.18, 1999.25, 3563.83};
  constexpr double kOnePerCent = 0.01;
  const BakeResult baked =
      bake_mesh(tuning_fork(), sounding({.youngs_modulus = 200e9, .poisson_ratio = 0.3, .density = 7850.0}, 1e-3));
  const ModalModel& model = *baked.asset.bodies.at(0);
  const Index tip = nearest_vertex(model.collision(), Vec3(0.0, 0.0, 0.1) - model.data().origin_in_input);
  const SoundModes& modes = *baked.asset.sounds.at(0);
  const auto gains = monopole_gains(modes, model.collision().rest, model.collision().triangles);
  const Struck struck = strike(modes, gains, tip, {0.02, 0.01, 0.0}, 5e-5, 1.0);
  for (const double hz : by_calculix) EXPECT_NEAR(struck.peak_near(hz) / hz, 1.0, kOnePerCent) << hz << " Hz";
}

// What a node of the surface does, by modes below 20 kHz and the synthesizer, against (K(1 + iη) − ω²M) u = f of the
// whole finite-element model, solved at the frequency itself.
TEST(Sound, TheTenStrongestPartialsAtANodeAreThoseOfTheWholeModel) {
  const Material glass = material_preset("glass");
  const TetMesh mesh = testing::tet_box(7, 4, 1, {0.21, 0.11, 0.005});
  const double loss = glass.loss_factor;
  constexpr double tau = 8e-5;
  const BakeResult baked = bake_mesh(mesh, sounding(glass, loss));
  const SoundModes& modes = *baked.asset.sounds.at(0);
  const ModalModel& model = *baked.asset.bodies.at(0);
  const Vec3 origin = model.data().origin_in_input;
  const Vec3 struck_at(0.0, 0.0, 0.005), heard_at(0.21, 0.0275, 0.005), impulse(0.3, 0.4, 1.0);
  const Vec3 direction = Vec3(0.5, 0.4, 0.7).normalized();
  const ModalSurface& surface = model.collision();
  const Index from = nearest_vertex(surface, struck_at - origin), to = nearest_vertex(surface, heard_at - origin);
  const Struck struck = strike(modes, point_velocity_gains(modes, to, direction), from, impulse, tau, 6.0);

  const std::array materials{glass};
  const Eigen::MatrixXd K = dense(assemble_stiffness(mesh, materials));
  const Eigen::MatrixXd node_mass = dense(assemble_mass(mesh, materials, MassKind::kConsistent));
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(K.rows(), K.cols());
  for (Eigen::Index a = 0; a < node_mass.rows(); ++a)
    for (Eigen::Index b = 0; b < node_mass.cols(); ++b)
      M.block<3, 3>(3 * a, 3 * b).diagonal().setConstant(node_mass(a, b));
  const auto node_at = [&](const Vec3& x) {
    return std::ranges::min_element(mesh.nodes, {}, [&](const Vec3& p) { return (p - x).norm(); }) - mesh.nodes.begin();
  };
  const auto whole = [&](double hz) {
    const double omega = 2.0 * pi * hz, Omega = 2.0 * pi / tau;
    // ∫ (1 − cos Ωt)/τ e^{−iωt} dt over the contact.
    const Complex i(0.0, 1.0), s = -i * omega;
    const Complex force = (std::exp(s * tau) - 1.0) / tau * (1.0 / s - s / (s * s + Omega * Omega));
    Eigen::VectorXcd f = Eigen::VectorXcd::Zero(K.rows());
    f.segment<3>(3 * node_at(struck_at)) = force * impulse.cast<Complex>();
    const Eigen::MatrixXcd A = K * Complex(1.0, loss) - M.cast<Complex>() * (omega * omega);
    const Eigen::VectorXcd u = A.partialPivLu().solve(f);
    return std::abs(omega * direction.cast<Complex>().dot(u.segment<3>(3 * node_at(heard_at))));
  };

  std::vector<std::pair<double, double>> partials;  // strength, Hz
  for (const double lambda : modes.eigenvalues) {
    const double hz = std::sqrt(lambda) / (2.0 * pi);
    partials.emplace_back(std::abs(struck.spectrum(hz)), hz);
  }
  std::ranges::sort(partials, std::greater<>());
  ASSERT_GE(partials.size(), 10u);
  constexpr double kOneDecibel = 1.0;
  for (std::size_t k = 0; k < 10; ++k)
    EXPECT_NEAR(20.0 * std::log10(partials[k].first / whole(partials[k].second)), 0.0, kOneDecibel)
        << partials[k].second << " Hz";
}

TEST(Sound, ModesDecayByTheMaterialsThatTheyStrain) {
  TetMesh mesh = testing::tet_box(8, 2, 1, {0.2, 0.03, 0.01});
  mesh.regions = {{.name = "left"}, {.name = "right"}};
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    double x = 0.0;
    for (const Index n : mesh.tets[t]) x += mesh.nodes[n].x() / 4.0;
    mesh.tet_region[t] = x > 0.1 ? 1 : 0;
  }
  Material left = material_preset("steel"), right = left;
  left.loss_factor = 1e-3, right.loss_factor = 5e-3;
  BakeOptions options = sounding(left, 1.0);
  options.materials = {{"left", left}, {"right", right}};
  options.sound.loss_factor.reset();
  const BakeResult baked = bake_mesh(mesh, options);
  const SoundModes& modes = *baked.asset.sounds.at(0);
  // The bar is its own mirror image but for Kuhn's diagonals: modes strain both halves alike.
  constexpr double kMirror = 0.05;
  for (Index k = 0; k < modes.modes(); ++k)
    EXPECT_NEAR(2.0 * modes.decays[k] / std::sqrt(modes.eigenvalues[k]) / 3e-3, 1.0, kMirror);
}

TEST(Sound, TheBlockIsReadAsItWasWrittenAndTellsDamage) {
  const TetMesh mesh = testing::tet_box(4, 2, 1, {0.1, 0.03, 0.01});
  const BakeResult baked = bake_mesh(mesh, sounding(material_preset("steel"), 1e-3));
  const std::string bytes = asset_bytes(baked.asset);
  const Asset read = asset_from_bytes(bytes, "test");
  ASSERT_TRUE(read.sound(0));
  EXPECT_EQ(read.sound(0)->eigenvalues, baked.asset.sounds[0]->eigenvalues);
  EXPECT_EQ(read.sound(0)->decays, baked.asset.sounds[0]->decays);
  EXPECT_EQ(read.sound(0)->shapes, baked.asset.sounds[0]->shapes);
  EXPECT_EQ(read.sound(0)->contact_modulus, baked.asset.sounds[0]->contact_modulus);
  EXPECT_EQ(asset_bytes(read), bytes);

  Asset wrong = baked.asset;
  SoundModes fewer = *wrong.sounds[0];
  fewer.decays.pop_back();
  wrong.sounds[0] = std::make_shared<SoundModes>(fewer);
  EXPECT_THROW(asset_bytes(wrong), InvalidArgument);
  std::string damaged = bytes;
  const std::size_t digit = damaged.find("\"contact_modulus\":") + 18;
  damaged[digit] = damaged[digit] == '1' ? '2' : '1';
  EXPECT_THROW(asset_from_bytes(damaged, "test"), InputError);
}

TEST(Sound, ABodyOfUnknownLossIsRefused) {
  const TetMesh mesh = testing::tet_box(2, 1, 1, {0.1, 0.03, 0.01});
  BakeOptions options = sounding({.youngs_modulus = 1e9, .poisson_ratio = 0.3, .density = 1000.0}, 1.0);
  options.sound.loss_factor.reset();
  EXPECT_THROW(bake_mesh(mesh, options), InvalidArgument);
  options.damping.mass_proportional = 20.0;
  const BakeResult baked = bake_mesh(mesh, options);
  for (const double xi : baked.asset.sounds.at(0)->decays) EXPECT_EQ(xi, 10.0);
}

}  // namespace
}  // namespace limber
