#include "contacts/near_samples.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <utility>

#include "constants.h"
#include "tuning.h"

namespace limber::internal {
namespace {

/// A part of a triangle.
struct Piece {
  double radius;  ///< about its centre
  Index triangle;
  std::array<Vec3, 3> corner;  ///< barycentric
  double distance;             ///< the nearest place that counts is no further from the centre

  Vec3 centre() const { return (corner[0] + corner[1] + corner[2]) / 3.0; }
  /// Share of the whole triangle's area.
  double share() const {
    Mat3 m;
    m << corner[0], corner[1], corner[2];
    return std::abs(m.determinant());
  }
};

/// The two halves across the longest edge; of edges of one length across the first.
std::array<Piece, 2> halves(const SmoothSurface& surface, const Piece& piece) {
  std::size_t longest = 0;
  double most = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double length =
        (surface.point(piece.triangle, piece.corner[k]) - surface.point(piece.triangle, piece.corner[(k + 1) % 3]))
            .squaredNorm();
    if (length > (1.0 + tuning().contacts.sampling.same_length) * most) most = length, longest = k;
  }
  const std::size_t next = (longest + 1) % 3;
  const Vec3 middle = 0.5 * (piece.corner[longest] + piece.corner[next]);
  std::array<Piece, 2> out = {piece, piece};
  out[0].corner[longest] = middle;
  out[1].corner[next] = middle;
  return out;
}

/// Cuts a surface down to what may matter: halves triangles, the largest first, and drops pieces on the way.
class NearPart {
 public:
  /// The distance from this point of this triangle to some place, of those that count, within a limit, if there is one.
  using SomePlace = std::function<std::optional<double>(Index triangle, const Vec3& from, double limit)>;

  /// @param reach what matters has a place that counts within this distance
  NearPart(const SmoothSurface& surface, double reach, SomePlace some_place)
      : surface_(surface), reach_(reach), some_place_(std::move(some_place)) {}

  /// Pieces in the order of their triangles, until most of their area matters or there are `most`. @param box around
  /// all that matters
  std::vector<Piece> pieces(const Eigen::AlignedBox3d& box, std::size_t most) {
    for (std::size_t t = 0; t < surface_.mesh().triangles.size(); ++t) {
      Eigen::AlignedBox3d own;
      for (const Index v : surface_.mesh().triangles[t])
        own.extend(surface_.mesh().vertices[static_cast<std::size_t>(v)]);
      if (!box.intersects(own)) continue;
      push(Piece{0.0, static_cast<Index>(t), {Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ()}, kUnknown});
    }
    for (std::size_t next_look = tuning().contacts.sampling.first_look; !heap_.empty() && heap_.size() < most;) {
      if (heap_.size() >= next_look) {
        if (mostly_matters()) break;
        next_look = 2 * heap_.size();
      }
      if (!halve_largest(most)) break;
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

  /// True if a place that counts lies within a limit of the piece's centre. Mostly the bound on the distance tells.
  bool lies_within(Piece& piece, const Vec3& centre, double limit) const {
    if (piece.distance <= limit) return true;
    const std::optional<double> found = some_place_(piece.triangle, centre, limit);
    if (found) piece.distance = *found;
    return found.has_value();
  }

  /// True if smaller pieces would leave out little more: the centres of most matter themselves.
  bool mostly_matters() {
    double all = 0.0, matters = 0.0;
    for (const auto& [radius, number] : heap_) {
      Piece& p = pieces_[number];
      const double area = p.share() * surface_.area(p.triangle);
      all += area;
      if (lies_within(p, surface_.point(p.triangle, p.centre()), reach_)) matters += area;
    }
    return matters >= tuning().contacts.sampling.matters * all;
  }

  /// Halves all that are as large as the largest, so that it does not matter which of them comes first.
  /// @return whether it did: not if there were many more than `most` then
  bool halve_largest(std::size_t most) {
    const double least = (1.0 - tuning().contacts.sampling.same_length) * heap_.front().first;
    std::vector<std::size_t> largest;
    auto left = heap_.end();
    for (; left != heap_.begin() && heap_.front().first >= least; --left) {
      largest.push_back(heap_.front().second);
      std::pop_heap(heap_.begin(), left);
    }
    if (heap_.size() + largest.size() > most + most / tuning().contacts.sampling.surplus_pieces) return false;
    heap_.erase(left, heap_.end());
    for (const std::size_t number : largest) halve(Piece(pieces_[number]));
    return true;
  }

  void halve(const Piece& piece) {
    const Vec3 centre = surface_.point(piece.triangle, piece.centre());
    for (Piece half : halves(surface_, piece)) {
      half.distance += (surface_.point(half.triangle, half.centre()) - centre).norm();
      push(half);
    }
  }

  const SmoothSurface& surface_;
  double reach_;
  SomePlace some_place_;
  std::vector<Piece> pieces_;                         ///< all there were
  std::vector<std::pair<double, std::size_t>> heap_;  ///< radius and number in pieces_, the largest first
};

/// The i-th of the R2 sequence, which fills the unit square evenly.
Eigen::Vector2d even_point(std::size_t i) {
  const double x = 0.5 + kEvenFirst * static_cast<double>(i + 1), y = 0.5 + kEvenSecond * static_cast<double>(i + 1);
  return {x - std::floor(x), y - std::floor(y)};
}

Vec3 even_barycentric(const Piece& piece, std::size_t i) {
  Eigen::Vector2d u = even_point(i);
  if (u.sum() > 1.0) u = Eigen::Vector2d::Ones() - u;
  return piece.corner[0] + u[0] * (piece.corner[1] - piece.corner[0]) + u[1] * (piece.corner[2] - piece.corner[0]);
}

/// True if the way from a point to the nearest one of the other surface leads along a normal rather than along the
/// surface. Faces side by side in one plane, which meet at an edge, do not face each other.
/// @param shortest a shorter way has no direction
bool leads_across(const Vec3& way, double shortest, const Vec3& normal, const Vec3& facing_facet) {
  const double distance = way.norm();
  return distance <= shortest || std::max(std::abs(way.dot(normal)), std::abs(way.dot(facing_facet))) >=
                                     tuning().contacts.sampling.across * distance;
}

/// Calls use(triangle, barycentric, area) for the centres of 2^levels equal parts of a piece.
template <class Use>
void use_parts(const SmoothSurface& surface, const Piece& piece, int levels, double area, Use&& use) {
  if (levels == 0) return use(piece.triangle, piece.centre(), area);
  for (const Piece& half : halves(surface, piece)) use_parts(surface, half, levels - 1, 0.5 * area, use);
}

/// Points at equal distances along a row of areas.
struct Row {
  double step;
  double covered = 0.0;
  std::size_t points = 0;

  /// How many points fall on the next area. On the end of one they count with the next, whatever the round-off.
  std::size_t next(double area) {
    const std::size_t before = points;
    for (covered += area;
         (static_cast<double>(points) + 0.5 + tuning().contacts.sampling.same_length) * step < covered;)
      ++points;
    return points - before;
  }
};

/// Calls use(triangle, barycentric, area) for about `wanted` points spread evenly over the pieces' area. Triangles of
/// one shape get the same points whatever their pose and order, so that what is symmetric is sampled symmetrically and
/// the errors of interpolated normals cancel as they do over the whole surface: the points of a piece are the centres
/// of equal parts of it, and pieces of less area than a point's share points with those of their triangle. Only
/// triangles that are smaller still share with each other.
/// @param pieces by triangle
template <class Use>
void spread_evenly(const SmoothSurface& surface, const std::vector<Piece>& pieces, int wanted, Use&& use) {
  const ContactsTuning& t = tuning().contacts;
  double total = 0.0;
  std::vector<double> area;
  for (const Piece& p : pieces) area.push_back(p.share() * surface.area(p.triangle)), total += area.back();
  const double step = total / wanted;
  Row of_all{step};
  for (std::size_t begin = 0, end = 0; begin < pieces.size(); begin = end) {
    const Index triangle = pieces[begin].triangle;
    double whole = 0.0, small = 0.0;
    std::vector<std::size_t> sharing;
    for (; end < pieces.size() && pieces[end].triangle == triangle; ++end) {
      whole += area[end];
      if (const double levels = std::round(std::log2(area[end] / step)); levels >= 0.0)
        use_parts(surface, pieces[end], static_cast<int>(levels), area[end], use);
      else
        sharing.push_back(end), small += area[end];
    }
    const double points =
        std::max(std::round(small / step - t.sampling.same_length), whole < t.sampling.own_point * step ? 0.0 : 1.0);
    Row of_triangle{small / points};
    for (const std::size_t p : sharing)
      if (points > 0.0) {
        if (of_triangle.next(area[p]) > 0) use(triangle, pieces[p].centre(), of_triangle.step);
      } else {
        for (std::size_t n = of_all.next(area[p]); n > 0; --n)
          use(triangle, even_barycentric(pieces[p], of_all.points - n), step);
      }
  }
}

/// Neighbouring samples of one facet as one.
struct Cell {
  Vec3 facet_normal;
  // Sums by area.
  Vec3 facing_normal = Vec3::Zero(), point = Vec3::Zero(), facing_point = Vec3::Zero();
  double area = 0.0;

  void add(const NearSample& s) {
    facing_normal += s.contact.area * s.facing_facet;
    point += s.contact.area * s.contact.point;
    facing_point += s.contact.area * s.contact.facing_point;
    area += s.contact.area;
  }
};

/// Each facet is cut alike, wherever it stands in the order of the samples. Some cells of a fine mesh stand for all.
/// @param wanted cells, about; up to twice as many come back
std::vector<Cell> cells_of(const std::vector<NearSample>& samples, std::size_t wanted) {
  const std::size_t largest = 1 + samples.size() / wanted;  // samples
  std::vector<Cell> all, out;
  std::size_t count = 0;
  for (const NearSample& s : samples) {
    if (all.empty() || count == largest || all.back().facet_normal != s.contact.facet_normal)
      all.push_back({s.contact.facet_normal}), count = 0;
    all.back().add(s);
    ++count;
  }
  const std::size_t stride = 1 + all.size() / (2 * wanted);
  for (std::size_t i = 0; i < all.size(); i += stride) out.push_back(all[i]);
  return out;
}

/// Puts in place of a sample the mean of the cells around it, with weights that fall to 0 at the rim: there it does not
/// matter which of several that are equally far count.
/// @param squared distances of the cells. @param rim squared radius
void average(NearSample& sample, const std::vector<Cell>& cells, const std::vector<double>& squared, double rim) {
  Cell mean{Vec3::Zero()};
  for (std::size_t j = 0; j < cells.size(); ++j) {
    const Cell& cell = cells[j];
    if (squared[j] >= rim || cell.facet_normal.dot(sample.contact.normal) < tuning().contacts.rough.same_side) continue;
    const double weight = 1.0 - squared[j] / rim;
    mean.facet_normal += weight * cell.area * cell.facet_normal;
    mean.facing_normal += weight * cell.facing_normal;
    mean.point += weight * cell.point;
    mean.facing_point += weight * cell.facing_point;
    mean.area += weight * cell.area;
  }
  if (!(mean.area > 0.0)) return;
  sample.contact.normal = mean.facet_normal.normalized();
  sample.contact.facing_normal = mean.facing_normal.normalized();
  sample.contact.point = mean.point / mean.area;
  sample.contact.facing_point = mean.facing_point / mean.area;
}

}  // namespace

void average_patches(std::vector<NearSample>& samples) {
  const ContactsTuning& t = tuning().contacts;
  if (samples.empty()) return;
  const std::vector<Cell> cells = cells_of(samples, t.rough.cells);
  const std::size_t wanted =
      std::min(std::max(t.rough.fewest_in_patch, cells.size() / t.rough.patches), cells.size() - 1);
  std::vector<Vec3> centres;
  centres.reserve(cells.size());
  for (const Cell& cell : cells) centres.push_back(cell.point / cell.area);
  std::vector<double> squared(cells.size()), sorted;
  for (NearSample& s : samples) {
    for (std::size_t j = 0; j < cells.size(); ++j) squared[j] = (centres[j] - s.contact.point).squaredNorm();
    sorted = squared;
    std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(wanted), sorted.end());
    average(s, cells, squared, sorted[wanted]);
  }
}

std::vector<NearSample> near_samples(const SmoothSurface& surface, const SmoothSurface& other, double reach,
                                     double facing_cosine, int wanted) {
  const ContactsTuning& t = tuning().contacts;
  const auto facing_place = [&](Index triangle, const Vec3& from, double limit) {
    return other.tree().some_within(from, limit, surface.tree().normal(triangle), t.sampling.loose_facing);
  };
  Eigen::AlignedBox3d box = other.tree().box();
  box.min().array() -= reach;
  box.max().array() += reach;
  const auto pieces = NearPart(surface, reach, facing_place).pieces(box, static_cast<std::size_t>(wanted));

  std::vector<NearSample> out;
  spread_evenly(surface, pieces, wanted, [&](Index triangle, const Vec3& barycentric, double area) {
    const Vec3 point = surface.point(triangle, barycentric), normal = surface.normal(triangle, barycentric);
    const auto facing = other.tree().nearest(point, reach, normal, t.sampling.facet_facing);
    if (!facing.found()) return;
    if (!leads_across(point - facing.point, t.sampling.shortest_way * reach, normal,
                      other.tree().normal(facing.triangle)))
      return;
    const Vec3 facing_normal = other.normal(facing.triangle, facing.barycentric);
    if (normal.dot(facing_normal) > facing_cosine) return;
    out.push_back({{point, normal, facing.point, facing_normal, area, (point - facing.point).dot(facing_normal), point,
                    surface.tree().normal(triangle)},
                   other.tree().normal(facing.triangle),
                   facing.distance,
                   std::max(surface.chord_error(triangle), other.chord_error(facing.triangle))});
  });
  return out;
}

std::vector<NearSample> inside_samples(const SmoothSurface& surface, const SmoothSurface& solid, int wanted) {
  const Eigen::AlignedBox3d& box = solid.tree().box();
  const auto box_within = [&](Index, const Vec3& from, double limit) -> std::optional<double> {
    const double distance = box.exteriorDistance(from);
    return distance <= limit ? std::optional(distance) : std::nullopt;
  };
  const auto pieces = NearPart(surface, 0.0, box_within).pieces(box, static_cast<std::size_t>(wanted));
  std::vector<NearSample> out;
  spread_evenly(surface, pieces, wanted, [&](Index triangle, const Vec3& barycentric, double area) {
    const Vec3 point = surface.point(triangle, barycentric), normal = surface.normal(triangle, barycentric);
    const Vec3& facet = surface.tree().normal(triangle);
    if (solid.tree().winding(point) > 0)
      out.push_back(
          {{point, normal, point, -normal, area, 0.0, point, facet}, -facet, 0.0, surface.chord_error(triangle)});
  });
  return out;
}

}  // namespace limber::internal
