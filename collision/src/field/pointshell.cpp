#include "field/pointshell.h"

#include <algorithm>
#include <cmath>
#include <variant>

#include "limber/core/disjoint_sets.h"
#include "limber/mesh/closest_point.h"
#include "tuning.h"

namespace limber::internal {
namespace {

constexpr std::size_t kLanes = kFieldLanes;

std::size_t rounded_up(std::size_t n, std::size_t to) { return (n + to - 1) / to * to; }

// Reorders things so that each run of eight is near together: split at the median along the longest side.
// @param place of a thing
template <class Place>
void group_by_eights(std::span<Index> things, const Place& place) {
  if (things.size() <= kLanes) return;
  Aabb box;
  for (const Index i : things) box.include(place(i));
  int axis = 0;
  (box.high - box.low).maxCoeff(&axis);
  const std::size_t eights = (things.size() + kLanes - 1) / kLanes, half = kLanes * ((eights + 1) / 2);
  if (half >= things.size()) return;
  std::nth_element(things.begin(), things.begin() + static_cast<std::ptrdiff_t>(half), things.end(),
                   [&](Index a, Index b) {
                     const double x = place(a)[axis], y = place(b)[axis];
                     return x != y ? x < y : a < b;
                   });
  group_by_eights(things.first(half), place);
  group_by_eights(things.subspan(half), place);
}

TrianglePoints rest_corners(const CollisionSurface& surface, Index t) {
  const Triangle& v = surface.triangle(t);
  return {surface.rest(v[0]), surface.rest(v[1]), surface.rest(v[2])};
}

}  // namespace

Pointshell::Pointshell(std::shared_ptr<const CollisionSurface> surface) : surface_(std::move(surface)) {
  make_distance(nullptr);
}

Pointshell::Pointshell(const RigidGeometry& geometry) : surface_(geometry.surface()) { make_distance(&geometry); }

void Pointshell::make_distance(const RigidGeometry* geometry) {
  const FieldTuning& tuning = collision_tuning().field;
  const Vec3 size = surface_->rest_bounds().high - surface_->rest_bounds().low;
  longest_side_ = size.maxCoeff();
  if (!surface_->closed() || surface_->skin() != nullptr) return;
  if (const Box* box = geometry ? std::get_if<Box>(&geometry->shape()) : nullptr) {
    half_extents_ = box->half_extents.cast<float>();
    cell_ = size.minCoeff() / 2;
    for (Index t = 0; t < surface_->triangles(); ++t) {
      int axis = 0;
      const Vec3 n = unit_normal(rest_corners(*surface_, t));
      n.cwiseAbs().maxCoeff(&axis);
      side_triangle_[static_cast<std::size_t>(2 * axis + (n[axis] < 0.0 ? 1 : 0))] = t;
    }
    resolved_ = true;
  } else {
    auto grid = std::make_unique<const SignedDistanceGrid>(*surface_);
    cell_ = grid->cell();
    resolved_ = resolved_area(*surface_, cell_) >= 1.0 - tuning.thin_area;
    if (resolved_) grid_ = std::move(grid);
  }
  if (!resolved_) return;
  if (modes() > 0) lattice_ = std::make_unique<const DisplacementLattice>(*surface_);
  order_samples();
  order_edges();
  lay_out();
  make_rows();
}

DistanceView Pointshell::distance() const {
  if (grid_) return grid_->view();
  DistanceView view;
  view.kind = DistanceView::Kind::kBox;
  for (int axis = 0; axis < 3; ++axis) view.size[axis] = half_extents_[axis];
  return view;
}

Index Pointshell::triangle_near(const FieldHit& hit) const {
  const Vec3f slope(hit.slope[0], hit.slope[1], hit.slope[2]);
  if (!grid_) {
    int axis = 0;
    slope.cwiseAbs().maxCoeff(&axis);
    return side_triangle_[static_cast<std::size_t>(2 * axis + (slope[axis] < 0.0f ? 1 : 0))];
  }
  const float steepness = slope.norm();
  const Vec3f rest(hit.rest[0], hit.rest[1], hit.rest[2]);
  return grid_->nearest_triangle(steepness > 0.0f ? Vec3f(rest - hit.distance / steepness * slope) : rest);
}

std::array<Index, 8> Pointshell::triangles_about(const FieldHit& hit) const {
  if (grid_) return grid_->triangles_about({hit.rest[0], hit.rest[1], hit.rest[2]});
  std::array<Index, 8> all;
  all.fill(triangle_near(hit));
  return all;
}

void Pointshell::order_samples() {
  for (Index v = 0; v < surface_->vertices(); ++v)
    if (!surface_->vertex_triangles(v).empty()) sample_vertex_.push_back(v);
  group_by_eights(std::span(sample_vertex_), [&](Index v) { return surface_->rest(v); });
  slot_.assign(static_cast<std::size_t>(surface_->vertices()), -1);
  for (std::size_t s = 0; s < sample_vertex_.size(); ++s)
    slot_[static_cast<std::size_t>(sample_vertex_[s])] =
        static_cast<std::int32_t>(s / kLanes * kClusterFloats + s % kLanes);
  for (Index t = 0; t < surface_->triangles(); ++t) {
    const Triangle& v = surface_->triangle(t);
    corner_slots_.push_back({slot_[static_cast<std::size_t>(v[0])], slot_[static_cast<std::size_t>(v[1])],
                             slot_[static_cast<std::size_t>(v[2])]});
  }
  sample_vertex_.resize(rounded_up(sample_vertex_.size(), kLanes), sample_vertex_.back());
}

// Edges that a common perpendicular with another body's edge may end on.
bool Pointshell::turns_outwards(Index e) const {
  const auto around = surface_->edge_triangles(e);
  if (around.empty()) return false;
  if (around.size() != 2) return true;
  const TrianglePoints x = rest_corners(*surface_, around[0]);
  const Vec3 n0 = unit_normal(x), n1 = unit_normal(rest_corners(*surface_, around[1]));
  const auto& ends = surface_->edge(e).vertices;
  for (const Index v : surface_->triangle(around[1]))
    if (v != ends[0] && v != ends[1])
      return n0.dot(surface_->rest(v) - x[0]) <= 0.0 && n0.cross(n1).norm() > collision_tuning().field.least_turn;
  return false;
}

void Pointshell::order_edges() {
  DisjointSets facets(static_cast<std::size_t>(surface_->triangles()));
  for (Index e = 0; e < surface_->edges(); ++e) {
    sticks_out_.push_back(turns_outwards(e));
    const auto around = surface_->edge_triangles(e);
    if (sticks_out_.back())
      edges_.push_back(e);
    else if (around.size() == 2)
      facets.join(around[0], around[1]);
  }
  facets_ = facets.labels();
  if (edges_.empty()) return;
  group_by_eights(std::span(edges_), [&](Index e) {
    const auto& ends = surface_->edge(e).vertices;
    return Vec3(0.5 * (surface_->rest(ends[0]) + surface_->rest(ends[1])));
  });
  edges_.resize(rounded_up(edges_.size(), kLanes), edges_.back());
  const auto sample_of = [this](Index v) {
    const std::int32_t at = slot_[static_cast<std::size_t>(v)];
    constexpr auto kFloats = static_cast<std::int32_t>(kClusterFloats), kEight = static_cast<std::int32_t>(kLanes);
    return at / kFloats * kEight + at % kFloats;
  };
  for (std::size_t i = 0; i < edges_.size(); i += kLanes)
    for (std::size_t end = 0; end < 2; ++end)
      for (std::size_t lane = 0; lane < kLanes; ++lane)
        edge_ends_.push_back(sample_of(surface_->edge(edges_[i + lane]).vertices[end]));
}

void Pointshell::lay_out() {
  const auto k = static_cast<std::size_t>(modes());
  const std::size_t nodes = lattice_ ? static_cast<std::size_t>(lattice_->nodes()) : 0;
  std::size_t row = sample_vertex_.size() / kLanes * kClusterFloats, radii = 0;
  const auto place = [&](Clusters& clusters, std::size_t things) {
    clusters.count = things / kLanes, clusters.groups = rounded_up(clusters.count, kLanes) / kLanes;
    clusters.centres = row, clusters.radii = radii;
    row += clusters.groups * kClusterFloats, radii += clusters.groups * kLanes;
  };
  place(sample_clusters_, sample_vertex_.size());
  place(edge_clusters_, edges_.size());
  lattice_rows_ = rounded_up(row, kRowTile);
  rows_ = rounded_up(lattice_rows_ + 3 * nodes, kRowTile), radii = rounded_up(radii, kRowTile);
  rest_ = AlignedArray<float>(rows_), U_ = AlignedArray<float>(rows_ * k);
  none_ = AlignedArray<float>(rounded_up(sample_clusters_.count * kClusterFloats, kRowTile));
  std::fill_n(none_.data(), none_.size(), 0.0f);
  radius_ = AlignedArray<float>(radii), spread_ = AlignedArray<float>(radii * k);
  std::fill_n(radius_.data(), radii, -std::numeric_limits<float>::infinity());
  largest_shape_.assign(k, 0.0f);
}

void Pointshell::set_row(std::size_t row, double rest, const std::vector<double>& u) {
  rest_[row] = static_cast<float>(rest);
  const auto k = static_cast<std::size_t>(modes());
  for (std::size_t m = 0; m < k; ++m)
    U_[(row / kRowTile * k + m) * kRowTile + row % kRowTile] = static_cast<float>(u[m]);
}

// The centre of a cluster is the mean of its vertices. Points of an edge are no farther from it than one of its ends.
void Pointshell::make_ball(const Clusters& of, std::size_t cluster, std::span<const Index> vertices) {
  const auto k = static_cast<std::size_t>(modes());
  const auto shape = [&](Index v, std::size_t axis, std::size_t m) {
    return static_cast<double>(surface_->row(v, static_cast<int>(axis))[m]);
  };
  Vec3 centre = Vec3::Zero();
  std::array<std::vector<double>, 3> mean{std::vector<double>(k), std::vector<double>(k), std::vector<double>(k)};
  for (const Index v : vertices) {
    centre += surface_->rest(v) / static_cast<double>(vertices.size());
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (std::size_t m = 0; m < k; ++m) mean[axis][m] += shape(v, axis, m) / static_cast<double>(vertices.size());
  }
  for (std::size_t axis = 0; axis < 3; ++axis)
    set_row(of.centres + cluster / kLanes * kClusterFloats + axis * kLanes + cluster % kLanes,
            centre[static_cast<int>(axis)], mean[axis]);
  const std::size_t row = of.radii + cluster;
  for (const Index v : vertices) {
    radius_[row] = std::max(radius_[row], static_cast<float>((surface_->rest(v) - centre).norm()));
    for (std::size_t m = 0; m < k; ++m) {
      const Vec3 u(shape(v, 0, m), shape(v, 1, m), shape(v, 2, m)),
          beside = u - Vec3(mean[0][m], mean[1][m], mean[2][m]);
      float& spread = spread_[(row / kRowTile * k + m) * kRowTile + row % kRowTile];
      spread = std::max(spread, static_cast<float>(beside.norm()));
      largest_shape_[m] = std::max(largest_shape_[m], static_cast<float>(u.norm()));
    }
  }
}

void Pointshell::make_rows() {
  const auto k = static_cast<std::size_t>(modes());
  std::vector<double> u(k);
  for (std::size_t s = 0; s < sample_vertex_.size(); ++s)
    for (int axis = 0; axis < 3; ++axis) {
      for (std::size_t m = 0; m < k; ++m) u[m] = static_cast<double>(surface_->row(sample_vertex_[s], axis)[m]);
      set_row(s / kLanes * kClusterFloats + static_cast<std::size_t>(axis) * kLanes + s % kLanes,
              surface_->rest(sample_vertex_[s])[axis], u);
    }
  for (std::size_t c = 0; c < sample_clusters_.count; ++c)
    make_ball(sample_clusters_, c, std::span(sample_vertex_).subspan(c * kLanes, kLanes));
  std::vector<Index> ends;
  for (std::size_t c = 0; c < edge_clusters_.count; ++c) {
    ends.clear();
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      for (const Index v : surface_->edge(edges_[c * kLanes + lane]).vertices) ends.push_back(v);
    make_ball(edge_clusters_, c, ends);
  }
  if (!lattice_) return;
  for (Index row = 0; row < 3 * lattice_->nodes(); ++row) {
    for (std::size_t m = 0; m < k; ++m) u[m] = static_cast<double>(lattice_->rows()(row, static_cast<Index>(m)));
    set_row(lattice_rows_ + static_cast<std::size_t>(row), 0.0, u);
  }
  for (const std::int32_t node : lattice_->place())
    lattice_place_.push_back(static_cast<std::int32_t>(lattice_rows_) + 3 * node);
}

std::size_t Pointshell::bytes() const {
  const auto of = [](const auto& v) { return v.size() * sizeof(v[0]); };
  return of(rest_) + of(U_) + of(radius_) + of(spread_) + of(sample_vertex_) + of(slot_) + of(corner_slots_) +
         of(edges_) + of(edge_ends_) + of(lattice_place_) + (grid_ ? grid_->bytes() : 0);
}

// -- In one state -----------------------------------------------------------------------------------------------------

DeformedPointshell::DeformedPointshell(std::shared_ptr<const Pointshell> shell) : shell_(std::move(shell)) {
  const Pointshell& s = *shell_;
  coordinates_ = s.rest_.data();
  if (s.modes() > 0) {
    own_ = AlignedArray<float>(s.rows_), swings_ = AlignedArray<float>(s.none_.size());
    radii_ = AlignedArray<float>(s.radius_.size());
    amplitudes_ = AlignedArray<float>(3 * static_cast<std::size_t>(s.modes()));
    coordinates_ = own_.data();
    std::copy_n(s.rest_.data(), s.rows_, own_.data());
    std::copy_n(s.radius_.data(), s.radius_.size(), radii_.data());
    space_ = AlignedArray<float>(3 * s.lattice_place_.size() + 1);
    std::fill_n(space_.data(), space_.size(), 0.0f);
  }
  find_extent();
}

void DeformedPointshell::set_amplitudes(std::span<const double> z, std::span<const double> end) {
  swings_about_ = false, largest_swing_ = 0.0f;
  for (std::size_t m = 0; m < z.size(); ++m) {
    amplitudes_[m] = static_cast<float>(z[m]);
    amplitudes_[z.size() + m] = std::abs(amplitudes_[m]);
    amplitudes_[2 * z.size() + m] = end.empty() ? 0.0f : static_cast<float>(end[m] - z[m]);
    swings_about_ = swings_about_ || amplitudes_[2 * z.size() + m] != 0.0f;
  }
}

void DeformedPointshell::restore(std::span<const double> z) {
  set_amplitudes(z);
  DeformedPointshell* const self = this;
  deform_together({&self, 1});
}

ShellView DeformedPointshell::view() const {
  const Pointshell& s = *shell_;
  const float* radii = s.modes() > 0 ? radii_.data() : s.radius_.data();
  const auto clusters = [&](const Pointshell::Clusters& of) {
    return ClusterView{coordinates_ + of.centres, radii + of.radii, of.groups};
  };
  return {coordinates_,
          swings_about_ ? swings_.data() : nullptr,
          s.sample_clusters_.count,
          clusters(s.sample_clusters_),
          clusters(s.edge_clusters_),
          s.edge_ends_.data()};
}

LatticeView DeformedPointshell::lattice() const {
  const Pointshell& s = *shell_;
  if (!carries_back_) return {};
  const bool once = static_cast<double>(flex_) <= collision_tuning().field.carried_once * s.longest_side_;
  return {s.lattice_->grid(), space_.data(), once ? 1 : 2};
}

// A vertex stays within its cluster's ball, and within flex of where it is at rest.
void DeformedPointshell::find_extent() {
  const Pointshell& s = *shell_;
  box_of_clusters(view().samples, low_.data(), high_.data());
  flex_ = 0.0f;
  for (std::size_t m = 0; m < s.largest_shape_.size(); ++m)
    flex_ += amplitudes_[s.largest_shape_.size() + m] * s.largest_shape_[m];
  const Vec3f beside = Vec3f::Constant(flex_);
  low_ = low_.cwiseMax(s.surface_->rest_bounds().low.cast<float>() - beside);
  high_ = high_.cwiseMin(s.surface_->rest_bounds().high.cast<float>() + beside);
  carries_back_ = s.lattice_ && static_cast<double>(flex_) > collision_tuning().field.carried_from * s.cell_;
}

// @pre carries_back_
void DeformedPointshell::find_flex() {
  float* u = space_.data();
  for (const std::int32_t at : shell_->lattice_place_) {
    // copy_n() calls memmove() for these twelve bytes.
    for (int axis = 0; axis < 3; ++axis) u[axis] = coordinates_[at + axis];
    u += 3;
  }
  float largest[3];
  largest_magnitudes(coordinates_ + shell_->lattice_rows_, static_cast<std::size_t>(shell_->lattice_->nodes()),
                     largest);
  flex_ = std::min(flex_, std::hypot(largest[0], largest[1], largest[2]));
  carries_back_ = static_cast<double>(flex_) > collision_tuning().field.carried_from * shell_->cell_;
}

// @param bodies of one shell, kBodiesAtOnce at most
void DeformedPointshell::deform_together(std::span<DeformedPointshell* const> bodies) {
  const Pointshell& s = bodies.front()->shell();
  const auto k = static_cast<std::size_t>(s.modes());
  if (k == 0) return;
  const float *z[kBodiesAtOnce] = {}, *magnitudes[kBodiesAtOnce] = {};
  float *x[kBodiesAtOnce] = {}, *radii[kBodiesAtOnce] = {};
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    z[b] = bodies[b]->amplitudes_.data(), magnitudes[b] = z[b] + k;
    x[b] = bodies[b]->own_.data(), radii[b] = bodies[b]->radii_.data();
  }
  const std::size_t first = s.lattice_rows_;
  for (DeformedPointshell* body : bodies) std::copy_n(body->own_.data(), s.none_.size(), body->swings_.data());
  multiply_rows(s.rest_.data(), s.U_.data(), first / kRowTile, k, z, x, bodies.size());
  multiply_rows(s.radius_.data(), s.spread_.data(), s.radius_.size() / kRowTile, k, magnitudes, radii, bodies.size());
  const std::size_t clusters = s.sample_clusters_.count;
  for (DeformedPointshell* body : bodies)
    body->last_bend_ = largest_distance(body->own_.data(), body->swings_.data(), clusters);
  std::size_t swinging = 0;
  const float* changes[kBodiesAtOnce] = {};
  float* swings[kBodiesAtOnce] = {};
  for (DeformedPointshell* body : bodies)
    if (body->swings_about_)
      changes[swinging] = body->amplitudes_.data() + 2 * k, swings[swinging++] = body->swings_.data();
  multiply_rows(s.none_.data(), s.U_.data(), s.none_.size() / kRowTile, k, changes, swings, swinging);
  for (DeformedPointshell* body : bodies)
    if (body->swings_about_) body->largest_swing_ = largest_distance(body->swings_.data(), s.none_.data(), clusters);
  // Displacements of the space about a body are for those that are bent by enough.
  std::size_t bent = 0;
  for (DeformedPointshell* body : bodies) {
    body->find_extent();
    if (body->carries_back_) z[bent] = body->amplitudes_.data(), x[bent++] = body->own_.data() + first;
  }
  if (bent == 0) return;
  multiply_rows(s.rest_.data() + first, s.U_.data() + first * k, (s.rows_ - first) / kRowTile, k, z, x, bent);
  for (DeformedPointshell* body : bodies)
    if (body->carries_back_) body->find_flex();
}

void deform(std::span<DeformedPointshell* const> bodies, Jobs& jobs) {
  // Numbers of a body are the same whichever others are computed with it, so that any cut will do.
  jobs.parallel_for(bodies.size(), 4 * kBodiesAtOnce, [&](std::size_t begin, std::size_t end) {
    for (std::size_t first = begin, last; first < end; first = last) {
      for (last = first + 1; last < end && last < first + kBodiesAtOnce; ++last)
        if (&bodies[last]->shell() != &bodies[first]->shell()) break;
      DeformedPointshell::deform_together(bodies.subspan(first, last - first));
    }
  });
}

}  // namespace limber::internal
