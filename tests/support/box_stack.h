/// @file box_stack.h
/// How far the boxes of a stack come down under their own weight, by the finite elements of all of them at once: faces
/// press on each other in the mean over what they share, by the shape functions of the upper one (a mortar method,
/// Belgacem, Hild and Laborde, Math. Comput. Modelling 28(4–8), 1998). Nothing pulls; what touches slides freely or
/// sticks. No mode, no contact point and no solver of the library takes part.
#pragma once

#include <Eigen/SparseLU>
#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include "constants.h"
#include "dense_fem.h"
#include "tet_box.h"

namespace limber::testing {

struct BoxStack {
  Vec3 size{0.4, 0.3, 0.2};
  std::array<int, 3> cells{3, 2, 2};
  int boxes = 3;
  double turn = 0.05;   // of each box on the one below, rad
  double aside = 0.01;  // of every other box, along x and y, m
  Material material{.youngs_modulus = 5e6, .poisson_ratio = 0.4, .density = 1100.0};

  TetMesh mesh() const { return tet_box(cells[0], cells[1], cells[2], size); }
  double angle(int box) const { return turn * box; }
  /// The middle of a box's lower face.
  Vec3 foot(int box) const { return {aside * (box % 2), aside * (box % 2), box * size.z()}; }
};

class WholeStack {
 public:
  explicit WholeStack(const BoxStack& stack)
      : stack_(stack), mesh_(stack.mesh()), nodes_(static_cast<Index>(mesh_.nodes.size())) {
    add_stiffness();
    for (Index n = 0; n < nodes_; ++n)
      if (mesh_.nodes[static_cast<std::size_t>(n)].z() < 1e-9) rows_.push_back({{n, 1.0}});
    for (int box = 0; box + 1 < stack_.boxes; ++box) add_rows_between(box);
  }

  /// The centre of mass of each box, m. @param sticks whether what presses sticks, or slides without friction
  std::vector<double> sunk(bool sticks) const {
    std::vector<char> pressed(rows_.size(), 1);
    for (int round = 0; round < 50; ++round) {
      const Eigen::VectorXd u = solve(pressed, sticks);
      if (!press_anew(u, sticks, pressed)) return centres(u);
    }
    throw std::runtime_error("the rows that press are not found");
  }

 private:
  using Row = std::vector<std::pair<Index, double>>;  // of displacements, by node of the stack
  static constexpr double kYield = 1e-10;             // m/N, so that redundant rows share
  static constexpr double kSideways = 1.0;  // N/m at each node, where nothing else holds boxes in their places

  Index size() const { return 3 * nodes_ * stack_.boxes; }

  void add_stiffness() {
    mass_ = Eigen::VectorXd::Zero(nodes_);
    const auto material_of = [this](std::size_t) -> const Material& { return stack_.material; };
    for_each_element(mesh_, false, material_of, [&](const Tet& t, const auto& K, const auto& M) {
      for (int box = 0; box < stack_.boxes; ++box) {
        const Mat3 R = Eigen::AngleAxisd(stack_.angle(box), Vec3::UnitZ()).toRotationMatrix();
        for (int i = 0; i < 4; ++i)
          for (int j = 0; j < 4; ++j)
            add_block(box * nodes_ + t[i], box * nodes_ + t[j],
                      R * K.template block<3, 3>(3 * i, 3 * j) * R.transpose());
      }
      for (int i = 0; i < 4; ++i) mass_[t[i]] += M.row(i).sum();
    });
  }
  void add_block(Index i, Index j, const Mat3& block) {
    for (int p = 0; p < 3; ++p)
      for (int q = 0; q < 3; ++q) stiffness_.emplace_back(3 * i + p, 3 * j + q, block(p, q));
  }

  /// The shape functions that are not zero at a point of the plane on a box's upper or lower face; false: beside it.
  bool face_at(int box, bool upper, double x, double y, std::array<std::pair<Index, double>, 3>& phi) const {
    const double c = std::cos(stack_.angle(box)), s = std::sin(stack_.angle(box));
    const double dx = x - stack_.foot(box).x(), dy = y - stack_.foot(box).y();
    const int nx = stack_.cells[0], ny = stack_.cells[1], layer = upper ? stack_.cells[2] : 0;
    const double u = nx * ((c * dx + s * dy) / stack_.size.x() + 0.5),
                 v = ny * ((c * dy - s * dx) / stack_.size.y() + 0.5);
    if (u < 0.0 || v < 0.0 || u > nx || v > ny) return false;
    const int i = std::min(static_cast<int>(u), nx - 1), j = std::min(static_cast<int>(v), ny - 1);
    const double p = u - i, q = v - j;
    const auto node = [&](int a, int b) { return a + (nx + 1) * (b + (ny + 1) * layer); };
    phi = {{{node(i, j), 1.0 - std::max(p, q)},
            {node(i + 1, j + 1), std::min(p, q)},
            {p > q ? node(i + 1, j) : node(i, j + 1), std::abs(p - q)}}};
    return true;
  }

  /// Of a box and the one upon it, by even samples of the plane.
  void add_rows_between(int lower) {
    constexpr int kSamples = 400;
    const Index first = lower * nodes_, second = first + nodes_;
    std::vector<Eigen::VectorXd> means(static_cast<std::size_t>(nodes_));
    std::vector<double> weights(static_cast<std::size_t>(nodes_), 0.0);
    const double side = 1.5 * std::max(stack_.size.x(), stack_.size.y());
    std::array<std::pair<Index, double>, 3> below, above;
    for (int a = 0; a < kSamples; ++a)
      for (int b = 0; b < kSamples; ++b) {
        const double x = side * ((a + 0.5) / kSamples - 0.5), y = side * ((b + 0.5) / kSamples - 0.5);
        if (!face_at(lower, true, x, y, below) || !face_at(lower + 1, false, x, y, above)) continue;
        for (const auto& [n, w] : above) {
          Eigen::VectorXd& mean = means[static_cast<std::size_t>(n)];
          if (mean.size() == 0) mean = Eigen::VectorXd::Zero(2 * nodes_);
          for (const auto& [m, v] : above) mean[nodes_ + m] += w * v;
          for (const auto& [m, v] : below) mean[m] -= w * v;
          weights[static_cast<std::size_t>(n)] += w;
        }
      }
    for (std::size_t n = 0; n < means.size(); ++n) {
      if (!(weights[n] > 1.0)) continue;  // less than one sample of the plane
      Row row;
      for (Index m = 0; m < 2 * nodes_; ++m)
        if (means[n][m] != 0.0)
          row.emplace_back(m < nodes_ ? first + m : second + m - nodes_, means[n][m] / weights[n]);
      rows_.push_back(row);
    }
  }

  /// [K Jᵀ; J −yield] [u; −f] = [weight; 0] of the rows that press.
  Eigen::VectorXd solve(const std::vector<char>& pressed, bool sticks) const {
    std::vector<Eigen::Triplet<double>> system = stiffness_;
    for (Index i = 0; i < nodes_ * stack_.boxes && !sticks; ++i)
      for (int axis = 0; axis < 2; ++axis) system.emplace_back(3 * i + axis, 3 * i + axis, kSideways);
    Index next = size();
    for (std::size_t r = 0; r < rows_.size(); ++r)
      for (int axis = 2; axis >= (sticks ? 0 : 2) && pressed[r] != 0; --axis, ++next) {
        for (const auto& [n, w] : rows_[r]) {
          system.emplace_back(next, 3 * n + axis, w);
          system.emplace_back(3 * n + axis, next, w);
        }
        system.emplace_back(next, next, -kYield);
      }
    Eigen::SparseMatrix<double> matrix(next, next);
    matrix.setFromTriplets(system.begin(), system.end());
    Eigen::VectorXd load = Eigen::VectorXd::Zero(next);
    for (Index i = 0; i < nodes_ * stack_.boxes; ++i) load[3 * i + 2] = -kGravity * mass_[i % nodes_];
    return Eigen::SparseLU<Eigen::SparseMatrix<double>>(matrix).solve(load);
  }

  /// Rows that pull let go, those that overlap press. @return whether any has changed
  bool press_anew(const Eigen::VectorXd& u, bool sticks, std::vector<char>& pressed) const {
    bool changed = false;
    Index next = size();
    for (std::size_t r = 0; r < rows_.size(); ++r) {
      const char was = pressed[r];
      double gap = 0.0;
      for (const auto& [n, w] : rows_[r]) gap += w * u[3 * n + 2];
      pressed[r] = (was != 0 ? u[next] < 1e-9 : gap < -1e-12) ? 1 : 0;
      next += was == 0 ? 0 : sticks ? 3 : 1;
      changed = changed || was != pressed[r];
    }
    return changed;
  }

  std::vector<double> centres(const Eigen::VectorXd& u) const {
    std::vector<double> sunk;
    for (int box = 0; box < stack_.boxes; ++box) {
      double sum = 0.0;
      for (Index n = 0; n < nodes_; ++n) sum -= mass_[n] * u[3 * (box * nodes_ + n) + 2];
      sunk.push_back(sum / mass_.sum());
    }
    return sunk;
  }

  BoxStack stack_;
  TetMesh mesh_;
  Index nodes_;
  Eigen::VectorXd mass_;  // by node, along any axis
  std::vector<Eigen::Triplet<double>> stiffness_;
  std::vector<Row> rows_;
};

}  // namespace limber::testing
