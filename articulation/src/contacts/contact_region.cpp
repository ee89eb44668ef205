#include "limber/articulation/contact_region.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <numeric>
#include <optional>

#include "contacts/convex_pieces.h"
#include "contacts/near_samples.h"
#include "counted_progress.h"
#include "limber/core/error.h"
#include "tuning.h"

namespace limber {
namespace {

using internal::ContactsTuning;
using internal::ConvexPieces;
using internal::inside_samples;
using internal::near_samples;
using internal::NearSample;
using internal::SmoothSurface;
using internal::TriangleTree;
using internal::tuning;

void require(bool holds, const std::string& field, double value, const std::string& expected) {
  if (!holds)
    throw InvalidArgument("ContactRegionOptions: " + field + " is " + std::to_string(value) + ", expected " + expected);
}

/// A component made ready: outward, with normals and a tree.
struct Prepared {
  Prepared(const Component& component, double crease_angle)
      : mesh(outward(component.surface, inside_out(component))),
        smooth(mesh, crease_angle, outward({{}, component.caps}, inside_out(component)).triangles),
        diagonal(component.diagonal),
        closed(component.closed) {}

  static bool inside_out(const Component& component) {
    return component.closed && enclosed_volume(bounding_surface(component)) < 0.0;
  }
  /// A closed surface drawn inside out is turned.
  static SurfaceMesh outward(SurfaceMesh surface, bool inside_out) {
    if (inside_out)
      for (Triangle& t : surface.triangles) std::swap(t[1], t[2]);
    return surface;
  }

  SurfaceMesh mesh;
  SmoothSurface smooth;
  double diagonal;
  bool closed;
  std::optional<ConvexPieces> pieces{};
};

using Parts = std::vector<std::unique_ptr<Prepared>>;

struct Pair {
  Index a, b;
};

/// Pairs whose boxes come within reach of each other, ordered.
std::vector<Pair> near_pairs(const Parts& parts, double search) {
  std::vector<Index> by_x(parts.size());
  std::iota(by_x.begin(), by_x.end(), Index{0});
  const auto box = [&](Index i) -> const Eigen::AlignedBox3d& {
    return parts[static_cast<std::size_t>(i)]->smooth.tree().box();
  };
  std::stable_sort(by_x.begin(), by_x.end(), [&](Index i, Index j) { return box(i).min()[0] < box(j).min()[0]; });
  std::vector<Pair> out;
  std::vector<Index> open;  // boxes that the sweep has not left behind
  for (const Index i : by_x) {
    const auto reach = [&](Index j) {
      return search *
             std::min(parts[static_cast<std::size_t>(i)]->diagonal, parts[static_cast<std::size_t>(j)]->diagonal);
    };
    std::erase_if(open, [&](Index j) {
      return box(j).max()[0] + search * parts[static_cast<std::size_t>(j)]->diagonal < box(i).min()[0];
    });
    for (const Index j : open)
      if (std::sqrt(box(i).squaredExteriorDistance(box(j))) <= reach(j))
        out.push_back({std::min(i, j), std::max(i, j)});
    open.push_back(i);
  }
  std::sort(out.begin(), out.end(),
            [](const Pair& p, const Pair& q) { return std::pair(p.a, p.b) < std::pair(q.a, q.b); });
  return out;
}

struct BothSides {
  std::vector<NearSample> a, b;
};

bool tell_enough(const BothSides& sides) {
  return std::min(sides.a.size(), sides.b.size()) >= tuning().contacts.sampling.fewest_samples;
}

double area_of(const BothSides& sides) {
  double out = 0.0;
  for (const auto* side : {&sides.a, &sides.b})
    for (const NearSample& s : *side) out += s.contact.area;
  return out;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Squared sine of the angle by which two surfaces do not look straight at each other.
double askew(const NearSample& s) { return s.contact.normal.cross(s.contact.facing_normal).squaredNorm(); }

/// Gaps that belong to a contact.
struct GapLimit {
  double between = 0.0;  ///< the surfaces that the facets stand for
  double facets = 0.0;   ///< what facets add to it in most of the contact
  /// Where a round surface goes on from a flat one, which is most of the contact, its facets add what they do there.
  double at(double chord_error) const { return between + std::max(facets, chord_error); }
  bool holds(const NearSample& s) const { return s.distance <= at(own_chord_error(s)); }
  /// Noise is no chord: it tilts the normals of one side only.
  static double own_chord_error(const NearSample& s) {
    return askew(s) < tuning().contacts.cluster.rough ? s.chord_error : 0.0;
  }
};

/// A cluster grown from the smallest gaps, so that a small hinge is not swamped by large faces that run side by side
/// further apart.
GapLimit gap_limit(const BothSides& sides, double diagonal) {
  const ContactsTuning& t = tuning().contacts;
  std::vector<const NearSample*> samples;
  for (const auto* side : {&sides.a, &sides.b})
    for (const NearSample& s : *side) samples.push_back(&s);
  if (samples.empty()) return {};
  auto grown =
      samples.begin() + static_cast<std::ptrdiff_t>(std::max<std::size_t>(1, samples.size() / t.cluster.cluster_start));
  std::nth_element(samples.begin(), grown - 1, samples.end(),
                   [](const NearSample* x, const NearSample* y) { return x->distance < y->distance; });
  while (true) {
    std::vector<double> gaps, chords;
    for (auto s = samples.begin(); s != grown; ++s) gaps.push_back((*s)->distance), chords.push_back((*s)->chord_error);
    const GapLimit limit = {t.cluster.cluster_gaps * median(gaps) + t.cluster.cluster_least * diagonal,
                            t.cluster.cluster_chords * median(chords)};
    const auto before = grown;
    grown = std::partition(before, samples.end(), [&](const NearSample* s) { return limit.holds(*s); });
    if (grown == before) return limit;
  }
}

double normal_spread(const BothSides& sides) {
  double spread = 0.0, area = 0.0;
  for (const auto* side : {&sides.a, &sides.b})
    for (const NearSample& s : *side) {
      spread += s.contact.area * askew(s);
      area += s.contact.area;
    }
  return spread / area;
}

/// Leaves out pairs that look past each other while most do not: the face at the end of a nut is near the bolt's flank
/// and leans by 34 degrees from it. A lean that most share is noise, curvature or both, and stays.
void drop_askew(BothSides& sides) {
  const ContactsTuning& t = tuning().contacts;
  std::vector<double> all;
  for (const auto* side : {&sides.a, &sides.b})
    for (const NearSample& s : *side) all.push_back(askew(s));
  if (all.empty()) return;
  const auto most =
      all.begin() + static_cast<std::ptrdiff_t>(t.left_out.askew_share * static_cast<double>(all.size() - 1));
  std::nth_element(all.begin(), most, all.end());
  const double limit = t.left_out.askew_always + t.left_out.askew_times * *most;
  for (auto* side : {&sides.a, &sides.b}) std::erase_if(*side, [&](const NearSample& s) { return askew(s) > limit; });
}

/// Measurements over the samples of both sides.
ContactRegion summarised(const Pair& pair, const BothSides& sides) {
  ContactRegion out;
  out.a = pair.a, out.b = pair.b;
  std::vector<double> gaps, chords;
  Eigen::AlignedBox3d box;
  for (auto [samples, target] : {std::pair(&sides.a, &out.on_a), {&sides.b, &out.on_b}})
    for (const NearSample& s : *samples) {
      target->push_back(s.contact);
      gaps.push_back(s.distance);
      chords.push_back(s.chord_error);
      box.extend(s.contact.point);
    }
  out.normal_spread = normal_spread(sides);
  out.gap = median(gaps);
  out.chord_error = median(chords);
  out.extent = box.diagonal().norm();
  return out;
}

/// The normal of the plane that rough samples lie in, if they do: whatever their facets say, it blocks no motion along
/// it.
std::optional<Vec3> plane_of(const BothSides& sides) {
  const double flat = tuning().contacts.rough.flat_thickness;
  Vec3 centre = Vec3::Zero();
  Mat3 second = Mat3::Zero();
  for (const auto* side : {&sides.a, &sides.b})
    for (const NearSample& s : *side) centre += s.contact.area * s.contact.point;
  centre /= area_of(sides);
  for (const auto* side : {&sides.a, &sides.b})
    for (const NearSample& s : *side)
      second += s.contact.area * (s.contact.point - centre) * (s.contact.point - centre).transpose();
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(second);
  if (solver.eigenvalues()[0] > flat * flat * solver.eigenvalues()[1]) return std::nullopt;
  return solver.eigenvectors().col(0);
}

void flatten(std::vector<NearSample>& samples, const Vec3& normal) {
  for (NearSample& s : samples) {
    s.contact.normal = s.contact.normal.dot(normal) < 0.0 ? Vec3(-normal) : normal;
    s.contact.facing_normal = -s.contact.normal;
  }
}

/// Takes the noise out of rough surfaces, where that makes the two sides agree better.
void quieten(BothSides& sides) {
  const double before = normal_spread(sides);
  if (before < tuning().contacts.cluster.rough) return;
  if (const auto normal = plane_of(sides)) {
    flatten(sides.a, *normal);
    flatten(sides.b, *normal);
    return;
  }
  BothSides quiet = sides;
  internal::average_patches(quiet.a);
  internal::average_patches(quiet.b);
  if (normal_spread(quiet) < tuning().contacts.rough.quieter * before) sides = std::move(quiet);
}

/// Σ A n nᵀ / Σ A, eigenvalues ascending: (0, 0, 1) for a flat contact, (0, ½, ½) for a cylinder.
Vec3 spread_of_directions(const BothSides& sides) {
  Mat3 sum = Mat3::Zero();
  for (const auto* side : {&sides.a, &sides.b})
    for (const NearSample& s : *side) sum += s.contact.area * s.contact.normal * s.contact.normal.transpose();
  return Eigen::SelfAdjointEigenSolver<Mat3>(sum / sum.trace(), Eigen::EigenvaluesOnly).eigenvalues();
}

/// The pairs that the limit holds, or the others.
BothSides part_of(BothSides sides, const GapLimit& limit, bool held = true) {
  for (auto* side : {&sides.a, &sides.b})
    std::erase_if(*side, [&](const NearSample& s) { return limit.holds(s) != held; });
  return sides;
}

/// Samples whose gaps belong together.
struct Cluster {
  GapLimit limit;
  BothSides samples;

  /// The largest gap that it could hold.
  double reach() const {
    double chord_error = 0.0;
    for (const auto* side : {&samples.a, &samples.b})
      for (const NearSample& s : *side) chord_error = std::max(chord_error, GapLimit::own_chord_error(s));
    return limit.at(chord_error);
  }
};

Cluster nearest_cluster(const BothSides& sides, double diagonal) {
  const GapLimit limit = gap_limit(sides, diagonal);
  return {limit, part_of(sides, limit)};
}

/// A second, wider contact that the nearest one hides: a bar that passes a flange more closely than the flange's
/// bearing fits. The nearest contact gives way only if it is flat, so that it guides no motion, and the wider one
/// guides (its normals span more than a line), agrees, and has several times the area. Plates that lie beside a small
/// hinge guide nothing: the hinge stays.
/// @param rest without what touches. Nothing if that one stands
std::optional<Cluster> wider_cluster(const BothSides& touch, const BothSides& rest, double diagonal) {
  const ContactsTuning& t = tuning().contacts;
  if (touch.a.empty() || touch.b.empty() || !tell_enough(rest)) return std::nullopt;
  Cluster wider = nearest_cluster(rest, diagonal);
  const BothSides& found = wider.samples;
  if (!tell_enough(found) || area_of(found) < t.left_out.wider_area * area_of(touch)) return std::nullopt;
  if (spread_of_directions(touch)[2] < t.left_out.stray_flat ||
      spread_of_directions(found)[1] < t.left_out.wider_guides)
    return std::nullopt;
  if (normal_spread(found) > t.left_out.most_spread) return std::nullopt;
  return wider;
}

Cluster contact_cluster(const BothSides& sides, double diagonal) {
  Cluster nearest = nearest_cluster(sides, diagonal);
  if (auto wider = wider_cluster(nearest.samples, part_of(sides, nearest.limit, false), diagonal)) return *wider;
  return nearest;
}

BothSides sample(const Prepared& a, const Prepared& b, double reach, double facing_cosine, int wanted) {
  return {near_samples(a.smooth, b.smooth, reach, facing_cosine, wanted),
          near_samples(b.smooth, a.smooth, reach, facing_cosine, wanted)};
}

/// Leaves out samples that another component stands before: the inner tube of a telescope does not touch the outer one.
void drop_hidden(const Pair& pair, const Parts& parts, BothSides& sides) {
  Eigen::AlignedBox3d box;
  for (const auto* side : {&sides.a, &sides.b})
    for (const NearSample& s : *side) box.extend(s.contact.point).extend(s.contact.facing_point);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const TriangleTree& tree = parts[i]->smooth.tree();
    if (static_cast<Index>(i) == pair.a || static_cast<Index>(i) == pair.b || !tree.box().intersects(box)) continue;
    const auto hidden = [&](const NearSample& s) {
      return s.distance > 0.0 && tree.crosses(s.contact.point, s.contact.facing_point);
    };
    std::erase_if(sides.a, hidden);
    std::erase_if(sides.b, hidden);
  }
}

/// A shaft drawn through a solid block without a hole: of the two surfaces inside each other the larger, if it is held
/// from all round. A shallow cap, whose normals point one way, is an overlap by chance.
std::vector<ContactRegion> overlap(const Pair& pair, const Prepared& a, const Prepared& b, int samples) {
  const Eigen::AlignedBox3d both = a.smooth.tree().box().intersection(b.smooth.tree().box());
  if (!a.closed || !b.closed || both.isEmpty() || both.volume() == 0.0) return {};
  BothSides sides = {inside_samples(a.smooth, b.smooth, samples), inside_samples(b.smooth, a.smooth, samples)};
  (area_of({sides.a, {}}) >= area_of({{}, sides.b}) ? sides.b : sides.a).clear();
  const auto& kept = sides.a.empty() ? sides.b : sides.a;
  if (kept.size() < tuning().contacts.sampling.fewest_samples) return {};
  Vec3 mean = Vec3::Zero();
  for (const NearSample& s : kept) mean += s.contact.normal / static_cast<double>(kept.size());
  if (mean.norm() > tuning().contacts.inside.one_way) return {};
  ContactRegion out = summarised(pair, sides);
  out.overlapping = true;
  return {std::move(out)};
}

/// [X09] 3.1.
std::vector<ContactRegion> hull_contact(const Pair& pair, const Parts& parts, const ContactRegionOptions& options) {
  const Prepared &a = *parts[static_cast<std::size_t>(pair.a)], &b = *parts[static_cast<std::size_t>(pair.b)];
  const double diagonal = std::min(a.diagonal, b.diagonal), growth = options.hull_growth * diagonal;
  BothSides sides = sample(a, b, options.search * diagonal, options.facing_cosine, options.samples);
  const auto outside = [&](const Prepared& other) {
    return [&other, growth](const NearSample& s) { return !other.pieces->hold(s.contact.point, growth); };
  };
  std::erase_if(sides.a, outside(b));
  std::erase_if(sides.b, outside(a));
  if (!tell_enough(sides)) return {};
  return {summarised(pair, sides)};
}

std::vector<ContactRegion> facing_contact(const Pair& pair, const Parts& parts, const ContactRegionOptions& options) {
  const Prepared &a = *parts[static_cast<std::size_t>(pair.a)], &b = *parts[static_cast<std::size_t>(pair.b)];
  const double diagonal = std::min(a.diagonal, b.diagonal), reach = options.search * diagonal;
  // A coarse look finds how wide the gap is; a fine one then spends its samples where the contact is.
  const ContactsTuning& t = tuning().contacts;
  const int coarse = static_cast<int>(
      std::max(t.sampling.coarse_fewest, static_cast<std::size_t>(options.samples) / t.sampling.coarse_divisor));
  BothSides sides = sample(a, b, reach, options.facing_cosine, coarse);
  if (sides.a.empty() && sides.b.empty()) return overlap(pair, a, b, coarse);
  const double fine_reach = std::min(reach, t.sampling.fine_reach * contact_cluster(sides, diagonal).reach());
  sides = contact_cluster(sample(a, b, fine_reach, options.facing_cosine, options.samples), diagonal).samples;
  drop_askew(sides);
  drop_hidden(pair, parts, sides);

  if (!tell_enough(sides)) return overlap(pair, a, b, coarse);
  quieten(sides);
  ContactRegion out = summarised(pair, sides);
  if (out.gap > options.largest_gap * out.extent) return {};
  return {std::move(out)};
}

}  // namespace

void ContactRegionOptions::validate() const {
  require(samples >= 100 && samples <= 100000, "samples", samples, "100 to 100000");
  require(facing_cosine >= -1.0 && facing_cosine <= 0.0, "facing_cosine", facing_cosine, "-1 to 0");
  require(crease_angle >= 0.0 && crease_angle <= std::numbers::pi, "crease_angle", crease_angle, "0 to pi");
  require(search > 0.0 && std::isfinite(search), "search", search, "more than 0");
  require(largest_gap > 0.0, "largest_gap", largest_gap, "more than 0");
  require(hull_growth > 0.0 && hull_growth <= search, "hull_growth", hull_growth, "more than 0, at most `search`");
  require(concavity > 0.0, "concavity", concavity, "more than 0");
}

std::vector<ContactRegion> find_contact_regions(const Assembly& assembly, const ContactRegionOptions& options,
                                                Jobs& jobs, const std::function<void(double)>& progress) {
  options.validate();
  Parts parts(assembly.components.size());
  const bool hulls = options.method == ContactSearch::kHulls;
  jobs.parallel_for(parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      parts[i] = std::make_unique<Prepared>(assembly.components[i], options.crease_angle);
      if (hulls) parts[i]->pieces.emplace(parts[i]->mesh, options.concavity * parts[i]->diagonal);
    }
  });
  const auto pairs = near_pairs(parts, options.search);
  std::vector<std::vector<ContactRegion>> found(pairs.size());
  internal::CountedProgress counted(pairs.size(), progress);
  jobs.parallel_for(pairs.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      found[i] = hulls ? hull_contact(pairs[i], parts, options) : facing_contact(pairs[i], parts, options);
      counted.done();
    }
  });
  std::vector<ContactRegion> out;
  for (auto& regions : found)
    for (auto& region : regions) out.push_back(std::move(region));
  return out;
}

}  // namespace limber
