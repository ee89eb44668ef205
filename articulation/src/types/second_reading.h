/// @file second_reading.h
/// Readings of a contact beside the first: what geometry does not tell apart. Private to the articulation module.
#pragma once

#include <vector>

#include "limber/articulation/slippage.h"

namespace limber {

/// Takes a share of the first reading's confidence, for another one that does not overtake it.
/// @return what was taken
double share_of_first(double share, Slippage& out);

/// Puts a reading in the place of those of its type, behind the first.
void replace_reading(JointHypothesis reading, Slippage& out);

/// Flanges that meet face to face slide as far as geometry knows, but where the face is round a bearing that is not
/// drawn may turn about its middle: four of KUKA's robots are drawn that way. A puck on a table looks the same, so the
/// turn stays a second reading.
void add_reading_of_flange(const std::vector<ContactRegion>& regions, Slippage& out);

}  // namespace limber
