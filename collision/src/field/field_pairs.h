// Contacts by distance fields for ManifoldFinder.
#pragma once

#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

#include "field/field_contacts.h"
#include "manifold/pair_query.h"

namespace limber::internal {

/// Finds the contacts of pairs in which a surface deforms. Holds the shells of all bodies, each made once for all that
/// share a model or shape; those of rigid shapes once a body that deforms is there.
class FieldPairs {
 public:
  void add_body(Index index, const ManifoldBody& body);
  void remove_body(Index index);
  /// Once a query, before anything else: all states are checked. @param changed bodies whose state may be another than
  /// in the last query, ascending
  void start_query(std::span<const ManifoldBody> bodies, std::span<const BodyState> states,
                   std::span<const Index> changed, Jobs& jobs);
  /// Whether it finds the contacts of two bodies, of which one deforms at least.
  bool takes(Index a, Index b) const;
  /// Appends; many threads may call it at once, each with scratch of its own. @pre query.by_fields
  void find(const PairQuery& query, FieldContacts& scratch, std::vector<FeatureContact>& found) const;
  /// Whether it has a body's coordinates, and then: what holds its surface, and where a point of it is; body frame.
  bool has(Index body) const { return entries_[static_cast<std::size_t>(body)].shell.has_value(); }
  Aabb bounds(Index body) const {
    const DeformedPointshell& shell = *entries_[static_cast<std::size_t>(body)].shell;
    return {shell.low().cast<double>(), shell.high().cast<double>()};
  }
  /// How far modes are expected to move any point of a body, m.
  double largest_swing(Index body) const {
    const auto& shell = entries_[static_cast<std::size_t>(body)].shell;
    return shell ? static_cast<double>(shell->largest_swing()) : 0.0;
  }
  // See DeformedPointshell. @pre has()
  double last_bend(Index body) const {
    return static_cast<double>(entries_[static_cast<std::size_t>(body)].shell->last_bend());
  }
  void restore(Index body, std::span<const double> z) { entries_[static_cast<std::size_t>(body)].shell->restore(z); }
  Vec3 place(Index body, const FeatureSide& side) const;
  /// What the expected motion and a fall close of a contact's gap, m. @param points, normal in the frames of a, b and a
  double closing(const PairQuery& query, const FeatureContact& contact) const;

 private:
  struct Entry {
    std::optional<DeformedPointshell> shell{};
    std::shared_ptr<const ManifoldShape> rigid{};
    bool fresh = false;  ///< not deformed yet
  };
  void make_rigid_shells();
  FieldBody field_body(Index index) const;

  std::vector<Entry> entries_;  ///< by body
  /// Shells by the surface they are of, which they keep alive.
  std::unordered_map<const CollisionSurface*, std::weak_ptr<const Pointshell>> shells_;
  std::vector<Index> rigid_;  ///< bodies whose shells are not made yet
  bool deforms_ = false;      ///< a body that deforms was there
  std::vector<DeformedPointshell*> to_deform_;
};

}  // namespace limber::internal
