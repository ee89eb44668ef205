// A plane between two bodies and all that they pass through within a step.
#pragma once

#include "field/field_pair.h"

namespace limber::internal {

/// Looks for a direction along which two bodies stay apart on their straight ways (Gilbert, SIAM J. Control 4(1), 1966;
/// the triangle with the last two vertices in place of a segment), and leaves the planes of the best one in the views.
/// @param a_in_b, b_in_a of the same pair @param reach m: farther apart is far enough
/// @param parting in: where to look first. Out: the best direction, and the gap there. Or null
/// @return whether they are
bool part(FieldView& a_in_b, FieldView& b_in_a, float reach, Parting* parting);

}  // namespace limber::internal
