#include "proximal_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "aligned_buffer.h"
#include "coulomb_contact.h"
#include "dense_coupling.h"
#include "secant_iteration.h"

namespace limber {
namespace {

// The proximal term that rows of any difficulty begin with, and its end.
constexpr double kFirstRho = ProximalSolver::Options{}.first_rho, kLargestRho = 1e10;
// Steps are solved to this part of the tolerance of the whole.
constexpr double kInner = 1e-2;

double largest(const double* x, std::size_t n) {
  double most = 0.0;
  for (std::size_t i = 0; i < n; ++i) most = std::max(most, std::abs(x[i]));
  return most;
}

}  // namespace

// In scaled numbers: f by √a, velocities by 1/√a, with a the mean of the diagonal over a cone, or a row's own. Cones do
// not change by that, and all residuals have one unit. What nothing moves (a = 0) keeps its scale and no force.
struct ProximalSolver::Impl {
  std::size_t cones = 0, n = 0;
  double size = 0.0;  // of b
  double rho = kFirstRho;
  DenseCoupling dense;
  RowCoupling* coupling = nullptr;
  AlignedBuffer memory;  // the vectors below
  double *b = nullptr, *lower = nullptr, *upper = nullptr, *f = nullptr, *best = nullptr, *y = nullptr, *v = nullptr,
         *z = nullptr, *p = nullptr, *d = nullptr, *Ad = nullptr, *dy = nullptr, *dv = nullptr, *trial_y = nullptr,
         *trial_v = nullptr;
  std::vector<double> scale, own, shift, shift_step;  // own: A_ii of single rows
  std::vector<ForceSet> sets;                         // of the first triples of rows
  SecantIteration secant;                             // of the shift
  std::vector<Mat3> diagonal;                         // of the cones
  std::vector<ProjectionDerivative> derivatives;      // of cones, then rows
  Result result;
  int max_newton_steps = 0;
  double best_residual = 0.0;
  double contradiction = 0.0;
  bool contradicts = false;  // no more of the residual will go, by whatever way

  bool tired() const { return result.newton_steps >= max_newton_steps; }

  void place(const BoundedRows& rows, std::span<const double> guess, double tolerance);
  void scale_rows();
  void multiply(double* out, const double* x) { coupling->multiply(out, x); }
  void find_velocity();
  void project(const double* from, double* to) const;
  double residual();
  double convex_residual() const;
  void keep();
  double shift_of(std::size_t cone) const { return sets[cone].mu * std::hypot(v[3 * cone + 1], v[3 * cone + 2]); }
  void find_shift();
  void solve_convex(double tolerance);
  void argument(const double* velocity, double* to) const;
  void find_derivatives();
  bool direction();
  double slope(double t);
  double line_search();
  bool convex_step(double tolerance);
  bool coupled_step(double tolerance);
  bool map_direction();
  Vec3 shift_derivative(std::size_t cone) const;
  double map_at(const double* at, const double* velocity);
  void newton_tail(double tolerance);
  void patient_tail(double tolerance);
  void sweep();
  void run(const Options& options);
};

void ProximalSolver::Impl::place(const BoundedRows& rows, std::span<const double> guess, double tolerance) {
  cones = static_cast<std::size_t>(rows.cones), n = guess.size();
  const std::size_t stride = padded(n);
  double** vectors[] = {&b, &lower, &upper, &f, &best, &y, &v, &z, &p, &d, &Ad, &dy, &dv, &trial_y, &trial_v};
  double* next = memory.need(std::size(vectors) * stride);
  std::fill_n(next, std::size(vectors) * stride, 0.0);
  for (double** vector : vectors) *vector = next, next += stride;
  shift.assign(cones, 0.0), shift_step.assign(cones, 0.0);
  scale_rows();
  make_force_sets(rows.friction.first(cones), rows.radius, scale, sets);
  for (std::size_t i = 0; i < n; ++i) {
    b[i] = rows.b[i] / scale[i];
    if (i >= 3 * cones) lower[i] = rows.lower[i] * scale[i], upper[i] = rows.upper[i] * scale[i];
    y[i] = std::isfinite(guess[i]) ? guess[i] * scale[i] : 0.0;
  }
  derivatives.resize(cones + n - 3 * cones);
  project(y, f);
  size = 0.0;
  for (std::size_t i = 0; i < cones; ++i) size = std::max(size, triple(b + 3 * i).norm());
  for (std::size_t i = 3 * cones; i < n; ++i) size = std::max(size, std::abs(b[i]));
  size = std::max(size, rows.noise / tolerance);
  if (size == 0.0) size = 1.0;  // nothing moves
}

void ProximalSolver::Impl::scale_rows() {
  scale.assign(n, 1.0);
  diagonal.resize(cones);
  const auto of = [&](double a) { return a > 0.0 ? std::sqrt(a) : 1.0; };
  for (std::size_t i = 0; i < cones; ++i) {
    diagonal[i] = coupling->own_block(3 * i, 3);
    const double root = of(diagonal[i].trace() / 3.0);
    std::fill_n(scale.begin() + static_cast<std::ptrdiff_t>(3 * i), 3, root);
    diagonal[i] /= root * root;
  }
  own.resize(n);
  for (std::size_t i = 3 * cones; i < n; ++i) {
    own[i] = coupling->own_block(i, 1)(0, 0);
    scale[i] = of(own[i]);
    own[i] /= scale[i] * scale[i];
  }
  coupling->scale(scale);
}

void ProximalSolver::Impl::project(const double* from, double* to) const {
  for (std::size_t i = 0; i < cones; ++i) {
    const Vec3 x = sets[i].project(triple(from + 3 * i));
    std::copy_n(x.data(), 3, to + 3 * i);
  }
  for (std::size_t i = 3 * cones; i < n; ++i) to[i] = std::clamp(from[i], lower[i], upper[i]);
}

/// v = A f + b
void ProximalSolver::Impl::find_velocity() {
  multiply(v, f);
  for (std::size_t i = 0; i < n; ++i) v[i] += b[i];
}

/// The largest |f − P(f − û(f))|, of the size of b. Leaves A f + b in v.
double ProximalSolver::Impl::residual() {
  find_velocity();
  double worst = 0.0;
  for (std::size_t i = 0; i < cones; ++i) {
    const Vec3 x = triple(f + 3 * i);
    worst = std::max(worst, (x - sets[i].project(x - corrected_velocity(triple(v + 3 * i), sets[i].mu))).norm());
  }
  for (std::size_t i = 3 * cones; i < n; ++i)
    worst = std::max(worst, std::abs(f[i] - std::clamp(f[i] - v[i], lower[i], upper[i])));
  return worst / size;
}

/// That of the problem with the shift as it is. A f + b is in v.
double ProximalSolver::Impl::convex_residual() const {
  double worst = 0.0;
  for (std::size_t i = 0; i < cones; ++i) {
    const Vec3 x = triple(f + 3 * i);
    worst = std::max(worst, (x - sets[i].project(x - triple(v + 3 * i) - shift[i] * Vec3::UnitX())).norm());
  }
  for (std::size_t i = 3 * cones; i < n; ++i)
    worst = std::max(worst, std::abs(f[i] - std::clamp(f[i] - v[i], lower[i], upper[i])));
  return worst / size;
}

/// The residual at f; remembers f if it is the best.
void ProximalSolver::Impl::keep() {
  result.residual = residual();
  if (!(result.residual < best_residual)) return;
  best_residual = result.residual;
  std::copy_n(f, n, best);
}

/// Of f, whose A f + b is in v.
void ProximalSolver::Impl::find_shift() {
  for (std::size_t i = 0; i < cones; ++i) shift[i] = shift_of(i);
}

/// f − ρ(velocity + b + shift)
void ProximalSolver::Impl::argument(const double* velocity, double* to) const {
  for (std::size_t i = 0; i < n; ++i) to[i] = f[i] - rho * (velocity[i] + b[i]);
  for (std::size_t i = 0; i < cones; ++i) to[3 * i] -= rho * shift[i];
}

/// Of the projection at z.
void ProximalSolver::Impl::find_derivatives() {
  for (std::size_t i = 0; i < cones; ++i) derivatives[i] = sets[i].derivative(triple(z + 3 * i), 3 * i);
  for (std::size_t i = 3 * cones; i < n; ++i) {
    ProjectionDerivative& P = derivatives[i - 2 * cones];
    P = {.first = i, .rows = 1, .s = {Vec3::UnitX(), Vec3::Zero(), Vec3::Zero()}};
    P.columns = z[i] > lower[i] && z[i] < upper[i] ? 1 : 0;
  }
}

/// Newton's step from y and A times it.
bool ProximalSolver::Impl::direction() {
  find_derivatives();
  if (!coupling->convex_step(derivatives, rho, d, dy)) return false;
  multiply(dv, dy);
  return all_finite(dv, n);
}

/// dφ/dt along dy: (y + t dy − p)ᵀ A dy
double ProximalSolver::Impl::slope(double t) {
  for (std::size_t i = 0; i < n; ++i) trial_v[i] = v[i] + t * dv[i];
  argument(trial_v, trial_y);
  project(trial_y, trial_y);
  double sum = 0.0;
  for (std::size_t i = 0; i < n; ++i) sum += dv[i] * (y[i] + t * dy[i] - trial_y[i]);
  return sum;
}

/// A length at which the slope has fallen to a tenth, by bracketing.
double ProximalSolver::Impl::line_search() {
  constexpr double kEnough = 0.1;
  constexpr int kMaxTrials = 40;
  const int longest = contradiction > 0.0 ? 4 : 20;  // along a null direction there is no end
  const double start = slope(0.0);
  double low = 0.0, at_low = start, high = 1.0, at_high = slope(high);
  if (std::abs(at_high) <= kEnough * std::abs(start)) return high;
  for (int n_longer = 0; at_high < 0.0 && n_longer < longest; ++n_longer)
    low = high, at_low = at_high, high *= 2.0, at_high = slope(high);
  if (at_high < 0.0) return high;
  double t = high;
  for (int trial = 0; trial < kMaxTrials; ++trial) {
    t = trial % 3 == 2 ? 0.5 * (low + high) : low - at_low * (high - low) / (at_high - at_low);
    const double now = slope(t);
    if (std::abs(now) <= kEnough * std::abs(start)) break;
    if (now < 0.0)
      low = t, at_low = now;
    else
      high = t, at_high = now;
  }
  return t;
}

/// One proximal step of (1) from f with the shift as it is. @return whether Newton's method came to its end
bool ProximalSolver::Impl::convex_step(double tolerance) {
  constexpr int kMaxNewton = 50;
  std::copy_n(f, n, y);
  multiply(v, y);
  bool settled = false;
  double last = std::numeric_limits<double>::infinity();
  for (int step = 0;; ++step) {
    argument(v, z);
    project(z, p);
    for (std::size_t i = 0; i < n; ++i) d[i] = y[i] - p[i];
    multiply(Ad, d);
    const double now = largest(Ad, n);
    settled = now <= tolerance * size;
    if (settled || step == kMaxNewton || tired()) break;
    if (step > 5 && now > 0.5 * last && now <= 1e-9 * (size + largest(v, n))) break;  // round-off
    last = now;
    ++result.newton_steps;
    if (!direction()) break;
    const double t = line_search();
    add_scaled(y, t, dy, n);
    add_scaled(v, t, dv, n);
  }
  std::copy_n(p, n, f);
  return settled;
}

/// y − P(y − û') in d, û' = û + (y − f)/ρ, and its size.
double ProximalSolver::Impl::map_at(const double* at, const double* velocity) {
  double sum = 0.0;
  for (std::size_t i = 0; i < n; ++i) z[i] = at[i] - (velocity[i] + b[i] + (at[i] - f[i]) / rho);
  for (std::size_t i = 0; i < cones; ++i)
    z[3 * i] -= sets[i].mu * std::hypot(velocity[3 * i + 1] + b[3 * i + 1], velocity[3 * i + 2] + b[3 * i + 2]);
  project(z, p);
  for (std::size_t i = 0; i < n; ++i) d[i] = at[i] - p[i], sum += d[i] * d[i];
  return std::sqrt(sum);
}

/// How the shift of a cone follows its velocity: μ times the direction of the velocity across.
Vec3 ProximalSolver::Impl::shift_derivative(std::size_t cone) const {
  const std::size_t i = 3 * cone;
  const double u0 = v[i + 1] + b[i + 1], u1 = v[i + 2] + b[i + 2], speed = std::hypot(u0, u1);
  return speed > 0.0 ? Vec3(sets[cone].mu / speed * Vec3(0.0, u0, u1)) : Vec3::Zero();
}

/// Newton's step on that map: (1 − P' + P'/ρ + P'C A) dy = −d.
bool ProximalSolver::Impl::map_direction() {
  find_derivatives();
  for (std::size_t i = 0; i < cones; ++i) derivatives[i].shift = shift_derivative(i);
  if (!coupling->map_step(derivatives, rho, d, dy)) return false;
  multiply(dv, dy);
  return all_finite(dv, n);
}

/// The proximal step from f with the shift found along with it. @return false, f as it was, if it is not found
bool ProximalSolver::Impl::coupled_step(double tolerance) {
  constexpr int kMaxNewton = 15, kLengths = 4;
  std::copy_n(f, n, y);
  multiply(v, y);
  double before = map_at(y, v);
  for (int step = 0; step < kMaxNewton; ++step) {
    if (before <= tolerance * size) {
      std::copy_n(p, n, f);
      return true;
    }
    if (tired()) return false;
    ++result.newton_steps;
    if (!map_direction()) return false;
    double t = 1.0, after = 0.0;
    int tried = 0;
    for (; tried < kLengths; ++tried, t *= 0.5) {
      for (std::size_t i = 0; i < n; ++i) trial_y[i] = y[i] + t * dy[i], trial_v[i] = v[i] + t * dv[i];
      after = map_at(trial_y, trial_v);
      if (after <= (1.0 - 0.25 * t) * before) break;
    }
    if (tried == kLengths) return false;
    std::copy_n(trial_y, n, y), std::copy_n(trial_v, n, v);
    before = after;
  }
  return false;
}

/// Proximal steps with the shift found along, as long as they help.
void ProximalSolver::Impl::newton_tail(double tolerance) {
  constexpr int kMaxSteps = 10;
  constexpr double kLess = 0.1;
  if (contradiction > 0.0) {
    patient_tail(tolerance);
    return;
  }
  for (int step = 0; step < kMaxSteps && result.residual > tolerance; ++step) {
    const double before = result.residual;
    if (!coupled_step(std::max(kInner * tolerance, 1e-3 * before))) return;
    keep();
    if (result.residual <= kLess * before) continue;
    if (rho >= kLargestRho) return;
    rho = std::min(30.0 * rho, kLargestRho);
  }
}

/// The same with shorter proximal steps where Newton's method does not come to its end. Finds out whether rows
/// contradict each other: the longer steps leave the same residual.
void ProximalSolver::Impl::patient_tail(double tolerance) {
  constexpr int kMaxSteps = 20, kSteadySteps = 2;
  constexpr double kLess = 0.1, kSteady = 0.9, kLeastRho = 1.0;
  const double rho_before = rho;
  int steady = 0;
  for (int step = 0; step < kMaxSteps && result.residual > tolerance && !tired(); ++step) {
    const double before = result.residual;
    const bool found = coupled_step(std::max(kInner * tolerance, 1e-3 * before));
    if (found) keep();
    if (!found || result.residual > 2.0 * before) {
      if (rho <= kLeastRho) break;
      rho /= 100.0;
      continue;
    }
    if (rho >= kFirstRho && result.residual > kSteady * before && ++steady == kSteadySteps) {
      contradicts = result.residual <= contradiction;
      break;
    }
    if (result.residual <= kLess * before) continue;
    if (rho >= kLargestRho) break;
    rho = std::min(30.0 * rho, kLargestRho);
  }
  rho = rho_before;
}

/// Every cone and row solved once, in order, for the forces of all others.
void ProximalSolver::Impl::sweep() {
  coupling->begin_sweeps(f);
  for (std::size_t i = 0; i < cones; ++i) {
    if (!(diagonal[i](0, 0) > 0.0)) continue;
    const Vec3 old = triple(f + 3 * i), velocity = coupling->answer(3 * i, 3) + triple(b + 3 * i);
    const Vec3 change = sets[i].improve(diagonal[i], old, velocity) - old;
    if (change.isZero(0.0)) continue;
    coupling->move(3 * i, 3, change);
    for (std::size_t c = 0; c < 3; ++c) f[3 * i + c] = old[static_cast<int>(c)] + change[static_cast<int>(c)];
  }
  for (std::size_t i = 3 * cones; i < n; ++i) {
    if (!(own[i] > 0.0)) continue;
    const double change = std::clamp(f[i] - (coupling->answer(i, 1)[0] + b[i]) / own[i], lower[i], upper[i]) - f[i];
    if (change == 0.0) continue;
    coupling->move(i, 1, change * Vec3::UnitX());
    f[i] += change;
  }
  ++result.sweeps;
}

/// Convex problems, each with the shift of the one before, and Newton's method from each; where those do not settle,
/// sweeps in between, which find other places to start from.
void ProximalSolver::Impl::run(const Options& options) {
  constexpr int kConvexSteps = 20, kSweepsPerRound = 10;
  constexpr double kRoundOff = 10.0;
  secant.begin(cones);
  if (largest(f, n) > 0.0) {
    find_shift();
    newton_tail(options.tolerance);
  }
  const auto unsettled = [&] { return result.residual > options.tolerance && !tired() && !contradicts; };
  double before = std::numeric_limits<double>::infinity();
  for (int step = 0; step < kConvexSteps && unsettled(); ++step) {
    // Round-off: what is left will not go, by whatever way.
    if (best_residual <= kRoundOff * options.tolerance && best_residual > 0.5 * before) return;
    before = best_residual;
    solve_convex(options.tolerance);
    keep();
    for (std::size_t i = 0; i < cones; ++i) shift_step[i] = shift_of(i) - shift[i];
    newton_tail(options.tolerance);
    secant.advance(shift, shift_step, shift_step);
    for (double& s : shift) s = std::max(s, 0.0);
  }
  while (unsettled() && result.sweeps < options.max_sweeps) {
    for (int k = 0; k < kSweepsPerRound && result.sweeps < options.max_sweeps; ++k) sweep();
    keep();
    newton_tail(options.tolerance);
  }
}

/// (1) to a part of the residual at hand, by proximal steps. Leaves A f + b in v.
void ProximalSolver::Impl::solve_convex(double tolerance) {
  constexpr int kMaxSteps = 8;
  const double wanted = std::max(0.1 * tolerance, 0.03 * result.residual);
  double before = std::numeric_limits<double>::infinity();
  for (int step = 0; step < kMaxSteps; ++step) {
    const bool found = convex_step(0.3 * wanted);
    find_velocity();
    const double now = convex_residual();
    if (now <= wanted || (!found && contradiction > 0.0)) return;
    if (now > 0.1 * before) rho = std::min(30.0 * rho, kLargestRho);
    before = now;
  }
}

ProximalSolver::ProximalSolver() : impl_(std::make_unique<Impl>()) {}
ProximalSolver::~ProximalSolver() = default;
ProximalSolver::ProximalSolver(ProximalSolver&&) noexcept = default;
ProximalSolver& ProximalSolver::operator=(ProximalSolver&&) noexcept = default;

ProximalSolver::Result ProximalSolver::solve(const BoundedRows& rows, std::span<double> f, const Options& options) {
  impl_->dense.set(rows.A, f.size());
  return solve(rows, impl_->dense, f, options);
}

ProximalSolver::Result ProximalSolver::solve(const BoundedRows& rows, RowCoupling& coupling, std::span<double> f,
                                             const Options& options) {
  Impl& s = *impl_;
  s.coupling = &coupling;
  s.result = {};
  s.contradicts = false;
  s.contradiction = options.contradiction;
  s.rho = options.first_rho;
  s.max_newton_steps = options.max_newton_steps;
  s.place(rows, f, options.tolerance);
  s.best_residual = std::numeric_limits<double>::infinity();
  s.keep();
  s.run(options);
  s.result.residual = s.best_residual;
  s.result.status = s.best_residual <= options.tolerance ? SolveStatus::kSolved
                    : s.contradicts                      ? SolveStatus::kRelaxed
                                                         : SolveStatus::kIterationLimit;
  for (std::size_t i = 0; i < s.n; ++i) f[i] = s.best[i] / s.scale[i];
  return s.result;
}

}  // namespace limber
