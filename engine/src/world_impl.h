// What a World is made of. Its functions have files by what they are about:
//
//   world.cpp              bodies, time and loads
//   world_step.cpp         a step, contacts on the way to the islands
//   world_reach.cpp        how far contacts are looked for
//   world_passing.cpp      bodies that come farther than contacts are looked for
//   world_constraints.cpp  handles, joints, the source of contacts
//   world_state.cpp        what can be read and set of bodies, and the hash of all of it
//   world_saving.cpp       all of it as bytes, and back
//   world_drawing.cpp      surfaces between two steps
#pragma once

#include <string>
#include <tuple>
#include <type_traits>

#include "constraint_stage.h"
#include "dented_surface.h"
#include "group_skin.h"
#include "limber/core/error.h"
#include "limber/dynamics/body_group.h"
#include "limber/dynamics/exact_motion.h"
#include "limber/dynamics/half_basis.h"
#include "limber/dynamics/reconstruct.h"
#include "limber/engine/world.h"
#include "passing_bodies.h"
#include "shape_extent.h"
#include "sleep_stage.h"
#include "step_parts.h"

namespace limber::internal {

// What arguments are to be, of the function named.
void require_finite(const Vec3& v, const char* function, const char* what);
void require_finite(std::span<const double> values, const char* function, const char* what);
void require_pose(const RigidTransform& X, const char* function);
void require_count(std::size_t seen, std::size_t expected, const char* function, const char* what);

}  // namespace limber::internal

namespace limber {

struct World::Impl {
  /// What a BodyId's index names.
  struct Entry {
    std::uint32_t generation = 1;
    bool alive = false;
    Index group = 0, slot = 0;  // group −1: static
    std::shared_ptr<const Shape> shape{};
    RigidTransform pose{};  // of a static one
    CollisionFilter filter{};
    double friction = -1.0;          // negative: that of the contact options
    internal::ShapeExtent extent{};  // of what moves
    bool placed = false;             // of a static one: the source has seen where it stands
    bool held = false;               // in an island in the last step, or its last part
  };
  /// Two bodies that do not meet as long as some joint between them stands, or until someone lets them.
  struct Apart {
    static constexpr std::uint32_t kNoJoint = 0xffffffff;
    Index a, b;
    std::uint32_t joint;  // its place

    friend bool operator==(const Apart&, const Apart&) = default;
    template <class Self>
    static auto state_fields(Self& s) {
      return std::tie(s.a, s.b, s.joint);
    }
  };
  /// Slots [begin, end) of a group: what one job advances.
  struct Range {
    Index group, begin, end;
  };

  WorldOptions options;
  Jobs* jobs;
  std::vector<Entry> entries;
  std::vector<std::uint32_t> vacant_entries;
  std::vector<std::unique_ptr<BodyGroup>> groups;                // null where the last body of a model was removed
  std::vector<std::unique_ptr<internal::DentedSurface>> dented;  // by group; null where nothing dents its bodies
  std::vector<std::unique_ptr<internal::GroupSkin>> skins;       // by group; null where the model has none
  std::vector<std::unique_ptr<const HalfBasis>> halves;          // by group; null where none is kept
  std::vector<Range> ranges;                                     // covers the bodies that are awake
  std::vector<std::pair<Index, Index>> awake_slots;              // scratch of make_ranges(): group and slot
  std::uint64_t ranges_of = 0, states_of = 0, contacts_of = 0;   // SleepStage::changes(), the last: wakings()
  int tellings_left = 0;         // of all states, sleepers and statics too: as they come to stand, and as they stay
  bool contacts_waited = false;  // those of fast bodies were remembered like those of sleepers
  internal::ConstraintStage constraints;  // bodies by their entries' indices
  internal::SleepStage sleep{constraints};
  std::optional<internal::StepParts> parts{};
  std::vector<Apart> apart, apart_then;  // the second: scratch of restore_state()
  ContactSource* source = nullptr;
  ContactSet contacts;
  std::vector<ContactPoint> touching, known;  // the latter while contacts are looked for anew
  std::function<bool(const ContactPoint&)> contact_acts;
  ContactOptions contact_options;
  std::vector<BodyState> states;  // by entries' indices, for the source
  std::vector<double> friction;   // the same
  std::vector<BodyState> ends;    // the same, as foreseen
  std::vector<Index> members;     // of islands, ascending
  std::vector<ContactPoint> found_at_end;
  struct ExpectedEnd {  // of a step; BodyState has the meaning of the members
    RigidTransform pose{};
    std::vector<double> amplitudes;
    double doubt = 0.0;
    bool foreseen = false;
  };
  std::vector<ExpectedEnd> expected;  // the same
  ExpectedEnd ends_foreseen;          // scratch
  std::vector<double> ways;  // the same: how far any point may come within the step, where it ends or before, m
  std::vector<std::vector<DentLoad>> loads_before;  // what dented each entry before the last step
  double energy_removed = 0.0;                      // of the step's parts before the last
  bool solved = true;
  int iterations = 0, newton_steps = 0;
  double residual = 0.0;
  StepAttempts attempts;
  ProgramReport programs;
  std::vector<ExactMotion> motions;
  internal::PassingBodies passing;
  StageTimes* stage_times = nullptr;
  StageClock clock;  // of the step at hand
  std::size_t alive = 0;
  std::uint64_t steps = 0, steps_before = 0;  // taken; those before the step's length was last set
  double time_before = 0.0;                   // s, of these
  double accumulator = 0.0, dropped = 0.0;
  // Scratch of drawing, kept so that it is not allocated again.
  struct Drawn {
    Index group;
    bool half;
    Index modes;
    std::size_t target;
  };
  std::vector<Drawn> drawn;
  std::vector<double> drawn_amplitudes;
  std::vector<float> drawn_dents;
  std::vector<ReconstructionTarget> reconstruction;

  const Entry& entry(BodyId id, const char* function) const {
    if (!contains(id))
      throw InvalidArgument(std::string("World::") + function + ": body " + std::to_string(id.index) + " (generation " +
                            std::to_string(id.generation) +
                            ") does not exist; it was removed or belongs to another world");
    if (entries[id.index].group < 0)
      throw InvalidArgument(std::string("World::") + function + ": body " + std::to_string(id.index) +
                            " is a static shape; it has no motion");
    return entries[id.index];
  }
  bool contains(BodyId id) const {
    return id.index < entries.size() && entries[id.index].alive && entries[id.index].generation == id.generation;
  }
  BodyGroup& group(const Entry& e) const { return *groups[static_cast<std::size_t>(e.group)]; }

  /// The constraint that an id names, if it is of the kind asked for.
  template <class Id>
  const internal::ConstraintStage::Entry* find(Id id) const {
    if (id.index >= constraints.entries().size()) return nullptr;
    const internal::ConstraintStage::Entry& e = constraints.entries()[id.index];
    const bool kind = std::is_same_v<Id, HandleId> ? e.handle != nullptr : e.joint != nullptr;
    return kind && e.generation == id.generation ? &e : nullptr;
  }
  template <class Id>
  const internal::ConstraintStage::Entry& constraint(Id id, const char* function) const {
    if (const internal::ConstraintStage::Entry* found = find(id)) return *found;
    throw InvalidArgument(std::string("World::") + function + ": " +
                          (std::is_same_v<Id, HandleId> ? "handle " : "joint ") + std::to_string(id.index) +
                          " (generation " + std::to_string(id.generation) +
                          ") does not exist; it was removed, with its body or by itself, or belongs to another world");
  }
  MaterialFrame joint_side(BodyId id, const JointFrame& in_world, const JointAttachment& on) const;

  BodyId place(Entry&& made);
  void tell_source(std::uint32_t index);
  bool shows(const Entry& e) const;
  void tell_apart(Index a, Index b, bool are_apart);
  bool are_apart(Index a, Index b) const;
  void keep_apart(Index a, Index b, std::uint32_t joint);
  void let_meet(std::uint32_t joint);
  void let_meet(std::vector<Apart>::iterator found);
  void set_apart(std::span<const Apart> pairs);
  void save_structure(StateWriter& state) const;
  void save_motion(StateWriter& state) const;
  std::vector<BodyId> check_structure(StateReader& state) const;
  void restore_motion(StateReader& state);
  void wake_bodies_of(std::uint32_t constraint);
  bool write_states();
  void write_all_states();
  bool some_woke();
  void write_state(Index body, double length);
  bool can_wait(Index body) const;
  void look_for_contacts();
  void take_contacts();
  double free_reach(Index body, const Vec3& displacement) const;
  static void expect_to_stay(BodyState& state);
  void expect(Index body);
  void expect_in_part(Index body, double left);
  double beside(Index body, const ExpectedEnd& end) const;
  double difference(Index body, const Quaternion& q, std::span<const double> z, const ExpectedEnd& end) const;
  void foreseen_end(Index body, ExpectedEnd& end) const;
  double fall() const;
  double sinking() const;
  double roughness();
  void find_end(Index body, ExpectedEnd& end) const;
  bool find_elsewhere();
  void keep_known();
  bool end_elsewhere();
  bool are_met(std::span<const ContactPoint> before);
  bool is_left_open(std::span<const ContactPoint> in_force, const ContactPoint& contact, double deepest);
  double gap_at_end(const ContactPoint& contact);
  Vec3 place_at_end(const ContactSide& side, const Vec3& inwards);
  Vec3 place_at_start(ContactSide& side, const Vec3& inwards) const;
  bool find_at_end();
  bool list_ends(double least);
  void foresee();
  void ask_source();
  void advance_free();
  template <class F>
  std::int64_t count_awake(F&& counts);
  bool find_passing();
  void list_fast();
  void find_first_touches();
  bool planes_last(Index a, Index b) const;
  void add_brisk();
  void join_passing();
  bool look_farther();
  void set_contacts(std::span<const ContactPoint> found);
  void advance_passing(int part);
  void advance_cluster(std::span<const Index> members, int part);
  std::span<const ContactPoint> contacts_of_cluster(std::span<const Index> members, bool first, double left);
  bool wake_what_is_touched();
  Index group_of(std::shared_ptr<const ModalModel> model);
  void make_ranges();
  void set_length(double step);
  void advance_part(int part);
  void keep_dents();
  std::span<const DentLoad> dents_before(BodyId id) const;
  bool is_dented(BodyId id, double s) const;
  template <class Real>
  void interpolate(BodyId id, double s, Real* amplitudes) const;
  double half_precision_error(const Entry& e, double tolerance, double s) const;
  Index modes_to_draw(const Entry& e, double tolerance, double s) const;
  const SkinPose* skin_at(BodyId id, const double* z) const;
  void prepare_drawing(std::span<const DrawTarget> targets, double s);
};

}  // namespace limber
