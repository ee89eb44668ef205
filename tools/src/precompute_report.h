/// @file precompute_report.h
/// The report of limber-precompute: figures of the whole input, and the same per body (docs/formats/reports.md).
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "limber/precompute/bake.h"

namespace limber::tools {

/// Adds nodes, tets, components, mass, volume, center_of_mass, inertia, zero_modes, frequencies_hz, kept, discarded,
/// residual_max, orthogonality_max, … and bodies[] to a report.
///
/// For several bodies, frequencies_hz is the merged ascending list up to the frequency below which it is complete: the
/// lowest of the bodies' last computed ones. `kept` and `discarded` index into that list.
void add_bake(nlohmann::ordered_json& report, const std::vector<BodyReport>& bodies);

/// Seconds per stage of the bake, summed over bodies.
void add_bake_seconds(nlohmann::ordered_json& seconds, const std::vector<BodyReport>& bodies);

/// Of how many of the lowest elastic modes the summary tells the error, and --frequency-error bounds it.
inline constexpr int kModesTold = 10;

/// The largest estimated error of these frequencies, relative, without its sign.
double largest_frequency_error(const BodyReport& body);

/// Warns of bodies of linear elements whose lowest frequencies are estimated to be more than 5 % too high.
void warn_of_stiff_elements(const std::vector<BodyReport>& bodies, Warnings& warnings);

/// A few lines for people: what was baked and what was left out.
std::string bake_summary(const std::vector<BodyReport>& bodies);

}  // namespace limber::tools
