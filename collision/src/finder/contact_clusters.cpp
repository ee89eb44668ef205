#include "limber/collision/contact_clusters.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
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

void require(bool holds, const char* field, double value, const char* expected) {
  if (!holds)
    throw InvalidArgument(std::string("ContactClusterOptions: ") + field + " is " + std::to_string(value) +
                          ", expected " + expected);
}

/// How much of a patch some of its contacts span.
struct Span {
  double area = 0.0, diameter = 0.0;
  bool at_least(double share, const Span& other) const {
    return area >= share * other.area && diameter >= share * other.diameter;
  }
};

}  // namespace

void ContactClusterOptions::validate() const {
  require(max_points >= 0, "max_points", max_points, "0 or more");
  require(max_normal_angle > 0.0 && max_normal_angle <= 0.5 * std::numbers::pi, "max_normal_angle", max_normal_angle,
          "above 0 and at most π/2");
  require(depth_tolerance >= 0.0 && std::isfinite(depth_tolerance), "depth_tolerance", depth_tolerance,
          "a finite number of at least 0");
  require(hysteresis >= 0.0 && hysteresis <= 1.0, "hysteresis", hysteresis, "0 to 1");
}

struct ContactClusters::Impl {
  explicit Impl(const ContactClusterOptions& o) : options(o), min_cosine(std::cos(o.max_normal_angle)) {
    options.validate();
  }

  ContactClusterOptions options;
  double min_cosine;

  // Of the pair under way.
  std::span<ContactPoint> contacts;
  std::span<const std::uint64_t> previous;
  std::vector<std::pair<std::uint64_t, std::size_t>> order;
  std::vector<ContactPoint> sorted;
  std::vector<Index> leaders;   ///< by patch: its first contact
  std::vector<Index> patch_of;  ///< by contact
  std::vector<Index> members;   ///< of one patch, ascending
  std::vector<std::uint8_t> keep;

  // Of the patch under way: its contacts in the plane across the mean normal.
  double deep_gap = 0.0;  ///< contacts with gaps up to here are deep
  std::vector<PlanePoint> place, points, hull, all_corners, kept, old, trial, trial_hull;

  ContactSpacing wanted;
  double spacing = 0.0;  ///< of the patch under way, m

  ContactShares shares = ContactShares::kNone;
  std::vector<ContactPoint> all;
  std::vector<ContactWeight> weights;
  PatchWeights patch_weights;
  PatchCells patch_cells;
  std::vector<double> cells;  ///< by contact

  void sort_by_id();
  void find_patches();
  void reduce_patch();
  void weigh_patch();
  void find_cells();
  void project();
  void choose();
  void add_corners();
  void cover();
  static bool near(const PlanePoint& p, const PlanePoint& q, double distance);
  static bool near_any(const PlanePoint& p, const std::vector<PlanePoint>& some, double distance);
  bool previous_will_do(std::size_t corners);
  Span span_of(const std::vector<PlanePoint>& some, bool deep_only);
  bool deep(const PlanePoint& p) const { return contacts[static_cast<std::size_t>(p.item)].gap <= deep_gap; }
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
  leaders.clear();
  patch_of.clear();
  for (const ContactPoint& c : contacts) {
    Index patch = 0;
    for (; static_cast<std::size_t>(patch) < leaders.size(); ++patch) {
      const ContactPoint& leader = contacts[static_cast<std::size_t>(leaders[static_cast<std::size_t>(patch)])];
      if (c.normal.dot(leader.normal) >= min_cosine) break;
    }
    if (static_cast<std::size_t>(patch) == leaders.size()) leaders.push_back(static_cast<Index>(&c - contacts.data()));
    patch_of.push_back(patch);
  }
}

void ContactClusters::Impl::project() {
  const ContactPoint& leader = contacts[static_cast<std::size_t>(members.front())];
  Vec3 normal = Vec3::Zero();
  for (const Index m : members) normal += contacts[static_cast<std::size_t>(m)].normal;
  if (normal.norm() > 0.0) normal.normalize();
  const Vec3 x = normal.unitOrthogonal(), y = normal.cross(x);
  place.clear();
  for (const Index m : members) {
    const Vec3 p = contacts[static_cast<std::size_t>(m)].position - leader.position;
    place.push_back({x.dot(p), y.dot(p), m});
  }
}

Span ContactClusters::Impl::span_of(const std::vector<PlanePoint>& some, bool deep_only) {
  trial.clear();
  for (const PlanePoint& p : some)
    if (!deep_only || deep(p)) trial.push_back(p);
  convex_hull(trial, trial_hull);
  return {area(trial_hull), diameter(trial_hull)};
}

/// Adds corners of the whole patch until there are max_points, as long as what they span grows.
void ContactClusters::Impl::add_corners() {
  while (kept.size() < static_cast<std::size_t>(options.max_points)) {
    Span best = span_of(kept, false);
    const PlanePoint* chosen = nullptr;
    for (const PlanePoint& corner : all_corners) {
      kept.push_back(corner);
      const Span span = span_of(kept, false);
      kept.pop_back();
      if (span.area > best.area || (span.area == best.area && span.diameter > best.diameter))
        best = span, chosen = &corner;
    }
    if (chosen == nullptr) return;
    kept.push_back(*chosen);
  }
}

bool ContactClusters::Impl::near(const PlanePoint& p, const PlanePoint& q, double distance) {
  const double x = p.x - q.x, y = p.y - q.y;
  return x * x + y * y <= distance * distance;
}

bool ContactClusters::Impl::near_any(const PlanePoint& p, const std::vector<PlanePoint>& some, double distance) {
  return std::any_of(some.begin(), some.end(), [&](const PlanePoint& q) { return near(p, q, distance); });
}

/// Adds what is farther than the spacing from all that are kept, the deepest first.
void ContactClusters::Impl::cover() {
  if (std::isinf(spacing)) return;
  const auto gap = [&](const PlanePoint& p) { return contacts[static_cast<std::size_t>(p.item)].gap; };
  points.clear();  // that are not covered yet
  for (const PlanePoint& p : place)
    if (!near_any(p, kept, spacing)) points.push_back(p);
  while (!points.empty()) {
    const PlanePoint chosen =
        *std::min_element(points.begin(), points.end(), [&](const auto& p, const auto& q) { return gap(p) < gap(q); });
    kept.push_back(chosen);
    std::erase_if(points, [&](const PlanePoint& p) { return near(p, chosen, spacing); });
  }
}

/// @param corners how many of the best choice are corners; the others cover what lies between
bool ContactClusters::Impl::previous_will_do(std::size_t corners) {
  const internal::FinderTuning& tuning = internal::collision_tuning().finder;
  old.clear();
  for (const PlanePoint& p : place)
    if (std::binary_search(previous.begin(), previous.end(), contacts[static_cast<std::size_t>(p.item)].id))
      old.push_back(p);
  const auto surplus = static_cast<std::size_t>(tuning.kept_surplus * static_cast<double>(kept.size() - corners));
  return old.size() >= corners && old.size() <= kept.size() + surplus &&
         std::any_of(old.begin(), old.end(), [&](const auto& p) { return deep(p); }) &&
         span_of(old, true).at_least(options.hysteresis, span_of(kept, true)) &&
         span_of(old, false).at_least(options.hysteresis, span_of(kept, false)) &&
         (std::isinf(spacing) || std::all_of(place.begin(), place.end(), [&](const PlanePoint& p) {
            return near_any(p, old, tuning.kept_spacing * spacing);
          }));
}

/// Fills `kept` from `place`; see the header.
void ContactClusters::Impl::choose() {
  points.assign(place.begin(), place.end());
  convex_hull(points, all_corners);
  largest_polygon(all_corners, static_cast<int>(kMostCorners), hull);  // thins the corners

  const auto gap = [&](const PlanePoint& p) { return contacts[static_cast<std::size_t>(p.item)].gap; };
  spacing = std::isinf(wanted.share) ? wanted.length : std::min(wanted.length, wanted.share * diameter(all_corners));
  const auto deepest =
      std::min_element(place.begin(), place.end(), [&](const auto& p, const auto& q) { return gap(p) < gap(q); });
  deep_gap = gap(*deepest) + options.depth_tolerance * diameter(all_corners);
  if (options.max_points == 1) {
    kept.assign(1, *deepest);
  } else {
    points.clear();
    std::copy_if(place.begin(), place.end(), std::back_inserter(points), [&](const auto& p) { return deep(p); });
    convex_hull(points, hull);
    largest_polygon(hull, options.max_points, kept);
    add_corners();
  }
  const std::size_t corners = kept.size();
  cover();
  if (previous_will_do(corners)) kept.swap(old);
}

void ContactClusters::Impl::reduce_patch() {
  if (members.size() <= static_cast<std::size_t>(options.max_points)) {
    for (const Index m : members) keep[static_cast<std::size_t>(m)] = 1;
    return;
  }
  project();
  choose();
  for (const PlanePoint& p : kept) keep[static_cast<std::size_t>(p.item)] = 1;
  if (shares != ContactShares::kNone) weigh_patch();
  if (shares == ContactShares::kWeightsAndCells) find_cells();
}

void ContactClusters::Impl::weigh_patch() {
  const auto gap = [&](const PlanePoint& p) { return contacts[static_cast<std::size_t>(p.item)].gap; };
  const double pressed_with = internal::collision_tuning().finder.pressed_with * diameter(all_corners);
  patch_weights.set(kept);
  for (const PlanePoint& p : place)
    for (const PatchWeights::Weight& w : patch_weights.find(p)) {
      const PlanePoint& r = kept[w.kept];
      const double farther = gap(p) - gap(r);
      const double part = farther <= pressed_with ? 1.0 : std::max(0.0, 2.0 - farther / pressed_with);
      if (part > 0.0) weights.push_back({.contact = p.item, .kept = r.item, .weight = part * w.value});
    }
}

void ContactClusters::Impl::find_cells() {
  const std::vector<double>& parts = patch_cells.find(place);
  for (std::size_t i = 0; i < place.size(); ++i) cells[static_cast<std::size_t>(place[i].item)] = parts[i];
}

ContactClusters::ContactClusters(const ContactClusterOptions& options) : impl_(std::make_unique<Impl>(options)) {}
ContactClusters::~ContactClusters() = default;
ContactClusters::ContactClusters(ContactClusters&&) noexcept = default;
ContactClusters& ContactClusters::operator=(ContactClusters&&) noexcept = default;

void ContactClusters::reduce(std::vector<ContactPoint>& contacts, std::size_t first, const ContactSpacing& spacing,
                             std::span<const std::uint64_t> previous, ContactShares shares) {
  Impl& m = *impl_;
  m.shares = shares;
  m.weights.clear();
  m.contacts = std::span(contacts).subspan(first);
  m.previous = previous;
  m.sort_by_id();
  m.keep.assign(m.contacts.size(), 1);
  if (shares != ContactShares::kNone) m.all.assign(m.contacts.begin(), m.contacts.end());
  if (shares == ContactShares::kWeightsAndCells)
    m.cells.assign(m.contacts.size(), std::numeric_limits<double>::infinity());
  if (m.options.max_points == 0 || m.contacts.size() <= static_cast<std::size_t>(m.options.max_points)) return;
  m.wanted = spacing;
  m.find_patches();
  m.keep.assign(m.contacts.size(), 0);
  for (std::size_t patch = 0; patch < m.leaders.size(); ++patch) {
    m.members.clear();
    for (std::size_t c = 0; c < m.patch_of.size(); ++c)
      if (m.patch_of[c] == static_cast<Index>(patch)) m.members.push_back(static_cast<Index>(c));
    m.reduce_patch();
  }
  std::size_t end = first;
  for (std::size_t c = 0; c < m.keep.size(); ++c)
    if (m.keep[c] != 0) contacts[end++] = contacts[first + c];
  contacts.resize(end);
}

std::span<const ContactPoint> ContactClusters::all() const { return impl_->all; }
bool ContactClusters::kept(Index contact) const { return impl_->keep[static_cast<std::size_t>(contact)] != 0; }
double ContactClusters::cell(Index contact) const { return impl_->cells[static_cast<std::size_t>(contact)]; }
std::span<const ContactWeight> ContactClusters::weights() const { return impl_->weights; }

}  // namespace limber
