#include "limber/solvers/block_factor.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "dense_kernels.h"

namespace limber::internal {
namespace {

constexpr std::size_t kBits = 64;

void insert(std::uint64_t* set, std::size_t i) { set[i / kBits] |= std::uint64_t{1} << (i % kBits); }
void erase(std::uint64_t* set, std::size_t i) { set[i / kBits] &= ~(std::uint64_t{1} << (i % kBits)); }

template <class Visit>
void for_each(const std::uint64_t* set, std::size_t words, Visit&& visit) {
  for (std::size_t w = 0; w < words; ++w)
    for (std::uint64_t bits = set[w]; bits != 0; bits &= bits - 1)
      visit(w * kBits + static_cast<std::size_t>(std::countr_zero(bits)));
}

}  // namespace

void BlockFactor::begin_pattern(std::span<const std::size_t> widths) {
  widths_.assign(widths.begin(), widths.end());
  words_ = (widths_.size() + kBits - 1) / kBits;
  adjacency_.assign(words_ * widths_.size(), 0);
  kept_.assign(widths_.size(), false);
  eliminated_ = widths_.size();
}

void BlockFactor::keep(std::size_t node) {
  if (!kept_[node]) --eliminated_;
  kept_[node] = true;
}

void BlockFactor::add_edge(std::size_t i, std::size_t j) {
  if (i == j) return;
  insert(neighbours(i), j);
  insert(neighbours(j), i);
}

void BlockFactor::end_pattern() {
  find_order();
  place_columns();
  runs_.clear();
  for (const Column& column : columns_)
    for (std::size_t e = 0; e < column.entries; ++e) find_runs(column, column.first_entry + e);
}

/// After this the neighbours of a node are those that it had when it was eliminated.
void BlockFactor::find_order() {
  const std::size_t n = widths_.size();
  const auto width_of = [&](std::size_t node) {
    std::size_t sum = 0;
    for_each(neighbours(node), words_, [&](std::size_t j) { sum += widths_[j]; });
    return sum;
  };
  degree_.resize(n), place_.assign(n, n), columns_.clear();
  for (std::size_t i = 0; i < n; ++i) degree_[i] = width_of(i);
  for (std::size_t step = 0; step < n; ++step) {
    std::size_t next = n;
    for (std::size_t i = 0; i < n; ++i)
      if (place_[i] == n && kept_[i] == (step >= eliminated_) && (next == n || degree_[i] < degree_[next])) next = i;
    place_[next] = step;
    columns_.push_back({.node = next, .width = widths_[next]});
    const std::uint64_t* around = neighbours(next);
    for_each(around, words_, [&](std::size_t j) {
      std::uint64_t* of = neighbours(j);
      for (std::size_t w = 0; w < words_; ++w) of[w] |= around[w];
      erase(of, j);
      erase(of, next);
    });
    for_each(around, words_, [&](std::size_t j) { degree_[j] = width_of(j); });
  }
}

void BlockFactor::place_columns() {
  entries_.clear();
  numbers_ = widest_ = longest_ = 0;
  for (Column& column : columns_) {
    column.first_entry = entries_.size();
    for_each(neighbours(column.node), words_, [&](std::size_t j) { entries_.push_back({.column = place_[j]}); });
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
  first_.resize(widths_.size());
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
  const Column& column = columns_[place_[i]];
  if (i == j) return {column.offset, column.stride};
  const auto begin = entries_.begin() + static_cast<std::ptrdiff_t>(column.first_entry);
  const auto found = std::lower_bound(begin, begin + static_cast<std::ptrdiff_t>(column.entries), place_[j],
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
  for (std::size_t c = 0; c < eliminated_; ++c) {
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
  for (std::size_t c = 0; c < eliminated_; ++c) {
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
  for (std::size_t c = 0; c < eliminated_; ++c) {
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
  for (std::size_t c = eliminated_; c-- > 0;) {
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
