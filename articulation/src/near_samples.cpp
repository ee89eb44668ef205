#include "near_samples.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <utility>

namespace limber {
namespace {

/// A part of a triangle.
struct Piece {
  double radius;  ///< about its centre
  Index triangle;
  std::array<Vec3, 3> corner;  ///< barycentric
  double distance;             ///< the nearest place that counts is no further from the centre

  Vec3 centre() const { return (corner[0] + corner[1] + corner[2]) / 3.0; }
  /// Of the whole triangle's area.
  double share() const {
    Mat3 m;
    m << corner[0], corner[1], corner[2];
    return std::abs(m.determinant());
  }
};

/// Cuts a surface down to what may matter: halves triangles, the largest first, and drops pieces on the way.
class NearPart {
 public:
  /// The distance from this point of this triangle to some place, of those that count, within a limit, if there is one.
  using SomePlace = std::function<std::optional<double>(Index triangle, const Vec3& from, double limit)>;

  /// @param reach what matters has a place that counts within this distance
  NearPart(const SmoothSurface& surface, double reach, SomePlace some_place)
      : surface_(surface), reach_(reach), some_place_(std::move(some_place)) {}

  /// Pieces in the order of their triangles, until most of their area matters, there are `most`, or the largest has the
  /// radius `finest`. @param box what matters lies in it
  std::vector<Piece> pieces(const Eigen::AlignedBox3d& box, std::size_t most, double finest) {
    for (std::size_t t = 0; t < surface_.mesh().triangles.size(); ++t) {
      Eigen::AlignedBox3d own;
      for (const Index v : surface_.mesh().triangles[t])
        own.extend(surface_.mesh().vertices[static_cast<std::size_t>(v)]);
      if (!box.intersects(own)) continue;
      push(Piece{0.0, static_cast<Index>(t), {Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ()}, kUnknown});
    }
    constexpr std::size_t kFirstLook = 512;
    for (std::size_t next_look = kFirstLook; !heap_.empty() && heap_.size() < most && heap_.front().first > finest;) {
      if (heap_.size() >= next_look) {
        if (mostly_matters()) break;
        next_look = 2 * heap_.size();
      }
      std::pop_heap(heap_.begin(), heap_.end());
      const std::size_t largest = heap_.back().second;
      heap_.pop_back();
      halve(Piece(pieces_[largest]));
    }
    std::vector<Piece> out;
    out.reserve(heap_.size());
    for (const auto& [radius, number] : heap_) out.push_back(pieces_[number]);
    std::sort(out.begin(), out.end(), [](const Piece& a, const Piece& b) {
      if (a.triangle != b.triangle) return a.triangle < b.triangle;
      const Vec3 x = a.centre(), y = b.centre();
      return std::lexicographical_compare(x.begin(), x.end(), y.begin(), y.end());
    });
    return out;
  }

 private:
  static constexpr double kUnknown = std::numeric_limits<double>::infinity();

  /// @param piece `distance` bounds that from its centre
  void push(Piece piece) {
    const Vec3 centre = surface_.point(piece.triangle, piece.centre());
    piece.radius = 0.0;
    for (const Vec3& c : piece.corner)
      piece.radius = std::max(piece.radius, (surface_.point(piece.triangle, c) - centre).norm());
    if (!lies_within(piece, centre, reach_ + piece.radius)) return;
    heap_.emplace_back(piece.radius, pieces_.size());
    std::push_heap(heap_.begin(), heap_.end());
    pieces_.push_back(piece);
  }

  /// Whether a place that counts lies within a limit of the piece's centre. Mostly the bound on the distance tells.
  bool lies_within(Piece& piece, const Vec3& centre, double limit) const {
    if (piece.distance <= limit) return true;
    const std::optional<double> found = some_place_(piece.triangle, centre, limit);
    if (found) piece.distance = *found;
    return found.has_value();
  }

  /// Whether smaller pieces would leave out little more: the centres of most matter themselves.
  bool mostly_matters() {
    constexpr double kMost = 0.8;
    double all = 0.0, matters = 0.0;
    for (const auto& [radius, number] : heap_) {
      Piece& p = pieces_[number];
      const double area = p.share() * surface_.area(p.triangle);
      all += area;
      if (lies_within(p, surface_.point(p.triangle, p.centre()), reach_)) matters += area;
    }
    return matters >= kMost * all;
  }

  void halve(const Piece& piece) {
    std::size_t longest = 0;
    double most = -1.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double length =
          (surface_.point(piece.triangle, piece.corner[k]) - surface_.point(piece.triangle, piece.corner[(k + 1) % 3]))
              .squaredNorm();
      if (length > most) most = length, longest = k;
    }
    const std::size_t next = (longest + 1) % 3;
    const Vec3 middle = 0.5 * (piece.corner[longest] + piece.corner[next]);
    for (const std::size_t replaced : {longest, next}) {
      Piece half = piece;
      half.corner[replaced] = middle;
      half.distance +=
          (surface_.point(piece.triangle, half.centre()) - surface_.point(piece.triangle, piece.centre())).norm();
      push(half);
    }
  }

  const SmoothSurface& surface_;
  double reach_;
  SomePlace some_place_;
  std::vector<Piece> pieces_;                         ///< all there were
  std::vector<std::pair<double, std::size_t>> heap_;  ///< radius and number in pieces_, the largest first
};

/// The i-th of a sequence that fills the unit square evenly (the plastic number's powers; Roberts 2018).
Eigen::Vector2d even_point(std::size_t i) {
  constexpr double kA = 0.7548776662466927, kB = 0.5698402909980532;
  const double x = 0.5 + kA * static_cast<double>(i + 1), y = 0.5 + kB * static_cast<double>(i + 1);
  return {x - std::floor(x), y - std::floor(y)};
}

Vec3 even_barycentric(const Piece& piece, std::size_t i) {
  Eigen::Vector2d u = even_point(i);
  if (u.sum() > 1.0) u = Eigen::Vector2d::Ones() - u;
  return piece.corner[0] + u[0] * (piece.corner[1] - piece.corner[0]) + u[1] * (piece.corner[2] - piece.corner[0]);
}

/// Whether the way from a point to the nearest one of the other surface leads along a normal rather than along the
/// surface. Faces side by side in one plane, which meet at an edge, do not face each other.
/// @param nothing a way so short that it has no direction
bool leads_across(const Vec3& way, double nothing, const Vec3& normal, const Vec3& facing_facet) {
  constexpr double kAcross = 0.4;  // cosine: 66 degrees, as far beside the rim as a gap may vary (2.5)
  const double distance = way.norm();
  return distance <= nothing ||
         std::max(std::abs(way.dot(normal)), std::abs(way.dot(facing_facet))) >= kAcross * distance;
}

/// Calls use(piece, barycentric, area) for `wanted` points spread evenly over the pieces' area.
template <class Use>
void spread_evenly(const SmoothSurface& surface, const std::vector<Piece>& pieces, int wanted, Use&& use) {
  double total = 0.0;
  std::vector<double> area;
  for (const Piece& p : pieces) area.push_back(p.share() * surface.area(p.triangle)), total += area.back();
  const double step = total / wanted;
  double covered = 0.0;
  std::size_t i = 0;
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    covered += area[p];
    for (; (static_cast<double>(i) + 0.5) * step < covered && i < static_cast<std::size_t>(wanted); ++i)
      use(pieces[p], even_barycentric(pieces[p], i), step);
  }
}

/// The nearest of every stride-th sample.
std::vector<std::size_t> neighbours(const std::vector<NearSample>& samples, const Vec3& p, std::size_t stride,
                                    std::size_t wanted) {
  std::vector<std::pair<double, std::size_t>> all;
  for (std::size_t j = 0; j < samples.size(); j += stride)
    all.emplace_back((samples[j].contact.point - p).squaredNorm(), j);
  wanted = std::min(wanted, all.size());
  std::nth_element(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(wanted - 1), all.end());
  std::vector<std::size_t> out;
  for (std::size_t k = 0; k < wanted; ++k) out.push_back(all[k].second);
  return out;
}

}  // namespace

void average_patches(std::vector<NearSample>& samples) {
  constexpr std::size_t kCandidates = 800, kPatches = 20;  // a patch is a twentieth of the contact
  const std::size_t stride = 1 + samples.size() / kCandidates;
  const std::size_t wanted = std::max<std::size_t>(6, samples.size() / stride / kPatches);
  constexpr double kSameSide = 0.5;  // cosine; what bends more is another face
  std::vector<NearSample> out;
  for (const NearSample& s : samples) {
    NearSample mean = s;
    Vec3 own = s.contact.facet_normal, facing = s.facing_facet;
    double count = 1.0;
    for (const std::size_t j : neighbours(samples, s.contact.point, stride, wanted)) {
      const NearSample& other = samples[j];
      if (other.contact.facet_normal.dot(s.contact.normal) < kSameSide) continue;
      own += other.contact.facet_normal;
      facing += other.facing_facet;
      mean.contact.point += other.contact.point;
      mean.contact.facing_point += other.contact.facing_point;
      count += 1.0;
    }
    mean.contact.normal = own.normalized();
    mean.contact.facing_normal = facing.normalized();
    mean.contact.point /= count;
    mean.contact.facing_point /= count;
    out.push_back(mean);
  }
  samples = std::move(out);
}

std::vector<NearSample> near_samples(const SmoothSurface& surface, const SmoothSurface& other, double reach,
                                     double facing_cosine, int wanted) {
  const auto facing_place = [&](Index triangle, const Vec3& from, double limit) {
    constexpr double kLooseFacing = -0.5;  // of facets; the smooth normals decide later
    return other.tree().some_within(from, limit, surface.tree().normal(triangle), kLooseFacing);
  };
  Eigen::AlignedBox3d box = other.tree().box();
  box.min().array() -= reach;
  box.max().array() += reach;
  const auto pieces =
      NearPart(surface, reach, facing_place).pieces(box, static_cast<std::size_t>(wanted), 0.25 * reach);

  std::vector<NearSample> out;
  spread_evenly(surface, pieces, wanted, [&](const Piece& piece, const Vec3& barycentric, double area) {
    const Vec3 point = surface.point(piece.triangle, barycentric), normal = surface.normal(piece.triangle, barycentric);
    constexpr double kFacetFacing = -0.6;  // facets may bend from the smooth normals by half a segment on each side
    const auto facing = other.tree().nearest(point, reach, normal, kFacetFacing);
    if (!facing.found()) return;
    constexpr double kNothing = 1e-6;
    if (!leads_across(point - facing.point, kNothing * reach, normal, other.tree().normal(facing.triangle))) return;
    const Vec3 facing_normal = other.normal(facing.triangle, facing.barycentric);
    if (normal.dot(facing_normal) > facing_cosine) return;
    out.push_back({{point, normal, facing.point, facing_normal, area, (point - facing.point).dot(facing_normal), point,
                    surface.tree().normal(piece.triangle)},
                   other.tree().normal(facing.triangle),
                   facing.distance,
                   std::max(surface.chord_error(piece.triangle), other.chord_error(facing.triangle))});
  });
  return out;
}

std::vector<NearSample> inside_samples(const SmoothSurface& surface, const SmoothSurface& solid, int wanted) {
  const Eigen::AlignedBox3d& box = solid.tree().box();
  const auto box_within = [&](Index, const Vec3& from, double limit) -> std::optional<double> {
    const double distance = box.exteriorDistance(from);
    return distance <= limit ? std::optional(distance) : std::nullopt;
  };
  const auto pieces = NearPart(surface, 0.0, box_within).pieces(box, static_cast<std::size_t>(wanted), 0.0);
  std::vector<NearSample> out;
  spread_evenly(surface, pieces, wanted, [&](const Piece& piece, const Vec3& barycentric, double area) {
    const Vec3 point = surface.point(piece.triangle, barycentric), normal = surface.normal(piece.triangle, barycentric);
    const Vec3& facet = surface.tree().normal(piece.triangle);
    if (solid.tree().winding(point) > 0)
      out.push_back(
          {{point, normal, point, -normal, area, 0.0, point, facet}, -facet, 0.0, surface.chord_error(piece.triangle)});
  });
  return out;
}

}  // namespace limber
