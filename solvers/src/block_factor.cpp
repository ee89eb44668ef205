#include "limber/solvers/block_factor.h"

#include <algorithm>
#include <cmath>

#include "dense_kernels.h"

namespace limber::internal {

void BlockFactor::end_pattern() {
  order_.find();
  place_columns();
  runs_.clear();
  for (const Column& column : columns_)
    for (std::size_t e = 0; e < column.entries; ++e) find_runs(column, column.first_entry + e);
}

void BlockFactor::place_columns() {
  columns_.clear(), entries_.clear();
  numbers_ = widest_ = longest_ = 0;
  for (std::size_t place = 0; place < order_.size(); ++place)
    columns_.push_back({.node = order_.node(place), .width = order_.width(order_.node(place))});
  for (Column& column : columns_) {
    column.first_entry = entries_.size();
    order_.later(column.node, [&](std::size_t j) { entries_.push_back({.column = order_.place(j)}); });
    column.entries = entries_.size() - column.first_entry;
    const auto begin = entries_.begin() + static_cast<std::ptrdiff_t>(column.first_entry);
    std::sort(begin, entries_.end(), [](const Entry& a, const Entry& b) { return a.column < b.column; });
    column.stride = padded(column.width);
    for (auto entry = begin; entry != entries_.end(); ++entry) {
      entry->at = column.stride;
      column.stride += padded(columns_[entry->column].width);
    }
    column.offset = numbers_;
    numbers_ += column.width * column.stride;
    widest_ = std::max(widest_, column.width);
    longest_ = std::max(longest_, column.stride);
  }
  upper_.need(numbers_);
  first_.resize(order_.size());
  size_ = 0;
  for (const Column& column : columns_) {
    first_[column.node] = size_;
    size_ += padded(column.width);
  }
  blocks_.clear();
  for (const Column& column : columns_)
    for (std::size_t e = column.first_entry; e < column.first_entry + column.entries; ++e) {
      const Column& later = columns_[entries_[e].column];
      blocks_.push_back({.rows = column.width,
                         .column = first_[later.node],
                         .width = padded(later.width),
                         .values = column.offset + entries_[e].at,
                         .stride = column.stride});
    }
}

/// What elimination of the column takes from the row of one that meets it: the entries from that one on.
void BlockFactor::find_runs(const Column& column, std::size_t entry) {
  Entry& own = entries_[entry];
  own.first_run = runs_.size();
  const Column& target = columns_[own.column];
  std::size_t at = target.first_entry;
  for (std::size_t e = entry; e < column.first_entry + column.entries; ++e) {
    const Entry& from = entries_[e];
    std::size_t to = 0;
    if (e != entry) {
      while (entries_[at].column != from.column) ++at;
      to = entries_[at].at;
    }
    const std::size_t count = padded(columns_[from.column].width);
    if (runs_.size() > own.first_run && runs_.back().from + runs_.back().count == from.at &&
        runs_.back().to + runs_.back().count == to)
      runs_.back().count += count;
    else
      runs_.push_back({from.at, to, count});
  }
  own.runs = runs_.size() - own.first_run;
}

BlockFactor::Block BlockFactor::block(std::size_t i, std::size_t j) const {
  const Column& column = columns_[order_.place(i)];
  if (i == j) return {column.offset, column.stride};
  const auto begin = entries_.begin() + static_cast<std::ptrdiff_t>(column.first_entry);
  const auto found = std::lower_bound(begin, begin + static_cast<std::ptrdiff_t>(column.entries), order_.place(j),
                                      [](const Entry& e, std::size_t c) { return e.column < c; });
  return {column.offset + found->at, column.stride};
}

void BlockFactor::set_identity() {
  std::fill_n(upper_.data(), padded(numbers_), 0.0);
  for (const Column& column : columns_)
    for (std::size_t i = 0; i < column.width; ++i) upper_.data()[column.offset + i * column.stride + i] = 1.0;
}

bool BlockFactor::factor() {
  double* U = upper_.data();
  const MatrixView memory = inverse_.need(widest_, widest_);
  double* divided_memory = divided_.need(widest_, longest_).values;
  for (std::size_t c = 0; c < order_.eliminated(); ++c) {
    const Column& column = columns_[c];
    const std::size_t n = column.width, head = padded(n), tail = column.stride - head;
    const MatrixView inverse{memory.values, head}, divided{divided_memory, column.stride};
    for (std::size_t i = 0; i < n; ++i) std::copy_n(U + column.offset + i * column.stride, head, inverse.row(i));
    if (!invert_positive(inverse, n)) return false;
    multiply_block({divided.values + head, column.stride}, inverse, {U + column.offset + head, column.stride}, n, tail);
    for (std::size_t i = 0; i < n; ++i) std::copy_n(inverse.row(i), head, U + column.offset + i * column.stride);
    for (std::size_t e = column.first_entry; e < column.first_entry + column.entries; ++e) {
      const Entry& entry = entries_[e];
      const Column& target = columns_[entry.column];
      subtract_runs({U + target.offset, target.stride}, U + column.offset + entry.at, divided, target.width, n,
                    runs_.data() + entry.first_run, entry.runs);
    }
  }
  return true;
}

double BlockFactor::work() const {
  double sum = 0.0;
  for (std::size_t c = 0; c < order_.eliminated(); ++c) {
    const double width = static_cast<double>(columns_[c].width), length = static_cast<double>(columns_[c].stride);
    sum += 0.5 * width * length * length;
  }
  return sum;
}

void BlockFactor::times_inverse_pivot(const Column& column, const double* x, double* out) const {
  const double* inverse = upper_.data() + column.offset;
  for (std::size_t i = 0; i < column.width; ++i) {
    double sum = 0.0;
    for (std::size_t j = 0; j < column.width; ++j) sum += inverse[i * column.stride + j] * x[j];
    out[i] = sum;
  }
}

void BlockFactor::reduce(double* x) {
  double* y = row_.need(2 * padded(widest_));
  for (std::size_t c = 0; c < order_.eliminated(); ++c) {
    const Column& column = columns_[c];
    double* own = x + first_[column.node];
    times_inverse_pivot(column, own, y);
    std::copy_n(y, column.width, own);
    for (std::size_t i = 0; i < column.width; ++i) y[i] = -own[i];
    gather_blocks(x, blocks_.data() + column.first_entry, column.entries, upper_.data(), y);
  }
}

void BlockFactor::expand(double* x, std::size_t count) {
  double *y = row_.need(2 * padded(widest_)), *part = y + padded(widest_);
  for (std::size_t c = order_.eliminated(); c-- > 0;) {
    const Column& column = columns_[c];
    for (std::size_t k = 0; k < count; ++k) {
      double* all = x + k * size_;
      double* own = all + first_[column.node];
      std::fill_n(y, column.width, 0.0);
      spread_blocks(y, blocks_.data() + column.first_entry, column.entries, upper_.data(), all);
      times_inverse_pivot(column, y, part);
      for (std::size_t q = 0; q < column.width; ++q) own[q] -= part[q];
    }
  }
}

void BlockFactor::solve(double* x) {
  reduce(x);
  expand(x);
}

}  // namespace limber::internal
