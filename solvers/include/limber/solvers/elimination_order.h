// In which order the nodes of a sparse symmetric matrix are eliminated, so that few links come of it: that of least
// degree (Tinney and Walker 1967; George and Liu, SIAM Review 31 (1989) 1).
#pragma once

#include <bit>
#include <cstdint>
#include <span>
#include <vector>

namespace limber::internal {

class EliminationOrder {
 public:
  /// Forgets the last pattern. @param widths of the nodes: a neighbour counts by its own
  void begin(std::span<const std::size_t> widths);
  void add_edge(std::size_t i, std::size_t j);
  /// Comes after all nodes that are not kept.
  void keep(std::size_t node);
  /// Finds the order. After this later() visits neighbours by elimination, too.
  void find();

  std::size_t size() const { return widths_.size(); }
  std::size_t width(std::size_t node) const { return widths_[node]; }
  /// How many are not kept: the first in the order.
  std::size_t eliminated() const { return eliminated_; }
  std::size_t node(std::size_t place) const { return nodes_[place]; }
  std::size_t place(std::size_t node) const { return places_[node]; }
  /// @param visit gets each neighbour that comes after the node, by number
  template <class Visit>
  void later(std::size_t node, Visit&& visit) const {
    for (std::size_t w = 0; w < words_; ++w)
      for (std::uint64_t bits = adjacency_[node * words_ + w]; bits != 0; bits &= bits - 1)
        visit(w * kBits + static_cast<std::size_t>(std::countr_zero(bits)));
  }

 private:
  static constexpr std::size_t kBits = 64;

  std::size_t degree(std::size_t node) const;
  void link(std::size_t node);
  std::uint64_t& word(std::size_t node, std::size_t of) { return adjacency_[node * words_ + of / kBits]; }
  static std::uint64_t bit(std::size_t i) { return std::uint64_t{1} << (i % kBits); }

  std::vector<std::size_t> widths_, nodes_, places_, degrees_;
  std::vector<std::uint64_t> adjacency_;  // by node, in bits
  std::vector<bool> kept_;
  std::size_t words_ = 0, eliminated_ = 0;
};

}  // namespace limber::internal
