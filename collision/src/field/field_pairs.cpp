#include "field/field_pairs.h"

#include <algorithm>
#include <cmath>

namespace limber::internal {
void FieldPairs::add_body(Index index, const ManifoldBody& body) {
  const auto at = static_cast<std::size_t>(index);
  if (at >= entries_.size()) entries_.resize(at + 1);
  entries_[at] = {.rigid = body.rigid};
  if (!body.modal) {
    rigid_.push_back(index);
    return;
  }
  std::erase_if(shells_, [](const auto& entry) { return entry.second.expired(); });
  auto& known = shells_[body.modal->surface.get()];
  auto shell = known.lock();
  if (!shell) known = shell = std::make_shared<const Pointshell>(body.modal->surface);
  if (shell->resolved()) entries_[at].shell.emplace(std::move(shell)), entries_[at].fresh = true;
  deforms_ = true;
}

void FieldPairs::remove_body(Index index) {
  entries_[static_cast<std::size_t>(index)] = {};
  std::erase(rigid_, index);
}

void FieldPairs::make_rigid_shells() {
  if (!deforms_) return;
  for (const Index index : rigid_) {
    Entry& entry = entries_[static_cast<std::size_t>(index)];
    const auto& surface = entry.rigid->geometry.surface();
    if (!surface) continue;
    auto& known = shells_[surface.get()];
    auto shell = known.lock();
    if (!shell) known = shell = std::make_shared<const Pointshell>(entry.rigid->geometry);
    if (shell->resolved()) entry.shell.emplace(std::move(shell));
  }
  rigid_.clear();
}

void FieldPairs::start_query(std::span<const ManifoldBody> bodies, std::span<const BodyState> states,
                             std::span<const Index> changed, Jobs& jobs) {
  make_rigid_shells();
  to_deform_.clear();
  const auto look_at = [&](std::size_t i, bool moved) {
    Entry& entry = entries_[i];
    if (!bodies[i].present || !bodies[i].modal || !entry.shell || !(moved || entry.fresh)) return;
    entry.fresh = false;
    const bool expected = std::isfinite(states[i].doubt);
    entry.shell->set_amplitudes(states[i].amplitudes, expected ? states[i].end_amplitudes : std::span<const double>());
    to_deform_.push_back(&*entry.shell);
  };
  for (const Index i : changed) look_at(static_cast<std::size_t>(i), true);
  for (std::size_t i = 0; i < entries_.size(); ++i) look_at(i, false);
  // By model, then by body: stable_sort() would allocate.
  std::sort(to_deform_.begin(), to_deform_.end(), [](const DeformedPointshell* a, const DeformedPointshell* b) {
    return std::pair(&a->shell(), a) < std::pair(&b->shell(), b);
  });
  deform(to_deform_, jobs);
}

FieldBody FieldPairs::field_body(Index index) const {
  const Entry& entry = entries_[static_cast<std::size_t>(index)];
  return {entry.shell ? &*entry.shell : nullptr, entry.rigid ? &entry.rigid->geometry : nullptr};
}

bool FieldPairs::takes(Index a, Index b) const { return a != b && FieldContacts::serves(field_body(a), field_body(b)); }

Vec3 FieldPairs::place(Index body, const FeatureSide& side) const {
  const DeformedPointshell& shell = *entries_[static_cast<std::size_t>(body)].shell;
  const Triangle& t = shell.shell().surface().triangle(side.triangle);
  Vec3 p = Vec3::Zero();
  for (std::size_t c = 0; c < 3; ++c)
    if (side.weight[c] != 0.0) p += side.weight[c] * shell.vertex(t[c]).cast<double>();
  return p;
}

double FieldPairs::closing(const PairQuery& query, const FeatureContact& contact) const {
  return FieldContacts::closing(field_body(query.index_a), field_body(query.index_b),
                                {query.X_AB, query.expected.X_AB_end, query.expected.fall},
                                {{contact.a, contact.b}, contact.normal, contact.gap});
}

void FieldPairs::find(const PairQuery& query, FieldContacts& scratch, std::vector<FeatureContact>& found) const {
  for (const FoundContact& c : scratch.find(
           field_body(query.index_a), field_body(query.index_b),
           {query.X_AB, query.expected.X_AB_end, query.expected.fall, query.passing.touching, query.expected.parting},
           query.expected.near)) {
    found.push_back({c.of[0], c.of[1], c.normal, c.gap});
    found.back().b.point = query.X_AB * c.of[1].point;
  }
}

}  // namespace limber::internal
