// Keeps a world's contact source told of the bodies that there are, and of the pairs that never meet.
#pragma once

#include <functional>
#include <span>
#include <tuple>
#include <vector>

#include "body_table.h"
#include "limber/dynamics/contact_source.h"

namespace limber::internal {

class ContactRegistry {
 public:
  explicit ContactRegistry(BodyTable& bodies) : bodies_(&bodies) {}

  /// Null: there is none.
  ContactSource* source() const { return source_; }
  /// @param source holds no bodies yet; is told of all
  void set_source(ContactSource* source);
  /// False leaves a contact that was found out of the step; empty: all act.
  void set_veto(std::function<bool(const ContactPoint&)> acts) { acts_ = std::move(acts); }
  bool has_veto() const { return acts_ != nullptr; }
  bool acts(const ContactPoint& contact) const { return !acts_ || acts_(contact); }

  void add_body(Index body);
  /// Parts of a compound, all of which were added, do not meet each other.
  void keep_parts_apart(Index body);
  void remove_body(Index body);

  // Pairs, a < b, that do not meet as long as a joint between them stands, or until someone lets them.
  /// @param joint its place
  void exclude_for_joint(Index a, Index b, std::uint32_t joint);
  /// A joint is removed: the pair that it kept apart meets again.
  void include_after_joint(std::uint32_t joint);
  /// @return whether that changes anything
  bool set_excluded(Index a, Index b, bool excluded);

  /// Pairs, and what the source remembers.
  void save_pairs(StateWriter& state) const { state(pairs_); }
  void restore_pairs(StateReader& state);

 private:
  struct Pair {
    static constexpr std::uint32_t kNoJoint = 0xffffffff;
    Index a, b;
    std::uint32_t joint;  // its place

    friend bool operator==(const Pair&, const Pair&) = default;
    template <class Self>
    static auto state_fields(Self& s) {
      return std::tie(s.a, s.b, s.joint);
    }
  };
  bool is_excluded(Index a, Index b) const;
  void exclude(const Pair& pair);
  void include(std::vector<Pair>::iterator found);
  void tell(const Pair& pair, bool excluded);

  BodyTable* bodies_;
  ContactSource* source_ = nullptr;
  std::function<bool(const ContactPoint&)> acts_;
  std::vector<Pair> pairs_, restored_;  // the second: scratch of restore_pairs()
};

}  // namespace limber::internal
