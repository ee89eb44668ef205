// Contacts between bodies that are free or stand, packed for the vector loops: pairs in bundles of eight, in an order
// that gives what Gauss–Seidel from one contact to the next gives.
//
//   level(pair) = 1 + the largest level of the pairs before it that share a body that moves
//
// Pairs of a level share no such body, so a bundle may hold any of them, and levels after each other keep the order.
// A colouring with fewest colours fills bundles better, but its sweeps carry less: towers of boxes need half as many
// substeps again.
#pragma once

#include <span>
#include <vector>

#include "../prepared_contact.h"
#include "bundle_kernels.h"
#include "game_bodies.h"

namespace limber::internal {

class PairBundles {
 public:
  /// Finds places for the contacts of all pairs that the loops take: those of a pair stand one after the other.
  void arrange(const GameBodies& bodies, std::span<const PreparedContact> contacts);
  /// Whether a contact has a place, by its number.
  bool holds(std::size_t contact) const { return places_[contact].lane >= 0; }
  /// Fills the place of a contact, but for its masses; `rest` is the gap. @param rows blocks of each side that moves,
  /// as the row says; those of frames are not read
  void put(std::size_t contact, const ContactRow& row, const Block8* rows);
  /// Gives a contact in its place resistance to rolling. @param radius m, > 0. @param moment N·m, to begin with
  void resist_rolling(std::size_t contact, double radius, const Vec3& moment);

  /// Force along a contact's axes at the last substep, and the sum of all, N.
  Vec3 force(std::size_t contact) const { return read(contact, &BundleContact::force); }
  Vec3 sum(std::size_t contact) const { return read(contact, &BundleContact::sum); }
  /// What resists rolling at the last substep, N·m.
  Vec3 moment(std::size_t contact) const { return read(contact, &BundleContact::moment); }
  bool resists_rolling(std::size_t contact) const { return read(contact, &BundleContact::radius) > 0.0; }
  double friction(std::size_t contact) const { return read(contact, &BundleContact::friction); }
  double compliance(std::size_t contact) const { return read(contact, &BundleContact::compliance); }

  /// For the kernels.
  BundleArrays arrays() { return {bundles_.data(), packed_.data(), rows_.data(), bundles_.size(), zeros_, standing_}; }

 private:
  /// Up to four contacts of a pair.
  struct Chunk {
    std::int32_t first = 0, count = 0, level = 0;
    std::int32_t frame[2] = {};   // −1: stands
    std::int32_t blocks[2] = {};  // of modes
    std::int32_t width() const { return blocks[0] + blocks[1]; }
  };
  struct Place {
    std::int32_t at = -1, lane = -1;  // in `packed_`; −1: none
    std::int32_t bundle = -1;
  };
  void add_chunks(const GameBodies& bodies, std::span<const PreparedContact> pair, std::size_t first);
  void order_by_level();
  void pack(const GameBodies& bodies);
  void fill_lane(const GameBodies& bodies, const Chunk& chunk, PairBundle& bundle, std::size_t lane);
  void put_modes(const Place& place, std::size_t side, const Block8* rows);
  Vec3 read(std::size_t contact, Block8 (BundleContact::*field)[3]) const;
  double read(std::size_t contact, Block8 BundleContact::*field) const;

  std::int32_t standing_ = 0, zeros_ = 0;
  std::vector<PairBundle> bundles_;
  std::vector<BundleContact> packed_;
  std::vector<Block8> rows_;   // of modes
  std::vector<Place> places_;  // by contact
  std::vector<Chunk> chunks_, ordered_;
  std::vector<std::int32_t> next_level_;  // by frame
  std::vector<std::int32_t> begins_;      // by level, in `ordered_`
};

}  // namespace limber::internal
