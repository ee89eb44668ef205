#include "finder/contact_regions.h"

#include <algorithm>
#include <tuple>

namespace limber::internal {
namespace {

const ContactSide& side_of(const ContactPoint& c, std::size_t side) { return side == 0 ? c.a : c.b; }

bool is_vertex(const ContactSide& side) { return std::count(side.weight.begin(), side.weight.end(), 0.0) == 2; }

/// A third of the triangles that have the vertex or the edge that touches, or of the one that is touched within.
/// @param outwards body frame
double area_about(const CollisionSurface& surface, const ContactSide& side, const Vec3& outwards) {
  const Triangle& touched = surface.triangle(side.triangle);
  const auto has_all = [&](const Triangle& corners) {
    for (std::size_t c = 0; c < 3; ++c)
      if (side.weight[c] > 0.0 && std::find(corners.begin(), corners.end(), touched[c]) == corners.end()) return false;
    return true;
  };
  const auto one =
      static_cast<std::size_t>(std::max_element(side.weight.begin(), side.weight.end()) - side.weight.begin());
  double area = 0.0;
  for (const Index t : surface.vertex_triangles(touched[one])) {
    const Triangle& corners = surface.triangle(t);
    if (!has_all(corners)) continue;
    const Vec3 &p = surface.rest(corners[0]), &q = surface.rest(corners[1]), &r = surface.rest(corners[2]);
    area += std::max(0.0, outwards.dot((q - p).cross(r - p))) / 6.0;
  }
  return area;
}

}  // namespace

void ContactRegions::append(const ContactRegions& others) {
  shares.insert(shares.end(), others.shares.begin(), others.shares.end());
  counts.insert(counts.end(), others.counts.begin(), others.counts.end());
}

void ContactRegions::give_to(std::span<ContactPoint> contacts) const {
  std::size_t next = 0;
  for (std::size_t c = 0; c < contacts.size(); ++c) {
    contacts[c].a.region = std::span(shares).subspan(next, counts[c][0]);
    contacts[c].b.region = std::span(shares).subspan(next + counts[c][0], counts[c][1]);
    next += counts[c][0] + counts[c][1];
  }
}

ContactShares shares_for(const std::array<RegionSide, 2>& sides, bool itself) {
  const int yielding = (sides[0].surface != nullptr ? 1 : 0) + (sides[1].surface != nullptr ? 1 : 0);
  if (yielding == 0) return ContactShares::kNone;
  return yielding == 2 && !itself ? ContactShares::kWeightsAndCells : ContactShares::kWeights;
}

void RegionFinder::find(const ContactClusters& clusters, ContactShares shares, const std::array<RegionSide, 2>& sides,
                        ContactRegions& regions) {
  if (shares == ContactShares::kNone) return;
  weigh(clusters, shares, sides);
  const std::span<const ContactPoint> all = clusters.all();
  std::size_t part = 0;
  for (Index kept = 0; kept < static_cast<Index>(all.size()); ++kept) {
    if (!clusters.kept(kept)) continue;
    const std::size_t first = part;
    while (part < parts_.size() && parts_[part].kept == kept) ++part;
    const std::span<const Part> own = std::span(parts_).subspan(first, part - first);
    regions.counts.push_back({0, 0});
    for (std::size_t side = 0; side < 2; ++side)
      if (sides[side].surface != nullptr) spread(all, own, *sides[side].surface, side, regions);
  }
}

/// φ a of all weights that have any, by the contact kept.
void RegionFinder::weigh(const ContactClusters& clusters, ContactShares shares,
                         const std::array<RegionSide, 2>& sides) {
  const bool by_cells = shares == ContactShares::kWeightsAndCells;
  const std::span<const ContactPoint> all = clusters.all();
  areas_.assign(all.size(), -1.0);
  parts_.clear();
  for (const ContactWeight& w : clusters.weights()) {
    const ContactPoint& contact = all[static_cast<std::size_t>(w.contact)];
    double& area = areas_[static_cast<std::size_t>(w.contact)];
    if (area < 0.0) {
      area = 0.0;
      for (std::size_t side = 0; side < 2; ++side) {
        const ContactSide& at = side_of(contact, side);
        if (sides[side].surface == nullptr || !(by_cells || is_vertex(at))) continue;
        const Vec3 outwards = sides[side].turn.conjugate() * (side == 0 ? -contact.normal : contact.normal);
        area += area_about(*sides[side].surface, at, outwards);
      }
      if (by_cells) area = std::min(area, clusters.cell(w.contact));
    }
    if (area > 0.0) parts_.push_back({.kept = w.kept, .contact = w.contact, .area = w.weight * area});
  }
  std::ranges::sort(
      parts_, [](const Part& p, const Part& q) { return std::tie(p.kept, p.contact) < std::tie(q.kept, q.contact); });
}

/// What stands for no area stands for itself.
void RegionFinder::spread(std::span<const ContactPoint> all, std::span<const Part> parts,
                          const CollisionSurface& surface, std::size_t side, ContactRegions& regions) {
  double whole = 0.0;
  for (const Part& part : parts) whole += part.area;
  if (!(whole > 0.0)) return;
  if (shares_.size() < static_cast<std::size_t>(surface.vertices()))
    shares_.resize(static_cast<std::size_t>(surface.vertices()), 0.0);
  touched_.clear();
  for (const Part& part : parts) {
    const ContactSide& at = side_of(all[static_cast<std::size_t>(part.contact)], side);
    const Triangle& corners = surface.triangle(at.triangle);
    for (std::size_t c = 0; c < 3; ++c) {
      if (!(at.weight[c] > 0.0)) continue;
      double& share = shares_[static_cast<std::size_t>(corners[c])];
      if (share == 0.0) touched_.push_back(corners[c]);
      share += part.area * at.weight[c] / whole;
    }
  }
  for (const Index vertex : touched_) {
    regions.shares.push_back({.vertex = vertex, .share = shares_[static_cast<std::size_t>(vertex)]});
    shares_[static_cast<std::size_t>(vertex)] = 0.0;
  }
  regions.counts.back()[side] = touched_.size();
}

}  // namespace limber::internal
