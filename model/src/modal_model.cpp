#include "limber/model/modal_model.h"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <numbers>
#include <span>

#include "limber/core/error.h"
#include "limber/model/morph_targets.h"
#include "text.h"

namespace limber {
namespace {

using internal::shown;

constexpr std::size_t kMaxNameLength = 200;
/// Slack on identities that hold exactly but for the round-off of whoever integrated over the mesh.
constexpr double kRoundOff = 1e-9;
/// Slack on what a solved eigenvector fulfils: orthogonality to rigid motions, norm 1.
constexpr double kShapeError = 1e-6;
/// Mass lumped at the corners of a single tetrahedron has up to √5 times its radius of gyration.
constexpr double kLumping = 2.5;

/// Checks the fields of one body; every failure is one line that begins with the body's name.
class Checker {
 public:
  explicit Checker(const ModalModelData& data) : d_(data), modes_(data.eigenvalues.size()) {}

  void check() const {
    check_name();
    check_rigid_body();
    check_frame();
    check_modes();
    check_integrals();
    check_surface(d_.render, "render");
    if (d_.collision) check_surface(*d_.collision, "collision");
    if (d_.volume_block) check_volume(*d_.volume_block);
    if (d_.residual_compliance) check_residual(*d_.residual_compliance);
    for (const CapturedLoad& load : d_.captured)
      if (!load.at.allFinite() || !(load.share >= 0.0 && load.share <= 1.0))
        refuse("captured", "has the share " + shown(load.share), "finite places, and shares from 0 to 1");
    if (d_.skin) check_skin(*d_.skin);
  }

 private:
  [[noreturn]] void refuse(const std::string& field, const std::string& seen, const std::string& expected) const {
    throw InvalidArgument("ModalModel \"" + d_.name + "\": " + field + " " + seen + ", expected " + expected);
  }

  void positive(double value, const std::string& field, const std::string& unit) const {
    if (!(std::isfinite(value) && value > 0.0)) refuse(field, "is " + shown(value) + unit, "above 0 and finite");
  }

  void count(std::size_t seen, std::size_t expected, const std::string& field, const std::string& of) const {
    if (seen != expected)
      refuse(field, "has " + std::to_string(seen) + " entries", std::to_string(expected) + ", one per " + of);
  }

  static std::string at(const std::string& field, std::size_t i) { return field + "[" + std::to_string(i) + "]"; }

  void check_name() const {
    if (d_.name.empty()) throw InvalidArgument("ModalModel: name is empty, expected some text");
    if (d_.name.size() > kMaxNameLength)
      throw InvalidArgument("ModalModel: name has " + std::to_string(d_.name.size()) + " bytes, expected at most " +
                            std::to_string(kMaxNameLength));
    for (const char c : d_.name)
      if (static_cast<unsigned char>(c) < 32 || c == 127)
        throw InvalidArgument("ModalModel: name holds a control character, expected printable text");
  }

  void check_rigid_body() const {
    positive(d_.mass, "mass", " kg");
    positive(d_.volume, "volume", " m^3");
    if (!d_.center_of_mass.allFinite()) refuse("center_of_mass", "is not finite", "three finite numbers");
    if (!d_.origin_in_input.allFinite()) refuse("origin_in_input", "is not finite", "three finite numbers");
    if (!d_.inertia.allFinite()) refuse("inertia", "is not finite", "nine finite numbers");
    const double size = d_.inertia.cwiseAbs().maxCoeff();
    if ((d_.inertia - d_.inertia.transpose()).cwiseAbs().maxCoeff() > kRoundOff * size)
      refuse("inertia", "is not symmetric", "a symmetric matrix");
    const Vec3 principal = Eigen::SelfAdjointEigenSolver<Mat3>(d_.inertia, Eigen::EigenvaluesOnly).eigenvalues();
    if (!(principal.x() > 0.0))
      refuse("inertia", "has the principal moment " + shown(principal.x()) + " kg m^2", "above 0");
    // A solid's largest principal moment is at most the sum of the others: ∫ρ(x²+y²) ≤ ∫ρ(y²+z²) + ∫ρ(x²+z²).
    if (principal.z() > (principal.x() + principal.y()) * (1.0 + kRoundOff))
      refuse("inertia",
             "has the principal moments " + shown(principal.x()) + ", " + shown(principal.y()) + ", " +
                 shown(principal.z()) + " kg m^2",
             "the largest to be at most the sum of the others, as in every solid");
  }

  void check_frame() const {
    const bool origin_at_center = d_.motion == FrameMotion::kFree || d_.motion == FrameMotion::kKinematic;
    if (origin_at_center && d_.center_of_mass.norm() > kRoundOff * radius())
      refuse("center_of_mass", "lies " + shown(d_.center_of_mass.norm()) + " m from the body's origin",
             "0 for motion \"" + std::string(to_string(d_.motion)) + "\"");
    if (d_.motion == FrameMotion::kLine && !(std::abs(d_.line_axis.norm() - 1.0) <= kRoundOff))
      refuse("line_axis", "has length " + shown(d_.line_axis.norm()), "1");
  }

  void check_modes() const {
    double previous = 0.0;
    for (std::size_t i = 0; i < modes_; ++i) {
      const double lambda = d_.eigenvalues[i];
      if (!(std::isfinite(lambda) && lambda >= 0.0))
        refuse(at("eigenvalues", i), "is " + shown(lambda) + " rad^2/s^2", "0 or more and finite");
      if (lambda < previous)
        refuse(at("eigenvalues", i), "is " + shown(lambda) + ", below the one before it", "ascending order");
      previous = lambda;
    }
    count(d_.decays.size(), modes_, "decays", "mode");
    for (std::size_t i = 0; i < modes_; ++i)
      if (!(std::isfinite(d_.decays[i]) && d_.decays[i] >= 0.0))
        refuse(at("decays", i), "is " + shown(d_.decays[i]) + " 1/s", "0 or more and finite");
    check_scales();
  }

  void check_scales() const {
    if (d_.mode_scales.empty()) return;
    count(d_.mode_scales.size(), modes_, "mode_scales", "mode");
    for (std::size_t i = 0; i < modes_; ++i) {
      const double scale = d_.mode_scales[i];
      int exponent = 0;
      if (!(scale > 0.0 && std::isfinite(1.0 / scale) && std::frexp(scale, &exponent) == 0.5))
        refuse(at("mode_scales", i), "is " + shown(scale) + " kg^(1/2) m", "a power of two with a finite reciprocal");
    }
  }

  /// Both integrals have bounds by the Cauchy-Schwarz inequality, as ∫ρ|w_i|² = 1: a wrong unit or normalisation shows
  /// here.
  void check_integrals() const {
    count(d_.participation.size(), modes_, "participation", "mode");
    count(d_.moments.size(), modes_, "moments", "mode");
    const double most = d_.motion == FrameMotion::kFree ? kShapeError : 1.0 + kShapeError;
    for (std::size_t i = 0; i < modes_; ++i) {
      const double p = d_.participation[i].cwiseAbs().maxCoeff();
      if (!(d_.participation[i].allFinite() && p <= most * std::sqrt(d_.mass)))
        refuse(at("participation", i), "has a component of size " + shown(p) + " kg^(1/2)",
               d_.motion == FrameMotion::kFree ? "0 for a free body"
                                               : "at most the root of the mass, " + shown(std::sqrt(d_.mass)));
      const double m = d_.moments[i].cwiseAbs().maxCoeff(), bound = kLumping * std::sqrt(d_.mass) * radius();
      if (!(d_.moments[i].allFinite() && m <= bound))
        refuse(at("moments", i), "has a component of size " + shown(m) + " kg^(1/2) m",
               "at most about the root of half the inertia's trace, " + shown(bound));
    }
  }

  void check_basis(const ModalBasis& basis, std::size_t vertices, const std::string& field) const {
    if (static_cast<std::size_t>(basis.vertices()) != vertices || static_cast<std::size_t>(basis.modes()) != modes_)
      refuse(field,
             "is for " + std::to_string(basis.vertices()) + " vertices and " + std::to_string(basis.modes()) + " modes",
             std::to_string(vertices) + " and " + std::to_string(modes_));
    const std::size_t floats = static_cast<std::size_t>(basis.tiles()) * modes_ * 3 * ModalBasis::kTile;
    for (std::size_t i = 0; i < floats; ++i)
      if (!std::isfinite(basis.tile(0)[i])) refuse(field, "holds a number that is not finite", "finite numbers");
  }

  template <std::size_t N>
  void check_indices(const std::vector<std::array<Index, N>>& elements, std::size_t vertices,
                     const std::string& field) const {
    for (std::size_t e = 0; e < elements.size(); ++e)
      for (std::size_t a = 0; a < N; ++a) {
        const Index i = elements[e][a];
        if (i < 0 || static_cast<std::size_t>(i) >= vertices)
          refuse(at(field, e), "names vertex " + std::to_string(i), "0 to " + std::to_string(vertices - 1));
        for (std::size_t b = 0; b < a; ++b)
          if (elements[e][b] == i)
            refuse(at(field, e), "names vertex " + std::to_string(i) + " twice", "distinct vertices");
      }
  }

  void check_surface(const ModalSurface& surface, const std::string& field) const {
    if (surface.triangles.empty()) refuse(field + ".triangles", "is empty", "at least one triangle");
    for (std::size_t v = 0; v < surface.rest.size(); ++v)
      if (!surface.rest[v].allFinite()) refuse(at(field + ".rest", v), "is not finite", "three finite numbers");
    check_indices(surface.triangles, surface.rest.size(), field + ".triangles");
    check_basis(surface.basis, surface.rest.size(), field + ".basis");
  }

  void check_volume(const ModalVolume& volume) const {
    if (volume.tets.empty()) refuse("volume_block.tets", "is empty", "at least one tetrahedron");
    for (std::size_t v = 0; v < volume.rest.size(); ++v)
      if (!volume.rest[v].allFinite()) refuse(at("volume_block.rest", v), "is not finite", "three finite numbers");
    check_indices(volume.tets, volume.rest.size(), "volume_block.tets");
    const auto node = [&](std::size_t e, std::size_t a) {
      return volume.rest[static_cast<std::size_t>(volume.tets[e][a])];
    };
    for (std::size_t e = 0; e < volume.tets.size(); ++e) {
      const Vec3 x0 = node(e, 0);
      const double six_volumes = (node(e, 1) - x0).cross(node(e, 2) - x0).dot(node(e, 3) - x0);
      if (!(six_volumes > 0.0))
        refuse(at("volume_block.tets", e), "has volume " + shown(six_volumes / 6.0) + " m^3", "above 0");
    }
    check_basis(volume.basis, volume.rest.size(), "volume_block.basis");
    check_basis(volume.mass_times_basis, volume.rest.size(), "volume_block.mass_times_basis");
  }

  void check_residual(const ResidualCompliance& residual) const {
    const auto vertices = (d_.collision ? *d_.collision : d_.render).rest.size();
    if (static_cast<std::size_t>(residual.vertices()) != vertices)
      refuse("residual_compliance", "is for " + std::to_string(residual.vertices()) + " vertices",
             std::to_string(vertices) + ", those of the collision surface");
    for (const float value : residual.values())
      if (!std::isfinite(value)) refuse("residual_compliance", "holds a number that is not finite", "finite numbers");
    for (Index v = 0; v < residual.vertices(); ++v) check_residual_block(residual.block(v, v), v);
  }

  /// A vertex yields to a force, never against it.
  void check_residual_block(const Mat3& G, Index vertex) const {
    const Mat3 symmetric = 0.5 * (G + G.transpose());
    const Vec3 principal = Eigen::SelfAdjointEigenSolver<Mat3>(symmetric, Eigen::EigenvaluesOnly).eigenvalues();
    if (!((G - symmetric).cwiseAbs().maxCoeff() <= kShapeError * principal.z()) && principal.z() != 0.0)
      refuse(at("residual_compliance", static_cast<std::size_t>(vertex)), "is not symmetric", "a symmetric block");
    if (principal.x() < -kShapeError * std::abs(principal.z()))
      refuse(at("residual_compliance", static_cast<std::size_t>(vertex)),
             "has the principal compliance " + shown(principal.x()) + " m/N", "0 or more");
  }

  void check_skin(const ModalSkin& skin) const {
    if (skin.handles < 1 || skin.handles > ModalSkin::kMaxHandles)
      refuse("skin.handles", "is " + std::to_string(skin.handles), "1 to " + std::to_string(ModalSkin::kMaxHandles));
    const auto n = static_cast<std::size_t>(skin.handles);
    count(static_cast<std::size_t>(skin.modes), modes_, "skin.modes", "mode");
    count(skin.rest.size(), n, "skin.rest", "handle");
    count(skin.rotations.size(), 3 * n * modes_, "skin.rotations", "handle, axis and mode");
    count(skin.arms.size(), 3 * n * n, "skin.arms", "pair of handles and axis");
    count(skin.shifts.size(), 3 * n * n * modes_, "skin.shifts", "pair of handles, axis and mode");
    for (const Vec3& r : skin.rest)
      if (!r.allFinite()) refuse("skin.rest", "holds a number that is not finite", "finite numbers");
    for (const auto* numbers : {&skin.rotations, &skin.arms, &skin.shifts}) check_finite<float>(*numbers, "skin");
    check_influences(skin.render, d_.render.rest.size(), skin, "skin.render");
    check_influences(skin.collision, d_.collision ? d_.collision->rest.size() : 0, skin, "skin.collision");
    check_influences(skin.volume, d_.volume_block ? d_.volume_block->rest.size() : 0, skin, "skin.volume");
    const std::size_t gauged = d_.motion == FrameMotion::kFree ? n : 0;
    count(skin.gauge.weights.size(), 4 * gauged, "skin.gauge.weights", "handle of a free body, four each");
    count(skin.gauge.rest.size(), 12 * gauged, "skin.gauge.rest", "handle of a free body, twelve each");
    count(skin.gauge.shapes.size(), 12 * gauged * modes_, "skin.gauge.shapes", "handle and mode, twelve each");
    for (const auto* numbers : {&skin.gauge.weights, &skin.gauge.rest, &skin.gauge.shapes})
      check_finite<double>(*numbers, "skin.gauge");
  }

  template <class T>
  void check_finite(std::span<const T> numbers, const std::string& field) const {
    for (const T x : numbers)
      if (!std::isfinite(x)) refuse(field, "holds a number that is not finite", "finite numbers");
  }

  void check_influences(const std::vector<SkinInfluences>& all, std::size_t vertices, const ModalSkin& skin,
                        const std::string& field) const {
    count(all.size(), vertices, field, "vertex");
    for (std::size_t v = 0; v < all.size(); ++v) {
      double sum = 0.0;
      for (std::size_t i = 0; i < SkinInfluences::kMost; ++i) {
        const auto weight = static_cast<double>(all[v].weight[i]);
        if (!(weight >= 0.0 && weight <= 1.0 && std::remainder(weight, SkinInfluences::kUnit) == 0.0))
          refuse(at(field, v), "has the weight " + shown(weight), "a multiple of 2^-20 in [0, 1]");
        if (all[v].handle[i] >= skin.handles)
          refuse(at(field, v), "names handle " + std::to_string(all[v].handle[i]),
                 "0 to " + std::to_string(skin.handles - 1));
        sum += weight;
      }
      if (sum != 1.0) refuse(at(field, v), "has weights of sum " + shown(sum), "1");
    }
  }

  /// Radius of gyration about the origin, m: ∫ρ|x|² = tr(I)/2.
  double radius() const { return std::sqrt(0.5 * d_.inertia.trace() / d_.mass); }

  const ModalModelData& d_;
  std::size_t modes_;
};

std::vector<double> visible_scales(const ModalSurface& surface) {
  std::vector<double> scales;
  scales.reserve(static_cast<std::size_t>(surface.basis.modes()));
  for (Index i = 0; i < surface.basis.modes(); ++i) scales.push_back(visible_mode_scale(surface, i));
  return scales;
}

SurfaceExtent extent(const ModalSurface& surface) {
  SurfaceExtent e;
  for (const Vec3f& r : surface.rest) e.radius = std::max(e.radius, r.cast<double>().norm());
  for (Index i = 0; i < surface.basis.modes(); ++i) {
    double most = 0.0;
    for (Index v = 0; v < surface.vertices(); ++v)
      most = std::max(most, surface.basis.shape(v, i).cast<double>().norm());
    e.shape.push_back(most);
  }
  return e;
}

}  // namespace

std::string_view to_string(FrameMotion motion) {
  switch (motion) {
    case FrameMotion::kFree:
      return "free";
    case FrameMotion::kPoint:
      return "point";
    case FrameMotion::kLine:
      return "line";
    case FrameMotion::kKinematic:
      return "kinematic";
  }
  throw InvalidArgument("FrameMotion: unknown value " + std::to_string(static_cast<int>(motion)));
}

ModalModel::ModalModel(ModalModelData data) : data_(std::move(data)) {
  (void)to_string(data_.motion);
  Checker(data_).check();
  if (data_.mode_scales.empty()) data_.mode_scales = visible_scales(data_.render);
  if (data_.touchable) collision_rows_ = VertexRows(collision().basis);
  collision_extent_ = extent(collision());
  if (data_.collision) render_extent_ = extent(data_.render);
}

std::vector<double> ModalModel::captured_shares() const {
  if (!data_.residual_compliance)
    throw InvalidArgument("captured_shares: \"" + data_.name +
                          "\" has no residual compliance, expected one (bake with --residual surface)");
  const ModalBasis& basis = collision().basis;
  std::vector<double> shares;
  for (Index v = 0; v < basis.vertices(); ++v) {
    double shown = 0.0;
    for (Index m = 0; m < modes(); ++m) {
      const double lambda = data_.eigenvalues[static_cast<std::size_t>(m)];
      if (lambda > 0.0) shown += static_cast<double>(basis.shape(v, m).squaredNorm()) / lambda;
    }
    const double left = data_.residual_compliance->block(v, v).trace();
    shares.push_back(shown + left > 0.0 ? shown / (shown + left) : 1.0);
  }
  return shares;
}

double ModalModel::frequency_hz(Index mode) const {
  if (mode < 0 || mode >= modes())
    throw InvalidArgument("ModalModel::frequency_hz: mode is " + std::to_string(mode) + ", expected 0 to " +
                          std::to_string(modes() - 1));
  return std::sqrt(data_.eigenvalues[static_cast<std::size_t>(mode)]) / (2.0 * std::numbers::pi);
}

}  // namespace limber
