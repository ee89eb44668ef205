#include "limber/view/page_pose.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <utility>

#include "cut_part.h"
#include "limber/articulation/joints_file.h"
#include "limber/core/error.h"
#include "limber/internal/joint_spec_json.h"
#include "limber/mesh/write_mesh.h"
#include "limber/posing/posed_model.h"

namespace limber {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kIterations = 30;  // of one call, so that a page goes on drawing

JointedModel read_model(const std::filesystem::path& model, const std::filesystem::path& joints) {
  Warnings warnings;
  const GroupedSurface surface = read_grouped_surface(model, warnings);
  return jointed_model(surface, read_joints(joints), "\"" + joints.filename().string() + "\"");
}

/// Passage of a ray through a triangle: its parameter and the weights of the second and third corner.
std::optional<Vec3> ray_triangle(const Vec3& from, const Vec3& along, const Vec3& a, const Vec3& b, const Vec3& c) {
  Mat3 m;
  m << -along, b - a, c - a;
  const double determinant = m.determinant();
  if (determinant == 0.0) return std::nullopt;
  const Vec3 t = m.inverse() * (from - a);
  if (!(t[0] >= 0.0 && t[1] >= 0.0 && t[2] >= 0.0 && t[1] + t[2] <= 1.0)) return std::nullopt;
  return t;
}

/// The axes with the joint's own direction in the column where another type has it.
Mat3 axes_for(const JointSpec& joint, JointType type) {
  const auto from = internal::axis_column(joint.type), to = internal::axis_column(type);
  if (!from || !to || *from == *to) return joint.frame.axes;
  Mat3 axes;  // turned round, so that they stay right-handed
  for (int i = 0; i < 3; ++i) axes.col((i + *to) % 3) = joint.frame.axes.col((i + *from) % 3);
  return axes;
}

std::size_t checked(const JointedModel& model, Index part, const char* function) {
  if (part < 0 || static_cast<std::size_t>(part) >= model.parts.size())
    throw InvalidArgument(std::string("PagePose::") + function + ": there is no part " + std::to_string(part) +
                          ", expected 0 to " + std::to_string(model.parts.size() - 1));
  return static_cast<std::size_t>(part);
}

}  // namespace

struct PagePose::Impl {
  explicit Impl(JointedModel model, std::string told)
      : session(std::move(model), {.max_iterations = kIterations, .starts = 0}), name(std::move(told)) {
    session.set_pinned(0, true);
    session.forget_changes();
    parts_changed();
  }

  void parts_changed() {
    triangles.clear();
    for (const ModelPart& part : session.model().parts)
      for (const Index t : part.triangles)
        for (const Index v : session.model().surface.triangles[static_cast<std::size_t>(t)])
          triangles.push_back(static_cast<std::uint32_t>(v));
    place();
  }

  /// The vertices' present places.
  void place() {
    posed.resize(session.model().surface.vertices.size());
    session.reconstruct(posed);
  }
  /// Handles that undo took away go, those that it brought back come.
  std::vector<PoseHandle> standing() const {
    std::vector<PoseHandle> there;
    std::copy_if(made.begin(), made.end(), std::back_inserter(there),
                 [&](PoseHandle handle) { return session.contains(handle); });
    return there;
  }

  PosingSession session;
  std::string name;
  std::vector<std::uint32_t> triangles;
  std::vector<PoseHandle> made;  // all that ever were
  PoseHandle held{};
  std::vector<Vec3> posed;
  std::vector<float> positions;
  std::vector<double> joint_frames, handles;
};

PagePose::PagePose(const std::filesystem::path& model, const std::filesystem::path& joints)
    : impl_(std::make_unique<Impl>(read_model(model, joints), model.stem().string())) {}
PagePose::~PagePose() = default;

std::string PagePose::description() const {
  const JointedModel& model = impl_->session.model();
  Json out = {{"name", impl_->name},
              {"vertices", model.surface.vertices.size()},
              {"parts", Json::array()},
              {"joints", Json::array()}};
  for (std::size_t p = 0; p < model.parts.size(); ++p) {
    const auto part = static_cast<Index>(p);
    out["parts"].push_back({{"name", model.parts[p].name},
                            {"triangles", model.parts[p].triangles.size()},
                            {"soft", impl_->session.part_options(part).cells != Subdivision::kRigid},
                            {"pinned", impl_->session.pinned(part)}});
  }
  for (const ModelJoint& joint : model.joints)
    out["joints"].push_back({{"a", model.parts[static_cast<std::size_t>(joint.a)].name},
                             {"b", model.parts[static_cast<std::size_t>(joint.b)].name},
                             {"type", to_string(joint.joint.type)},
                             {"limits", internal::joint_limits_json(joint.joint)}});
  return out.dump(-1, ' ', true, Json::error_handler_t::replace);
}

std::span<const std::uint32_t> PagePose::triangles() const { return impl_->triangles; }

std::span<const float> PagePose::positions() {
  impl_->positions.clear();
  for (const Vec3& p : impl_->posed)
    for (int i = 0; i < 3; ++i) impl_->positions.push_back(static_cast<float>(p[i]));
  return impl_->positions;
}

std::span<const double> PagePose::joint_frames() {
  Impl& m = *impl_;
  m.joint_frames.clear();
  for (std::size_t j = 0; j < m.session.model().joints.size(); ++j) {
    const PosedJoint joint = m.session.joint(static_cast<Index>(j));
    const int column = internal::axis_column(m.session.model().joints[j].joint.type).value_or(0);
    for (const Vec3& v : {joint.frame.origin, Vec3(joint.frame.axes.col(column))})
      for (int i = 0; i < 3; ++i) m.joint_frames.push_back(v[i]);
    for (std::size_t i = 0; i < 3; ++i)
      m.joint_frames.push_back(i < joint.coordinates.size() ? joint.coordinates[i] : 0.0);
  }
  return m.joint_frames;
}

std::span<const double> PagePose::handles() {
  Impl& m = *impl_;
  m.handles.clear();
  for (const PoseHandle handle : m.standing())
    for (const Vec3& p : {m.session.handle_point(handle), m.session.handle_target(handle)})
      for (int i = 0; i < 3; ++i) m.handles.push_back(p[i]);
  return m.handles;
}

PoseHit PagePose::cast_ray(const Vec3& from, const Vec3& direction) const {
  const Impl& m = *impl_;
  const JointedModel& model = m.session.model();
  const Vec3 along = direction.normalized();
  PoseHit best{.distance = std::numeric_limits<double>::infinity()};
  for (std::size_t p = 0; p < model.parts.size(); ++p)
    for (const Index t : model.parts[p].triangles) {
      const Triangle& corners = model.surface.triangles[static_cast<std::size_t>(t)];
      const auto at = [&](const std::vector<Vec3>& points, std::size_t k) -> const Vec3& {
        return points[static_cast<std::size_t>(corners[k])];
      };
      const auto hit = ray_triangle(from, along, at(m.posed, 0), at(m.posed, 1), at(m.posed, 2));
      if (!hit || (*hit)[0] >= best.distance) continue;
      const std::vector<Vec3>& rest = model.surface.vertices;
      best = {static_cast<Index>(p),
              at(rest, 0) + (*hit)[1] * (at(rest, 1) - at(rest, 0)) + (*hit)[2] * (at(rest, 2) - at(rest, 0)),
              from + (*hit)[0] * along, (*hit)[0]};
    }
  return best;
}

bool PagePose::grab(const PoseHit& hit) {
  if (hit.part < 0) return false;
  impl_->held = impl_->session.add_handle(hit.part, hit.at_rest);
  impl_->made.push_back(impl_->held);
  return true;
}

void PagePose::take(int handle) {
  const std::vector<PoseHandle> there = impl_->standing();
  if (handle < 0 || static_cast<std::size_t>(handle) >= there.size())
    throw InvalidArgument("PagePose: there is no handle " + std::to_string(handle));
  impl_->held = there[static_cast<std::size_t>(handle)];
}

void PagePose::drag_to(const Vec3& target) {
  if (target.allFinite() && impl_->session.contains(impl_->held)) impl_->session.move_handle(impl_->held, target);
}

void PagePose::let_go() { impl_->held = {}; }

void PagePose::remove_handle() {
  if (impl_->session.contains(impl_->held)) impl_->session.remove_handle(impl_->held);
  let_go();
}

void PagePose::remove_handles() {
  for (const PoseHandle handle : impl_->standing()) impl_->session.remove_handle(handle);
  let_go();
}

void PagePose::set_pinned(Index part, bool pinned) { impl_->session.set_pinned(part, pinned); }

void PagePose::set_soft(Index part, bool soft) {
  PartOptions options = impl_->session.part_options(part);
  options.cells = soft ? Subdivision::kUniform : Subdivision::kRigid;
  impl_->session.set_part(part, options);
}

void PagePose::set_joint(Index joint, std::string_view told) {
  const auto& joints = impl_->session.model().joints;
  if (joint < 0 || static_cast<std::size_t>(joint) >= joints.size())
    throw InvalidArgument("PagePose: there is no joint " + std::to_string(joint));
  const nlohmann::json value = internal::parse_json(told, "joint");
  const internal::JsonObject o(value, "joint");
  const auto type = joint_type_of(o.text("type"));
  if (!type) internal::refuse("joint.type", internal::in_quotes(o.text("type")), "a type of the joints file");
  JointSpec spec = joints[static_cast<std::size_t>(joint)].joint;
  spec.frame.axes = axes_for(spec, *type);
  spec.limits = internal::read_joint_limits(o, *type);
  spec.type = *type;
  if (spec.type != JointType::kCylindrical) spec.pitch = 0.0;
  o.finish();
  impl_->session.set_joint(joint, spec);
}

void PagePose::set_name(Index part, const std::string& name) {
  Impl& m = *impl_;
  JointedModel model = m.session.model();
  std::vector<Index> was(model.parts.size());
  std::iota(was.begin(), was.end(), Index{0});
  model.parts[checked(model, part, "set_name")].name = name;
  m.session.set_model(std::move(model), was);
}

void PagePose::cut(Index part, const PoseStroke& stroke) {
  Impl& m = *impl_;
  const JointedModel& whole = m.session.model();
  checked(whole, part, "cut");
  std::vector<Index> was(whole.parts.size());
  std::iota(was.begin(), was.end(), Index{0});
  was.push_back(part);
  m.session.set_model(internal::cut_part(whole, part, stroke, m.posed), was);
  m.parts_changed();
}

bool PagePose::undo() {
  const bool done = impl_->session.undo();
  impl_->parts_changed();
  return done;
}

void PagePose::reset() {
  impl_->session.reset_pose();
  impl_->place();
}

PoseResult PagePose::solve() {
  const PoseResult result = impl_->session.solve();
  impl_->place();
  return result;
}

const PosingSession& PagePose::session() const { return impl_->session; }

std::string PagePose::model_text() const {
  Warnings warnings;
  return obj_text(posed_model(impl_->session, warnings).surface);
}

std::string PagePose::joints_text() const {
  Warnings warnings;
  return limber::joints_text(joints_file(posed_model(impl_->session, warnings)));
}

}  // namespace limber
