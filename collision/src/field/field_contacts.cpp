#include "field/field_contacts.h"

#include <algorithm>
#include <cmath>
#include <variant>

#include "field/parting_plane.h"
#include "limber/core/quaternion.h"

namespace limber::internal {
namespace {

bool is_half_space(const FieldBody& body) {
  return body.geometry != nullptr && std::holds_alternative<HalfSpace>(body.geometry->shape());
}

// A ball is a capsule of no length.
bool capsule_of(const FieldBody& body, Capsule& capsule) {
  if (body.geometry == nullptr) return false;
  if (const auto* ball = std::get_if<Sphere>(&body.geometry->shape())) {
    capsule = {.radius = ball->radius, .half_length = 0.0};
    return true;
  }
  const auto* shape = std::get_if<Capsule>(&body.geometry->shape());
  if (shape != nullptr) capsule = *shape;
  return shape != nullptr;
}

double longest_side(const FieldBody& body) {
  if (body.shell != nullptr) return body.shell->shell().longest_side();
  return (body.geometry->bounds().high - body.geometry->bounds().low).maxCoeff();
}

void set_frame(FieldQuery& query, const Eigen::Matrix3f& R, const Vec3f& p) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) query.R[i][j] = R(i, j);
    query.p[i] = p[i];
  }
}

// What turns by θ about a point at a distance r strays by r (1 − cos θ/2) from its chord; points are up to |p| from the
// origin of the field's frame, and as far as their box's corners from their own. |R' − R| = √8 sin θ/2.
// @param R_FS that of X_FS
void set_motion(FieldQuery& query, const RigidTransform& X_FS, const Mat3& R_FS, const RigidTransform& end,
                const DeformedPointshell& me) {
  const Mat3 turn = to_matrix(end.q) - R_FS;
  const Vec3 shift = end.p - X_FS.p;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) query.turn[i][j] = static_cast<float>(turn(i, j));
    query.shift[i] = static_cast<float>(shift[i]);
  }
  query.turning = static_cast<float>(turn.norm());
  const double squared_sine = std::min(0.125 * turn.squaredNorm(), 1.0);
  const double farthest = static_cast<double>(me.low().cwiseAbs().cwiseMax(me.high().cwiseAbs()).norm());
  query.curve =
      static_cast<float>((farthest + std::max(X_FS.p.norm(), end.p.norm())) * (1.0 - std::sqrt(1.0 - squared_sine)));
}

void set_fall(FieldQuery& query, const Vec3& fall) {
  for (int i = 0; i < 3; ++i) query.fall[i] = static_cast<float>(fall[i]);
}

const std::vector<std::uint32_t>& find_near(const FieldQuery& query, const ClusterView& clusters,
                                            std::vector<std::uint32_t>& found, const SampleBounds& bounds = {}) {
  found.resize(kFieldLanes * clusters.groups);
  found.resize(near_clusters(query, clusters, found.data(), bounds));
  return found;
}

SampleBounds bounds_of(const ClusterView& samples, std::vector<float>& room) {
  const std::size_t most = kFieldLanes * kFieldLanes * samples.groups;
  grow(room, 5 * most);
  return {room.data(), room.data() + most, room.data() + 2 * most};
}

}  // namespace

// -- What is found ----------------------------------------------------------------------------------------------------

void FieldView::place(const DeformedPointshell& me, const DeformedPointshell& field, const RigidTransform& X_FS,
                      const RigidTransform& end, const Vec3& fall, double reach) {
  mine = &me, other = &field;
  const Mat3 R_FS = to_matrix(X_FS.q);
  turn = R_FS.cast<float>(), shift = X_FS.p.cast<float>();
  query.reach = static_cast<float>(reach);
  set_motion(query, X_FS, R_FS, end, me);
  query.swing = me.largest_swing();
  set_fall(query, fall);
}

void FieldView::see_field() {
  query.field = other->shell().distance();
  query.lattice = other->lattice();
  Eigen::Map<Vec3f>(query.low) = other->low(), Eigen::Map<Vec3f>(query.high) = other->high();
  set_frame(query, turn, shift);
}

bool FieldView::apart(Parting* parting) const {
  const Vec3f middle = 0.5f * (mine->low() + mine->high()), half_mine = 0.5f * (mine->high() - mine->low());
  const Vec3f centre = placed(middle) - 0.5f * (other->low() + other->high());
  const Vec3f half = turn.cwiseAbs() * half_mine + 0.5f * (other->high() - other->low());
  const Vec3f then = centre + carried(middle);
  const float fall = std::hypot(query.fall[0], query.fall[1], query.fall[2]);
  const float spread = query.turning * half_mine.norm() + query.swing + fall + query.curve;
  // On one side now and then, the same one.
  const Vec3f beyond = centre.cwiseMin(then).cwiseMax(-centre.cwiseMax(then)) - half;
  if (!(beyond.maxCoeff() > query.reach + spread)) return false;
  if (parting != nullptr) parting->gap = static_cast<double>((centre.cwiseAbs() - half).maxCoeff() - fall);
  return true;
}

FeatureSide at_vertex(const DeformedPointshell& body, Index v) {
  const CollisionSurface& surface = body.shell().surface();
  const Index t = surface.vertex_triangles(v).front();
  FeatureSide side{
      .key = feature_key(Feature::Kind::kVertex, v), .triangle = t, .point = body.vertex(v).cast<double>()};
  for (std::size_t c = 0; c < 3; ++c) side.weight[c] = surface.triangle(t)[c] == v ? 1.0 : 0.0;
  return side;
}

FeatureSide on_foot(const SurfaceFoothold& foot) {
  FeatureSide side{.key = kAnyFace, .triangle = foot.triangle, .point = foot.point.cast<double>()};
  const auto v = static_cast<double>(foot.weight[1]), w = static_cast<double>(foot.weight[2]);
  side.weight = {1.0 - v - w, v, w};
  return side;
}

Index& PatchExits::sample_of(Index vertex) { return sample_of_[static_cast<std::size_t>(vertex)]; }

bool PatchExits::leaves(const Vec3f& from, const Vec3f& to, FieldHit& exit) const {
  return first_exit(query_, from.data(), to.data(), static_cast<float>(view_.other->shell().cell()), exit);
}

// How far along an edge from a vertex inside it ends, as a part of it. Faces ask for it up to four times.
// @param edge of the triangle, after the corner of this number
float PatchExits::part_inside(Index t, std::size_t edge, const Vec3f& from, const Vec3f& to) {
  const Index e = view_.mine->shell().surface().edge_of(t, static_cast<int>(edge));
  float& part = part_inside_[static_cast<std::size_t>(e)];
  FieldHit exit;
  if (part < 0.0f) part = leaves(from, to, exit) ? exit.along : 1.0f;
  return part;
}

// The part of a triangle's area vector that is inside, shared by its corners that are; other's frame.
Vec3f PatchExits::area_inside(Index t, Index corner) {
  const Triangle& of = view_.mine->shell().surface().triangle(t);
  const auto v = static_cast<std::size_t>(std::ranges::find(of, corner) - of.begin());
  const std::size_t a = (v + 1) % 3, b = (v + 2) % 3;
  TrianglePointsf x = corners_of(*view_.mine, t);
  for (Vec3f& corner_of_it : x) corner_of_it = view_.placed(corner_of_it);
  const Vec3f area = 0.5f * (x[1] - x[0]).cross(x[2] - x[0]);
  const bool with_a = sample_of(of[a]) >= 0, with_b = sample_of(of[b]) >= 0;
  if (with_a && with_b) return area / 3.0f;
  // Edges are named by the corner that they begin at.
  if (!with_a && !with_b) return part_inside(t, v, x[v], x[a]) * part_inside(t, b, x[v], x[b]) * area;
  const std::size_t in = with_a ? a : b, out = with_a ? b : a;
  const float of_v = part_inside(t, with_a ? b : v, x[v], x[out]), of_in = part_inside(t, a, x[in], x[out]);
  return 0.5f * (1.0f - (1.0f - of_v) * (1.0f - of_in)) * area;
}

void PatchExits::find(const FieldView& view, std::span<const SampleFoot> samples) {
  view_ = view, query_ = view.query;
  set_frame(query_, Eigen::Matrix3f::Identity(), Vec3f::Zero());
  const CollisionSurface& surface = view.mine->shell().surface();
  if (sample_of_.size() < static_cast<std::size_t>(surface.vertices()))
    sample_of_.resize(static_cast<std::size_t>(surface.vertices()), -1);
  if (part_inside_.size() < static_cast<std::size_t>(surface.edges()))
    part_inside_.resize(static_cast<std::size_t>(surface.edges()), -1.0f);
  // No more samples than vertices: the room of the largest surface once.
  if (patches_.capacity() < sample_of_.size()) patches_.reserve(sample_of_.size()), joined_.reset(sample_of_.size());
  joined_.reset(samples.size());
  patches_.assign(samples.size(), {});
  for (std::size_t i = 0; i < samples.size(); ++i)
    if (samples[i].gap < 0.0f) sample_of(samples[i].vertex) = static_cast<Index>(i);
  for (std::size_t i = 0; i < samples.size(); ++i)
    if (samples[i].gap < 0.0f)
      for (const Index w : surface.vertex_neighbours(samples[i].vertex))
        if (sample_of(w) >= 0) joined_.join(static_cast<Index>(i), sample_of(w));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!(samples[i].gap < 0.0f)) continue;
    Patch& patch = patches_[static_cast<std::size_t>(joined_.root(static_cast<Index>(i)))];
    for (const Index t : surface.vertex_triangles(samples[i].vertex)) {
      const Vec3f area = area_inside(t, samples[i].vertex);
      patch.way -= area, patch.area += area.norm();
    }
  }
  for (const SampleFoot& sample : samples) {
    if (!(sample.gap < 0.0f)) continue;
    sample_of(sample.vertex) = -1;
    for (const Index t : surface.vertex_triangles(sample.vertex))
      for (int c = 0; c < 3; ++c) part_inside_[static_cast<std::size_t>(surface.edge_of(t, c))] = -1.0f;
  }
  const auto least = static_cast<float>(collision_tuning().field.least_patch);
  for (Patch& patch : patches_) {
    const float length = patch.way.norm();
    patch.way = length > least * patch.area ? Vec3f(patch.way / length) : Vec3f::Zero();
  }
}

// -- Two bodies -------------------------------------------------------------------------------------------------------

bool FieldContacts::serves(const FieldBody& a, const FieldBody& b) {
  Capsule capsule;
  const auto known = [&](const FieldBody& body) {
    return body.shell != nullptr ? body.shell->shell().resolved() : is_half_space(body) || capsule_of(body, capsule);
  };
  if (!known(a) || !known(b) || (a.shell == nullptr && b.shell == nullptr)) return false;
  const double cells = collision_tuning().field.cells_of_the_other;
  const auto fine = [&](const FieldBody& field, const FieldBody& other) {
    return field.shell == nullptr || !field.shell->shell().has_grid() || is_half_space(other) ||
           field.shell->shell().cell() * cells <= longest_side(other);
  };
  return fine(a, b) && fine(b, a);
}

std::span<const FoundContact> FieldContacts::find(const FieldBody& a, const FieldBody& b, const FieldMotion& motion,
                                                  double reach) {
  reach_ = reach;
  found_.clear();
  bodies_[0] = &a, bodies_[1] = &b;
  motion_ = motion;
  if (a.shell != nullptr && b.shell != nullptr) {
    find_between(a, b);
  } else {
    find_on_shape(a.shell != nullptr ? a : b, a.shell != nullptr ? b : a, a.shell == nullptr);
  }
  settle();
  return found_;
}

void FieldContacts::find_between(const FieldBody& a, const FieldBody& b) {
  // What lies within the margin is told by the foot; the field is off by a part of its cells.
  const double slack = collision_tuning().field.slack;
  view_[0].place(*a.shell, *b.shell, motion_.X_AB.inverse(), motion_.end.inverse(),
                 motion_.X_AB.q.conjugate() * motion_.fall, comes_near(1) + slack * b.shell->shell().cell());
  if (view_[0].apart(motion_.parting)) return;
  view_[1].place(*b.shell, *a.shell, motion_.X_AB, motion_.end, motion_.fall,
                 comes_near(0) + slack * a.shell->shell().cell());
  if (view_[1].apart(motion_.parting) || part(view_[0], view_[1], static_cast<float>(reach_), motion_.parting)) return;
  for (FieldView& view : view_) view.see_field();
  edges_.begin(view_[0], view_[1], static_cast<float>(reach_), static_cast<float>(motion_.passed));
  SampleBounds bounds[2];
  for (int of = 0; of < 2; ++of) {
    const ClusterView samples = view_[of].mine->view().samples;
    bounds[of] = bounds_of(samples, bounds_[of]);
    find_samples(of, find_near(view_[of].query, samples, near_, bounds[of]), bounds[of]);
  }
  if (find_near(view_[0].query, view_[0].mine->view().edges, near_).empty() ||
      find_near(view_[1].query, view_[1].mine->view().edges, other_near_).empty())
    return;  // an edge that meets another one is met
  edges_.find(0, bounds[0], near_);
  edges_.find(1, bounds[1], other_near_);
  edges_.finish(found_);
}

void FieldContacts::find_samples(int of, std::span<const std::uint32_t> clusters, const SampleBounds& bounds) {
  const FieldView& view = view_[of];
  grow(hits_, kHitsOfCluster * clusters.size());
  const std::size_t count =
      near_samples(view.query, view.mine->view(), clusters.data(), clusters.size(), hits_.data(), bounds);
  samples_.clear();
  Index last = -1;
  for (const FieldHit& hit : std::span(hits_).first(count)) {
    SampleFoot sample{.vertex = view.mine->shell().sample_vertex(hit.feature)};
    if (std::exchange(last, sample.vertex) == sample.vertex) continue;  // repeated to fill the last cluster
    settle_foot(view, hit, sample);
    rest_on_face(view, sample);
    samples_.push_back(sample);
  }
  leave_by_patches(view);
  for (SampleFoot& sample : samples_) {
    edges_.find_at_end(of, sample);
    const bool inside = sample.gap < 0.0f, meets = unhindered(view, sample, static_cast<float>(motion_.passed));
    const Vec3f n = of == 0 ? view.turned_back(sample.normal) : Vec3f(-sample.normal);
    if (inside) edges_.set_exit(of, sample.vertex, n);
    if (meets) add_sample(of, sample, n);
  }
}

void FieldContacts::settle_foot(const FieldView& view, const FieldHit& hit, SampleFoot& sample) {
  const DeformedPointshell& other = *view.other;
  sample.at = Vec3f(hit.at[0], hit.at[1], hit.at[2]);
  SurfaceFoothold start = foot_on(other, other.shell().triangle_near(hit), sample.at);
  const std::array<Index, 8> about = other.shell().triangles_about(hit);
  Index last = start.triangle;
  for (const Index t : about) {
    if (t == start.triangle || std::exchange(last, t) == t) continue;
    const SurfaceFoothold foot = foot_on(other, t, sample.at);
    if (foot.squared_distance < start.squared_distance) start = foot;
  }
  sample.foot = walk_to_foot(other, start, sample.at, about);
  // Next to the surface the field's sign is not to be relied on; farther off the foot may be on another part of it.
  const bool near = std::abs(hit.distance) < 0.5f * static_cast<float>(other.shell().cell());
  const float distance = std::sqrt(sample.foot.squared_distance);
  const float directionless = kNoise * static_cast<float>(other.shell().longest_side());
  const bool directed = sample.foot.corners != kFootOnFace && distance > directionless;
  const Vec3f out = sample.at - sample.foot.point,
              outward = near || !directed ? normal_at(other, sample.foot) : Vec3f(Vec3f::Zero());
  const bool inside = near ? out.dot(outward) < 0.0f : hit.distance < 0.0f;
  sample.gap = inside ? -distance : distance;
  sample.normal = directed ? Vec3f(out / sample.gap) : Vec3f(outward.normalized());
}

// Vertices inside whose own surface does not lie on the side that their nearest point would push them to: of two boxes
// that lie all but flush on each other, the corners are nearest to each other's sides.
void FieldContacts::leave_by_patches(const FieldView& view) {
  const auto leaning = static_cast<float>(collision_tuning().field.leaning);
  bool known = false;
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    SampleFoot& sample = samples_[i];
    if (!(sample.gap < 0.0f) || lies_in_front(*view.mine, sample.vertex, view.turned_back(sample.normal), leaning))
      continue;
    if (!known) patches_.find(view, samples_);
    known = true;
    const Vec3f& way = patches_.way(i);
    const DeformedPointshell& other = *view.other;
    const Vec3f far = sample.at + (other.high() - other.low()).norm() * way;
    FieldHit exit;
    if (!patches_.leaves(sample.at, far, exit)) continue;
    const Pierced through = walk_to_face(other, other.shell().triangle_near(exit), sample.at, far);
    if (through.triangle < 0 || !(through.along > 0.0f && through.along <= 1.0f)) continue;
    const Vec3f point = sample.at + through.along * (far - sample.at);
    sample.foot = foot_on(other, through.triangle, point);
    sample.normal = way, sample.gap = -(point - sample.at).norm();
  }
}

// @param n out of b, frame of a
void FieldContacts::add_sample(int of, const SampleFoot& sample, const Vec3f& n) {
  const FieldView& view = view_[of];
  FoundContact contact;
  contact.of[of] = at_vertex(*view.mine, sample.vertex);
  contact.of[1 - of] = on_foot(sample.foot);
  contact.normal = n.cast<double>();
  found_.push_back(contact);
}

// -- Half-spaces, balls and capsules ----------------------------------------------------------------------------------

void FieldContacts::find_on_shape(const FieldBody& body, const FieldBody& shape, bool shape_is_a) {
  const RigidTransform X_BS = shape_is_a ? motion_.X_AB.inverse() : motion_.X_AB, X_SB = X_BS.inverse();
  FieldQuery query;
  query.reach = static_cast<float>(reach_);
  const Vec3 fall_S = shape_is_a ? motion_.fall : Vec3(motion_.X_AB.q.conjugate() * motion_.fall);
  query.swing = body.shell->largest_swing();
  Capsule capsule;
  const auto* half_space = std::get_if<HalfSpace>(&shape.geometry->shape());
  if (half_space != nullptr) {
    // In the frame of the samples, whose numbers are small however far away the plane's own frame is.
    const Vec3 n = X_BS.q * half_space->normal;
    query.field.kind = DistanceView::Kind::kPlane;
    for (int axis = 0; axis < 3; ++axis) query.field.size[axis] = static_cast<float>(n[axis]);
    query.field.radius = static_cast<float>(half_space->offset + n.dot(X_BS.p));
    set_frame(query, Eigen::Matrix3f::Identity(), Vec3f::Zero());
    // In that frame the plane moves the other way.
    const RigidTransform moved = X_BS * (shape_is_a ? motion_.end : motion_.end.inverse());
    set_motion(query, {}, Mat3::Identity(), moved, *body.shell);
    set_fall(query, X_BS.q * fall_S);
  } else {
    capsule_of(shape, capsule);
    query.field.kind = DistanceView::Kind::kSegment;
    query.field.size[2] = static_cast<float>(capsule.half_length);
    query.field.radius = static_cast<float>(capsule.radius);
    const Mat3 R_SB = to_matrix(X_SB.q);
    set_frame(query, R_SB.cast<float>(), X_SB.p.cast<float>());
    set_motion(query, X_SB, R_SB, shape_is_a ? motion_.end : motion_.end.inverse(), *body.shell);
    set_fall(query, fall_S);
  }
  const ShellView shell = body.shell->view();
  const std::vector<std::uint32_t>& clusters = find_near(query, shell.samples, near_);
  grow(hits_, kHitsOfCluster * clusters.size());
  const std::size_t count = near_samples(query, shell, clusters.data(), clusters.size(), hits_.data());
  const Mat3 R_AB = to_matrix(motion_.X_AB.q);
  Index last = -1;
  for (const FieldHit& hit : std::span(hits_).first(count)) {
    const Index v = body.shell->shell().sample_vertex(hit.feature);
    if (std::exchange(last, v) == v) continue;  // repeated to fill the last cluster
    FoundContact contact;
    FeatureSide &mine = contact.of[shape_is_a ? 1 : 0], &other = contact.of[shape_is_a ? 0 : 1];
    mine = at_vertex(*body.shell, v);
    const Vec3 p = X_SB * mine.point;
    Vec3 n;
    if (half_space != nullptr) {
      n = half_space->normal;
      other.point = p - (n.dot(p) - half_space->offset) * n;
    } else {
      const Vec3 centre(0.0, 0.0, std::clamp(p.z(), -capsule.half_length, capsule.half_length)), out = p - centre;
      n = out.isZero(0.0) ? Vec3::UnitX() : out.normalized();
      other.point = centre + capsule.radius * n;
    }
    contact.normal = shape_is_a ? Vec3(-n) : Vec3(R_AB * n);
    found_.push_back(contact);
  }
  if (half_space == nullptr) find_shape_in_field(body, capsule, X_BS, shape_is_a);
}

// Nearest points of the surface to a capsule's axis: local minima, walked to from wherever the field has the axis or a
// point of the capsule's own surface near.
void FieldContacts::find_shape_in_field(const FieldBody& body, const Capsule& shape, const RigidTransform& X_BS,
                                        bool shape_is_a) {
  const DeformedPointshell& shell = *body.shell;
  FieldQuery query;
  query.field = shell.shell().distance(), query.lattice = shell.lattice();
  set_frame(query, Eigen::Matrix3f::Identity(), Vec3f::Zero());
  const Mat3 R = to_matrix(X_BS.q), R_AB = to_matrix(motion_.X_AB.q);
  // How far points of the capsule come against those of the body.
  const RigidTransform moved =
      (shape_is_a ? motion_.end : motion_.end.inverse()) * X_BS;  // of the shape, from its frame now
  const double comes = motion_.fall.norm() + moved.p.norm() +
                       2.0 * moved.q.vector().norm() * (shape.half_length + shape.radius) +
                       static_cast<double>(shell.largest_swing());
  const double slack =
      comes + collision_tuning().field.slack * shell.shell().cell() + static_cast<double>(shell.flex());
  feet_.clear();
  const int stations = shape.half_length > 0.0 ? 4 : 1;
  for (int station = 0; station < stations; ++station) {
    const double start = stations > 1 ? shape.half_length * (2.0 * station / (stations - 1) - 1.0) : 0.0;
    for (int side = 0; side < 7; ++side) {
      Vec3 probe = Vec3::Zero();
      if (side > 0) probe[(side - 1) / 2] = side % 2 == 1 ? shape.radius : -shape.radius;
      probe.z() += start;
      const Vec3f at = (X_BS * probe).cast<float>();
      const FieldHit hit = field_at(query, at.data());
      if (static_cast<double>(hit.distance) > reach_ + slack + (side == 0 ? shape.radius : 0.0)) continue;
      Index triangle = shell.shell().triangle_near(hit);
      double along = start;
      SurfaceFoothold foot;
      // Whether the foot of a point of the axis lies farther up, m: the distance falls that way. It does not at the
      // upper end, nor the other way at the lower one, so that a least distance lies between the start and one of them.
      const auto farther_up = [&](double of) {
        foot = walk_to_foot(shell, triangle, (X_BS * Vec3(0.0, 0.0, of)).cast<float>());
        triangle = foot.triangle;
        return (R.transpose() * (foot.point.cast<double>() - X_BS.p)).z() - of;
      };
      if (shape.half_length > 0.0) {
        const bool up = farther_up(start) > 0.0;
        double low = up ? start : -shape.half_length, high = up ? shape.half_length : start;
        constexpr int kHalvings = 24;
        for (int halving = 0; halving < kHalvings; ++halving) {
          const double middle = 0.5 * (low + high);
          (farther_up(middle) > 0.0 ? low : high) = middle;
        }
        along = up ? high : low;
      }
      farther_up(along);
      const FeatureKey key = key_of(shell.shell().surface(), foot);
      if (std::ranges::find(feet_, key) != feet_.end()) continue;
      feet_.push_back(key);
      const Vec3 centre = X_BS * Vec3(0.0, 0.0, along), out = centre - foot.point.cast<double>();
      const Vec3 outward = normal_at(shell, foot).cast<double>();
      const double distance = out.norm();
      const bool inside = out.dot(outward) < 0.0;
      const Vec3 n =
          distance > 1e-5 * shape.radius ? Vec3(out / (inside ? -distance : distance)) : Vec3(outward.normalized());
      FoundContact contact;
      FeatureSide &mine = contact.of[shape_is_a ? 1 : 0], &other = contact.of[shape_is_a ? 0 : 1];
      mine = on_foot(foot), mine.key = key;
      other.point = X_BS.inverse() * Vec3(centre - shape.radius * n);
      contact.normal = shape_is_a ? Vec3(R_AB * n) : Vec3(-n);
      found_.push_back(contact);
    }
  }
}

// m: gaps, the samples' own motion and a fall aside, up to which the other's points may come by its modes.
double FieldContacts::comes_near(int of) const {
  return reach_ + static_cast<double>(bodies_[of]->shell->largest_swing());
}

double FieldContacts::closing(const FieldBody& a, const FieldBody& b, const FieldMotion& motion,
                              const FoundContact& contact) {
  const auto swing = [](const FieldBody& body, const FeatureSide& side) {
    Vec3 sum = Vec3::Zero();
    if (body.shell == nullptr || side.triangle < 0) return sum;
    const Triangle& t = body.shell->shell().surface().triangle(side.triangle);
    for (std::size_t c = 0; c < 3; ++c)
      if (side.weight[c] != 0.0) sum += side.weight[c] * body.shell->swing(t[c]).cast<double>();
    return sum;
  };
  const Vec3& p_b = contact.of[1].point;
  const Vec3 of_b = motion.end * Vec3(p_b + swing(b, contact.of[1])) - motion.X_AB * p_b;
  return contact.normal.dot(of_b - swing(a, contact.of[0])) + std::abs(contact.normal.dot(motion.fall));
}

// Gaps are those of the points: in double, of numbers of single precision.
void FieldContacts::settle() {
  for (FoundContact& found : found_) {
    found.normal.normalize();
    found.gap = found.normal.dot(found.of[0].point - motion_.X_AB * found.of[1].point);
  }
  std::erase_if(found_, [this](const FoundContact& found) {
    return found.gap > reach_ && found.gap > reach_ + closing(*bodies_[0], *bodies_[1], motion_, found);
  });
  std::ranges::sort(found_, {}, &FoundContact::id);
}

}  // namespace limber::internal
