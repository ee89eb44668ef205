#include "limber/solvers/elimination_order.h"

namespace limber::internal {

void EliminationOrder::begin(std::span<const std::size_t> widths) {
  widths_.assign(widths.begin(), widths.end());
  words_ = (widths_.size() + kBits - 1) / kBits;
  adjacency_.assign(words_ * widths_.size(), 0);
  kept_.assign(widths_.size(), false);
  eliminated_ = widths_.size();
}

void EliminationOrder::keep(std::size_t node) {
  if (!kept_[node]) --eliminated_;
  kept_[node] = true;
}

void EliminationOrder::add_edge(std::size_t i, std::size_t j) {
  if (i == j) return;
  word(i, j) |= bit(j);
  word(j, i) |= bit(i);
}

/// After this the neighbours of a node are those that it had when it was eliminated.
void EliminationOrder::find() {
  const std::size_t n = size();
  degrees_.resize(n), places_.assign(n, n), nodes_.clear();
  for (std::size_t i = 0; i < n; ++i) degrees_[i] = degree(i);
  for (std::size_t step = 0; step < n; ++step) {
    std::size_t next = n;
    for (std::size_t i = 0; i < n; ++i)
      if (places_[i] == n && kept_[i] == (step >= eliminated_) && (next == n || degrees_[i] < degrees_[next])) next = i;
    places_[next] = step;
    nodes_.push_back(next);
    link(next);
    later(next, [&](std::size_t j) { degrees_[j] = degree(j); });
  }
}

std::size_t EliminationOrder::degree(std::size_t node) const {
  std::size_t sum = 0;
  later(node, [&](std::size_t j) { sum += widths_[j]; });
  return sum;
}

/// What elimination of a node makes of its neighbours': they are each other's, and no longer its own.
void EliminationOrder::link(std::size_t node) {
  later(node, [&](std::size_t j) {
    for (std::size_t w = 0; w < words_; ++w) adjacency_[j * words_ + w] |= adjacency_[node * words_ + w];
    word(j, j) &= ~bit(j);
    word(j, node) &= ~bit(node);
  });
}

}  // namespace limber::internal
