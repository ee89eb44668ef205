#include "bake/sound.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <vector>

#include "bake/modal_blocks.h"
#include "eigen/hertz.h"
#include "limber/core/error.h"
#include "limber/precompute/modal_analysis.h"

namespace limber::internal {
namespace {

/// η per region of the mesh; empty where a region of the body has none, so that Rayleigh damping counts.
std::vector<double> losses_of(const TetMesh& mesh, std::span<const Material> materials, const SoundOptions& options) {
  std::vector<double> losses(materials.size(), 0.0);
  for (std::size_t r = 0; r < materials.size(); ++r) losses[r] = options.loss_factor.value_or(materials[r].loss_factor);
  const bool known =
      std::ranges::all_of(mesh.tet_region, [&](Index r) { return losses[static_cast<std::size_t>(r)] > 0.0; });
  return known ? losses : std::vector<double>();
}

/// uᵀ K u of the whole body as if region r had the stiffness weight_r E_r.
double weighted_energy(const TetMesh& mesh, std::vector<Material> materials, std::span<const double> weights,
                       std::span<const double> u) {
  for (std::size_t r = 0; r < materials.size(); ++r)
    if (weights[r] > 0.0) materials[r].youngs_modulus *= weights[r];
  std::vector<double> forces(u.size());
  elastic_forces(mesh, materials, u, forces);
  double energy = 0.0;
  for (std::size_t i = 0; i < u.size(); ++i) energy += u[i] * forces[i];
  return energy;
}

/// ξ of a column of the analysis.
double decay_of_sound(const ModalAnalysis& a, Index mode, const TetMesh& mesh, std::span<const Material> materials,
                      std::span<const double> losses, const RayleighDamping& damping) {
  const double lambda = a.eigenvalues[static_cast<std::size_t>(mode)];
  if (losses.empty()) return 0.5 * (damping.stiffness_proportional * lambda + damping.mass_proportional);
  const auto [least, most] = std::ranges::minmax(losses);
  double loss = most;
  if (least < most) {
    const std::size_t size = 3 * static_cast<std::size_t>(a.nodes);
    const auto u = std::span(a.shapes).subspan(static_cast<std::size_t>(mode) * size, size);
    loss = weighted_energy(mesh, {materials.begin(), materials.end()}, losses, u) / lambda;  // uᵀ K u = λ
  }
  return 0.5 * loss * std::sqrt(lambda);
}

/// The mean of E/(1−ν²) over the tets that have a face on the boundary, by volume.
double contact_modulus_of(const TetMesh& mesh, std::span<const Material> materials) {
  std::vector<char> outside(mesh.nodes.size(), 0);
  const BoundarySurface boundary = boundary_surface(mesh);
  for (const Index n : boundary.node_of) outside[static_cast<std::size_t>(n)] = 1;
  double sum = 0.0, volume = 0.0;
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    if (std::ranges::count_if(mesh.tets[t], [&](Index n) { return outside[static_cast<std::size_t>(n)] != 0; }) < 3)
      continue;
    const Material& m = materials[static_cast<std::size_t>(mesh.tet_region[t])];
    const double v = signed_volume(mesh, static_cast<Index>(t));
    sum += v * m.youngs_modulus / (1.0 - m.poisson_ratio * m.poisson_ratio);
    volume += v;
  }
  return sum / volume;
}

void fill_report_of_sound(const SoundModes& sound, SoundReport& report) {
  report.modes = sound.modes();
  report.bytes = sizeof(float) * sound.shapes.size();
  if (sound.modes() == 0) return;
  report.lowest_hz = hz_of_eigenvalue(sound.eigenvalues.front());
  report.highest_hz = hz_of_eigenvalue(sound.eigenvalues.back());
  report.lowest_loss = kUnbounded;
  for (std::size_t k = 0; k < sound.eigenvalues.size(); ++k) {
    const double loss = 2.0 * sound.decays[k] / std::sqrt(sound.eigenvalues[k]);
    report.lowest_loss = std::min(report.lowest_loss, loss);
    report.highest_loss = std::max(report.highest_loss, loss);
  }
}

}  // namespace

void require_losses(const BodyInput& in, std::span<const Material> materials, const BakeOptions& options) {
  const RayleighDamping& d = options.damping;
  if (losses_of(in.part.mesh, materials, options.sound).empty() &&
      d.stiffness_proportional + d.mass_proportional == 0.0)
    throw InvalidArgument("sound of body \"" + in.name +
                          "\": its material has no loss factor and there is no Rayleigh damping, so it would ring for "
                          "ever; give a loss factor (--loss-factor, or loss_factor of the material)");
}

std::shared_ptr<const SoundModes> bake_sound(const BodyInput& in, std::span<const Material> materials,
                                             const PlacedSurface& touching, const BakeOptions& options,
                                             SoundReport& report, Warnings& warnings, Jobs& jobs) {
  const auto start = std::chrono::steady_clock::now();
  const TetMesh& mesh = in.part.mesh;
  ModalAnalysisOptions wanted = options.analysis;
  wanted.modes = options.sound.modes;
  wanted.below = eigenvalue_of_hz(options.sound.highest_hz);
  Warnings known;  // told of the modes that move it
  const ModalAnalysis a = analyse_modes(mesh, materials, in.fixed, wanted, known, jobs);

  const std::vector<double> losses = losses_of(mesh, materials, options.sound);
  auto sound = std::make_shared<SoundModes>();
  std::vector<Index> kept;
  Index inaudible = 0;
  for (Index m = a.freedom.mechanisms; m < static_cast<Index>(a.eigenvalues.size()); ++m) {
    const double lambda = a.eigenvalues[static_cast<std::size_t>(m)];
    if (!(lambda < wanted.below)) break;  // completes a cluster
    if (lambda < eigenvalue_of_hz(options.sound.lowest_hz)) {
      ++inaudible;
      continue;
    }
    const double xi = decay_of_sound(a, m, mesh, materials, losses, options.damping);
    if (!(xi * xi < lambda)) {
      ++report.overdamped;
      continue;
    }
    kept.push_back(m);
    sound->eigenvalues.push_back(lambda);
    sound->decays.push_back(xi);
  }
  report.audible = std::max(0, a.elastic_below - inaudible);

  const ModalSurface surface = modal_surface(touching, a, mesh, kept, Vec3::Zero());
  sound->vertices = surface.vertices();
  for (Index k = 0; k < static_cast<Index>(kept.size()); ++k)
    for (Index v = 0; v < surface.vertices(); ++v) {
      const Vec3f w = surface.basis.shape(v, k);
      sound->shapes.insert(sound->shapes.end(), {w.x(), w.y(), w.z()});
    }
  sound->contact_modulus = contact_modulus_of(mesh, materials);
  fill_report_of_sound(*sound, report);
  report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (report.modes + report.overdamped < report.audible)
    warnings.push_back("sound of body \"" + in.name + "\": the lowest " + std::to_string(report.modes) + " of " +
                       std::to_string(report.audible) + " modes up to " +
                       std::to_string(std::lround(options.sound.highest_hz)) + " Hz, to " +
                       std::to_string(std::lround(report.highest_hz)) + " Hz; --sound=MODES takes more");
  return sound;
}

}  // namespace limber::internal
