#include <algorithm>
#include <numbers>

#include "../tuning.h"
#include "island_impl.h"

namespace limber::internal {
namespace {

/// A part that is accepted, and soon: it may be done ten times more.
bool is_quick(const IslandReport& done) {
  return done.accepted && done.newton_steps <= kConstraintsTuning.impacts.quick_newton_steps;
}

}  // namespace

/// Cuts a part of a step that has been foreseen where an impact lets go within it.
///
/// A force that is held cannot end within a step. But the impulse I(s) that keeps the gaps of an impact closed until s
/// grows as long as they press, dI/ds being the force then; from where it shrinks on they would have to pull. That is
/// where they let go. The exact wave in a bar has I = F s up to the release at T, F (2T − s) after it in steps that
/// began before, and F s²/(3s − 2T) in one that begins with the impact. It grows again later, after 4T/3 there: the
/// release is its first maximum.
void IslandParts::end_at_release(StepPart& part, IslandReport& done) {
  const double latest = longest_impact();
  if (latest == 0.0 || step_.theta == 1.0 || !may_repeat()) return;
  const auto end_at = [&](double time) {
    part.options.step = time;
    part.ends = false;
    done.attempts[StepAttempt::kCutAtTouch] = 0;
    done.attempts[StepAttempt::kCutAtRelease] = 1;
  };
  const auto again = [&] {
    const StepAttempts cut = done.attempts;
    done = find_guarded(part);
    done.attempts.add(cut);
  };
  if (is_part(latest, part.options.step, part.whole_step)) {
    end_at(latest);
    again();
  }
  if (!is_quick(done)) return;
  const double length = part.options.step, release = find_release(part);
  if (is_part(release, length, part.whole_step)) end_at(release);
  again();
}

/// By when those have let go that are to be cut there, s; 0: there are none.
double IslandParts::longest_impact() const {
  double longest = 0.0;
  for (std::size_t i = 0; i < step_.size(); ++i) longest = std::max(longest, step_.law(i).lets_go_within);
  return longest;
}

/// Of all impacts of the island in the last step; 0: they begin.
double IslandParts::last_impact_force() const {
  double before = 0.0;
  for (std::size_t i = 0; i < step_.size(); ++i)
    if (step_.law(i).lets_go_within > 0.0) before += step_.law(i).last_force;
  return before;
}

/// Of all impacts of the island, along their normals.
double IslandParts::impact_impulse(double length) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < step_.size(); ++i)
    if (step_.law(i).lets_go_within > 0.0) sum += step_.f[i] + length * step_.reaction[i];
  return sum;
}

/// The end of the part with the largest impulse, by golden section; the part's own end if it grows to there. Where the
/// impact begins with the part, the first such end: between ends of which each is a quarter later than the one before.
double IslandParts::find_release(StepPart part) {
  constexpr const ImpactTuning& tuning = kConstraintsTuning.impacts;
  const double length = part.options.step, golden = 1.0 / std::numbers::phi, whole = impact_impulse(length);
  const bool begins = last_impact_force() == 0.0;
  bool quick = true;
  const auto impulse_until = [&](double end) {
    if (!quick) return 0.0;
    if (end == length) return whole;
    part.options.step = end;
    quick = is_quick(find(part));
    return impact_impulse(end);
  };
  double begin = 0.0, end = length, at_end = whole;
  if (begins) {
    end = tuning.release_soonest * length, at_end = impulse_until(end);
    double between = 0.0, at_between = 0.0;
    while (quick && at_end >= at_between && end < length) {
      begin = between, between = end, at_between = at_end;
      end = std::min(tuning.release_later * end, length), at_end = impulse_until(end);
    }
    if (!quick || at_end >= at_between) return length;
  } else if (whole > 0.0 && impulse_until(tuning.release_almost * length) < (1.0 + tuning.release_noticeable) * whole) {
    return length;
  }
  double first = end - golden * (end - begin), second = begin + golden * (end - begin);
  double at_first = impulse_until(first), at_second = impulse_until(second);
  for (int trial = 2; trial < tuning.release_trials && quick; ++trial) {
    if (at_first < at_second) {
      begin = first, first = second, at_first = at_second;
      second = begin + golden * (end - begin);
      at_second = impulse_until(second);
    } else {
      end = second, second = first, at_second = at_first;
      first = end - golden * (end - begin);
      at_first = impulse_until(first);
    }
  }
  if (!quick) return length;
  return std::max(at_first, at_second) > at_end ? (at_first < at_second ? second : first) : length;
}

}  // namespace limber::internal
