// Contacts by distance fields for ManifoldFinder.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <unordered_map>
#include <vector>

#include "field/field_contacts.h"
#include "manifold/pair_finder.h"

namespace limber::internal {

/// Holds the shells of all bodies, each made once for all that share a model or shape; those of rigid shapes once a
/// body that deforms is there.
class FieldPairs final : public DeformingPairs {
 public:
  void add_body(Index index, const ManifoldBody& body) override;
  void remove_body(Index index) override;
  void start_query(std::span<const ManifoldBody> bodies, std::span<const BodyState> states,
                   std::span<const Index> changed, Jobs& jobs) override;
  bool takes(Index a, Index b) const override;
  void find(const PairQuery& query, std::vector<FeatureContact>& found) override;
  bool has(Index body) const override { return entries_[static_cast<std::size_t>(body)].shell.has_value(); }
  Aabb bounds(Index body) const override {
    const DeformedPointshell& shell = *entries_[static_cast<std::size_t>(body)].shell;
    return {shell.low().cast<double>(), shell.high().cast<double>()};
  }
  double largest_swing(Index body) const override {
    return static_cast<double>(entries_[static_cast<std::size_t>(body)].shell->largest_swing());
  }
  Vec3 place(Index body, const FeatureSide& side) const override;
  double closing(const PairQuery& query, const FeatureContact& contact) const override;

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
  std::mutex mutex_;
  std::vector<std::unique_ptr<FieldContacts>> scratch_;
  std::vector<FieldContacts*> free_;
};

}  // namespace limber::internal
