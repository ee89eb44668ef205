#include "limber/collision/narrow_phase.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "limber/collision/collision_surface.h"
#include "limber/collision/deformed_surface.h"
#include "limber/core/error.h"
#include "narrow/convex_contacts.h"
#include "narrow/pair_surface.h"
#include "narrow/primitive_contacts.h"
#include "narrow/rest_depth.h"
#include "narrow/surface_contacts.h"

namespace limber {

using internal::convex_core;
using internal::ConvexContacts;
using internal::ConvexCore;
using internal::CoreContacts;
using internal::FeatureContact;
using internal::FeatureSide;
using internal::half_space_contacts;
using internal::kRoundOff;
using internal::OverlapRule;
using internal::PairSurface;
using internal::RestDepth;
using internal::RestDepthRule;
using internal::RoundedCore;
using internal::SurfaceContacts;
using internal::triangulated;

// -- Rigid shapes -----------------------------------------------------------------------------------------------------

struct RigidGeometry::Impl {
  Shape shape;
  std::shared_ptr<const CollisionSurface> surface{};
  ConvexCore core{};  // of the convex ones
  Aabb bounds{};
  Vec3 up = Vec3::Zero();
};

namespace {

template <class... F>
struct Overloaded : F... {
  using F::operator()...;
};
template <class... F>
Overloaded(F...) -> Overloaded<F...>;

Aabb bounds_of(const HalfSpace& shape) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Aabb all{Vec3::Constant(-kInfinity), Vec3::Constant(kInfinity)};
  for (int axis = 0; axis < 3; ++axis) {
    if (shape.normal[axis] == 1.0) all.high[axis] = shape.offset;
    if (shape.normal[axis] == -1.0) all.low[axis] = -shape.offset;
  }
  return all;
}

Aabb bounds_of(const ConvexCore& core) {
  Aabb box;
  for (const Vec3& p : core.points) box.include(p);
  return box.grown(core.radius);
}

// The way that an open surface looks as a whole, if no face looks back.
Vec3 up_of(const CollisionSurface& surface) {
  const auto corners = [&](Index t) {
    const auto& [a, b, c] = surface.triangle(t);
    return TrianglePoints{surface.rest(a), surface.rest(b), surface.rest(c)};
  };
  if (surface.closed()) return Vec3::Zero();
  Vec3 sum = Vec3::Zero();
  for (Index t = 0; t < surface.triangles(); ++t) {
    const TrianglePoints x = corners(t);
    sum += (x[1] - x[0]).cross(x[2] - x[0]);
  }
  const Vec3 up = internal::unit_or(sum, Vec3::Zero());
  for (Index t = 0; t < surface.triangles(); ++t)
    if (unit_normal(corners(t)).dot(up) < -internal::kRoundOff) return Vec3::Zero();
  return up;
}

}  // namespace

RigidGeometry::RigidGeometry(const Shape& shape) {
  validate(shape);
  auto impl = std::make_unique<Impl>(Impl{shape});
  const auto convex = [&](ConvexCore core) {
    impl->core = std::move(core);
    impl->bounds = bounds_of(impl->core);
    if (!impl->core.faces.empty()) impl->surface = std::make_shared<const CollisionSurface>(triangulated(impl->core));
  };
  const auto mesh = [&](const auto& triangles) {
    impl->surface = std::make_shared<const CollisionSurface>(triangles);
    impl->bounds = impl->surface->rest_bounds();
  };
  std::visit(
      Overloaded{[&](const HalfSpace& s) { impl->bounds = bounds_of(s); },
                 [&](const Sphere& s) { convex(convex_core(s)); }, [&](const Capsule& s) { convex(convex_core(s)); },
                 [&](const Box& s) { convex(convex_core(s)); }, [&](const ConvexHull& s) { convex(convex_core(s)); },
                 [&](const TriangleMesh& s) { mesh(s), impl->up = up_of(*impl->surface); },
                 [&](const HeightField& s) { mesh(s), impl->up = Vec3::UnitZ(); }},
      shape);
  impl_ = std::move(impl);
}
RigidGeometry::~RigidGeometry() = default;
RigidGeometry::RigidGeometry(RigidGeometry&&) noexcept = default;
RigidGeometry& RigidGeometry::operator=(RigidGeometry&&) noexcept = default;

const Shape& RigidGeometry::shape() const { return impl_->shape; }
Aabb RigidGeometry::bounds() const { return impl_->bounds; }
const Vec3& RigidGeometry::up() const { return impl_->up; }
const std::shared_ptr<const CollisionSurface>& RigidGeometry::surface() const { return impl_->surface; }

// -- Pairs ------------------------------------------------------------------------------------------------------------

struct RestVolume::Impl : RestDepth {
  using RestDepth::RestDepth;
};

RestVolume::RestVolume(std::shared_ptr<const ModalModel> model)
    : impl_(std::make_unique<const Impl>(std::move(model))) {}
RestVolume::~RestVolume() = default;
RestVolume::RestVolume(RestVolume&&) noexcept = default;
RestVolume& RestVolume::operator=(RestVolume&&) noexcept = default;

namespace {

// A way out along a normal that is given.
class NormalRule final : public OverlapRule {
 public:
  void bind(OverlapNormals& normals, int of) { normals_ = &normals, of_ = of; }
  bool exit(PairSurface& surface, const Vec3& p, const PairSurface::Nearest&, Exit& exit) override {
    exit.normal = normals_->normal(of_, p);
    if (exit.normal.isZero()) return false;
    const PairSurface::WayOut way = surface.way_out(p, exit.normal);
    if (way.triangle < 0) return false;
    exit.at = surface.on_face(way.triangle, p + way.distance * exit.normal);
    return true;
  }

 private:
  OverlapNormals* normals_ = nullptr;
  int of_ = 0;
};

}  // namespace

struct NarrowPhase::Impl {
  NarrowPhaseOptions options;
  DeformedSurface rigid[2];  // of rigid shapes made of triangles
  PairSurface surface[2];
  SurfaceContacts surface_contacts;
  CoreContacts core_contacts;
  ConvexContacts convex_contacts;
  RestDepthRule rest_depth[2];
  std::unique_ptr<OverlapNormals> normals;  // null: the options' overlap says
  NormalRule normal_rule[2];
  std::vector<Index> triangles;
  std::vector<FeatureContact> found;
  struct Place {
    std::uint64_t id;
    double gap;
    std::size_t found;
    friend auto operator<=>(const Place&, const Place&) = default;
  };
  std::vector<Place> order;  // of what was found, by feature pair

  static const HalfSpace* half_space(const CollisionBody& body) {
    return body.geometry == nullptr ? nullptr : std::get_if<HalfSpace>(&body.geometry->shape());
  }
  static const ConvexCore* convex(const CollisionBody& body) {
    return body.geometry == nullptr || body.geometry->impl_->core.points.empty() ? nullptr
                                                                                 : &body.geometry->impl_->core;
  }
  static bool has_triangles(const CollisionBody& body) {
    return body.surface != nullptr || body.geometry->surface() != nullptr;
  }

  DeformedSurface& deformed(const CollisionBody& body, int side);
  std::array<OverlapRule*, 2> rules(const CollisionBody& a, const CollisionBody& b, const RigidTransform& X_AB);
  void bind(const CollisionBody& body, const RigidTransform& X_PB, double tolerance, int side);
  static double size(const CollisionBody& body);

  void find(const CollisionBody& a, const CollisionBody& b, const RigidTransform& X_AB, double margin);
  void on_half_space(const CollisionBody& body, const RigidTransform& X_BH, const HalfSpace& shape, double margin);
  void against_core(const CollisionBody& body, const RigidTransform& X_BC, const ConvexCore& core, double margin);
  void flip();
  void deliver(const CollisionBody& a, const RigidTransform& X_AF, const CollisionBody& b, const RigidTransform& X_BF,
               const RigidTransform& X_OF, std::vector<ContactPoint>& contacts);
};

namespace {

// What was found with the sides exchanged.
FeatureContact flipped(const FeatureContact& c) { return {c.b, c.a, -c.normal, c.gap}; }

std::uint64_t id_of(const FeatureContact& c) { return std::uint64_t{c.a.key} << 32 | c.b.key; }

ContactSide contact_side(const CollisionBody& body, double radius, const FeatureSide& side, const Vec3& point_B) {
  if (body.surface == nullptr) return {body.index, -1, {0.0, 0.0, 0.0}, point_B, radius};
  return {body.index, side.triangle, side.weight, point_B};
}

void check(const CollisionBody& body) {
  if ((body.surface == nullptr) == (body.geometry == nullptr))
    throw InvalidArgument("NarrowPhase: body " + std::to_string(body.index) +
                          " has a surface and a rigid geometry, or neither; expected one of the two");
}

double largest_coordinate(const Aabb& box) {
  return std::max(box.low.cwiseAbs().maxCoeff(), box.high.cwiseAbs().maxCoeff());
}

RoundedCore rounded(const ConvexCore& core, const RigidTransform& X_PC) {
  return {{X_PC * core.points.front(), X_PC * core.points.back()}, core.points.size() == 2, core.radius};
}

}  // namespace

DeformedSurface& NarrowPhase::Impl::deformed(const CollisionBody& body, int side) {
  if (body.surface != nullptr) return *body.surface;
  DeformedSurface& mine = rigid[side];
  mine.bind(body.geometry->surface(), {});
  return mine;
}

double NarrowPhase::Impl::size(const CollisionBody& body) {
  if (body.surface != nullptr) return largest_coordinate(body.surface->bounds(0));
  if (half_space(body) != nullptr) return 0.0;
  return largest_coordinate(body.geometry->bounds());
}

void NarrowPhase::Impl::bind(const CollisionBody& body, const RigidTransform& X_PB, double tolerance, int side) {
  surface[side].bind(deformed(body, side), X_PB, tolerance,
                     body.geometry != nullptr ? body.geometry->up() : Vec3(Vec3::Zero()));
}

// For vertices inside each, in the frame of a, both surfaces of which are bound; null: the nearest point.
std::array<OverlapRule*, 2> NarrowPhase::Impl::rules(const CollisionBody& a, const CollisionBody& b,
                                                     const RigidTransform& X_AB) {
  std::array<OverlapRule*, 2> chosen{nullptr, nullptr};
  const CollisionBody* body[2] = {&a, &b};
  const RigidTransform X_PB[2] = {{}, X_AB};
  if (normals != nullptr && a.volume != nullptr && b.volume != nullptr) {
    const auto overlapping = [&](std::size_t i) {
      return OverlapNormals::Body{body[i]->volume->impl_->model(), body[i]->surface->amplitudes(),
                                  body[i]->surface->skin(), X_PB[i]};
    };
    normals->bind(overlapping(0), overlapping(1), surface[0].tolerance());
    for (std::size_t i = 0; i < 2; ++i) {
      normal_rule[i].bind(*normals, static_cast<int>(i));
      chosen[i] = &normal_rule[i];
    }
  } else if (options.overlap == OverlapMethod::kRestDepth) {
    for (std::size_t i = 0; i < 2; ++i) {
      if (body[i]->volume == nullptr) continue;
      rest_depth[i].bind(*body[i]->volume->impl_, *body[i]->surface, X_PB[i]);
      chosen[i] = &rest_depth[i];
    }
  }
  return chosen;
}

void NarrowPhase::Impl::flip() {
  for (FeatureContact& c : found) c = flipped(c);
}

// In the frame of the body, for what lies far from the half-space's own origin.
void NarrowPhase::Impl::on_half_space(const CollisionBody& body, const RigidTransform& X_BH, const HalfSpace& shape,
                                      double margin) {
  const Vec3 normal = X_BH.q * shape.normal;
  const double offset = shape.offset + normal.dot(X_BH.p);
  if (const ConvexCore* core = convex(body)) return half_space_contacts(*core, normal, offset, margin, found);
  bind(body, {}, kRoundOff * size(body), 0);
  half_space_contacts(surface[0], normal, offset, margin, triangles, found);
}

void NarrowPhase::Impl::against_core(const CollisionBody& body, const RigidTransform& X_BC, const ConvexCore& core,
                                     double margin) {
  bind(body, {}, kRoundOff * (size(body) + X_BC.p.norm()), 0);
  core_contacts.find(surface[0], rounded(core, X_BC), margin, found);
}

// In the frame of a. @pre a is not a half-space; if only one has triangles and the other is no half-space, it is a
void NarrowPhase::Impl::find(const CollisionBody& a, const CollisionBody& b, const RigidTransform& X_AB,
                             double margin) {
  const ConvexCore *core_a = convex(a), *core_b = convex(b);
  if (core_a != nullptr && core_b != nullptr) {
    convex_contacts.find(*core_a, *core_b, X_AB, margin, found);
  } else if (const HalfSpace* plane = half_space(b)) {
    on_half_space(a, X_AB, *plane, margin);
  } else if (!has_triangles(b)) {
    against_core(a, X_AB, *core_b, margin);
  } else {
    const double round_off = kRoundOff * (size(a) + size(b) + X_AB.p.norm());
    bind(a, {}, round_off, 0);
    bind(b, X_AB, round_off, 1);
    const Quaternion to_a = a.X_WB.q.conjugate();
    surface[0].expect_motion(to_a * a.displacement, to_a * a.rotation);
    surface[1].expect_motion(to_a * b.displacement, to_a * b.rotation);
    const auto [rule_a, rule_b] = rules(a, b, X_AB);
    const Vec3 way_A = to_a * (b.displacement - a.displacement);
    surface_contacts.find(surface[0], surface[1], X_AB,
                          {margin, a.reach + b.reach, way_A, std::max(a.left_alone, b.left_alone)}, rule_a, rule_b,
                          found);
  }
}

// From the frame F in which they were found to the caller's; each feature pair once, by ascending id.
void NarrowPhase::Impl::deliver(const CollisionBody& a, const RigidTransform& X_AF, const CollisionBody& b,
                                const RigidTransform& X_BF, const RigidTransform& X_OF,
                                std::vector<ContactPoint>& contacts) {
  order.clear();
  for (std::size_t i = 0; i < found.size(); ++i) order.push_back({id_of(found[i]), found[i].gap, i});
  std::sort(order.begin(), order.end());
  order.erase(std::unique(order.begin(), order.end(), [](const Place& c, const Place& d) { return c.id == d.id; }),
              order.end());
  const ConvexCore *core_a = convex(a), *core_b = convex(b);
  const double radius_a = core_a != nullptr ? core_a->radius : 0.0, radius_b = core_b != nullptr ? core_b->radius : 0.0;
  for (const Place& place : order) {
    const FeatureContact& c = found[place.found];
    contacts.push_back({contact_side(a, radius_a, c.a, X_AF * c.a.point),
                        contact_side(b, radius_b, c.b, X_BF * c.b.point), X_OF.q * c.normal,
                        X_OF * (0.5 * (c.a.point + c.b.point)), c.gap, place.id});
  }
}

NarrowPhase::NarrowPhase(const NarrowPhaseOptions& options) : impl_(std::make_unique<Impl>()) {
  impl_->options = options;
  if (options.normals) impl_->normals = options.normals();
}
NarrowPhase::~NarrowPhase() = default;
NarrowPhase::NarrowPhase(NarrowPhase&&) noexcept = default;
NarrowPhase& NarrowPhase::operator=(NarrowPhase&&) noexcept = default;

void NarrowPhase::find_contacts(const CollisionBody& a, const CollisionBody& b, double margin, const Vec3& origin,
                                std::vector<ContactPoint>& contacts) {
  check(a), check(b);
  Impl& impl = *impl_;
  impl.found.clear();
  if (Impl::half_space(a) != nullptr && Impl::half_space(b) != nullptr) return;
  // The body with more to say comes first: triangles before none, a half-space last.
  const bool exchange = Impl::half_space(a) != nullptr ||
                        (!Impl::has_triangles(a) && Impl::has_triangles(b) && Impl::half_space(b) == nullptr);
  const CollisionBody &first = exchange ? b : a, &second = exchange ? a : b;
  const Quaternion to_first = first.X_WB.q.conjugate();
  const RigidTransform X_FS{to_first * second.X_WB.q, to_first * (second.X_WB.p - first.X_WB.p)};
  impl.find(first, second, X_FS, margin);
  const RigidTransform X_SF = X_FS.inverse(), X_OF{first.X_WB.q, first.X_WB.p - origin};
  if (exchange) impl.flip();
  impl.deliver(a, exchange ? X_SF : RigidTransform{}, b, exchange ? RigidTransform{} : X_SF, X_OF, contacts);
}

void NarrowPhase::find_self_contacts(const CollisionBody& body, double margin, const Vec3& origin,
                                     std::vector<ContactPoint>& contacts) {
  check(body);
  if (body.surface == nullptr) return;
  Impl& impl = *impl_;
  impl.found.clear();
  impl.bind(body, {}, kRoundOff * impl.size(body), 0);
  if (body.volume != nullptr) impl.rest_depth[0].bind(*body.volume->impl_, *body.surface, {});
  impl.surface_contacts.find_self(impl.surface[0], margin, body.volume != nullptr ? &impl.rest_depth[0] : nullptr,
                                  impl.found);
  impl.deliver(body, {}, body, {}, {body.X_WB.q, body.X_WB.p - origin}, contacts);
}

}  // namespace limber
