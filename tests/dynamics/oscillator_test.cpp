#include "limber/dynamics/oscillator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>
#include <complex>
#include <functional>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "asked.h"
#include "constants.h"
#include "instruction_sets.h"
#include "limber/core/error.h"
#include "limber/dynamics/exact_motion.h"

namespace limber {
namespace {

// The reference: z̈ + 2ξż + λz = g as ẏ = A y for y = (√λ z, ż, g), by the exponential of A h in 50 digits: Taylor's
// series of A h/2ˢ, squared s times. It knows nothing of roots or regimes. Squaring loses at most 2ˢ < 1e15 of the
// 1e-50.
using Wide = boost::multiprecision::number<boost::multiprecision::cpp_bin_float<50>, boost::multiprecision::et_off>;
using Matrix = std::array<std::array<Wide, 3>, 3>;

Matrix product(const Matrix& a, const Matrix& b) {
  Matrix c{};
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 3; ++j) c[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
  for (int j = 0; j < 3; ++j) c[2][j] = a[2][2] * b[2][j];  // the force does not depend on the state
  return c;
}

Matrix exponential(Matrix a) {
  Wide size = 0;
  for (const auto& row : a)
    for (const Wide& x : row) size = std::max(size, Wide(abs(x)));
  int squarings = 0;
  for (; size > Wide(0.01); size /= 2) ++squarings;
  Matrix term{}, sum{};
  for (int i = 0; i < 3; ++i) term[i][i] = sum[i][i] = 1;
  for (auto& row : a)
    for (Wide& x : row) x = ldexp(x, -squarings);
  for (int n = 1; n <= 20; ++n) {  // the first term left out: (3·0.01)²¹/21! < 1e-50
    term = product(term, a);
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 3; ++j) sum[i][j] += (term[i][j] /= n);
    term[2][2] = 0;
  }
  for (; squarings > 0; --squarings) sum = product(sum, sum);
  return sum;
}

/// A flow in the scaled state (√λ z, ż): what becomes of z₀ = 1/√λ, of ż₀ = 1, and of a force 1 held over the step.
/// Without damping the free part turns it, with damping it shrinks it, so its entries are at most 1.
struct ScaledFlow {
  Wide z_z, z_v, v_z, v_v, z_g, v_g;
};

ScaledFlow reference(const Mode& mode, double h) {
  const Wide omega = sqrt(Wide(mode.lambda)), step = h;
  Matrix a{};
  a[0][1] = omega * step;
  a[1][0] = -omega * step, a[1][1] = -2 * Wide(mode.decay) * step, a[1][2] = step;
  const Matrix e = exponential(a);
  return {e[0][0], e[0][1], e[1][0], e[1][1], e[0][2], e[1][2]};
}

ScaledFlow scaled(const Mode& mode, const ModePropagator& p) {
  const Wide omega = sqrt(Wide(mode.lambda));
  return {p.z_z, omega * p.z_zdot, p.zdot_z / omega, p.zdot_zdot, omega * p.z_g, p.zdot_g};
}

Wide size(const Wide& z, const Wide& v) { return sqrt(z * z + v * v); }

/// Frobenius norm of the difference: no state of size 1 comes out further from the truth.
double free_error(const ScaledFlow& a, const ScaledFlow& b) {
  return static_cast<double>(size(size(a.z_z - b.z_z, a.z_v - b.z_v), size(a.v_z - b.v_z, a.v_v - b.v_v)));
}

using testing::kEpsilon;

/// The accuracy that oscillator.h promises: four ulps of the phase (one of λ alone moves it by ε·√λ h/2), and 1e-12.
double promised(const Mode& mode, double h) { return 1e-12 + 4.0 * kEpsilon * std::sqrt(mode.lambda) * h; }

/// What the implementation is written for: four ulps of the phase, and a few of the state.
double round_off(const Mode& mode, double h) { return 4.0 * kEpsilon * (4.0 + std::sqrt(mode.lambda) * h); }

std::vector<double> damping_ratios() {
  std::vector<double> ratios{0.0, 1e-6, 0.01, 0.5, 0.9, 1.0, 1.15, 1.16, 2.0, 10.0, 1e3, 1e6};
  for (int p = 1; p <= 15; ++p) ratios.push_back(1.0 - std::pow(10.0, -p)), ratios.push_back(1.0 + std::pow(10.0, -p));
  return ratios;
}

std::vector<double> phases() {
  std::vector<double> values{0.3, 0.7, 2.0, 3.0, std::numbers::pi, 5.0, 2.0 * std::numbers::pi};
  for (int p = -9; p <= 6; ++p) values.push_back(std::pow(10.0, p));
  return values;
}

/// Calls claim(mode, h) over damping ratio × phase √λ h, for a λ with an exact root (1 ± 1e-15 is then met) and one
/// without.
void for_every_regime(const std::function<void(const Mode&, double h)>& claim) {
  for (const double lambda : {1e4, 3.7e9})
    for (const double ratio : damping_ratios())
      for (const double phase : phases()) {
        const double omega = std::sqrt(lambda);
        SCOPED_TRACE(::testing::Message()
                     << "lambda " << lambda << ", damping ratio 1 + " << ratio - 1.0 << ", phase " << phase);
        claim({.lambda = lambda, .decay = ratio * omega}, phase / omega);
      }
}

TEST(Oscillator, FreeFlowIsExactInEveryRegime) {
  for_every_regime([](const Mode& mode, double h) {
    const double error = free_error(scaled(mode, propagator(mode, h)), reference(mode, h));
    EXPECT_LE(error, promised(mode, h));
    EXPECT_LE(error, round_off(mode, h));
  });
}

TEST(Oscillator, HeldForceIsExactInEveryRegime) {
  for_every_regime([](const Mode& mode, double h) {
    const ScaledFlow flow = scaled(mode, propagator(mode, h)), exact = reference(mode, h),
                     halfway = reference(mode, h / 2);
    const double error = static_cast<double>(size(flow.z_g - exact.z_g, flow.v_g - exact.v_g));
    // Relative to the response's size on its way: at the end alone it may pass through zero (after a whole period).
    const double response = static_cast<double>(std::max(size(exact.z_g, exact.v_g), size(halfway.z_g, halfway.v_g)));
    EXPECT_LE(error, promised(mode, h) * response);
    EXPECT_LE(error, 2.0 * round_off(mode, h) * response);
  });
}

TEST(Oscillator, ImpulseInsideTheStepIsExactInEveryRegime) {
  for_every_regime([](const Mode& mode, double h) {
    const double impulse = -0.8;
    const double omega = std::sqrt(mode.lambda), remaining = 0.375 * h;
    const ModeState start{.z = 0.6 / omega, .zdot = 0.5};
    ModeState end = advance(propagator(mode, h), start);
    const ModeState kick = impulse_response(mode, remaining, impulse);
    end.z += kick.z, end.zdot += kick.zdot;
    const ScaledFlow whole = reference(mode, h), rest = reference(mode, remaining);
    const Wide w = sqrt(Wide(mode.lambda)), z0 = w * start.z, v0 = start.zdot;
    const Wide z = whole.z_z * z0 + whole.z_v * v0 + rest.z_v * impulse;
    const Wide v = whole.v_z * z0 + whole.v_v * v0 + rest.v_v * impulse;
    const double error = static_cast<double>(size(w * end.z - z, end.zdot - v));
    EXPECT_LE(error, promised(mode, h));
  });
}

TEST(Oscillator, TwoHalfStepsEqualOneWholeStep) {
  for_every_regime([](const Mode& mode, double h) {
    const double omega = std::sqrt(mode.lambda), g = 0.7 * omega;
    const ModeState start{.z = 0.6 / omega, .zdot = -0.8};
    const ModePropagator half = propagator(mode, h / 2);
    const ModeState whole = advance(propagator(mode, h), start, g);
    const ModeState twice = advance(half, advance(half, start, g), g);
    // Sizes: 1 of the start, and the held force's shift g/λ, 0.7 in scaled units, about which it swings.
    EXPECT_LE(std::hypot(omega * (twice.z - whole.z), twice.zdot - whole.zdot), promised(mode, h) * 1.7);
  });
}

TEST(Oscillator, ComplexPairOfThePaperGivesTheSameAwayFromCriticalDamping) {
  using Complex = std::complex<double>;
  // The pair divides by ω₊ − ω₋ and, overdamped, subtracts to make ω₊: up to some ten ulps of phase for these ratios.
  constexpr double kPairError = 1e-12;
  for (const double ratio : {0.0, 1e-6, 0.1, 0.5, 0.9, 1.1, 2.0})
    for (const double phase : {1e-3, 0.1, 1.0, 3.0, 10.0, 50.0}) {
      SCOPED_TRACE(::testing::Message() << "damping ratio " << ratio << ", phase " << phase);
      const double omega = 40.0, h = phase / omega, z0 = 0.6 / omega, v0 = 0.8;
      const Mode mode{.lambda = omega * omega, .decay = ratio * omega};
      const Complex root = std::sqrt(Complex(mode.decay * mode.decay - mode.lambda));
      const Complex plus = -mode.decay + root, minus = -mode.decay - root;
      const Complex c1 = (v0 - minus * z0) / (plus - minus), c2 = (plus * z0 - v0) / (plus - minus);
      const Complex e1 = std::exp(plus * h), e2 = std::exp(minus * h);
      const ModeState state = advance(propagator(mode, h), {z0, v0});
      EXPECT_NEAR(omega * state.z, omega * (c1 * e1 + c2 * e2).real(), kPairError);
      EXPECT_NEAR(state.zdot, (c1 * plus * e1 + c2 * minus * e2).real(), kPairError);
    }
}

TEST(Oscillator, MechanismCoastsAndFalls) {
  const double h = 0.3, g = -9.81;
  const ModeState end = advance(propagator({}, h), {.z = 2.0, .zdot = 5.0}, g);
  EXPECT_DOUBLE_EQ(end.z, 2.0 + 5.0 * h + 0.5 * g * h * h);
  EXPECT_DOUBLE_EQ(end.zdot, 5.0 + g * h);
}

TEST(Oscillator, DampedMechanismIsExact) {
  for (const double decay : {1e-12, 1e-3, 1.0, 1e3, 1e12})
    for (const double h : {1e-9, 1e-3, 1.0, 1e6}) {
      SCOPED_TRACE(::testing::Message() << "decay " << decay << ", step " << h);
      const Wide rate = 2 * Wide(decay), t = h, S = -expm1(-rate * t) / rate;
      const auto relative = [](double value, const Wide& exact) {
        return static_cast<double>((value - exact) / exact);
      };
      const ModePropagator p = propagator({.lambda = 0.0, .decay = decay}, h);
      constexpr double kRoundOff = 8.0 * kEpsilon;
      EXPECT_EQ(p.z_z, 1.0);
      EXPECT_EQ(p.zdot_z, 0.0);
      EXPECT_NEAR(relative(p.z_zdot, S), 0.0, kRoundOff);
      EXPECT_NEAR(relative(p.z_g, (t - S) / rate), 0.0, kRoundOff);
      EXPECT_NEAR(p.zdot_zdot, static_cast<double>(exp(-rate * t)), kRoundOff);
      EXPECT_EQ(p.zdot_g, p.z_zdot);
    }
}

TEST(Oscillator, HeldResponseIsNeverNegativeAndNothingOverflows) {
  const std::vector<double> sizes{0.0, 1e-100, 1e-18, 1e-9, 1e-3, 1.0, 7.0, 1e3, 1e6, 1e9, 1e12, 1e18, 1e24, 1e100};
  for (const double lambda : sizes)
    for (const double decay : sizes)
      for (const double h : sizes) {
        SCOPED_TRACE(::testing::Message() << "lambda " << lambda << ", decay " << decay << ", step " << h);
        const ModePropagator p = propagator({lambda, decay}, h);
        EXPECT_GE(p.z_g, 0.0);
        EXPECT_LE(std::abs(p.z_z), 1.0 + 4.0 * kEpsilon);
        EXPECT_LE(std::abs(p.zdot_zdot), 1.0 + 4.0 * kEpsilon);
        for (const double x : {p.z_z, p.z_zdot, p.zdot_z, p.zdot_zdot, p.z_g, p.zdot_g}) EXPECT_TRUE(std::isfinite(x));
      }
}

TEST(Oscillator, ImpulseResponseChangesSignAboveTheNyquistRateAndHeldResponseDoesNot) {
  const double omega = 100.0, h = 1.5 * std::numbers::pi / omega;  // three quarters of a period per step
  const ModePropagator p = propagator({.lambda = omega * omega, .decay = 0.0}, h);
  EXPECT_NEAR(omega * p.z_zdot, -1.0, 8.0 * kEpsilon);
  EXPECT_NEAR(omega * omega * p.z_g, 1.0, 8.0 * kEpsilon);
}

TEST(Oscillator, EnergyNeverRisesWithDamping) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> angle(0.0, 2.0 * std::numbers::pi);
  for_every_regime([&](const Mode& mode, double h) {
    const double turn = angle(random);
    const ModeState start{.z = std::cos(turn) / std::sqrt(mode.lambda), .zdot = std::sin(turn)};
    const double rounding = 16.0 * kEpsilon;  // of four products and their coefficients
    EXPECT_LE(energy(mode, advance(propagator(mode, h), start)), energy(mode, start) * (1.0 + rounding));
  });
}

TEST(Oscillator, RejectsWhatIsNotANumberFromZeroToItsLimit) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinite = std::numeric_limits<double>::infinity();
  for (const double wrong : {-1.0, nan, infinite, 1e101}) {
    EXPECT_THROW(propagator({.lambda = wrong}, 1.0), InvalidArgument);
    EXPECT_THROW(propagator({.decay = wrong}, 1.0), InvalidArgument);
    EXPECT_THROW(propagator({}, wrong), InvalidArgument);
    EXPECT_THROW(impulse_response({}, wrong, 1.0), InvalidArgument);
    EXPECT_THROW(PropagatorTable({}, {}, wrong), InvalidArgument);
  }
  EXPECT_THROW(PropagatorTable(std::vector{1.0, 2.0}, std::vector{0.0}, 0.1), InvalidArgument);
}

/// A row of doubles as the table wants them: 64-byte aligned and padded with zeros.
struct alignas(64) Row {
  double value[40] = {};
  double& operator[](Index i) { return value[i]; }
};

/// Modes from deep below to far above a step's Nyquist rate.
std::vector<double> spread_eigenvalues(Index modes) {
  std::vector<double> lambda;
  for (Index i = 0; i < modes; ++i) lambda.push_back(std::pow(0.1 * std::pow(1.37, i), 2));
  return lambda;
}

TEST(PropagatorTable, AdvancesEveryModeAndLeavesThePaddingZero) {
  constexpr double kStep = 0.01;
  for (const Index modes : {1, 7, 8, 9, 37}) {
    const std::vector<double> lambda = spread_eigenvalues(modes);
    std::vector<double> decay(lambda.size());
    for (std::size_t i = 0; i < decay.size(); ++i) decay[i] = 0.3 * static_cast<double>(i);
    const PropagatorTable table(lambda, decay, kStep);
    ASSERT_EQ(table.modes(), modes);
    ASSERT_EQ(table.padded() % PropagatorTable::kPad, 0);
    Row z, v, g, z_free, v_free;
    for (Index i = 0; i < modes; ++i)
      z[i] = z_free[i] = 1.0 + i, v[i] = v_free[i] = 2.0 - i, g[i] = 0.5 * i, g[i] += 3.0;
    table.advance(z.value, v.value, g.value);
    table.advance_free(z_free.value, v_free.value);
    for (Index i = 0; i < modes; ++i) {
      const ModePropagator p = propagator({lambda[i], decay[i]}, kStep);
      const ModeState start{1.0 + i, 2.0 - i}, held = limber::advance(p, start, 3.0 + 0.5 * i),
                                               free = limber::advance(p, start);
      const double scale = 8.0 * kEpsilon * (std::abs(start.z) + std::abs(start.zdot) + 3.0 + 0.5 * i) *
                           std::max(1.0, std::sqrt(lambda[i]));
      EXPECT_NEAR(z[i], held.z, scale);
      EXPECT_NEAR(v[i], held.zdot, scale);
      EXPECT_NEAR(z_free[i], free.z, scale);
      EXPECT_NEAR(v_free[i], free.zdot, scale);
      EXPECT_EQ(table.at(i).z_z, p.z_z);
      EXPECT_EQ(table.at(i).zdot_g, p.zdot_g);
      EXPECT_EQ(table.at(i).z_g, p.z_g);
    }
    for (Index i = modes; i < 40; ++i) EXPECT_EQ(z[i] + v[i] + z_free[i] + v_free[i], 0.0);
  }
}

TEST(PropagatorTable, IsEmptyWithoutModes) {
  const PropagatorTable table({}, {}, 0.1);
  EXPECT_EQ(table.padded(), 0);
  table.advance(nullptr, nullptr, nullptr);
  table.advance_free(nullptr, nullptr);
}

TEST(PropagatorTable, TenMillionStepsKeepAmplitudeAndPhase) {
  constexpr int kSteps = testing::all_or_tenth(10'000'000);
  constexpr double kStep = 1.0 / 60.0;
  // A rounded rotation is off by up to ε/2 in each of its entries, the same at every step: 1.6e-9 in 10⁷ of them, in
  // size and in angle. The products add less, as they do not all err alike.
  constexpr double kDrift = 2e-9;
  const std::vector<double> lambda = spread_eigenvalues(32), decay(32, 0.0);
  const PropagatorTable table(lambda, decay, kStep);
  Row z, v;
  for (Index i = 0; i < 32; ++i) z[i] = 1.0 / std::sqrt(lambda[i]);
  for (int step = 0; step < kSteps; ++step) table.advance_free(z.value, v.value);
  for (Index i = 0; i < 32; ++i) {
    const Wide omega = sqrt(Wide(lambda[i])), phase = omega * Wide(kStep) * kSteps;
    const double amplitude = static_cast<double>(size(omega * z[i], v[i]));
    const double error = static_cast<double>(size(omega * z[i] - cos(phase), v[i] + sin(phase)));
    // Above the step's Nyquist rate the angle of one step is a larger number, and its own rounding is a drift of the
    // phase.
    const double angle = std::sqrt(lambda[i]) * kStep;
    const double rounded_angle = angle > std::numbers::pi ? 0.5 * kEpsilon * static_cast<double>(phase) : 0.0;
    EXPECT_NEAR(amplitude, 1.0, kDrift) << "angle per step " << angle;
    EXPECT_LE(error, kDrift + rounded_angle) << "angle per step " << angle;
  }
}

TEST(PropagatorTable, InstructionSetsWithFusedMultiplyAddGiveTheSameBits) {
  const std::vector<double> lambda = spread_eigenvalues(37), decay(37, 0.4);
  const PropagatorTable table(lambda, decay, 0.013);
  std::vector<Row> results;
  for_each_instruction_set([&](std::int64_t target) {
    Row z, v, g;
    for (Index i = 0; i < 37; ++i) z[i] = std::sin(i), v[i] = std::cos(i), g[i] = 0.1 * i;
    for (int step = 0; step < 100; ++step)
      table.advance(z.value, v.value, g.value), table.advance_free(z.value, v.value);
    if (has_fused_multiply_add(target)) results.push_back(z), results.push_back(v);
  });
  for (std::size_t i = 2; i < results.size(); ++i)
    EXPECT_TRUE(std::equal(std::begin(results[i].value), std::end(results[i].value), std::begin(results[i % 2].value)));
}

// The flow of many modes at once, which ExactMotion evaluates within a step.

/// All of for_every_regime()'s modes that have this step.
struct ManyModes {
  std::vector<double> lambda, decay, z, rates, force;
  double h = 0.0;

  explicit ManyModes(double step) : h(step) {
    for (const double ratio : damping_ratios())
      for (const double phase : phases()) {
        const double omega = phase / h;
        lambda.push_back(omega * omega), decay.push_back(ratio * omega);
      }
    z.resize(lambda.size()), rates.resize(lambda.size()), force.resize(lambda.size());
  }
  ExactMotion motion() const {
    ExactMotion m;
    m.set_frame({}, h);
    m.set_modes(lambda, decay, z, rates);
    std::ranges::copy(force, m.forces().begin());
    return m;
  }
  MotionState at(double t) const {
    MotionState s;
    motion().evaluate(t, s);
    return s;
  }
  std::size_t size() const { return lambda.size(); }
};

TEST(ManyModes, FlowExactlyInEveryRegime) {
  ManyModes modes(0.25);
  std::ranges::fill(modes.rates, 1.0);
  const MotionState kicked = modes.at(modes.h);
  std::ranges::fill(modes.rates, 0.0);
  for (std::size_t i = 0; i < modes.size(); ++i) modes.z[i] = 1.0 / std::sqrt(modes.lambda[i]);
  const MotionState displaced = modes.at(modes.h);
  std::ranges::fill(modes.z, 0.0);
  std::ranges::fill(modes.force, 1.0);
  const MotionState pushed = modes.at(modes.h);
  for (std::size_t i = 0; i < modes.size(); ++i) {
    const Mode mode{modes.lambda[i], modes.decay[i]};
    const Wide omega = sqrt(Wide(mode.lambda));
    SCOPED_TRACE(::testing::Message() << "phase " << std::sqrt(mode.lambda) * modes.h << ", damping ratio "
                                      << mode.decay / std::sqrt(mode.lambda));
    const ScaledFlow exact = reference(mode, modes.h), halfway = reference(mode, modes.h / 2);
    const ScaledFlow flow{omega * displaced.amplitudes[i],
                          omega * kicked.amplitudes[i],
                          displaced.rates[i],
                          kicked.rates[i],
                          omega * pushed.amplitudes[i],
                          pushed.rates[i]};
    EXPECT_LE(free_error(flow, exact), round_off(mode, modes.h));
    const double error = static_cast<double>(size(flow.z_g - exact.z_g, flow.v_g - exact.v_g));
    const double response = static_cast<double>(std::max(size(exact.z_g, exact.v_g), size(halfway.z_g, halfway.v_g)));
    EXPECT_LE(error, 2.0 * round_off(mode, modes.h) * response);
  }
}

TEST(ManyModes, ImpulsesGoOnFromTheirTimeAsOfOneModeAlone) {
  const ManyModes modes(0.1);
  ExactMotion motion = modes.motion();
  std::ranges::fill(motion.add_impulse(0.0), 0.5);
  std::ranges::fill(motion.add_impulse(0.03), -0.8);
  std::ranges::fill(motion.add_impulse(0.09), 1e3);  // not yet
  MotionState s;
  motion.evaluate(0.07, s);
  for (std::size_t i = 0; i < modes.size(); ++i) {
    const Mode mode{modes.lambda[i], modes.decay[i]};
    const ModeState first = impulse_response(mode, 0.07, 0.5), second = impulse_response(mode, 0.07 - 0.03, -0.8);
    const double omega = std::sqrt(mode.lambda), error = 2.0 * round_off(mode, 0.07);
    EXPECT_NEAR(omega * s.amplitudes[i], omega * (first.z + second.z), error);
    EXPECT_NEAR(s.rates[i], first.zdot + second.zdot, error);
    EXPECT_EQ(motion.amplitude(static_cast<Index>(i), 0.07), s.amplitudes[i]);
  }
}

TEST(ManyModes, StayFiniteAndNoLargerThanTheyWere) {
  const std::vector<double> sizes{0.0, 1e-100, 1e-18, 1e-9, 1e-3, 1.0, 7.0, 1e3, 1e6, 1e9, 1e12, 1e18, 1e24, 1e100};
  std::vector<double> lambda, decay;
  for (const double l : sizes)
    for (const double d : sizes) lambda.push_back(l), decay.push_back(d);
  const std::vector<double> ones(lambda.size(), 1.0), zeros(lambda.size(), 0.0);
  for (const double h : sizes) {
    ExactMotion motion;
    motion.set_frame({}, h);
    MotionState s;
    motion.set_modes(lambda, decay, zeros, ones);
    motion.evaluate(h, s);
    for (std::size_t i = 0; i < lambda.size(); ++i) {
      SCOPED_TRACE(::testing::Message() << "lambda " << lambda[i] << ", decay " << decay[i] << ", time " << h);
      EXPECT_LE(std::abs(s.rates[i]), 1.0 + 8.0 * kEpsilon);
      EXPECT_LE(std::sqrt(lambda[i]) * std::abs(s.amplitudes[i]), 1.0 + 8.0 * kEpsilon);
    }
    motion.set_modes(lambda, decay, ones, zeros);
    std::ranges::fill(motion.forces(), 1.0);
    motion.evaluate(h, s);
    for (std::size_t i = 0; i < lambda.size(); ++i)
      EXPECT_TRUE(std::isfinite(s.amplitudes[i]) && std::isfinite(s.rates[i]))
          << "lambda " << lambda[i] << ", decay " << decay[i] << ", time " << h;
  }
}

TEST(ManyModes, MechanismsCoastAndFall) {
  ManyModes modes(0.3);
  modes.lambda = {0.0, 0.0, 0.0}, modes.decay = {0.0, 1.0, 1e3};
  modes.z = {2.0, 2.0, 2.0}, modes.rates = {5.0, 5.0, 5.0}, modes.force = {-9.81, -9.81, -9.81};
  const MotionState s = modes.at(0.3);
  for (std::size_t i = 0; i < 3; ++i) {
    const ModeState alone = advance(propagator({0.0, modes.decay[i]}, 0.3), {2.0, 5.0}, -9.81);
    EXPECT_DOUBLE_EQ(s.amplitudes[i], alone.z);
    EXPECT_NEAR(s.rates[i], alone.zdot, 4.0 * kEpsilon);
  }
}

TEST(ManyModes, InstructionSetsWithFusedMultiplyAddGiveTheSameBits) {
  ManyModes modes(0.02);
  for (std::size_t i = 0; i < modes.size(); ++i)
    modes.z[i] = std::sin(i), modes.rates[i] = std::cos(i), modes.force[i] = 0.1 * static_cast<double>(i);
  std::vector<MotionState> results;
  for_each_instruction_set([&](std::int64_t target) {
    const MotionState s = modes.at(0.013);
    if (has_fused_multiply_add(target)) results.push_back(s);
  });
  for (const MotionState& s : results) {
    EXPECT_EQ(s.amplitudes, results.front().amplitudes);
    EXPECT_EQ(s.rates, results.front().rates);
  }
}

}  // namespace
}  // namespace limber
