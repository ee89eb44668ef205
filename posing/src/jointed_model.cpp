#include "limber/posing/jointed_model.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "limber/core/error.h"
#include "limber/internal/strict_json.h"

namespace limber {
namespace {

using internal::in_quotes;

/// The triangles of some faces of the file, ascending.
std::vector<Index> triangles_of(const GroupedSurface& surface, const ComponentRecord& record, const std::string& name) {
  std::vector<Index> out;
  const Index faces = surface.face_of.empty() ? 0 : surface.face_of.back() + 1;
  for (const FaceRange& range : record.faces) {
    if (range.first + range.count > faces)
      throw InputError(name + " component " + in_quotes(record.name) + ": faces " + std::to_string(range.first) +
                       " to " + std::to_string(range.first + range.count - 1) + ", but the model has " +
                       std::to_string(faces) + " faces; is it another model's file?");
    const auto begin = std::lower_bound(surface.face_of.begin(), surface.face_of.end(), range.first);
    const auto end = std::lower_bound(begin, surface.face_of.end(), range.first + range.count);
    for (auto it = begin; it != end; ++it) out.push_back(static_cast<Index>(it - surface.face_of.begin()));
  }
  if (out.empty())
    throw InputError(name + " component " + in_quotes(record.name) + ": has no triangle of the model left");
  return out;
}

void require_all_faces(const JointedModel& model, const GroupedSurface& surface, const std::string& name) {
  std::vector<bool> taken(surface.surface.triangles.size(), false);
  for (const ModelPart& part : model.parts)
    for (const Index t : part.triangles) taken[static_cast<std::size_t>(t)] = true;
  const auto left = std::find(taken.begin(), taken.end(), false);
  if (left != taken.end())
    throw InputError(name + " components: face " +
                     std::to_string(surface.face_of[static_cast<std::size_t>(left - taken.begin())]) +
                     " of the model belongs to none, expected every face in one");
}

/// A part's triangles over its own vertices, as a component of an assembly.
Component component_of(const JointedModel& model, const ModelPart& part) {
  Component out;
  out.name = part.name;
  out.triangles = part.triangles;
  std::map<Index, Index> own;
  for (const Index t : part.triangles) {
    Triangle corners{};
    for (std::size_t k = 0; k < 3; ++k) {
      const Index v = model.surface.triangles[static_cast<std::size_t>(t)][k];
      const auto [entry, fresh] = own.try_emplace(v, static_cast<Index>(out.surface.vertices.size()));
      if (fresh) out.surface.vertices.push_back(model.surface.vertices[static_cast<std::size_t>(v)]);
      corners[k] = entry->second;
    }
    out.surface.triangles.push_back(corners);
  }
  weld(out.surface);
  std::erase_if(out.surface.triangles, [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
  out.closed = surface_quality(out.surface).closed_manifold();
  Eigen::AlignedBox3d box;
  for (const Vec3& p : out.surface.vertices) box.extend(p);
  out.diagonal = box.diagonal().norm();
  return out;
}

OrientedBox box_around(const std::vector<Vec3>& points, const Mat3& axes) {
  Eigen::AlignedBox3d box;
  for (const Vec3& p : points) box.extend(Vec3(axes.transpose() * p));
  return {{axes * box.center(), axes}, 0.5 * box.diagonal()};
}

/// Vertices that two parts share.
std::vector<Vec3> shared_vertices(const JointedModel& model, Index a, Index b) {
  const auto vertices_of = [&](Index part) {
    std::set<Index> out;
    for (const Index t : model.parts[static_cast<std::size_t>(part)].triangles)
      for (const Index v : model.surface.triangles[static_cast<std::size_t>(t)]) out.insert(v);
    return out;
  };
  const std::set<Index> of_a = vertices_of(a), of_b = vertices_of(b);
  std::vector<Vec3> out;
  for (const Index v : of_a)
    if (of_b.contains(v)) out.push_back(model.surface.vertices[static_cast<std::size_t>(v)]);
  return out;
}

std::vector<Vec3> contact_points(const std::vector<ContactRegion>& regions, Index a, Index b) {
  std::vector<Vec3> out;
  for (const ContactRegion& region : regions) {
    if (std::minmax(region.a, region.b) != std::minmax(a, b)) continue;
    for (const auto* side : {&region.on_a, &region.on_b})
      for (const ContactSample& sample : *side) out.push_back(sample.point);
  }
  return out;
}

void find_influences(JointedModel& model) {
  Assembly assembly{.source = model.surface, .components = {}, .proposals = {}};
  Eigen::AlignedBox3d all;
  for (const Vec3& p : model.surface.vertices) all.extend(p);
  assembly.diagonal = all.diagonal().norm();
  for (const ModelPart& part : model.parts) assembly.components.push_back(component_of(model, part));
  const std::vector<ContactRegion> regions = find_contact_regions(assembly);
  for (ModelJoint& joint : model.joints) {
    std::vector<Vec3> points = shared_vertices(model, joint.a, joint.b);
    if (points.empty()) points = contact_points(regions, joint.a, joint.b);
    if (!points.empty()) joint.influence = box_around(points, joint.joint.frame.axes);
  }
}

}  // namespace

Index JointedModel::part_named(const std::string& name) const {
  std::vector<std::string> names;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    if (parts[p].name == name) return static_cast<Index>(p);
    names.push_back(parts[p].name);
  }
  throw InvalidArgument("there is no part " + in_quotes(name) + "; the nearest is " +
                        in_quotes(internal::nearest_word(name, names)));
}

void JointedModel::validate() const {
  if (parts.empty()) throw InvalidArgument("JointedModel: there are no parts, expected one or more");
  std::set<std::string> names;
  for (const ModelPart& part : parts)
    if (part.name.empty() || !names.insert(part.name).second)
      throw InvalidArgument("JointedModel: a part is called " + in_quotes(part.name) +
                            (part.name.empty() ? ", expected a name" : " as another is, expected a name of its own"));
  std::vector<Index> owner(surface.triangles.size(), -1);
  const auto vertices = static_cast<Index>(surface.vertices.size());
  for (std::size_t p = 0; p < parts.size(); ++p) {
    if (parts[p].triangles.empty())
      throw InvalidArgument("JointedModel: part " + in_quotes(parts[p].name) + " has no triangle");
    for (const Index t : parts[p].triangles) {
      if (t < 0 || static_cast<std::size_t>(t) >= owner.size() || owner[static_cast<std::size_t>(t)] >= 0)
        throw InvalidArgument("JointedModel: triangle " + std::to_string(t) + " of part " + in_quotes(parts[p].name) +
                              " is not there or another part's too");
      owner[static_cast<std::size_t>(t)] = static_cast<Index>(p);
      for (const Index v : surface.triangles[static_cast<std::size_t>(t)])
        if (v < 0 || v >= vertices)
          throw InvalidArgument("JointedModel: triangle " + std::to_string(t) + " names vertex " + std::to_string(v) +
                                " of " + std::to_string(vertices));
    }
  }
  for (const Vec3& p : surface.vertices)
    if (!p.allFinite()) throw InvalidArgument("JointedModel: a vertex is not finite");
  const auto count = static_cast<Index>(parts.size());
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const ModelJoint& joint = joints[j];
    if (joint.a < 0 || joint.a >= count || joint.b < 0 || joint.b >= count || joint.a == joint.b)
      throw InvalidArgument("JointedModel: joint " + std::to_string(j) + " is between parts " +
                            std::to_string(joint.a) + " and " + std::to_string(joint.b) + ", expected two of " +
                            std::to_string(count));
    joint.joint.validate();
  }
}

JointedModel jointed_model(const GroupedSurface& surface, const JointsFile& file, const std::string& name) {
  JointedModel out;
  out.surface = surface.surface;
  for (const ComponentRecord& record : file.components)
    out.parts.push_back({record.name, triangles_of(surface, record, name)});
  require_all_faces(out, surface, name);
  for (const JointRecord& record : file.joints) {
    ModelJoint joint{.a = record.a, .b = record.b, .joint = record.joint, .influence = {}};
    if (!record.limits_known) joint.joint.limits = {};
    out.joints.push_back(joint);
  }
  out.validate();
  find_influences(out);
  return out;
}

JointedModel jointed_model(const Assembly& assembly, const std::vector<DetectedJoint>& joints) {
  JointedModel out;
  out.surface = assembly.source;
  for (const Component& component : assembly.components) out.parts.push_back({component.name, component.triangles});
  for (const DetectedJoint& joint : joints) out.joints.push_back({joint.a, joint.b, joint.joint, joint.influence});
  out.validate();
  return out;
}

}  // namespace limber
