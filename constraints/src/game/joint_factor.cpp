#include "joint_factor.h"

#include <algorithm>
#include <cmath>

#include "../tuning.h"

namespace limber::internal {
namespace {

constexpr double kRegular = kConstraintsTuning.small_steps.regular;

/// Three, the rows of a ball joint, or as many as are given: kernels below come for both.
template <int fixed>
constexpr int size_of(int given) {
  return fixed > 0 ? fixed : given;
}

/// L and 1/D of the lower part of a = L D Lᵀ, n × n, in its place; L's own diagonal is 1. @param own each row's own
/// response, of which others that say the same leave no more than round-off, of either sign
template <int fixed>
void factor_dense(double* a, int given, const double* own) {
  const int n = size_of<fixed>(given);
  for (int i = 0; i < n; ++i) {
    double* row = a + i * n;
    for (int j = 1; j < i; ++j)
      for (int k = 0; k < j; ++k) row[j] -= row[k] * a[j * n + k];
    double pivot = row[i];
    for (int k = 0; k < i; ++k) {
      const double scaled = row[k] * a[k * n + k];
      pivot -= row[k] * scaled;
      row[k] = scaled;
    }
    row[i] = 1.0 / std::max(pivot, 1e-3 * kRegular * own[i]);
  }
}

/// t −= b D⁻¹ aᵀ, `rows` × `columns`, inner size n.
template <int fixed>
void subtract_product(const double* b, int rows, const double* a, int columns, const double* l, int given, double* t) {
  const int n = size_of<fixed>(given), count = size_of<fixed>(columns);
  for (int j = 0; j < count; ++j)
    for (int k = 0; k < n; ++k) {
      const double scaled = a[j * n + k] * l[k * n + k];
      for (int i = 0; i < size_of<fixed>(rows); ++i) t[i * count + j] -= b[i * n + k] * scaled;
    }
}

template <std::size_t columns>
using Sides = std::array<double, columns>;  // one row of right-hand sides

template <std::size_t columns>
void subtract(double by, const Sides<columns>& from, Sides<columns>& to) {
  for (std::size_t c = 0; c < columns; ++c) to[c] -= by * from[c];
}

/// x ← L⁻¹ x, n rows.
template <int fixed, std::size_t columns>
void solve_lower(const double* l, int given, Sides<columns>* x) {
  const int n = size_of<fixed>(given);
  for (int i = 1; i < n; ++i)
    for (int k = 0; k < i; ++k) subtract(l[i * n + k], x[k], x[i]);
}

/// x ← D⁻¹ x
template <int fixed, std::size_t columns>
void scale(const double* l, int given, Sides<columns>* x) {
  const int n = size_of<fixed>(given);
  for (int i = 0; i < n; ++i)
    for (double& number : x[i]) number *= l[i * n + i];
}

/// x ← L⁻ᵀ x
template <int fixed, std::size_t columns>
void solve_upper(const double* l, int given, Sides<columns>* x) {
  const int n = size_of<fixed>(given);
  for (int i = n; i-- > 0;)
    for (int k = i + 1; k < n; ++k) subtract(l[k * n + i], x[k], x[i]);
}

/// y −= b x, b `rows` × n
template <int fixed, std::size_t columns>
void subtract_times(const double* b, int rows, int given, const Sides<columns>* x, Sides<columns>* y) {
  const int n = size_of<fixed>(given);
  for (int i = 0; i < size_of<fixed>(rows); ++i) {
    Sides<columns> sum = y[i];
    for (int k = 0; k < n; ++k) subtract(b[i * n + k], x[k], sum);
    y[i] = sum;
  }
}

/// x −= bᵀ y
template <int fixed, std::size_t columns>
void subtract_transposed(const double* b, int rows, int given, const Sides<columns>* y, Sides<columns>* x) {
  const int n = size_of<fixed>(given);
  for (int i = 0; i < size_of<fixed>(rows); ++i)
    for (int k = 0; k < n; ++k) subtract(b[i * n + k], y[i], x[k]);
}

}  // namespace

void JointFactor::set_graph(std::size_t nodes, std::span<const Pair> couplings) {
  if (nodes == nodes_ && std::ranges::equal(couplings, graph_)) return;
  nodes_ = nodes;
  graph_.assign(couplings.begin(), couplings.end());
  order();
}

/// Least degree, what has it longest first: eliminations that follow each other then seldom wait for each other, as a
/// chain goes from both ends. What the graph of the others becomes is kept as it is.
void JointFactor::order() {
  sizes_.clear();
  std::vector<std::vector<std::int32_t>> neighbours(nodes_), columns(nodes_);
  for (const auto& [a, b] : graph_) {
    neighbours[static_cast<std::size_t>(a)].push_back(b);
    neighbours[static_cast<std::size_t>(b)].push_back(a);
  }
  using Entry = std::array<std::int32_t, 3>;  // degree, turn, node
  std::int32_t turn = 0;
  std::vector<Entry> heap;
  const auto later = [](const Entry& a, const Entry& b) { return a > b; };
  const auto push = [&](std::int32_t node) {
    heap.push_back({static_cast<std::int32_t>(neighbours[static_cast<std::size_t>(node)].size()), turn++, node});
    std::push_heap(heap.begin(), heap.end(), later);
  };
  for (std::size_t i = 0; i < nodes_; ++i) {
    std::ranges::sort(neighbours[i]);
    push(static_cast<std::int32_t>(i));
  }
  pattern_.position.assign(nodes_, -1);
  pattern_.node_at.clear();
  std::vector<std::int32_t> merged;
  while (pattern_.node_at.size() < nodes_) {
    std::pop_heap(heap.begin(), heap.end(), later);
    const std::int32_t degree = heap.back()[0], node = heap.back()[2];
    heap.pop_back();
    const auto at = static_cast<std::size_t>(node);
    if (pattern_.position[at] >= 0 || degree != static_cast<std::int32_t>(neighbours[at].size())) continue;
    pattern_.position[at] = static_cast<std::int32_t>(pattern_.node_at.size());
    columns[pattern_.node_at.size()] = neighbours[at];
    pattern_.node_at.push_back(node);
    const bool joins = neighbours[at].size() <= kConstraintsTuning.small_steps.most_joined;
    for (const std::int32_t other : neighbours[at]) {
      std::vector<std::int32_t>& theirs = neighbours[static_cast<std::size_t>(other)];
      merged.clear();
      if (joins)
        std::set_union(theirs.begin(), theirs.end(), neighbours[at].begin(), neighbours[at].end(),
                       std::back_inserter(merged));
      else
        merged = theirs;
      std::erase_if(merged, [&](std::int32_t n) { return n == other || n == node; });
      theirs = merged;
      push(other);
    }
  }
  pattern_.column_starts.assign(1, 0);
  pattern_.rows.clear();
  for (std::vector<std::int32_t>& column : columns) {
    for (std::int32_t& node : column) node = pattern_.position[static_cast<std::size_t>(node)];
    std::ranges::sort(column);
    pattern_.rows.insert(pattern_.rows.end(), column.begin(), column.end());
    pattern_.column_starts.push_back(pattern_.rows.size());
  }
  pattern_.places.clear();
  for (const auto& [a, b] : graph_) {
    const std::int32_t p = pattern_.position[static_cast<std::size_t>(a)],
                       q = pattern_.position[static_cast<std::size_t>(b)];
    pattern_.places.push_back(find(std::max(p, q), std::min(p, q)));
  }
  pattern_.target_starts.clear(), pattern_.targets.clear();
  for (const std::vector<std::int32_t>& column : columns) {
    pattern_.target_starts.push_back(static_cast<std::int32_t>(pattern_.targets.size()));
    for (std::size_t a = 0; a < column.size(); ++a)
      for (std::size_t b = a; b < column.size(); ++b) pattern_.targets.push_back(find(column[b], column[a]));
  }
  pattern_.complete = std::ranges::find(pattern_.targets, -1) == pattern_.targets.end();
}

/// The number of a block of L; −1: there is none.
std::int32_t JointFactor::find(std::int32_t row, std::int32_t column) const {
  if (row == column) return row;
  const auto begin = pattern_.rows.begin() + pattern_.column_starts[static_cast<std::size_t>(column)],
             end = pattern_.rows.begin() + pattern_.column_starts[static_cast<std::size_t>(column) + 1];
  const auto found = std::lower_bound(begin, end, row);
  if (found == end || *found != row) return -1;
  return static_cast<std::int32_t>(nodes_) + static_cast<std::int32_t>(found - pattern_.rows.begin());
}

std::int32_t JointFactor::rows_of(std::size_t coupling) const {
  const auto [a, b] = graph_[coupling];
  return pattern_.position[static_cast<std::size_t>(a)] > pattern_.position[static_cast<std::size_t>(b)] ? a : b;
}

void JointFactor::begin(std::span<const std::int32_t> sizes) {
  if (!has_sizes(sizes)) lay_out(sizes);
  std::ranges::fill(values_, 0.0);
}

bool JointFactor::has_sizes(std::span<const std::int32_t> sizes) const {
  if (sizes_.size() != nodes_) return false;
  for (std::size_t p = 0; p < nodes_; ++p)
    if (sizes_[p] != sizes[static_cast<std::size_t>(pattern_.node_at[p])]) return false;
  return true;
}

void JointFactor::lay_out(std::span<const std::int32_t> sizes) {
  sizes_.resize(nodes_), firsts_.resize(nodes_), starts_.resize(nodes_ + pattern_.rows.size());
  std::size_t numbers = 0;
  size_ = 0;
  for (std::size_t p = 0; p < nodes_; ++p) {
    sizes_[p] = sizes[static_cast<std::size_t>(pattern_.node_at[p])];
    const auto n = static_cast<std::size_t>(sizes_[p]);
    firsts_[p] = size_;
    size_ += n;
    starts_[p] = numbers;
    numbers += n * n;
  }
  for (std::size_t p = 0; p < nodes_; ++p)
    for (std::size_t e = pattern_.column_starts[p]; e < pattern_.column_starts[p + 1]; ++e) {
      starts_[nodes_ + e] = numbers;
      numbers += static_cast<std::size_t>(sizes_[p] * sizes_[static_cast<std::size_t>(pattern_.rows[e])]);
    }
  values_.resize(numbers);
}

void JointFactor::factor() {
  own_.resize(size_);
  for (std::size_t p = 0; p < nodes_; ++p) {
    double* d = values_.data() + starts_[p];
    for (int i = 0; i < sizes_[p]; ++i)
      own_[firsts_[p] + static_cast<std::size_t>(i)] = d[i * sizes_[p] + i] *= 1.0 + kRegular;
  }
  for (std::size_t p = 0; p < nodes_; ++p) eliminate(p);
}

void JointFactor::eliminate(std::size_t column) {
  const int n = sizes_[column];
  if (n == 0) return;
  double* l = &values_[starts_[column]];
  const bool ball = n == 3;
  (ball ? factor_dense<3> : factor_dense<0>)(l, n, &own_[firsts_[column]]);
  const std::size_t begin = pattern_.column_starts[column], end = pattern_.column_starts[column + 1];
  auto target = static_cast<std::size_t>(pattern_.target_starts[column]);
  int below = 0;  // rows, which follow each other: A L⁻ᵀ, and in the end A L⁻ᵀ D⁻¹
  for (std::size_t e = begin; e < end; ++e) below += sizes_[static_cast<std::size_t>(pattern_.rows[e])];
  auto* const rows_below = below > 0 ? reinterpret_cast<Sides<1>*>(&values_[starts_[nodes_ + begin]]) : nullptr;
  for (int i = 0; i < below; ++i) (ball ? solve_lower<3, 1> : solve_lower<0, 1>)(l, n, rows_below + i * n);
  for (std::size_t a = begin; a < end; ++a)
    for (std::size_t b = a; b < end; ++b) {
      const std::int32_t to = pattern_.targets[target++];
      if (to < 0) {
        leave_out(column, a, b);
        continue;
      }
      const int rows = sizes_[static_cast<std::size_t>(pattern_.rows[b])],
                columns = sizes_[static_cast<std::size_t>(pattern_.rows[a])];
      (ball && rows == 3 && columns == 3 ? subtract_product<3>
                                         : subtract_product<0>)(&values_[starts_[nodes_ + b]], rows,
                                                                &values_[starts_[nodes_ + a]], columns, l, n,
                                                                &values_[starts_[static_cast<std::size_t>(to)]]);
    }
  for (int i = 0; i < below; ++i) (ball ? scale<3, 1> : scale<0, 1>)(l, n, rows_below + i * n);
}

/// The product of two blocks of a column: its size goes to both diagonals.
void JointFactor::leave_out(std::size_t column, std::size_t a, std::size_t b) {
  const int n = sizes_[column];
  const double* l = &values_[starts_[column]];
  const auto row_a = static_cast<std::size_t>(pattern_.rows[a]), row_b = static_cast<std::size_t>(pattern_.rows[b]);
  double square = 0.0;
  for (int i = 0; i < sizes_[row_b]; ++i)
    for (int j = 0; j < sizes_[row_a]; ++j) {
      double sum = 0.0;
      for (int k = 0; k < n; ++k)
        sum += values_[starts_[nodes_ + b] + static_cast<std::size_t>(i * n + k)] * l[k * n + k] *
               values_[starts_[nodes_ + a] + static_cast<std::size_t>(j * n + k)];
      square += sum * sum;
    }
  const double size = std::sqrt(square);
  for (const std::size_t row : {row_a, row_b})
    for (int i = 0; i < sizes_[row]; ++i) values_[starts_[row] + static_cast<std::size_t>(i * sizes_[row] + i)] += size;
}

template <std::size_t columns>
void JointFactor::solve(std::span<double> x) const {
  const auto sides_at = [&](std::size_t position) {
    return reinterpret_cast<Sides<columns>*>(x.data() + firsts_[position] * columns);
  };
  for (std::size_t p = 0; p < nodes_; ++p) {
    const int n = sizes_[p];
    const bool ball = n == 3;
    (ball ? solve_lower<3, columns> : solve_lower<0, columns>)(values_.data() + starts_[p], n, sides_at(p));
    for (std::size_t e = pattern_.column_starts[p]; e < pattern_.column_starts[p + 1]; ++e) {
      const auto row = static_cast<std::size_t>(pattern_.rows[e]);
      const int rows = sizes_[row];
      (ball && rows == 3
           ? subtract_times<3, columns>
           : subtract_times<0, columns>)(values_.data() + starts_[nodes_ + e], rows, n, sides_at(p), sides_at(row));
    }
  }
  for (std::size_t p = nodes_; p-- > 0;) {
    const int n = sizes_[p];
    const bool ball = n == 3;
    (ball ? scale<3, columns> : scale<0, columns>)(values_.data() + starts_[p], n, sides_at(p));
    for (std::size_t e = pattern_.column_starts[p]; e < pattern_.column_starts[p + 1]; ++e) {
      const auto row = static_cast<std::size_t>(pattern_.rows[e]);
      const int rows = sizes_[row];
      (ball && rows == 3 ? subtract_transposed<3, columns>
                         : subtract_transposed<0, columns>)(values_.data() + starts_[nodes_ + e], rows, n,
                                                            sides_at(row), sides_at(p));
    }
    (ball ? solve_upper<3, columns> : solve_upper<0, columns>)(values_.data() + starts_[p], n, sides_at(p));
  }
}

template void JointFactor::solve<1>(std::span<double>) const;
template void JointFactor::solve<3>(std::span<double>) const;

}  // namespace limber::internal
