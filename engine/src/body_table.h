// Bodies of a world by number: their ids, what they show to others, and the groups in which bodies of one model move.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "group_skin.h"
#include "indented_surface.h"
#include "limber/core/jobs.h"
#include "limber/dynamics/body_group.h"
#include "limber/dynamics/contact_source.h"
#include "limber/dynamics/half_basis.h"
#include "limber/engine/world.h"
#include "shape_extent.h"

namespace limber::internal {

class BodyTable {
 public:
  /// One body; a BodyId's index names it.
  struct Entry {
    std::uint32_t generation = 1;
    bool alive = false;
    Index group = 0, slot = 0;  // group −1: static
    std::shared_ptr<const Shape> shape{};
    RigidTransform pose{};  // of a static one
    CollisionFilter filter{};
    double friction = -1.0;  // negative: that of the contact options
    double restitution = 0.0;
    ShapeExtent extent{};  // of what moves
    bool placed = false;   // of a static one: the source has seen where it stands
    bool sensor = false;   // tells what it overlaps, and meets nothing
    std::uint64_t user_data = 0;
    Vec3 surface_velocity = Vec3::Zero();  // m/s, body axes
    std::vector<Index> parts{};            // of a compound: what others meet of it
    Index whole = -1;                      // of such a part: the body, in which it is at `pose`
  };
  /// All bodies of one model, with what looking ahead and drawing need of it.
  struct ModelGroup {
    std::unique_ptr<BodyGroup> bodies;          // null where the last body of a model was removed
    std::unique_ptr<IndentedSurface> indented;  // null where nothing indents its bodies
    std::unique_ptr<GroupSkin> skin;            // null where the model has none
    std::unique_ptr<const HalfBasis> half;      // null where none is kept
  };

  /// @param half_precision keeps the drawn shapes in half precision too, of models without a skin
  explicit BodyTable(bool half_precision) : half_precision_(half_precision) {}

  /// The group of a model's bodies, a new one if it has none. @param step s, that of a new one
  Index group_of(std::shared_ptr<const ModalModel> model, double step);
  /// Gives a body an id; one that moves is in its group already.
  BodyId add(Entry&& made);
  /// @pre contains(id)
  void remove(BodyId id);

  std::size_t count() const { return alive_; }
  bool contains(BodyId id) const {
    return id.index < entries_.size() && entries_[id.index].alive && entries_[id.index].whole < 0 &&
           entries_[id.index].generation == id.generation;
  }
  /// @throws InvalidArgument, in the name of a function of World, for an id that names no body or one that is static
  const Entry& entry(BodyId id, const char* function) const;
  /// The same for one that may be static.
  const Entry& any_entry(BodyId id, const char* function) const;
  /// By BodyId::index.
  std::span<const Entry> entries() const { return entries_; }
  std::span<Entry> entries() { return entries_; }
  std::size_t size() const { return entries_.size(); }
  const Entry& operator[](Index body) const { return entries_[static_cast<std::size_t>(body)]; }
  Entry& operator[](Index body) { return entries_[static_cast<std::size_t>(body)]; }

  // Parts of compounds are entries of their own, which contact sources and queries know; ids name wholes alone.
  bool has_parts() const { return parts_ > 0; }
  /// The body that an entry is of.
  Index whole_of(Index body) const { return (*this)[body].whole < 0 ? body : (*this)[body].whole; }
  /// Of a body, or of the whole that a part is of.
  BodyId id(Index entry) const {
    const Index body = whole_of(entry);
    return {static_cast<std::uint32_t>(body), (*this)[body].generation};
  }
  /// Where an entry that is no body of its own is.
  RigidTransform standing_pose(const Entry& e) const {
    if (e.whole < 0) return e.pose;
    const Entry& whole = (*this)[e.whole];
    return group(whole).frame(whole.slot).pose() * e.pose;
  }
  /// visit(entry's number) for all that others meet of a body.
  template <class Visit>
  void for_shown(Index body, const Visit& visit) const {
    if (const Entry& e = (*this)[body]; e.parts.empty())
      visit(body);
    else
      for (const Index part : e.parts) visit(part);
  }

  /// @pre the body moves
  BodyGroup& group(const Entry& e) const { return *model_group(e).bodies; }
  const ModelGroup& model_group(const Entry& e) const { return model_group(e.group); }
  const ModelGroup& model_group(Index group) const { return groups_[static_cast<std::size_t>(group)]; }
  /// Whether a contact source knows a body: it has something to meet others with, and others to meet.
  bool shows(const Entry& e) const;

  /// Whether its turning and its modes feel each other's inertia.
  bool coupled(const Entry& e) const { return e.group >= 0 && group(e).coupled(e.slot); }

  /// Whether contacts may press indentations into any of them.
  bool any_indented() const;

  /// @param step s
  void set_step_length(double step);
  /// Whether the step to come goes on one that has been taken in part.
  void set_within_step(bool within);
  /// Whether an impulse with a delay waits for the coming step.
  bool impulses_wait() const;
  /// Moves the bodies that nothing constrains over one step.
  /// @param awake those that move and do not sleep. @param changes differs from the last call's where `awake` does
  void advance_free(std::span<const Index> awake, std::uint64_t changes, const Vec3& gravity, Jobs& jobs);

  /// Motion of bodies, ids, and what entries note of the last step.
  void save_state(StateWriter& state) const;
  /// @pre the same bodies are alive
  void restore_state(StateReader& state);

 private:
  /// Slots [begin, end) of a group: what one job advances.
  struct Range {
    Index group, begin, end;
  };
  /// Runs of slots whose bodies are awake.
  struct AwakeRanges {
    std::vector<Range> ranges;
    std::vector<std::pair<Index, Index>> slots;  // scratch: group and slot
    std::uint64_t made_of = 0;                   // `changes` when they were made
  };
  void make_ranges(std::span<const Index> awake, std::uint64_t changes);

  std::vector<Entry> entries_;
  std::vector<std::uint32_t> vacant_;
  std::vector<ModelGroup> groups_;
  std::size_t alive_ = 0, parts_ = 0;  // bodies, and parts of such
  bool half_precision_;
  AwakeRanges awake_;
};

}  // namespace limber::internal
