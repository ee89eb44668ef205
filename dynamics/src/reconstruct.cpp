#include "limber/dynamics/reconstruct.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <string>

#include "limber/core/error.h"
#include "limber/dynamics/half_basis.h"
#include "reconstruct_kernels.h"

namespace limber {
namespace {

using internal::InstanceOutput;
using internal::kBlockInstances;
using internal::kTileVertices;
using internal::normalize_vectors;
using internal::reconstruct_tiles;

static_assert(ModalBasis::kTile == int{kTileVertices});
static_assert(SkinPose::kNumbers == internal::kHandleNumbers);
static_assert(sizeof(Vec3f) == 3 * sizeof(float), "rest positions are read as plain floats");

/// Amplitudes of one block, single precision, on the stack: with more modes a block holds fewer instances.
constexpr std::size_t kAmplitudeFloats = 8192;
/// Basis bytes per range of tiles: stays in the second-level cache while the blocks of instances pass over it.
constexpr std::size_t kRangeBytes = 256 * 1024;

InstanceOutput instance_output(const ReconstructionTarget& target) {
  const Mat3 R = to_matrix(target.X_OB.q);
  InstanceOutput out{};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) out.rotation[3 * row + column] = static_cast<float>(R(row, column));
    out.translation[row] = static_cast<float>(target.X_OB.p[row]);
  }
  out.displacement = target.displacement;
  out.positions = target.positions;
  if (target.skin && target.skin->largest_angle() > kDrawnStraight) out.handles = target.skin->numbers().data();
  return out;
}

/// The work in pieces: (range of tiles) × (block of instances), blocks of one range one after another.
struct Pieces {
  const ModalSurface& surface;
  const SkinTiles* influences;  // null: no target has a skin
  const HalfBasis* half;        // null: single precision
  std::span<const ReconstructionTarget> targets;
  std::size_t tiles, modes, tiles_per_range, instances_per_block;

  Pieces(const ModalSurface& s, const SkinTiles* skin, const HalfBasis* h, std::span<const ReconstructionTarget> t)
      : surface(s),
        influences(skin),
        half(h),
        targets(t),
        tiles(static_cast<std::size_t>(s.basis.tiles())),
        modes(static_cast<std::size_t>(s.basis.modes())),
        tiles_per_range(std::max<std::size_t>(
            1, kRangeBytes / (sizeof(float) * 3 * kTileVertices * std::max<std::size_t>(1, modes)))),
        instances_per_block(std::min(kBlockInstances, kAmplitudeFloats / std::max<std::size_t>(1, modes))) {}

  std::size_t drawn_modes(const ReconstructionTarget& target) const {
    return target.modes < 0 ? modes : static_cast<std::size_t>(target.modes);
  }
  std::size_t blocks() const { return (targets.size() + instances_per_block - 1) / instances_per_block; }
  std::size_t count() const { return (tiles + tiles_per_range - 1) / tiles_per_range * blocks(); }

  void operator()(std::size_t begin, std::size_t end) const {
    for (std::size_t piece = begin; piece < end; ++piece) run(piece / blocks(), piece % blocks());
  }

  void run(std::size_t range, std::size_t block) const {
    const auto members = targets.subspan(block * instances_per_block);
    const std::size_t n = std::min(instances_per_block, members.size());
    alignas(64) std::array<float, kAmplitudeFloats> amplitudes;  // [mode][instance]; only what is used is written
    std::array<InstanceOutput, kBlockInstances> outputs;
    std::size_t summed = 0;
    for (std::size_t i = 0; i < n; ++i) summed = std::max(summed, drawn_modes(members[i]));
    for (std::size_t i = 0; i < n; ++i) {
      outputs[i] = instance_output(members[i]);
      const std::size_t own = drawn_modes(members[i]);
      for (std::size_t m = 0; m < summed; ++m) {
        const double scale = half ? static_cast<double>(half->scales()[m]) : 1.0;
        amplitudes[m * n + i] = m < own ? static_cast<float>(scale * members[i].amplitudes[m]) : 0.0f;
      }
    }
    const std::size_t first_tile = range * tiles_per_range;
    internal::TileInfluences hang{};
    if (influences) hang = {influences->starts(), influences->handle_of_entry(), influences->weights()};
    reconstruct_tiles({.basis = surface.basis.tile(0),
                       .half_basis = half ? half->tile(0) : nullptr,
                       .rest = surface.rest.front().data(),
                       .vertices = surface.rest.size(),
                       .stored_modes = modes,
                       .first_tile = first_tile,
                       .last_tile = std::min(first_tile + tiles_per_range, tiles),
                       .modes = summed,
                       .amplitudes = amplitudes.data(),
                       .outputs = outputs.data(),
                       .instances = n,
                       .influences = hang});
  }
};

void check_triangles(std::span<const Triangle> triangles, std::size_t vertices) {
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (const Index v : triangles[t])
      if (v < 0 || static_cast<std::size_t>(v) >= vertices)
        throw InvalidArgument("vertex_normals: triangle " + std::to_string(t) + " names vertex " + std::to_string(v) +
                              ", expected 0 to " + std::to_string(vertices) + " exclusive");
}

void check_skin(const ModalSurface& surface, const SkinTiles* influences, const ReconstructionTarget& target,
                std::size_t i) {
  if (!influences)
    throw InvalidArgument("reconstruct: target " + std::to_string(i) +
                          " has a skin, expected none or the influences of the surface");
  if (influences->vertices() != surface.vertices())
    throw InvalidArgument("reconstruct: influences of " + std::to_string(influences->vertices()) + " vertices for " +
                          std::to_string(surface.vertices()) + ", expected as many");
  if (influences->handles() > target.skin->skin().handles)
    throw InvalidArgument("reconstruct: target " + std::to_string(i) + " has " +
                          std::to_string(target.skin->skin().handles) + " handles, its surface hangs on " +
                          std::to_string(influences->handles()));
}

void check(const ModalSurface& surface, const SkinTiles* influences, std::span<const ReconstructionTarget> targets) {
  if (surface.basis.vertices() != surface.vertices())
    throw InvalidArgument("reconstruct: the basis has " + std::to_string(surface.basis.vertices()) +
                          " vertices and the rest shape " + std::to_string(surface.vertices()) + ", expected as many");
  if (static_cast<std::size_t>(surface.basis.modes()) > kAmplitudeFloats)
    throw InvalidArgument("reconstruct: " + std::to_string(surface.basis.modes()) + " modes, expected at most " +
                          std::to_string(kAmplitudeFloats));
  bool normals = false;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    if (targets[i].positions == nullptr)
      throw InvalidArgument("reconstruct: target " + std::to_string(i) + " has no array for positions");
    if (targets[i].amplitudes == nullptr && surface.basis.modes() > 0)
      throw InvalidArgument("reconstruct: target " + std::to_string(i) + " has no amplitudes");
    if (targets[i].modes > surface.basis.modes())
      throw InvalidArgument("reconstruct: target " + std::to_string(i) + " asks for " +
                            std::to_string(targets[i].modes) + " modes, expected at most " +
                            std::to_string(surface.basis.modes()));
    if (targets[i].skin) check_skin(surface, influences, targets[i], i);
    normals |= targets[i].normals != nullptr;
  }
  if (normals) check_triangles(surface.triangles, surface.rest.size());
}

void add_area_normals(std::span<const Triangle> triangles, const float* p, float* normals) {
  for (const Triangle& t : triangles) {
    const float *a = p + 3 * t[0], *b = p + 3 * t[1], *c = p + 3 * t[2];
    const float ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2];
    const float vx = c[0] - a[0], vy = c[1] - a[1], vz = c[2] - a[2];
    const float nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
    for (const Index vertex : t) {
      float* n = normals + 3 * vertex;
      n[0] += nx, n[1] += ny, n[2] += nz;
    }
  }
}

void unchecked_vertex_normals(std::span<const Triangle> triangles, const float* positions, std::span<float> normals) {
  std::fill(normals.begin(), normals.end(), 0.0f);
  add_area_normals(triangles, positions, normals.data());
  normalize_vectors(normals.data(), normals.size() / 3);
}

/// The normals of the targets that want them, one target after another.
struct Normals {
  const ModalSurface& surface;
  std::span<const ReconstructionTarget> targets;
  void operator()(std::size_t begin, std::size_t end) const {
    for (const ReconstructionTarget& t : targets.subspan(begin, end - begin))
      if (t.normals) unchecked_vertex_normals(surface.triangles, t.positions, {t.normals, 3 * surface.rest.size()});
  }
};

void reconstruct_any(const ModalSurface& surface, const SkinTiles* influences, const HalfBasis* half,
                     std::span<const ReconstructionTarget> targets, Jobs& jobs) {
  check(surface, influences, targets);
  if (surface.rest.empty() || targets.empty()) return;
  // By reference: a std::function of the structs themselves would allocate.
  const Pieces pieces(surface, influences, half, targets);
  jobs.parallel_for(pieces.count(), 1, std::cref(pieces));
  const bool normals = std::any_of(targets.begin(), targets.end(), [](const auto& t) { return t.normals != nullptr; });
  const Normals every{surface, targets};
  if (normals) jobs.parallel_for(targets.size(), 1, std::cref(every));
}

}  // namespace

Index drawn_modes(const SurfaceExtent& extent, std::span<const double> z, double tolerance) {
  double rest = 0.0;  // what the modes from k on show at most
  std::size_t k = z.size();
  for (; k > 0; --k) {
    rest += std::abs(z[k - 1]) * extent.shape[k - 1];
    if (rest > tolerance) break;
  }
  return static_cast<Index>(k);
}

void reconstruct(const ModalSurface& surface, std::span<const ReconstructionTarget> targets, Jobs& jobs) {
  reconstruct_any(surface, nullptr, nullptr, targets, jobs);
}

void reconstruct(const ModalSurface& surface, const SkinTiles& influences,
                 std::span<const ReconstructionTarget> targets, Jobs& jobs) {
  reconstruct_any(surface, &influences, nullptr, targets, jobs);
}

void reconstruct(const ModalSurface& surface, const HalfBasis& basis, std::span<const ReconstructionTarget> targets,
                 Jobs& jobs) {
  if (basis.vertices() != surface.vertices() || basis.modes() != surface.basis.modes())
    throw InvalidArgument("reconstruct: the half-precision basis has " + std::to_string(basis.vertices()) +
                          " vertices and " + std::to_string(basis.modes()) + " modes, expected those of the surface");
  reconstruct_any(surface, nullptr, &basis, targets, jobs);
}

void vertex_normals(std::span<const Triangle> triangles, std::span<const float> positions, std::span<float> normals) {
  if (positions.size() != normals.size() || positions.size() % 3 != 0)
    throw InvalidArgument("vertex_normals: " + std::to_string(positions.size()) + " floats of positions and " +
                          std::to_string(normals.size()) + " of normals, expected three of each per vertex");
  check_triangles(triangles, positions.size() / 3);
  unchecked_vertex_normals(triangles, positions.data(), normals);
}

}  // namespace limber
