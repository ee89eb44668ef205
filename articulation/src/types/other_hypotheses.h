/// @file other_hypotheses.h
/// Hypotheses that a contact bears out as well as the first one, since geometry does not tell them apart. Private to
/// the articulation module.
#pragma once

#include <vector>

#include "limber/articulation/slippage.h"

namespace limber::internal {

/// Takes a share of the first hypothesis' confidence, for another one that does not overtake it.
/// @return the confidence taken
double share_of_first(double share, Slippage& out);

/// Puts a hypothesis in the place of those of its type, behind the first.
void replace_hypothesis(JointHypothesis hypothesis, Slippage& out);

/// Flanges that meet face to face slide as far as geometry knows, but where the face is round a bearing that is not
/// drawn may turn about its middle: four of KUKA's robots are drawn that way. A puck on a table looks the same, so the
/// turn stays the second hypothesis.
void add_hypothesis_of_flange(const std::vector<ContactRegion>& regions, Slippage& out);

/// A turn about a line along a flat contact's normal about which surfaces of both parts near it turn into themselves:
/// the outlines of flanges, housings and covers tell an axis that the contact does not.
/// @param point of the line
void add_hypothesis_of_line(const Vec3& point, Slippage& out);

/// Puts the turn of a flat contact first and the slide second, where the whole mechanism rules the slide out.
void prefer_turn(Slippage& out);

}  // namespace limber::internal
