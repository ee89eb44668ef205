/// @file limber/model/residual_compliance.h
/// Static response of the modes that are not kept, at the collision surface.
///
///   G_res = S (K⁺ − Σ_kept w wᵀ/λ) Sᵀ        3V × 3V, m/N, symmetric, positive semidefinite
///
/// S takes displacements of the nodes to the V vertices of the collision surface, K⁺ is the elastic flexibility of the
/// body that is free to float (inertia relief: K⁺ = P K_pin⁻¹ Pᵀ, P = 1 − R Rᵀ M). A force f at vertex b moves vertex a
/// by G_ab f beyond what the kept modes show; without it a point contact on a body of 40 modes is two to four times
/// too stiff. Stored in full where that is small enough, else the blocks of single vertices alone: each contact is then
/// as soft as it is, and what contacts give each other comes from the kept modes only.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

#include "limber/core/types.h"

namespace limber {

class ResidualCompliance {
 public:
  enum class Form {
    kFull,   ///< all pairs of vertices: 18 V² bytes
    kLocal,  ///< single vertices: 36 V bytes
  };

  ResidualCompliance() = default;
  /// All zero, to be filled through set().
  ResidualCompliance(Form form, Index vertices);

  Form form() const { return form_; }
  Index vertices() const { return vertices_; }

  /// G_ab, body axes, m/N: zero for a ≠ b in the local form. @pre both are vertices
  Mat3 block(Index a, Index b) const;
  /// Sets G_ab and with it G_ba; the local form keeps only a = b.
  void set(Index a, Index b, const Mat3& G);

  /// All numbers, 9 per block, column after column: of the pairs (a, b), a ≥ b, in the order (0,0) (1,0) (1,1) (2,0) …,
  /// or of the single vertices.
  std::span<const float> values() const { return values_; }
  std::span<float> values() { return values_; }
  static std::size_t value_count(Form form, Index vertices);

 private:
  std::size_t place(Index a, Index b) const;

  Form form_ = Form::kLocal;
  Index vertices_ = 0;
  std::vector<float> values_;
};

/// "full" or "local": its name in files and reports.
std::string_view to_string(ResidualCompliance::Form form);

}  // namespace limber
