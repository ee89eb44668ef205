/// @file limber/model/tet_element.h
/// The linear tetrahedron of elasticity, which bakes and ready bodies share: gradients of its shape functions, and the
/// 3 × 3 blocks of its stiffness.
///
///   K_ab = V (λ g_a g_bᵀ + μ g_b g_aᵀ + μ (g_a·g_b) I)
///
/// O. C. Zienkiewicz, R. L. Taylor, J. Z. Zhu: The Finite Element Method, 6th edition, 2005.
#pragma once

#include <array>

#include "limber/core/types.h"
#include "limber/model/material.h"

namespace limber {

/// Ingredients of a tet's blocks: gradients of its barycentric coordinates, which are constant.
struct TetElement {
  std::array<Vec3, 4> gradient;  ///< 1/m, summing to zero
  double lambda_volume = 0.0;    ///< λV, N·m
  double mu_volume = 0.0;        ///< μV, N·m
};

/// @param x its corners, right-handed
inline TetElement make_tet_element(const std::array<Vec3, 4>& x, const Material& material) {
  const Vec3 e1 = x[1] - x[0], e2 = x[2] - x[0], e3 = x[3] - x[0];
  const double six_volumes = e1.cross(e2).dot(e3);
  TetElement e;
  e.gradient[1] = e2.cross(e3) / six_volumes;
  e.gradient[2] = e3.cross(e1) / six_volumes;
  e.gradient[3] = e1.cross(e2) / six_volumes;
  e.gradient[0] = -(e.gradient[1] + e.gradient[2] + e.gradient[3]);
  e.lambda_volume = material.lame_lambda() * six_volumes / 6.0;
  e.mu_volume = material.shear_modulus() * six_volumes / 6.0;
  return e;
}

/// K_ab of two gradients, N/m. Each product has the same factors in K_ba, so K_baᵀ = K_ab to the bit.
inline Mat3 stiffness_block(const TetElement& e, const Vec3& ga, const Vec3& gb) {
  const double isotropic = e.mu_volume * (ga[0] * gb[0] + ga[1] * gb[1] + ga[2] * gb[2]);
  Mat3 block;
  for (int p = 0; p < 3; ++p)
    for (int q = 0; q < 3; ++q)
      block(p, q) = (e.lambda_volume * (ga[p] * gb[q]) + e.mu_volume * (gb[p] * ga[q])) + (p == q ? isotropic : 0.0);
  return block;
}

}  // namespace limber
