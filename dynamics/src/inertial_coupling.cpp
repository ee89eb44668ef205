#include "limber/dynamics/inertial_coupling.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "limber/core/error.h"
#include "limber/core/exact_math.h"

namespace limber {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Row = Eigen::Map<const VectorXd>;

// A symmetric 3 × 3 matrix by its entries xx, yy, zz, yz, zx, xy.
constexpr std::array<std::array<Eigen::Index, 2>, 6> kEntries{{{0, 0}, {1, 1}, {2, 2}, {1, 2}, {2, 0}, {0, 1}}};
constexpr Eigen::Index kAxes = 3, kProducts = 9;

constexpr double kTurnOfPart = 0.1;  // rad: of a turn θ the midpoint rule misses θ³/12, a thousandth at most
constexpr double kSettled = 1e-14;   // change of the implicit rule's rates, relative to the motion
constexpr int kMostIterations = 60;  // more than parts of kTurnOfPart take, each contracting by half of it
constexpr int kMostParts = 1024;

/// One axis of a basis, nodes × modes.
MatrixXd component(const ModalBasis& basis, Eigen::Index axis) {
  MatrixXd out(basis.vertices(), basis.modes());
  for (Index mode = 0; mode < basis.modes(); ++mode)
    for (Index node = 0; node < basis.vertices(); ++node)
      out(node, mode) = static_cast<double>(basis.shape(node, mode)[axis]);
  return out;
}

using PairMoments = std::array<std::array<MatrixXd, 3>, 3>;

/// [a][b](i, j) = ∫ρ w_ia w_jb.
PairMoments pair_moments(const ModalVolume& volume) {
  std::array<MatrixXd, 3> W, MW;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    W[axis] = component(volume.basis, static_cast<Eigen::Index>(axis));
    MW[axis] = component(volume.mass_times_basis, static_cast<Eigen::Index>(axis));
  }
  PairMoments S;
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = 0; b < 3; ++b) S[a][b] = 0.5 * (W[a].transpose() * MW[b] + MW[a].transpose() * W[b]);
  return S;
}

/// −sinc′(x)/x
double sinc_slope(double x) { return stumpff_c2(x * x) - stumpff_c3(x * x); }

/// Means over −1 ≤ s ≤ 1 of cos ps cos qs and of sin ps sin qs / pq. @param p, q ≥ 0
double cosine_mean(double p, double q) { return 0.5 * (sinc(p - q) + sinc(p + q)); }
double sine_mean(double p, double q) {
  if (p < q) std::swap(p, q);
  if (q < 1e-5) return sinc_slope(p);  // the difference below would lose as much as this leaves out, 1e-10
  return 0.5 * (sinc(p - q) - sinc(p + q)) / (p * q);
}

double norm_of_difference(std::span<const double> a, std::span<const double> b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(sum);
}

/// entry by entry: f(D(a, b), k numbers of that entry)
template <class F>
void for_each_entry(F&& f) {
  for (std::size_t e = 0; e < kEntries.size(); ++e) f(static_cast<Eigen::Index>(e), kEntries[e][0], kEntries[e][1]);
}

void add_symmetric(Mat3& D, Eigen::Index a, Eigen::Index b, double change) {
  D(a, b) += change;
  if (a != b) D(b, a) += change;
}

}  // namespace

InertialCoupling::Terms::Terms(Index modes)
    : of_amplitudes(static_cast<std::size_t>(kProducts * modes)), of_momenta(of_amplitudes.size()) {}

InertialCoupling::InertialCoupling(const ModalModelData& body, double step)
    : rest_(body.inertia),
      rest_inverse_(body.inertia.inverse()),
      principal_(principal_inertia(body.inertia)),
      lambda_(body.eigenvalues),
      decay_(body.decays),
      first_(static_cast<Eigen::Index>(lambda_.size()), 6) {
  if (body.motion != FrameMotion::kFree)
    throw InvalidArgument("InertialCoupling: \"" + body.name + "\" has fixed nodes, expected a free body");
  const auto k = static_cast<Eigen::Index>(lambda_.size());
  if (k > 0 && !body.volume_block)
    throw InvalidArgument("InertialCoupling: \"" + body.name + "\" has no volume block; bake it with --volume");
  for (Eigen::Index i = 0; i < k; ++i) {
    const Mat3& S = body.moments[static_cast<std::size_t>(i)];
    const Mat3 first = 2.0 * S.trace() * Mat3::Identity() - S - S.transpose();
    for_each_entry([&](Eigen::Index e, Eigen::Index a, Eigen::Index b) { first_(i, e) = first(a, b); });
  }
  turning_.resize(3 * k, k), second_.resize(6 * k, k);
  mean_first_.resize(k, 6), mean_amplitudes_.resize(kProducts * k, k), mean_momenta_.resize(kProducts * k, k);
  if (k > 0) {
    const PairMoments S = pair_moments(*body.volume_block);
    for (std::size_t c = 0; c < 3; ++c)
      turning_.middleRows(static_cast<Eigen::Index>(c) * k, k) =
          (S[(c + 1) % 3][(c + 2) % 3] - S[(c + 2) % 3][(c + 1) % 3]).transpose();
    for_each_entry([&](Eigen::Index e, Eigen::Index a, Eigen::Index b) {
      const auto A = turning_.middleRows(a * k, k), B = turning_.middleRows(b * k, k);
      const MatrixXd& pair = S[static_cast<std::size_t>(a)][static_cast<std::size_t>(b)];
      second_.middleRows(e * k, k) = 0.5 * (A * B + B * A) - 0.5 * (pair + pair.transpose());
      if (a == b) second_.middleRows(e * k, k).diagonal().array() += 1.0;
    });
  }
  set_step(step);
}

Mat3 InertialCoupling::first_order(Eigen::Index mode) const {
  Mat3 first = Mat3::Zero();
  for_each_entry([&](Eigen::Index e, Eigen::Index a, Eigen::Index b) { add_symmetric(first, a, b, first_(mode, e)); });
  return first;
}

/// With the modes alone, t from the middle: z = z̄ cos ωt + π̄ sin ωt/ω, π = π̄ cos ωt − z̄ ω sin ωt. Products that are
/// odd in t have no mean. D⁻¹ brings a product of D's first order with itself, as the means of each: what is missing to
/// the mean of the product is taken from the second order.
void InertialCoupling::set_step(double step) {
  half_.set(lambda_, decay_, 0.5 * step);
  const Eigen::Index k = modes();
  const auto angle = [&](Eigen::Index i) { return 0.5 * step * std::sqrt(lambda_[static_cast<std::size_t>(i)]); };
  for (Eigen::Index j = 0; j < k; ++j) {
    mean_first_.row(j) = sinc(angle(j)) * first_.row(j);
    const Mat3 first_j = first_order(j);
    for (Eigen::Index i = 0; i < k; ++i) {
      const double cosines = cosine_mean(angle(i), angle(j));
      const double sines = 0.25 * step * step * sine_mean(angle(i), angle(j));
      for (Eigen::Index c = 0; c < kAxes; ++c) {
        const double b_ij = turning_(c * k + j, i) * (cosines + lambda_[static_cast<std::size_t>(i)] * sines);
        mean_amplitudes_(c * k + j, i) = mean_momenta_(c * k + i, j) = b_ij;
      }
      const Mat3 square = first_order(i) * rest_inverse_ * first_j;
      const double missing = cosines - sinc(angle(i)) * sinc(angle(j));
      for_each_entry([&](Eigen::Index e, Eigen::Index a, Eigen::Index b) {
        const double second = second_(e * k + j, i), product = 0.5 * (square(a, b) + square(b, a));
        mean_amplitudes_((kAxes + e) * k + j, i) = cosines * second - missing * product;
        mean_momenta_((kAxes + e) * k + j, i) = sines * (second - product);
      });
    }
  }
}

void InertialCoupling::evaluate(const double* z, const double* momenta, Terms& terms) const {
  const Eigen::Index k = modes();
  Eigen::Map<VectorXd> products(terms.of_amplitudes.data(), kProducts * k);
  products.head(3 * k).noalias() = turning_ * Row(z, k);
  products.tail(6 * k).noalias() = second_ * Row(z, k);
  terms.inertia = rest_;
  for_each_entry([&](Eigen::Index e, Eigen::Index a, Eigen::Index b) {
    add_symmetric(terms.inertia, a, b, Row(z, k).dot(first_.col(e) + products.segment((kAxes + e) * k, k)));
  });
  for (Eigen::Index c = 0; c < kAxes; ++c) terms.relative[c] = -products.segment(c * k, k).dot(Row(momenta, k));
}

void InertialCoupling::evaluate_means(const double* z, const double* momenta, Terms& terms) const {
  const Eigen::Index k = modes();
  Eigen::Map<VectorXd> of_z(terms.of_amplitudes.data(), kProducts * k), of_pi(terms.of_momenta.data(), kProducts * k);
  of_z.noalias() = mean_amplitudes_ * Row(z, k);
  of_pi.noalias() = mean_momenta_ * Row(momenta, k);
  terms.inertia = rest_;
  for_each_entry([&](Eigen::Index e, Eigen::Index a, Eigen::Index b) {
    add_symmetric(terms.inertia, a, b,
                  Row(z, k).dot(mean_first_.col(e) + of_z.segment((kAxes + e) * k, k)) +
                      Row(momenta, k).dot(of_pi.segment((kAxes + e) * k, k)));
  });
  for (Eigen::Index c = 0; c < kAxes; ++c) terms.relative[c] = -of_z.segment(c * k, k).dot(Row(momenta, k));
}

void InertialCoupling::add_turning(const Vec3& omega, const Terms& terms, std::span<double> rates) {
  const std::size_t k = rates.size();
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t j = 0; j < k; ++j)
      rates[j] -= omega[static_cast<Eigen::Index>(c)] * terms.of_amplitudes[c * k + j];
}

Vec3 InertialCoupling::differentiate(const Vec3& L, const double* z, const Terms& terms, std::span<double> rates,
                                     std::span<double> forces) const {
  const Vec3 omega = terms.inertia.inverse() * (L + terms.relative), at_rest = rest_inverse_ * L;
  const Eigen::Index k = modes();
  const Row of_z(terms.of_amplitudes.data(), kProducts * k), of_pi(terms.of_momenta.data(), kProducts * k);
  Eigen::Map<VectorXd> rate(rates.data(), k), force(forces.data(), k);
  rate.setZero(), force.setZero();
  for (Eigen::Index c = 0; c < kAxes; ++c) {
    rate -= omega[c] * of_z.segment(c * k, k);
    force += omega[c] * of_pi.segment(c * k, k);
  }
  for_each_entry([&](Eigen::Index e, Eigen::Index a, Eigen::Index b) {
    const double half = a == b ? 0.5 : 1.0, spin = half * omega[a] * omega[b];
    rate -= 2.0 * spin * of_pi.segment((kAxes + e) * k, k);
    force +=
        (spin - half * at_rest[a] * at_rest[b]) * mean_first_.col(e) + 2.0 * spin * of_z.segment((kAxes + e) * k, k);
  });
  return omega - at_rest - turn_of_stretch(mean_first_, L, z);
}

void InertialCoupling::add_stretching(const Vec3& L, double weight, double* forces) const {
  const Vec3 omega = rest_inverse_ * L;
  for_each_entry([&](Eigen::Index e, Eigen::Index a, Eigen::Index b) {
    Eigen::Map<VectorXd>(forces, modes()) += (weight * (a == b ? 0.5 : 1.0) * omega[a] * omega[b]) * first_.col(e);
  });
}

Vec3 InertialCoupling::turn_of_stretch(const Matrix& first, const Vec3& L, const double* z) const {
  Mat3 change = Mat3::Zero();
  for_each_entry([&](Eigen::Index e, Eigen::Index a, Eigen::Index b) {
    add_symmetric(change, a, b, Row(z, modes()).dot(first.col(e)));
  });
  return -(rest_inverse_ * (change * (rest_inverse_ * L)));
}

CoupledMotion::CoupledMotion(const InertialCoupling& coupling)
    : coupling_(coupling), rates_(static_cast<std::size_t>(coupling.modes())), terms_(coupling.modes()) {
  for (auto* row : {&middle_z_, &middle_momenta_, &velocity_, &force_, &last_velocity_, &last_force_})
    row->resize(rates_.size());
  const auto padded = static_cast<std::size_t>(coupling.half_step().padded());
  part_ = {AlignedArray<double>(padded), AlignedArray<double>(padded), AlignedArray<double>(padded)};
}

Vec3 CoupledMotion::set_velocities(const double* z, const Vec3& omega, std::span<const double> rates, double* momenta) {
  std::copy(rates.begin(), rates.end(), rates_.begin());
  coupling_.evaluate(z, momenta, terms_);
  const std::span<double> turning = velocity_;
  std::fill(turning.begin(), turning.end(), 0.0);
  InertialCoupling::add_turning(omega, terms_, turning);
  for (std::size_t j = 0; j < rates_.size(); ++j) momenta[j] = rates_[j] - turning[j];
  coupling_.evaluate(z, momenta, terms_);
  const Vec3 L = terms_.inertia * omega - terms_.relative;
  set_momenta(z, L, momenta);
  return L;
}

void CoupledMotion::set_momenta(const double* z, const Vec3& L, const double* momenta) {
  coupling_.evaluate(z, momenta, terms_);
  const Vec3 moment = L + terms_.relative;
  angular_velocity_ = terms_.inertia.inverse() * moment;
  std::copy_n(momenta, rates_.size(), rates_.begin());
  InertialCoupling::add_turning(angular_velocity_, terms_, rates_);
  kinetic_energy_ = 0.5 * angular_velocity_.dot(moment);
  for (std::size_t j = 0; j < rates_.size(); ++j)
    kinetic_energy_ += 0.5 * (momenta[j] - rates_[j]) * (momenta[j] + rates_[j]);
}

/// The flow of the modes and their stretching, ½π² + ½Σλz² − F·z, over half a step. Both sides of F·z are held at their
/// discrete gradient, means of the ends, so that the sum is kept to round-off but for what damping takes.
void CoupledMotion::stretch(const double* forces, double* z, double* momenta, Quaternion& q_WB, const Vec3& L_W) {
  const std::size_t k = rates_.size();
  if (k == 0) return;
  const PropagatorTable& modes = coupling_.half_step();
  const Vec3 L = q_WB.conjugate() * L_W;
  Quaternion turn;
  Vec3 rate = Vec3::Zero();
  for (int iteration = 0; iteration < kMostIterations; ++iteration) {
    const Vec3 L_end = turn.conjugate() * L;
    std::copy_n(z, k, part_.z.data()), std::copy_n(momenta, k, part_.momenta.data());
    std::copy_n(forces, k, part_.loads.data());
    coupling_.add_stretching(L, 0.5, part_.loads.data());
    coupling_.add_stretching(L_end, 0.5, part_.loads.data());
    modes.advance(part_.z.data(), part_.momenta.data(), part_.loads.data());
    for (std::size_t i = 0; i < k; ++i) middle_z_[i] = 0.5 * (z[i] + part_.z[i]);
    const Vec3 last_rate = std::exchange(rate, coupling_.turn_of_stretch(0.5 * (L + L_end), middle_z_.data()));
    turn = quaternion_from_rotation_vector(modes.step() * rate);
    if (modes.step() * (rate - last_rate).norm() <= kSettled) break;
  }
  std::copy_n(part_.z.data(), k, z), std::copy_n(part_.momenta.data(), k, momenta);
  q_WB = normalized(q_WB * turn);
}

/// The flow of U over h by the implicit midpoint rule. @param L body axes, at its start
/// @return false, with nothing changed, if the iteration does not settle
bool CoupledMotion::couple(double h, double* z, double* momenta, const Vec3& L, Quaternion& turn) {
  const std::size_t k = rates_.size();
  std::fill(velocity_.begin(), velocity_.end(), 0.0);
  std::fill(force_.begin(), force_.end(), 0.0);
  Vec3 rate = Vec3::Zero();
  turn = {};
  for (int iteration = 0; iteration < kMostIterations; ++iteration) {
    double squared = 0.0;  // of momenta: twice a kinetic energy
    for (std::size_t i = 0; i < k; ++i) {
      middle_z_[i] = z[i] + 0.5 * h * velocity_[i];
      middle_momenta_[i] = momenta[i] + 0.5 * h * force_[i];
      squared += middle_momenta_[i] * middle_momenta_[i];
    }
    std::swap(velocity_, last_velocity_), std::swap(force_, last_force_);
    coupling_.evaluate_means(middle_z_.data(), middle_momenta_.data(), terms_);
    const Vec3 middle = 0.5 * (L + turn.conjugate() * L);
    const Vec3 last_rate =
        std::exchange(rate, coupling_.differentiate(middle, middle_z_.data(), terms_, velocity_, force_));
    turn = quaternion_from_rotation_vector(h * rate);
    squared += middle.dot(coupling_.rest_inverse() * middle);
    const double change = norm_of_difference(velocity_, last_velocity_) + h * norm_of_difference(force_, last_force_);
    if (h * (rate - last_rate).norm() > kSettled || change > kSettled * std::sqrt(squared)) continue;
    for (std::size_t i = 0; i < k; ++i) z[i] += h * velocity_[i], momenta[i] += h * force_[i];
    return true;
  }
  return false;
}

void CoupledMotion::begin_step(const double* forces, double* z, double* momenta, Quaternion& q_WB, const Vec3& L_W) {
  const double h = coupling_.step();
  const auto turn_alone = [&] { q_WB = FreeRotation(coupling_.rest(), q_WB, L_W).attitude(0.5 * h); };
  stretch(forces, z, momenta, q_WB, L_W);
  turn_alone();
  const double way = h * (coupling_.rest_inverse() * (q_WB.conjugate() * L_W)).norm();
  int parts = static_cast<int>(std::clamp(std::ceil(way / kTurnOfPart), 1.0, static_cast<double>(kMostParts)));
  Quaternion turn;
  for (int done = 0; done < parts;) {
    const bool settled = couple(h / parts, z, momenta, q_WB.conjugate() * L_W, turn);
    if (!settled && parts < kMostParts) {
      parts *= 2, done *= 2;
      continue;
    }
    if (settled) q_WB = normalized(q_WB * turn);
    ++done;
  }
  turn_alone();
}

}  // namespace limber
