// A = G Gᵀ + D of an island with many bodies: G in blocks, one for each body that a contact touches, D diagonal, what
// rows yield by themselves; A never formed.
//
// Newton's steps are taken in the smaller and sparser space of the bodies' degrees of freedom x = Gᵀy. With a diagonal
// of small blocks K and N, (K + N G Gᵀ) dy = −d has
//
//   (1 + Gᵀ K⁻¹N G) dx = −Gᵀ K⁻¹ d,    dy = −K⁻¹ (d + N G dx),                                                   (1)
//
// and the matrix in (1) has a block off its diagonal only where two bodies touch (BlockFactor).
#pragma once

#include <algorithm>
#include <vector>

#include "block_factor.h"
#include "row_coupling.h"

namespace limber {

class SparseCoupling final : public RowCoupling {
 public:
  // Built in this order: nodes, units with their sides, end_structure(), then the values of all sides.
  void begin_structure();
  /// Degrees of freedom that belong together: those of a body. @return its number
  std::size_t add_node(std::size_t width);
  /// The next one or three rows.
  void add_unit(std::size_t rows);
  /// What the last unit's rows see of a node. @return the side's number
  std::size_t add_side(std::size_t node);
  /// Finds the order of elimination; all values are zero. Memory grows to the largest problem seen.
  void end_structure();
  void clear_values() {
    std::fill_n(given_.data(), padded(numbers_), 0.0);
    std::fill(compliance_.begin(), compliance_.end(), 0.0);
  }
  /// Of a row by itself: its number of D, ≥ 0.
  double& compliance(std::size_t row) { return compliance_[row]; }
  /// Row by row: rows of its unit × the node's width.
  MatrixView values(std::size_t side) {
    return {given_.data() + sides_[side].offset, padded(widths_[sides_[side].node])};
  }

  std::size_t rows() const override { return rows_; }
  std::size_t width(std::size_t node) const { return widths_[node]; }
  Mat3 own_block(std::size_t first, std::size_t count) const override;
  /// No numbers: A as it was given.
  void scale(std::span<const double> s) override;
  void multiply(double* out, const double* x) override;
  bool convex_step(std::span<const ProjectionDerivative> P, double rho, const double* d, double* dy) override;
  bool map_step(std::span<const ProjectionDerivative> P, double rho, const double* d, double* dy) override;
  bool factor_shifted(double shift) override;
  void solve_shifted(double* x) override;
  void begin_sweeps(const double* f) override;
  Vec3 answer(std::size_t first, std::size_t count) const override;
  void move(std::size_t first, std::size_t count, const Vec3& change) override;

 private:
  struct Unit {
    std::size_t first = 0, rows = 0, first_side = 0, sides = 0, first_place = 0;
  };
  struct Side {
    std::size_t node = 0, offset = 0;
  };
  /// Where the product of two sides goes; a is eliminated first.
  struct Place {
    std::size_t a = 0, b = 0;
    BlockFactor::Block block{};
  };

  MatrixView used(std::size_t side) const;
  void add_to_motion(const Unit& unit, const double* rows, double* x) const;
  Vec3 seen(const Unit& unit, const double* x) const;
  void gather(const double* rows, double* x) const;
  void add_product(const Unit& unit, const Mat3& N, bool symmetric);
  Mat3 own_compliance(const Unit& unit) const;
  bool factor_with(std::span<const ProjectionDerivative> P, bool symmetric);
  void step_of_rows(std::span<const ProjectionDerivative> P, const double* d, double* dy);

  std::size_t rows_ = 0, numbers_ = 0;
  std::vector<std::size_t> widths_, unit_of_;
  std::vector<Unit> units_;
  std::vector<Side> sides_;
  std::vector<RowBlock> blocks_;  // of the sides, with their places in vectors of motion
  std::vector<Place> places_;
  std::vector<Mat3> left_, right_;  // by unit, K⁻¹ and K⁻¹N of (1)
  std::vector<double> compliance_, scaled_compliance_, share_, swept_;
  BlockFactor factor_;
  double shift_ = 1.0;
  const double* used_ = nullptr;  // given_ or scaled_
  AlignedBuffer given_, scaled_, product_, motion_, step_, rows_memory_;
};

}  // namespace limber
