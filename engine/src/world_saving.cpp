#include <algorithm>
#include <bit>
#include <cstring>

#include "world_impl.h"

namespace limber {
namespace {

/// Changes with what is written.
constexpr std::uint32_t kFormat = 1;
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

void World::save_state(std::vector<std::byte>& state) const {
  state.clear();
  StateWriter writer(state);
  writer(Header{});
  impl_->save_structure(writer);
  impl_->save_motion(writer);
  const std::uint64_t sum = checksum(std::span(state).subspan(kHeaderSize));
  std::memcpy(state.data() + kHeaderSize - sizeof(sum), &sum, sizeof(sum));
}

void World::restore_state(std::span<const std::byte> state) {
  if (state.size() < kHeaderSize) refuse(std::to_string(state.size()) + " bytes, expected a state of save_state()");
  StateReader reader(state);
  const auto header = reader.read<Header>();
  if (header.magic != kMagic) refuse("the bytes are no state of save_state()");
  if (header.format != kFormat)
    refuse("format " + std::to_string(header.format) + ", expected " + std::to_string(kFormat) +
           ": another version of limber wrote it");
  if (header.checksum != checksum(state.subspan(kHeaderSize))) refuse("the bytes are damaged: their checksum differs");
  const std::vector<BodyId> later = impl_->check_structure(reader);
  for (const BodyId body : later) remove_body(body);
  impl_->restore_motion(reader);
}

/// What has to be the same, first: nothing is changed before it has been looked at.
void World::Impl::save_structure(StateWriter& state) const {
  state(options.substeps, source != nullptr, static_cast<std::uint64_t>(entries.size()));
  for (const Entry& e : entries) {
    state(e.generation, e.alive);
    if (e.alive) state(e.group >= 0 ? fingerprint(group(e).model()) : std::uint64_t{0});
  }
}

/// @return bodies that have come since
std::vector<BodyId> World::Impl::check_structure(StateReader& state) const {
  const auto substeps = state.read<int>();
  if (substeps != options.substeps)
    refuse(std::to_string(substeps) + " substeps, expected " + std::to_string(options.substeps));
  if (state.read<bool>() != (source != nullptr))
    refuse(std::string("saved ") + (source != nullptr ? "without" : "with") + " a contact source, expected one " +
           (source != nullptr ? "with" : "without"));
  const auto count = static_cast<std::size_t>(state.read<std::uint64_t>());
  std::vector<BodyId> later;
  for (std::size_t i = 0; i < std::max(count, entries.size()); ++i) {
    const bool known = i < entries.size() && entries[i].alive;
    std::uint32_t generation = 0;
    bool alive = false;
    if (i < count) state(generation, alive);
    if (alive) {
      const auto saved = state.read<std::uint64_t>();
      if (!known || entries[i].generation != generation)
        refuse("body " + std::to_string(i) + " (generation " + std::to_string(generation) +
               ") has been removed since; bodies cannot be brought back");
      if (saved != (entries[i].group >= 0 ? fingerprint(group(entries[i]).model()) : 0))
        refuse("body " + std::to_string(i) + " has another model than when the state was saved");
    } else if (known) {
      later.push_back({static_cast<std::uint32_t>(i), entries[i].generation});
    }
  }
  return later;
}

void World::Impl::save_motion(StateWriter& state) const {
  state(static_cast<std::uint64_t>(entries.size()));
  for (const Entry& e : entries) state(e.generation, e.placed, e.held);
  state(options.step, vacant_entries, steps, steps_before, time_before, accumulator, dropped, options.gravity);
  for (const Entry& e : entries)
    if (e.alive && e.group >= 0) group(e).save_state(e.slot, state);
  constraints.save_state(entries.size(), state);
  sleep.save_state(entries.size(), state);
  state(*parts, apart, contact_options);
  contacts.save_state(state);
  const std::vector<DentLoad> none;
  for (std::size_t i = 0; i < entries.size(); ++i) state(i < loads_before.size() ? loads_before[i] : none);
  if (source != nullptr) source->save_state(state);
}

/// @pre the bodies are those of the state
void World::Impl::restore_motion(StateReader& state) {
  std::uint64_t count = 0;
  state(count);
  entries.resize(static_cast<std::size_t>(count));
  for (Entry& e : entries) state(e.generation, e.placed, e.held);
  if (const auto step = state.read<double>(); step != options.step) set_length(step);
  state(vacant_entries, steps, steps_before, time_before, accumulator, dropped, options.gravity);
  for (const Entry& e : entries)
    if (e.alive && e.group >= 0) group(e).restore_state(e.slot, state);
  constraints.restore_state(entries.size(), state);
  sleep.restore_state(entries.size(), state);
  state(*parts, apart_then, contact_options);
  set_apart(apart_then);
  contacts.restore_state(state);
  loads_before.resize(entries.size());
  for (std::vector<DentLoad>& loads : loads_before) state(loads);
  if (source != nullptr) source->restore_state(state);
}

void World::Impl::set_apart(std::span<const Apart> pairs) {
  if (std::ranges::equal(apart, pairs)) return;
  const auto tell = [&](bool excluded) {
    for (const Apart& pair : apart) tell_apart(pair.a, pair.b, excluded);
  };
  tell(false);
  apart.assign(pairs.begin(), pairs.end());
  tell(true);
}

}  // namespace limber
