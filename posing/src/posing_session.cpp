#include "limber/posing/posing_session.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include "limber/core/error.h"
#include "limber/internal/strict_json.h"
#include "limber/mesh/surface_locator.h"
#include "pose_problem.h"
#include "pose_transfer.h"
#include "skin/skin.h"
#include "solver/pose_solver.h"

namespace limber {
namespace {

using namespace internal;

struct Handle {
  Index number = 0, part = 0;
  Vec3 point = Vec3::Zero(), target = Vec3::Zero();
};

/// What follows from model, options and pins: shared by all states that have the same.
struct Built {
  PoseStructure structure;
  Skin skin;
};

/// All that undo brings back.
struct State {
  std::shared_ptr<const JointedModel> model{};
  std::vector<PartOptions> parts{};
  std::vector<bool> pinned{};
  std::vector<Handle> handles{};
  std::shared_ptr<const Built> built{};
  Pose pose{};
  std::vector<BodyMap> affine{};  // where a method of its own finds poses; else empty
};

void require_finite(const Vec3& p, const char* what) {
  if (!p.allFinite()) throw InvalidArgument(std::string("PosingSession: ") + what + " is not finite");
}

}  // namespace

struct PosingSession::Impl {
  PosingOptions options;
  std::shared_ptr<const PoseMethod> method{};  // null: PoseSolver
  State now{};
  std::vector<State> before{};
  Index next_handle = 0;
  Index last_moved = -1;               // the handle whose moves go on, or −1
  std::optional<PoseSolver> solver{};  // of `now`, while it fits

  /// Remembers the state before a change, and that the solver no longer fits.
  void begin_change() {
    before.push_back(now);
    last_moved = -1;
    solver.reset();
  }

  void require(Index i, std::size_t count, const char* what) const {
    if (i < 0 || static_cast<std::size_t>(i) >= count)
      throw InvalidArgument(std::string("PosingSession: there is no ") + what + " " + std::to_string(i) +
                            ", expected 0 to " + std::to_string(static_cast<Index>(count) - 1));
  }

  Handle& handle(PoseHandle id) {
    const auto found =
        std::find_if(now.handles.begin(), now.handles.end(), [&](const Handle& h) { return h.number == id.number; });
    if (found == now.handles.end())
      throw InvalidArgument("PosingSession: there is no handle " + std::to_string(id.number) + "; was it removed?");
    return *found;
  }

  /// The body that holds a part's point.
  Index body_at(Index part, const Vec3& point) const { return cell_nearest(now.built->structure, part, point).body; }

  Vec3 place_of(const Handle& h) const {
    const PoseStructure& s = now.built->structure;
    const auto body = static_cast<std::size_t>(body_at(h.part, h.point));
    return now.pose.bodies[body] * Vec3(h.point - s.bodies[body].centre);
  }

  /// Cells, bodies and joints anew; the pose goes over to them.
  /// @param was per part its part in the cells that there are
  void rebuild(std::span<const Index> was) {
    PoseStructure structure = build_structure(*now.model, now.parts, now.pinned, options.strain);
    Pose pose{rest_poses(structure), std::vector<double>(structure.joints.size(), 0.0)};
    if (now.built) pose = transferred(now.built->structure, now.pose, structure, was);
    Skin skin(*now.model, structure);
    now.built = std::make_shared<const Built>(Built{std::move(structure), std::move(skin)});
    now.pose = std::move(pose);
    now.affine.clear();
  }

  std::vector<Index> same_parts() const {
    std::vector<Index> parts(now.model->parts.size());
    std::iota(parts.begin(), parts.end(), Index{0});
    return parts;
  }

  /// A change that needs new cells; taken back if it cannot be made.
  template <class Change>
  void change_structure(Change&& change) {
    change_structure(change, same_parts());
  }
  template <class Change>
  void change_structure(Change&& change, std::span<const Index> was) {
    begin_change();
    try {
      change();
      rebuild(was);
    } catch (...) {
      take_back();
      throw;
    }
  }

  /// A part's triangles with all vertices of the model.
  SurfaceMesh surface_of(Index part) const {
    SurfaceMesh surface{now.model->surface.vertices, {}};
    for (const Index t : now.model->parts[static_cast<std::size_t>(part)].triangles)
      surface.triangles.push_back(surface_triangle(*now.model, t));
    return surface;
  }
  double distance(Index part, const Vec3& point) const {
    const SurfaceMesh surface = surface_of(part);
    return SurfaceLocator(surface.vertices, surface.triangles).nearest(point).distance;
  }
  /// The piece of a part that is nearest to a point at rest.
  Index nearest_piece(std::span<const Index> was, Index part, const Vec3& point) const {
    Index best = -1;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t p = 0; p < was.size(); ++p) {
      if (was[p] != part) continue;
      const double d = distance(static_cast<Index>(p), point);
      if (d < least) least = d, best = static_cast<Index>(p);
    }
    return best;
  }

  void take_back() {
    now = std::move(before.back());
    before.pop_back();
    last_moved = -1;
    solver.reset();
  }

  std::vector<HandleTerm> handle_terms() const {
    std::vector<HandleTerm> terms;
    const PoseStructure& s = now.built->structure;
    for (const Handle& h : now.handles) {
      const Index body = body_at(h.part, h.point);
      terms.push_back({.body = body,
                       .arm = h.point - s.bodies[static_cast<std::size_t>(body)].centre,
                       .target = h.target,
                       .weight = options.handle_stiffness * s.size});
    }
    return terms;
  }

  /// What the method leaves of joints and limits is told of the nearest rotations.
  PoseResult solve_by_method() {
    const PoseStructure& s = now.built->structure;
    AffinePose pose{maps(), now.pose.turns};
    PoseResult result = method->solve({s, options, handle_terms()}, pose);
    now.affine = std::move(pose.maps), now.pose.turns = std::move(pose.turns);
    for (std::size_t b = 0; b < now.affine.size(); ++b)
      now.pose.bodies[b] = {normalized(quaternion_from_matrix(nearest_rotation(now.affine[b].A))), now.affine[b].p};
    const Feasibility f = feasibility(s, now.pose);
    result.joint_error = f.joints, result.limit_violation = std::max(0.0, f.limits);
    for (const Handle& h : now.handles)
      result.handle_error = std::max(result.handle_error, (place_of(h) - h.target).norm());
    return result;
  }

  std::vector<BodyMap> maps() const {
    if (!now.affine.empty()) return now.affine;
    std::vector<BodyMap> out;
    for (const RigidTransform& X : now.pose.bodies) out.push_back({to_matrix(X.q), X.p});
    return out;
  }
};

PosingSession::PosingSession(JointedModel model, const PosingOptions& options, std::shared_ptr<const PoseMethod> method)
    : impl_(std::make_unique<Impl>()) {
  options.validate();
  model.validate();
  impl_->options = options;
  impl_->method = std::move(method);
  impl_->now.parts.resize(model.parts.size());
  impl_->now.pinned.assign(model.parts.size(), false);
  impl_->now.model = std::make_shared<const JointedModel>(std::move(model));
  impl_->rebuild({});
}
PosingSession::~PosingSession() = default;
PosingSession::PosingSession(PosingSession&&) noexcept = default;
PosingSession& PosingSession::operator=(PosingSession&&) noexcept = default;

const JointedModel& PosingSession::model() const { return *impl_->now.model; }
const PosingOptions& PosingSession::options() const { return impl_->options; }

PoseHandle PosingSession::add_handle(Index part, const Vec3& point) {
  impl_->require(part, model().parts.size(), "part");
  require_finite(point, "the handle's point");
  const SurfaceMesh surface = impl_->surface_of(part);
  Eigen::AlignedBox3d box;
  for (const Triangle& t : surface.triangles)
    for (const Index v : t) box.extend(surface.vertices[static_cast<std::size_t>(v)]);
  const double distance = impl_->distance(part, point);
  constexpr double kReach = 0.1;  // of the part's diagonal
  if (distance > kReach * box.diagonal().norm())
    throw InvalidArgument(
        "PosingSession: the handle's point (" + std::to_string(point.x()) + ", " + std::to_string(point.y()) + ", " +
        std::to_string(point.z()) + ") is " + std::to_string(distance) + " from the surface of " +
        in_quotes(model().parts[static_cast<std::size_t>(part)].name) + ", expected a tenth of its diagonal at most");
  impl_->begin_change();
  Handle h{.number = impl_->next_handle++, .part = part, .point = point, .target = {}};
  h.target = impl_->place_of(h);
  impl_->now.handles.push_back(h);
  return {h.number};
}

void PosingSession::move_handle(PoseHandle handle, const Vec3& target) {
  require_finite(target, "the handle's target");
  impl_->handle(handle);  // or it throws before anything changes
  if (impl_->last_moved != handle.number) {
    impl_->before.push_back(impl_->now);
    impl_->last_moved = handle.number;
  }
  impl_->handle(handle).target = target;
}

void PosingSession::remove_handle(PoseHandle handle) {
  impl_->handle(handle);
  impl_->begin_change();
  std::erase_if(impl_->now.handles, [&](const Handle& h) { return h.number == handle.number; });
}

bool PosingSession::contains(PoseHandle handle) const {
  return std::any_of(impl_->now.handles.begin(), impl_->now.handles.end(),
                     [&](const Handle& h) { return h.number == handle.number; });
}

Vec3 PosingSession::handle_point(PoseHandle handle) const { return impl_->place_of(impl_->handle(handle)); }
Vec3 PosingSession::handle_target(PoseHandle handle) const { return impl_->handle(handle).target; }

void PosingSession::set_pinned(Index part, bool pinned) {
  impl_->require(part, model().parts.size(), "part");
  if (impl_->now.pinned[static_cast<std::size_t>(part)] == pinned) return;
  impl_->change_structure([&] { impl_->now.pinned[static_cast<std::size_t>(part)] = pinned; });
}

bool PosingSession::pinned(Index part) const {
  impl_->require(part, model().parts.size(), "part");
  return impl_->now.pinned[static_cast<std::size_t>(part)];
}

void PosingSession::set_part(Index part, const PartOptions& options) {
  impl_->require(part, model().parts.size(), "part");
  options.validate();
  if (impl_->now.parts[static_cast<std::size_t>(part)] == options) return;
  impl_->change_structure([&] { impl_->now.parts[static_cast<std::size_t>(part)] = options; });
}

PartOptions PosingSession::part_options(Index part) const {
  impl_->require(part, model().parts.size(), "part");
  return impl_->now.parts[static_cast<std::size_t>(part)];
}

void PosingSession::set_joint(Index joint, const JointSpec& spec) {
  impl_->require(joint, model().joints.size(), "joint");
  spec.validate();
  JointedModel changed = model();
  changed.joints[static_cast<std::size_t>(joint)].joint = spec;
  impl_->change_structure([&] { impl_->now.model = std::make_shared<const JointedModel>(std::move(changed)); });
}

void PosingSession::set_model(JointedModel model, std::span<const Index> was) {
  model.validate();
  if (was.size() != model.parts.size())
    throw InvalidArgument("PosingSession::set_model: was names " + std::to_string(was.size()) + " parts, expected " +
                          std::to_string(model.parts.size()) + ", those of the model");
  for (const Index p : was) impl_->require(p, impl_->now.parts.size(), "part");
  std::vector<PartOptions> parts;
  std::vector<bool> pinned, given(impl_->now.parts.size(), false);
  for (const Index p : was) {
    const auto old = static_cast<std::size_t>(p);
    parts.push_back(impl_->now.parts[old]);
    pinned.push_back(impl_->now.pinned[old] && !given[old]);
    given[old] = true;
  }
  impl_->change_structure(
      [&] {
        impl_->now.model = std::make_shared<const JointedModel>(std::move(model));
        impl_->now.parts = std::move(parts), impl_->now.pinned = std::move(pinned);
        std::erase_if(impl_->now.handles, [&](const Handle& h) { return !given[static_cast<std::size_t>(h.part)]; });
        for (Handle& h : impl_->now.handles) h.part = impl_->nearest_piece(was, h.part, h.point);
      },
      was);
}

bool PosingSession::undo() {
  if (impl_->before.empty()) return false;
  impl_->take_back();
  return true;
}

void PosingSession::forget_changes() {
  impl_->before.clear();
  impl_->last_moved = -1;
}

PoseResult PosingSession::solve() {
  if (impl_->method != nullptr) return impl_->solve_by_method();
  if (!impl_->solver) impl_->solver.emplace(impl_->now.built->structure, impl_->options, impl_->handle_terms());
  std::vector<Vec3> targets;
  for (const Handle& h : impl_->now.handles) targets.push_back(h.target);
  impl_->solver->set_targets(targets);
  return impl_->solver->solve(impl_->now.pose);
}

void PosingSession::reset_pose() {
  impl_->begin_change();
  const PoseStructure& s = impl_->now.built->structure;
  impl_->now.pose = {rest_poses(s), std::vector<double>(s.joints.size(), 0.0)};
  impl_->now.affine.clear();
}

std::vector<PosedCell> PosingSession::cells() const {
  const PoseStructure& s = impl_->now.built->structure;
  const std::vector<BodyMap> maps = impl_->maps();
  std::vector<PosedCell> out;
  for (const PlacedCell& c : s.cells) {
    const BodyMap& map = maps[static_cast<std::size_t>(c.body)];
    out.push_back({.part = c.part,
                   .body = c.body,
                   .rest = c.cell,
                   .axes = s.grids[static_cast<std::size_t>(c.grid)].axes,
                   .rotation = map.A,
                   .place = map.p + map.A * (c.cell.centre - s.bodies[static_cast<std::size_t>(c.body)].centre)});
  }
  return out;
}

PosedJoint PosingSession::joint(Index joint) const {
  impl_->require(joint, model().joints.size(), "joint");
  const PoseStructure& s = impl_->now.built->structure;
  PosedJoint out;
  const ModelJoint& told = model().joints[static_cast<std::size_t>(joint)];
  const Vec3& origin = told.joint.frame.origin;
  Index a = impl_->body_at(told.a, origin),
        b = impl_->body_at(told.b, origin);  // of joints that hold nothing: one body
  for (std::size_t j = 0; j < s.joints.size(); ++j) {
    if (s.joints[j].model_joint != joint) continue;
    a = s.joints[j].a, b = s.joints[j].b;
    out.coordinates = joint_coordinates(s, s.joints[j], impl_->now.pose.bodies, impl_->now.pose.turns[j]);
    JointRows rows;
    append_joint_rows(s, s.joints[j], impl_->now.pose.bodies, impl_->now.pose.turns[j], rows);
    for (const Row& r : rows.constraints) out.error = std::max(out.error, std::abs(r.value));
  }
  const RigidTransform &X_a = impl_->now.pose.bodies[static_cast<std::size_t>(a)],
                       &X_b = impl_->now.pose.bodies[static_cast<std::size_t>(b)];
  out.frame = {X_b * Vec3(origin - s.bodies[static_cast<std::size_t>(b)].centre),
               to_matrix(X_a.q) * told.joint.frame.axes};
  out.turn = rotation_vector(X_a.q.conjugate() * X_b.q).norm();
  return out;
}

std::optional<RigidTransform> PosingSession::motion(Index part) const {
  impl_->require(part, model().parts.size(), "part");
  const PoseStructure& s = impl_->now.built->structure;
  const Index group = s.group_of_part[static_cast<std::size_t>(part)];
  if (impl_->now.parts[static_cast<std::size_t>(part)].cells != Subdivision::kRigid ||
      std::count(s.group_of_part.begin(), s.group_of_part.end(), group) > 1)
    return std::nullopt;
  const auto cell = std::find_if(s.cells.begin(), s.cells.end(), [&](const PlacedCell& c) { return c.part == part; });
  const RigidTransform& X = impl_->now.pose.bodies[static_cast<std::size_t>(cell->body)];
  return RigidTransform{X.q, X * Vec3(-s.bodies[static_cast<std::size_t>(cell->body)].centre)};
}

void PosingSession::reconstruct(std::span<Vec3> positions) const {
  if (positions.size() != model().surface.vertices.size())
    throw InvalidArgument("PosingSession.reconstruct: room for " + std::to_string(positions.size()) +
                          " vertices, expected " + std::to_string(model().surface.vertices.size()));
  impl_->now.built->skin.positions(impl_->maps(), positions);
}

void PosingSession::reconstruct(std::span<Vec3> positions, std::span<Vec3> normals) const {
  reconstruct(positions);
  if (normals.size() != positions.size())
    throw InvalidArgument("PosingSession.reconstruct: room for " + std::to_string(normals.size()) +
                          " normals, expected " + std::to_string(positions.size()));
  vertex_normals(positions, model().surface.triangles, normals);
}

}  // namespace limber
