#include "proximal_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "aligned_buffer.h"
#include "coulomb_contact.h"
#include "secant_iteration.h"

namespace limber {
namespace {

// Of the proximal term, for rows scaled to A_ii = 1. Larger: fewer proximal steps, and more digits lost in each.
constexpr double kFirstRho = 1e4, kLargestRho = 1e10;
// Steps are solved to this part of the tolerance of the whole.
constexpr double kInner = 1e-2;

Vec3 triple(const double* x) { return {x[0], x[1], x[2]}; }

double largest(const double* x, std::size_t n) {
  double most = 0.0;
  for (std::size_t i = 0; i < n; ++i) most = std::max(most, std::abs(x[i]));
  return most;
}

/// LU with row exchanges of a small matrix, in place.
class DenseLu {
 public:
  bool factor(MatrixView M, std::size_t n) {
    M_ = M, n_ = n;
    pivots_.resize(n);
    for (std::size_t k = 0; k < n; ++k) {
      std::size_t p = k;
      for (std::size_t i = k + 1; i < n; ++i)
        if (std::abs(M.row(i)[k]) > std::abs(M.row(p)[k])) p = i;
      if (!(std::abs(M.row(p)[k]) > 0.0)) return false;
      pivots_[k] = p;
      if (p != k) std::swap_ranges(M.row(p), M.row(p) + n, M.row(k));
      const std::size_t first = k / kPad * kPad;  // kernels take aligned rows; what is left of k is put back
      double kept[kPad];
      for (std::size_t i = k + 1; i < n; ++i) {
        double* row = M.row(i);
        const double part = row[k] / M.row(k)[k];
        if (part == 0.0) continue;
        std::copy_n(row + first, k - first, kept);
        add_scaled(row + first, -part, M.row(k) + first, n - first);
        std::copy_n(kept, k - first, row + first);
        row[k] = part;
      }
    }
    return true;
  }

  void solve(double* x) const {
    for (std::size_t k = 0; k < n_; ++k) std::swap(x[k], x[pivots_[k]]);
    for (std::size_t i = 1; i < n_; ++i)
      for (std::size_t j = 0; j < i; ++j) x[i] -= M_.row(i)[j] * x[j];
    for (std::size_t i = n_; i-- > 0;) {
      for (std::size_t j = i + 1; j < n_; ++j) x[i] -= M_.row(i)[j] * x[j];
      x[i] /= M_.row(i)[i];
    }
  }

 private:
  MatrixView M_{};
  std::size_t n_ = 0;
  std::vector<std::size_t> pivots_;
};

}  // namespace

// In scaled numbers: f by √a, velocities by 1/√a, with a the mean of the diagonal over a cone, or a row's own. Cones do
// not change by that, and all residuals have one unit. What nothing moves (a = 0) keeps its scale and no force.
struct ProximalSolver::Impl {
  std::size_t cones = 0, n = 0;
  double size = 0.0;  // of b
  double rho = kFirstRho;
  MatrixBuffer A_memory, newton_memory;
  MatrixView A{};
  AlignedBuffer memory;  // the vectors below
  double *b = nullptr, *lower = nullptr, *upper = nullptr, *f = nullptr, *best = nullptr, *y = nullptr, *v = nullptr,
         *z = nullptr, *p = nullptr, *d = nullptr, *Ad = nullptr, *dy = nullptr, *dv = nullptr, *trial_y = nullptr,
         *trial_v = nullptr, *zero = nullptr;
  AlignedBuffer coefficients_memory, row_memory;
  std::vector<double> scale, mu, shift, shift_step;
  SecantIteration secant;  // of the shift
  std::vector<Mat3> diagonal, derivative;
  std::vector<std::size_t> active;
  // Columns of S, P' = S Sᵀ, those of one cone or row next to each other.
  struct Column {
    std::size_t first = 0, rows = 0;
    Vec3 s = Vec3::Zero();
  };
  std::vector<Column> columns;
  DenseLu lu;
  Result result;
  int max_newton_steps = 0;
  double best_residual = 0.0;

  bool tired() const { return result.newton_steps >= max_newton_steps; }

  void place(const BoundedRows& rows, std::span<const double> guess, double tolerance);
  void scale_rows(const BoundedRows& rows);
  void multiply(double* out, const double* x) { multiply_rows(out, A, nullptr, x, n, n); }
  void project(const double* from, double* to) const;
  double residual();
  double convex_residual() const;
  void keep();
  double shift_of(std::size_t cone) const { return mu[cone] * std::hypot(v[3 * cone + 1], v[3 * cone + 2]); }
  void find_shift();
  void solve_convex(double tolerance);
  void argument(const double* velocity, double* to) const;
  void find_columns();
  void add_cone_columns(std::size_t cone);
  bool direction();
  double slope(double t);
  double line_search();
  bool convex_step(double tolerance);
  bool coupled_step(double tolerance);
  bool map_direction();
  Mat3 shifted_derivative(std::size_t cone) const;
  double map_at(const double* at, const double* velocity);
  void newton_tail(double tolerance);
  void sweep();
  void run(const Options& options);
};

void ProximalSolver::Impl::place(const BoundedRows& rows, std::span<const double> guess, double tolerance) {
  cones = static_cast<std::size_t>(rows.cones), n = guess.size();
  const std::size_t stride = padded(n);
  double** vectors[] = {&b, &lower, &upper, &f, &best, &y, &v, &z, &p, &d, &Ad, &dy, &dv, &trial_y, &trial_v, &zero};
  double* next = memory.need(std::size(vectors) * stride);
  std::fill_n(next, std::size(vectors) * stride, 0.0);
  for (double** vector : vectors) *vector = next, next += stride;
  A = A_memory.need(n, n);
  mu.assign(rows.friction.begin(), rows.friction.end());
  shift.assign(cones, 0.0), shift_step.assign(cones, 0.0);
  scale_rows(rows);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) A.row(i)[j] = rows.A[i * n + j] / (scale[i] * scale[j]);
    std::fill(A.row(i) + n, A.row(i) + A.stride, 0.0);
    b[i] = rows.b[i] / scale[i];
    if (i >= 3 * cones) lower[i] = rows.lower[i] * scale[i], upper[i] = rows.upper[i] * scale[i];
    y[i] = std::isfinite(guess[i]) ? guess[i] * scale[i] : 0.0;
  }
  diagonal.resize(cones), derivative.resize(cones);
  active.reserve(n);
  for (std::size_t i = 0; i < cones; ++i)
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t c = 0; c < 3; ++c)
        diagonal[i](static_cast<int>(r), static_cast<int>(c)) = A.row(3 * i + r)[3 * i + c];
  project(y, f);
  size = 0.0;
  for (std::size_t i = 0; i < cones; ++i) size = std::max(size, triple(b + 3 * i).norm());
  for (std::size_t i = 3 * cones; i < n; ++i) size = std::max(size, std::abs(b[i]));
  size = std::max(size, rows.noise / tolerance);
  if (size == 0.0) size = 1.0;  // nothing moves
}

void ProximalSolver::Impl::scale_rows(const BoundedRows& rows) {
  scale.assign(n, 1.0);
  const auto of = [&](double a) { return a > 0.0 ? std::sqrt(a) : 1.0; };
  for (std::size_t i = 0; i < 3 * cones; i += 3) {
    double trace = 0.0;
    for (std::size_t c = i; c < i + 3; ++c) trace += rows.A[c * n + c];
    std::fill_n(scale.begin() + static_cast<std::ptrdiff_t>(i), 3, of(trace / 3.0));
  }
  for (std::size_t i = 3 * cones; i < n; ++i) scale[i] = of(rows.A[i * n + i]);
}

void ProximalSolver::Impl::project(const double* from, double* to) const {
  for (std::size_t i = 0; i < cones; ++i) {
    const Vec3 x = project_on_cone(triple(from + 3 * i), mu[i]);
    std::copy_n(x.data(), 3, to + 3 * i);
  }
  for (std::size_t i = 3 * cones; i < n; ++i) to[i] = std::clamp(from[i], lower[i], upper[i]);
}

/// The largest |f − P(f − û(f))|, of the size of b. Leaves A f + b in v.
double ProximalSolver::Impl::residual() {
  combine_rows(v, b, A, nullptr, f, n, n);
  double worst = 0.0;
  for (std::size_t i = 0; i < cones; ++i) {
    const Vec3 x = triple(f + 3 * i);
    worst = std::max(worst, (x - project_on_cone(x - corrected_velocity(triple(v + 3 * i), mu[i]), mu[i])).norm());
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
    worst = std::max(worst, (x - project_on_cone(x - triple(v + 3 * i) - shift[i] * Vec3::UnitX(), mu[i])).norm());
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

void ProximalSolver::Impl::add_cone_columns(std::size_t cone) {
  const std::size_t first = 3 * cone;
  const double m = mu[cone], across = std::hypot(z[first + 1], z[first + 2]);
  if (m * across <= -z[first]) return;
  if (m > 0.0 && across <= m * z[first]) {  // sticks: there is no direction of sliding, and no shift
    for (int c = 0; c < 3; ++c) columns.push_back({first, 3, Vec3::Unit(c)});
    return;
  }
  if (m == 0.0) {
    columns.push_back({first, 3, Vec3::UnitX()});
    return;
  }
  const double t0 = z[first + 1] / across, t1 = z[first + 2] / across;
  const double pressed = (z[first] + m * across) / (1.0 + m * m);
  const Vec3 along = Vec3(1.0, m * t0, m * t1) / std::sqrt(1.0 + m * m);
  const Vec3 aside = Vec3(0.0, -t1, t0) * std::sqrt(m * pressed / across);
  columns.push_back({first, 3, along});
  columns.push_back({first, 3, aside});
}

void ProximalSolver::Impl::find_columns() {
  columns.clear();
  columns.reserve(n);
  for (std::size_t i = 0; i < cones; ++i) add_cone_columns(i);
  for (std::size_t i = 3 * cones; i < n; ++i)
    if (z[i] > lower[i] && z[i] < upper[i]) columns.push_back({i, 1, Vec3::UnitX()});
}

/// Newton's step from y, dy = −d + ρ S (1 + ρ SᵀA S)⁻¹ SᵀA d for d = y − p, and A dy.
bool ProximalSolver::Impl::direction() {
  const std::size_t a = columns.size();
  const MatrixView M = newton_memory.need(a, a);
  double* x = coefficients_memory.need(a);
  double* row = row_memory.need(n);
  for (std::size_t i = 0; i < a; ++i) {
    const Column& at = columns[i];
    int rows[3];
    for (std::size_t r = 0; r < at.rows; ++r) rows[r] = static_cast<int>(at.first + r);
    combine_rows(row, zero, A, rows, at.s.data(), at.rows, n);  // of A S
    for (std::size_t j = 0; j < a; ++j) {
      const Column& to = columns[j];
      double sum = 0.0;
      for (std::size_t r = 0; r < to.rows; ++r) sum += to.s[static_cast<int>(r)] * row[to.first + r];
      M.row(i)[j] = rho * sum + (i == j ? 1.0 : 0.0);
    }
    std::fill(M.row(i) + a, M.row(i) + M.stride, 0.0);
    x[i] = 0.0;
    for (std::size_t r = 0; r < at.rows; ++r) x[i] += rho * at.s[static_cast<int>(r)] * Ad[at.first + r];
  }
  if (!lu.factor(M, a)) return false;
  lu.solve(x);
  for (std::size_t i = 0; i < n; ++i) dy[i] = -d[i];
  for (std::size_t i = 0; i < a; ++i)
    for (std::size_t r = 0; r < columns[i].rows; ++r)
      dy[columns[i].first + r] += columns[i].s[static_cast<int>(r)] * x[i];
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
  constexpr int kLongest = 20, kMaxTrials = 40;
  const double start = slope(0.0);
  double low = 0.0, at_low = start, high = 1.0, at_high = slope(high);
  if (std::abs(at_high) <= kEnough * std::abs(start)) return high;
  for (int n_longer = 0; at_high < 0.0 && n_longer < kLongest; ++n_longer)
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
    find_columns();
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
    z[3 * i] -= mu[i] * std::hypot(velocity[3 * i + 1] + b[3 * i + 1], velocity[3 * i + 2] + b[3 * i + 2]);
  project(z, p);
  for (std::size_t i = 0; i < n; ++i) d[i] = at[i] - p[i], sum += d[i] * d[i];
  return std::sqrt(sum);
}

/// P'C of a cone, C = 1 + μ e_n tᵀ with t the direction of the velocity across.
Mat3 ProximalSolver::Impl::shifted_derivative(std::size_t cone) const {
  const std::size_t i = 3 * cone;
  const double u0 = v[i + 1] + b[i + 1], u1 = v[i + 2] + b[i + 2], speed = std::hypot(u0, u1);
  Mat3 PC = derivative[cone];
  if (speed > 0.0) PC += PC.col(0) * (mu[cone] / speed * Vec3(0.0, u0, u1)).transpose();
  return PC;
}

/// Newton's step on that map: (1 − P' + P'C(A + 1/ρ)) dy = −d.
bool ProximalSolver::Impl::map_direction() {
  active.clear();
  for (std::size_t i = 0; i < n; ++i) dy[i] = 0.0;
  const auto leave = [&](std::size_t i) { dy[i] = -d[i]; };
  for (std::size_t i = 0; i < cones; ++i) {
    derivative[i] = cone_projection_derivative(triple(z + 3 * i), mu[i]);
    const bool acts = !derivative[i].isZero(0.0);
    for (std::size_t c = 3 * i; c < 3 * i + 3; ++c) acts ? active.push_back(c) : leave(c);
  }
  for (std::size_t i = 3 * cones; i < n; ++i) z[i] > lower[i] && z[i] < upper[i] ? active.push_back(i) : leave(i);
  const std::size_t a = active.size();
  const MatrixView M = newton_memory.need(a, a);
  double* x = coefficients_memory.need(a);
  double* row = row_memory.need(n);
  multiply(dv, dy);  // of what has left
  for (std::size_t k = 0; k < a;) {
    const std::size_t i = active[k], rows = i < 3 * cones ? 3 : 1;
    const Mat3 P = rows == 3 ? derivative[i / 3] : Mat3::Identity(), PC = rows == 3 ? shifted_derivative(i / 3) : P;
    int from[3];
    for (std::size_t c = 0; c < rows; ++c) from[c] = static_cast<int>(i + c);
    for (std::size_t r = 0; r < rows; ++r) {
      const Vec3 weight = PC.row(static_cast<int>(r));
      combine_rows(row, zero, A, from, weight.data(), rows, n);
      double* to = M.row(k + r);
      for (std::size_t j = 0; j < a; ++j) to[j] = row[active[j]];
      std::fill(to + a, to + M.stride, 0.0);
      x[k + r] = -d[i + r];
      for (std::size_t c = 0; c < rows; ++c) {
        const double part = P(static_cast<int>(r), static_cast<int>(c));
        to[k + c] += (r == c ? 1.0 : 0.0) - part + part / rho;
        x[k + r] -= weight[static_cast<int>(c)] * dv[i + c];
      }
    }
    k += rows;
  }
  if (!lu.factor(M, a)) return false;
  lu.solve(x);
  for (std::size_t k = 0; k < a; ++k) dy[active[k]] = x[k];
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
  for (int step = 0; step < kMaxSteps && result.residual > tolerance; ++step) {
    const double before = result.residual;
    if (!coupled_step(std::max(kInner * tolerance, 1e-3 * before))) return;
    keep();
    if (result.residual <= kLess * before) continue;
    if (rho >= kLargestRho) return;
    rho = std::min(30.0 * rho, kLargestRho);
  }
}

/// Every cone and row solved once, in order, for the forces of all others.
void ProximalSolver::Impl::sweep() {
  combine_rows(v, b, A, nullptr, f, n, n);
  for (std::size_t i = 0; i < cones; ++i) {
    if (!(diagonal[i](0, 0) > 0.0)) continue;
    const Vec3 old = triple(f + 3 * i);
    const Vec3 change = solve_coulomb_contact(diagonal[i], triple(v + 3 * i) - diagonal[i] * old, mu[i]) - old;
    if (change.isZero(0.0)) continue;
    const int rows[3] = {static_cast<int>(3 * i), static_cast<int>(3 * i + 1), static_cast<int>(3 * i + 2)};
    combine_rows(v, v, A, rows, change.data(), 3, n);
    for (std::size_t c = 0; c < 3; ++c) f[3 * i + c] = old[static_cast<int>(c)] + change[static_cast<int>(c)];
  }
  for (std::size_t i = 3 * cones; i < n; ++i) {
    const double own = A.row(i)[i];
    if (!(own > 0.0)) continue;
    const double change = std::clamp(f[i] - v[i] / own, lower[i], upper[i]) - f[i];
    if (change == 0.0) continue;
    add_scaled(v, change, A.row(i), n);
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
  const auto unsettled = [&] { return result.residual > options.tolerance && !tired(); };
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
    convex_step(0.3 * wanted);
    combine_rows(v, b, A, nullptr, f, n, n);
    const double now = convex_residual();
    if (now <= wanted) return;
    if (now > 0.1 * before) rho = std::min(30.0 * rho, kLargestRho);
    before = now;
  }
}

ProximalSolver::ProximalSolver() : impl_(std::make_unique<Impl>()) {}
ProximalSolver::~ProximalSolver() = default;
ProximalSolver::ProximalSolver(ProximalSolver&&) noexcept = default;
ProximalSolver& ProximalSolver::operator=(ProximalSolver&&) noexcept = default;

ProximalSolver::Result ProximalSolver::solve(const BoundedRows& rows, std::span<double> f, const Options& options) {
  Impl& s = *impl_;
  s.result = {};
  s.rho = kFirstRho;
  s.max_newton_steps = options.max_newton_steps;
  s.place(rows, f, options.tolerance);
  s.best_residual = std::numeric_limits<double>::infinity();
  s.keep();
  s.run(options);
  s.result.residual = s.best_residual;
  s.result.status = s.best_residual <= options.tolerance ? SolveStatus::kSolved : SolveStatus::kIterationLimit;
  for (std::size_t i = 0; i < s.n; ++i) f[i] = s.best[i] / s.scale[i];
  return s.result;
}

}  // namespace limber
