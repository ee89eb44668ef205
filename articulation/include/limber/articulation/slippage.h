/// @file limber/articulation/slippage.h
/// Which rigid motions a contact allows: those along which the surfaces slide on themselves.
///
/// A motion ξ = (ω, v) moves a point p with the velocity ω × p + v, whose normal part is c·ξ with c = (p × n, n).
/// With areas A_i
///
///   C = Σ A_i c_i c_iᵀ,   M = Σ A_i G_iᵀ G_i,   G_i ξ = ω × p_i + v,   C ξ = μ M ξ                       (1)
///
/// μ in [0, 1] is the mean squared normal velocity per mean squared velocity: 0 for a motion that slips. It depends on
/// no centre, basis or unit of length, unlike the eigenvalues of C alone, which [X09] compares with a fixed ratio g.
///
/// Each type of joint is a hypothesis: its family of motions is fitted to the contact and is as likely as all its
/// motions slip, P(μ) = 1/(1 + (μ/τ)²) with τ = threshold + spread of the normals, and all others do not. The shares of
/// all hypotheses are their confidences. If two joints touch alike (a stop or the end of a hole, a flange or a
/// puck) the second is added with a share that does not overtake the first.
///
/// Sources: Gelfand and Guibas, "Shape segmentation using local slippage analysis", 2004; [X09] 3.2 and Table 1.
/// Derivation: docs/derivations/slippage.md.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "limber/articulation/contact_region.h"
#include "limber/model/joint_spec.h"

namespace limber {

enum class SlippageMethod {
  kGeneralised,  ///< (1), and a test of each of Table 1's families of motions
  kFixedRatio,   ///< [X09]: eigenvalues of C about the centroid, scaled to mean radius 1; λ₆/λ_j > g slips
};

struct SlippageOptions {
  SlippageMethod method = SlippageMethod::kGeneralised;
  double threshold = 2e-3;  ///< largest μ of a motion that slips, besides what the normals' spread explains; 0 … 1
  double ratio = 150.0;     ///< kFixedRatio: g; > 1
  void validate() const;    ///< @throws InvalidArgument naming the field
};

/// One type of joint that a contact may be.
struct JointHypothesis {
  JointSpec joint;          ///< limits open
  double slippage = 0.0;    ///< largest μ over the freedoms that the type leaves; small: it slips
  double confidence = 0.0;  ///< 0 … 1; those of all hypotheses of a contact add up to at most 1
  std::string reason;       ///< one sentence
};

struct Slippage {
  std::array<double, 6> mu{};               ///< eigenvalues of (1), ascending (kFixedRatio: λ_j/λ₆)
  double threshold = 0.0;                   ///< that was used, spread included
  std::vector<JointHypothesis> hypotheses;  ///< best first, at least one
};

/// @param regions one or more contacts of the same two components, taken together
/// @throws InvalidArgument if there is no sample at all
Slippage analyse_slippage(const std::vector<ContactRegion>& regions, const SlippageOptions& options = {});

}  // namespace limber
