#include "limber/collision/contact_clusters.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "convex/convex_polygon.h"
#include "finder/patch_cells.h"
#include "finder/patch_weights.h"
#include "limber/core/error.h"
#include "tuning.h"

namespace limber {

using internal::area;
using internal::convex_hull;
using internal::diameter;
using internal::kMostCorners;
using internal::largest_polygon;
using internal::PatchCells;
using internal::PatchWeights;
using internal::PlanePoint;

namespace {

/// How much of a patch some of its contacts span.
struct Span {
  double area = 0.0, diameter = 0.0;
  bool at_least(double share, const Span& other) const {
    return area >= share * other.area && diameter >= share * other.diameter;
  }
};

bool near(const PlanePoint& p, const PlanePoint& q, double distance) {
  const double x = p.x - q.x, y = p.y - q.y;
  return x * x + y * y <= distance * distance;
}

bool near_any(const PlanePoint& p, const std::vector<PlanePoint>& some, double distance) {
  return std::any_of(some.begin(), some.end(), [&](const PlanePoint& q) { return near(p, q, distance); });
}

/// Which contacts of one patch are kept, as its mean normal shows them; see the header.
class PatchChoice {
 public:
  explicit PatchChoice(const ContactClusterOptions& options) : options_(options) {}

  /// @param members of the patch, ascending. @param previous ids that were kept last time, ascending
  void choose(std::span<const ContactPoint> contacts, std::span<const Index> members, const ContactSpacing& wanted,
              std::span<const std::uint64_t> previous);

  double gap(const PlanePoint& p) const { return contacts_[static_cast<std::size_t>(p.item)].gap; }
  const std::vector<PlanePoint>& all() const { return place_; }
  const std::vector<PlanePoint>& kept() const { return kept_; }
  double extent() const { return diameter(corners_); }

 private:
  bool deep(const PlanePoint& p) const { return gap(p) <= deep_gap_; }
  const PlanePoint& deepest(const std::vector<PlanePoint>& some) const {
    return *std::min_element(some.begin(), some.end(), [&](const auto& p, const auto& q) { return gap(p) < gap(q); });
  }
  void project(std::span<const Index> members);
  void add_corners();
  void cover();
  bool previous_will_do(std::span<const std::uint64_t> previous, std::size_t corners);
  Span span_of(const std::vector<PlanePoint>& some, bool deep_only);

  ContactClusterOptions options_;
  std::span<const ContactPoint> contacts_;
  std::vector<PlanePoint> place_, kept_;
  std::vector<PlanePoint> corners_;  // of all
  double deep_gap_ = 0.0;            // contacts with gaps up to here are deep
  double spacing_ = 0.0;             // m
  std::vector<PlanePoint> points_, hull_, old_, trial_, trial_hull_;
};

void PatchChoice::project(std::span<const Index> members) {
  const ContactPoint& leader = contacts_[static_cast<std::size_t>(members.front())];
  Vec3 normal = Vec3::Zero();
  for (const Index m : members) normal += contacts_[static_cast<std::size_t>(m)].normal;
  if (normal.norm() > 0.0) normal.normalize();
  const Vec3 x = normal.unitOrthogonal(), y = normal.cross(x);
  place_.clear();
  for (const Index m : members) {
    const Vec3 p = contacts_[static_cast<std::size_t>(m)].position - leader.position;
    place_.push_back({x.dot(p), y.dot(p), m});
  }
}

Span PatchChoice::span_of(const std::vector<PlanePoint>& some, bool deep_only) {
  trial_.clear();
  for (const PlanePoint& p : some)
    if (!deep_only || deep(p)) trial_.push_back(p);
  convex_hull(trial_, trial_hull_);
  return {area(trial_hull_), diameter(trial_hull_)};
}

/// Adds corners of the whole patch until there are max_points, as long as what they span grows.
void PatchChoice::add_corners() {
  while (kept_.size() < static_cast<std::size_t>(options_.max_points)) {
    Span best = span_of(kept_, false);
    const PlanePoint* chosen = nullptr;
    for (const PlanePoint& corner : corners_) {
      kept_.push_back(corner);
      const Span span = span_of(kept_, false);
      kept_.pop_back();
      if (span.area > best.area || (span.area == best.area && span.diameter > best.diameter))
        best = span, chosen = &corner;
    }
    if (chosen == nullptr) return;
    kept_.push_back(*chosen);
  }
}

/// Adds what is farther than the spacing from all that are kept, the deepest first.
void PatchChoice::cover() {
  if (std::isinf(spacing_)) return;
  points_.clear();  // that are not covered yet
  for (const PlanePoint& p : place_)
    if (!near_any(p, kept_, spacing_)) points_.push_back(p);
  while (!points_.empty()) {
    const PlanePoint chosen = deepest(points_);
    kept_.push_back(chosen);
    std::erase_if(points_, [&](const PlanePoint& p) { return near(p, chosen, spacing_); });
  }
}

/// @param corners how many of the best choice are corners; the others cover what lies between
bool PatchChoice::previous_will_do(std::span<const std::uint64_t> previous, std::size_t corners) {
  const internal::ClusterTuning& tuning = internal::collision_tuning().clusters;
  old_.clear();
  for (const PlanePoint& p : place_)
    if (std::binary_search(previous.begin(), previous.end(), contacts_[static_cast<std::size_t>(p.item)].id))
      old_.push_back(p);
  const auto surplus = static_cast<std::size_t>(tuning.kept_surplus * static_cast<double>(kept_.size() - corners));
  return old_.size() >= corners && old_.size() <= kept_.size() + surplus &&
         std::any_of(old_.begin(), old_.end(), [&](const auto& p) { return deep(p); }) &&
         span_of(old_, true).at_least(tuning.hysteresis, span_of(kept_, true)) &&
         span_of(old_, false).at_least(tuning.hysteresis, span_of(kept_, false)) &&
         (std::isinf(spacing_) || std::all_of(place_.begin(), place_.end(), [&](const PlanePoint& p) {
            return near_any(p, old_, tuning.kept_spacing * spacing_);
          }));
}

void PatchChoice::choose(std::span<const ContactPoint> contacts, std::span<const Index> members,
                         const ContactSpacing& wanted, std::span<const std::uint64_t> previous) {
  contacts_ = contacts;
  project(members);
  points_.assign(place_.begin(), place_.end());
  convex_hull(points_, corners_);
  largest_polygon(corners_, static_cast<int>(kMostCorners), hull_);  // thins the corners

  spacing_ = std::isinf(wanted.share) ? wanted.length : std::min(wanted.length, wanted.share * diameter(corners_));
  const PlanePoint first = deepest(place_);
  deep_gap_ = gap(first) + internal::collision_tuning().clusters.deep * diameter(corners_);
  if (options_.max_points == 1) {
    kept_.assign(1, first);
  } else {
    points_.clear();
    std::copy_if(place_.begin(), place_.end(), std::back_inserter(points_), [&](const auto& p) { return deep(p); });
    convex_hull(points_, hull_);
    largest_polygon(hull_, options_.max_points, kept_);
    add_corners();
  }
  const std::size_t corners = kept_.size();
  cover();
  if (previous_will_do(previous, corners)) kept_.swap(old_);
}

}  // namespace

void ContactClusterOptions::validate() const {
  if (max_points < 0)
    throw InvalidArgument("ContactClusterOptions: max_points is " + std::to_string(max_points) +
                          ", expected 0 or more");
}

struct ContactClusters::Impl {
  explicit Impl(const ContactClusterOptions& o) : options(o), choice(o) { options.validate(); }

  /// What is told of contacts beside which are kept.
  struct Told {
    ContactShares shares = ContactShares::kNone;
    std::vector<ContactPoint> all;
    std::vector<ContactWeight> weights;
    std::vector<double> cells;  ///< by contact
  };

  ContactClusterOptions options;

  // Of the pair under way.
  std::span<ContactPoint> contacts;
  std::vector<std::pair<std::uint64_t, std::size_t>> order;
  std::vector<ContactPoint> sorted;
  std::vector<Index> leaders;   ///< by patch: its first contact
  std::vector<Index> patch_of;  ///< by contact
  std::vector<Index> members;   ///< of one patch, ascending
  std::vector<std::uint8_t> keep;
  Told told;

  PatchChoice choice;
  PatchWeights patch_weights;
  PatchCells patch_cells;

  void sort_by_id();
  void find_patches();
  void reduce_patch(const ContactSpacing& wanted, std::span<const std::uint64_t> previous);
  void weigh_patch();
  void find_cells();
};

/// Contacts are large: places are sorted, and each contact is moved once.
void ContactClusters::Impl::sort_by_id() {
  order.clear();
  for (std::size_t c = 0; c < contacts.size(); ++c) order.emplace_back(contacts[c].id, c);
  std::sort(order.begin(), order.end());
  sorted.clear();
  for (const auto& [id, c] : order) sorted.push_back(contacts[c]);
  std::copy(sorted.begin(), sorted.end(), contacts.begin());
}

/// In ascending id, each joins the first patch whose first contact is like it, or begins one: as long as the same ids
/// are there, the same ones lead.
void ContactClusters::Impl::find_patches() {
  const double least_cosine = std::cos(internal::collision_tuning().clusters.normal_angle);
  leaders.clear();
  patch_of.clear();
  for (const ContactPoint& c : contacts) {
    Index patch = 0;
    for (; static_cast<std::size_t>(patch) < leaders.size(); ++patch) {
      const ContactPoint& leader = contacts[static_cast<std::size_t>(leaders[static_cast<std::size_t>(patch)])];
      if (c.normal.dot(leader.normal) >= least_cosine) break;
    }
    if (static_cast<std::size_t>(patch) == leaders.size()) leaders.push_back(static_cast<Index>(&c - contacts.data()));
    patch_of.push_back(patch);
  }
}

void ContactClusters::Impl::reduce_patch(const ContactSpacing& wanted, std::span<const std::uint64_t> previous) {
  if (members.size() <= static_cast<std::size_t>(options.max_points)) {
    for (const Index m : members) keep[static_cast<std::size_t>(m)] = 1;
    return;
  }
  choice.choose(contacts, members, wanted, previous);
  for (const PlanePoint& p : choice.kept()) keep[static_cast<std::size_t>(p.item)] = 1;
  if (told.shares != ContactShares::kNone) weigh_patch();
  if (told.shares == ContactShares::kWeightsAndCells) find_cells();
}

void ContactClusters::Impl::weigh_patch() {
  const double pressed_with = internal::collision_tuning().clusters.pressed_with * choice.extent();
  patch_weights.set(choice.kept());
  for (const PlanePoint& p : choice.all())
    for (const PatchWeights::Weight& w : patch_weights.find(p)) {
      const PlanePoint& r = choice.kept()[w.kept];
      const double farther = choice.gap(p) - choice.gap(r);
      const double part = farther <= pressed_with ? 1.0 : std::max(0.0, 2.0 - farther / pressed_with);
      if (part > 0.0) told.weights.push_back({.contact = p.item, .kept = r.item, .weight = part * w.value});
    }
}

void ContactClusters::Impl::find_cells() {
  const std::vector<double>& parts = patch_cells.find(choice.all());
  for (std::size_t i = 0; i < parts.size(); ++i) told.cells[static_cast<std::size_t>(choice.all()[i].item)] = parts[i];
}

ContactClusters::ContactClusters(const ContactClusterOptions& options) : impl_(std::make_unique<Impl>(options)) {}
ContactClusters::~ContactClusters() = default;
ContactClusters::ContactClusters(ContactClusters&&) noexcept = default;
ContactClusters& ContactClusters::operator=(ContactClusters&&) noexcept = default;

void ContactClusters::reduce(std::vector<ContactPoint>& contacts, std::size_t first, const ContactSpacing& spacing,
                             std::span<const std::uint64_t> previous, ContactShares shares) {
  Impl& m = *impl_;
  m.told.shares = shares;
  m.told.weights.clear();
  m.contacts = std::span(contacts).subspan(first);
  m.sort_by_id();
  m.keep.assign(m.contacts.size(), 1);
  if (shares != ContactShares::kNone) m.told.all.assign(m.contacts.begin(), m.contacts.end());
  if (shares == ContactShares::kWeightsAndCells)
    m.told.cells.assign(m.contacts.size(), std::numeric_limits<double>::infinity());
  if (m.options.max_points == 0 || m.contacts.size() <= static_cast<std::size_t>(m.options.max_points)) return;
  m.find_patches();
  m.keep.assign(m.contacts.size(), 0);
  for (std::size_t patch = 0; patch < m.leaders.size(); ++patch) {
    m.members.clear();
    for (std::size_t c = 0; c < m.patch_of.size(); ++c)
      if (m.patch_of[c] == static_cast<Index>(patch)) m.members.push_back(static_cast<Index>(c));
    m.reduce_patch(spacing, previous);
  }
  std::size_t end = first;
  for (std::size_t c = 0; c < m.keep.size(); ++c)
    if (m.keep[c] != 0) contacts[end++] = contacts[first + c];
  contacts.resize(end);
}

std::span<const ContactPoint> ContactClusters::all() const { return impl_->told.all; }
bool ContactClusters::kept(Index contact) const { return impl_->keep[static_cast<std::size_t>(contact)] != 0; }
double ContactClusters::cell(Index contact) const { return impl_->told.cells[static_cast<std::size_t>(contact)]; }
std::span<const ContactWeight> ContactClusters::weights() const { return impl_->told.weights; }

}  // namespace limber
