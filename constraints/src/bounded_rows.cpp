#include "bounded_rows.h"

#include <Eigen/Core>
#include <algorithm>

namespace limber {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

}  // namespace

SolveStatus BoundedRowSolver::solve(const BoundedRows& rows, std::span<double> f) {
  return rows.cones == 0 ? solve_boxes(rows, f) : solve_in_turn(rows, f);
}

SolveStatus BoundedRowSolver::solve_boxes(const BoundedRows& rows, std::span<double> f) {
  return qp_
      .solve(
          ContactQp{
              .size = static_cast<int>(f.size()), .A = rows.A, .b = rows.b, .lower = rows.lower, .upper = rows.upper},
          f)
      .status;
}

/// Contacts and rows with fixed bounds are solved for in turn, each exactly, until neither changes the other.
SolveStatus BoundedRowSolver::solve_in_turn(const BoundedRows& rows, std::span<double> f) {
  constexpr int kRounds = 50, kSweeps = 60;
  constexpr double kSettled = 1e-12;  // of the largest impulse
  const auto n = static_cast<Eigen::Index>(f.size()), c = static_cast<Eigen::Index>(3 * rows.cones), r = n - c;
  const auto cone_rows = static_cast<std::size_t>(c), box_rows = static_cast<std::size_t>(r);
  for (std::vector<double>* v : {&b_cones_, &last_}) v->resize(cone_rows);
  A_cones_.resize(cone_rows * cone_rows), A_boxes_.resize(box_rows * box_rows), b_boxes_.resize(box_rows);
  const Eigen::Map<const RowMajor> A(rows.A.data(), n, n);
  const Eigen::Map<const Eigen::VectorXd> b(rows.b.data(), n);
  Eigen::Map<Eigen::VectorXd> F(f.data(), n), b_c(b_cones_.data(), c), b_r(b_boxes_.data(), r), last(last_.data(), c);
  Eigen::Map<RowMajor>(A_cones_.data(), c, c) = A.topLeftCorner(c, c);
  Eigen::Map<RowMajor>(A_boxes_.data(), r, r) = A.bottomRightCorner(r, r);
  SolveStatus status = SolveStatus::kSolved;
  for (int round = 0; round < kRounds; ++round) {
    if (r > 0) {
      b_r = b.tail(r);
      b_r.noalias() += A.bottomLeftCorner(r, c) * F.head(c);
      qp_.solve(ContactQp{.size = static_cast<int>(r),
                          .A = A_boxes_,
                          .b = b_boxes_,
                          .lower = rows.lower.subspan(cone_rows),
                          .upper = rows.upper.subspan(cone_rows)},
                f.subspan(cone_rows));
    }
    b_c = b.head(c);
    b_c.noalias() += A.topRightCorner(c, r) * F.tail(r);
    last = F.head(c);
    status = friction_
                 .solve(FrictionProblem{.contacts = rows.cones, .A = A_cones_, .b = b_cones_, .mu = rows.friction},
                        f.first(cone_rows), {.max_sweeps = kSweeps})
                 .status;
    if (r == 0 || (last - F.head(c)).lpNorm<Eigen::Infinity>() <= kSettled * F.lpNorm<Eigen::Infinity>()) break;
  }
  return status;
}

}  // namespace limber
