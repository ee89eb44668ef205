#include "snapshot.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <string>
#include <tuple>

#include "limber/core/error.h"

namespace limber::internal {
namespace {

/// Changes with what is written.
constexpr std::uint32_t kFormat = 7;
constexpr std::uint64_t kMagic = 0x6574617473626d6c;  // "lmbstate"

struct Header {
  std::uint64_t magic = kMagic;
  std::uint32_t format = kFormat;
  std::uint64_t checksum = 0;  // of what follows

  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.magic, s.format, s.checksum);
  }
};
constexpr std::size_t kHeaderSize = 8 + 4 + 8;

/// FNV-1a by words of eight bytes, folded so that the upper bits count too.
class WordHash {
 public:
  void add(std::uint64_t word) {
    value_ = (value_ ^ word) * 0x100000001b3ull;
    value_ ^= value_ >> 32;
  }
  std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325ull;
};

std::uint64_t checksum(std::span<const std::byte> bytes) {
  WordHash hash;
  hash.add(bytes.size());
  while (!bytes.empty()) {
    const std::size_t size = std::min(bytes.size(), sizeof(std::uint64_t));
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data(), size);
    hash.add(word);
    bytes = bytes.subspan(size);
  }
  return hash.value();
}

/// Tells models apart whose states would not fit each other.
std::uint64_t fingerprint(const ModalModel& model) {
  const ModalModelData& data = model.data();
  WordHash hash;
  const auto add = [&](double x) { hash.add(std::bit_cast<std::uint64_t>(x)); };
  add(data.mass);
  for (const double x : data.inertia.reshaped()) add(x);
  for (const double x : data.eigenvalues) add(x);
  for (const double x : data.decays) add(x);
  hash.add(static_cast<std::uint64_t>(model.collision().vertices()));
  return hash.value();
}

[[noreturn]] void refuse(const std::string& what) { throw InvalidArgument("World::restore_state: " + what); }

}  // namespace

void Snapshot::save(std::vector<std::byte>& bytes) const {
  bytes.clear();
  StateWriter writer(bytes);
  writer(Header{});
  save_structure(writer);
  save_motion(writer);
  const std::uint64_t sum = checksum(std::span(bytes).subspan(kHeaderSize));
  std::memcpy(bytes.data() + kHeaderSize - sizeof(sum), &sum, sizeof(sum));
}

StateReader Snapshot::open(std::span<const std::byte> bytes) {
  if (bytes.size() < kHeaderSize) refuse(std::to_string(bytes.size()) + " bytes, expected a state of save_state()");
  StateReader reader(bytes);
  const auto header = reader.read<Header>();
  if (header.magic != kMagic) refuse("the bytes are no state of save_state()");
  if (header.format != kFormat)
    refuse("format " + std::to_string(header.format) + ", expected " + std::to_string(kFormat) +
           ": another version of limber wrote it");
  if (header.checksum != checksum(bytes.subspan(kHeaderSize))) refuse("the bytes are damaged: their checksum differs");
  return reader;
}

/// Saves first what has to be the same: nothing is changed before it has been looked at.
void Snapshot::save_structure(StateWriter& state) const {
  const BodyTable& bodies = rooms_.bodies;
  state(rooms_.options.substeps, rooms_.solver, rooms_.registry.source() != nullptr,
        static_cast<std::uint64_t>(bodies.size()));
  for (const BodyTable::Entry& e : bodies.entries()) {
    state(e.generation, e.alive);
    if (e.alive) state(e.group >= 0 ? fingerprint(bodies.group(e).model()) : std::uint64_t{0});
  }
}

std::vector<BodyId> Snapshot::check_structure(StateReader& state) const {
  const auto substeps = state.read<int>();
  if (substeps != rooms_.options.substeps)
    refuse(std::to_string(substeps) + " substeps, expected " + std::to_string(rooms_.options.substeps));
  if (state.read<ContactSolver>() != rooms_.solver) refuse("saved with another contact solver than this world's");
  const bool has_source = rooms_.registry.source() != nullptr;
  if (state.read<bool>() != has_source)
    refuse(std::string("saved ") + (has_source ? "without" : "with") + " a contact source, expected one " +
           (has_source ? "with" : "without"));
  const auto count = static_cast<std::size_t>(state.read<std::uint64_t>());
  std::vector<BodyId> later;
  for (std::size_t i = 0; i < std::max(count, rooms_.bodies.size()); ++i)
    if (const BodyId made = check_body(i, i < count, state); made != BodyId{}) later.push_back(made);
  return later;
}

/// @return the body at this place, if it has come since
BodyId Snapshot::check_body(std::size_t i, bool saved, StateReader& state) const {
  const std::span<const BodyTable::Entry> entries = std::as_const(rooms_.bodies).entries();
  const bool known = i < entries.size() && entries[i].alive;
  const bool is_part = known && entries[i].whole >= 0;  // comes and goes with its body
  std::uint32_t generation = 0;
  bool alive = false;
  if (saved) state(generation, alive);
  if (!alive) return known && !is_part ? BodyId{static_cast<std::uint32_t>(i), entries[i].generation} : BodyId{};
  const auto print = state.read<std::uint64_t>();
  if (!known || entries[i].generation != generation)
    refuse("body " + std::to_string(i) + " (generation " + std::to_string(generation) +
           ") has been removed since; bodies cannot be brought back");
  if (print != (entries[i].group >= 0 ? fingerprint(rooms_.bodies.group(entries[i]).model()) : 0))
    refuse("body " + std::to_string(i) + " has another model than when the state was saved");
  return {};
}

void Snapshot::save_motion(StateWriter& state) const {
  state(rooms_.options.step, rooms_.options.gravity, rooms_.time);
  rooms_.bodies.save_state(state);
  rooms_.constraints.save_state(rooms_.bodies.size(), state);
  rooms_.sleep.save_state(rooms_.bodies.size(), state);
  state(rooms_.parts, rooms_.events, rooms_.breaks, rooms_.sensors);
  rooms_.registry.save_pairs(state);
  rooms_.path.save_state(state);
  rooms_.drawing.save_state(state);
  if (rooms_.registry.source() != nullptr) rooms_.registry.source()->save_state(state);
}

void Snapshot::restore_motion(StateReader& state) {
  if (const auto step = state.read<double>(); step != rooms_.options.step) {
    rooms_.options.step = step;
    rooms_.parts.set_step(step);
    rooms_.bodies.set_step_length(rooms_.parts.length());
  }
  state(rooms_.options.gravity, rooms_.time);
  rooms_.bodies.restore_state(state);
  rooms_.constraints.restore_state(rooms_.bodies.size(), state);
  rooms_.sleep.restore_state(rooms_.bodies.size(), state);
  state(rooms_.parts, rooms_.events, rooms_.breaks, rooms_.sensors);
  rooms_.registry.restore_pairs(state);
  rooms_.path.restore_state(state);
  rooms_.drawing.restore_state(state);
  if (rooms_.registry.source() != nullptr) rooms_.registry.source()->restore_state(state);
}

}  // namespace limber::internal
