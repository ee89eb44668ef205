#include "structure.h"

#include <algorithm>
#include <cmath>

#include "cells/cell_bodies.h"
#include "limber/core/error.h"
#include "limber/internal/strict_json.h"
#include "limber/mesh/surface_locator.h"

namespace limber::internal {
namespace {

/// Parts that share vertices, numbered by their first part.
std::vector<Index> groups_of(const JointedModel& model) {
  DisjointSets sets(model.parts.size());
  std::vector<Index> owner(model.surface.vertices.size(), -1);
  for (std::size_t p = 0; p < model.parts.size(); ++p)
    for (const Index t : model.parts[p].triangles)
      for (const Index v : model.surface.triangles[static_cast<std::size_t>(t)]) {
        Index& first = owner[static_cast<std::size_t>(v)];
        if (first < 0)
          first = static_cast<Index>(p);
        else
          sets.join(first, static_cast<Index>(p));
      }
  return sets.labels();
}

/// A group's triangles over the model's vertices, and whose each is.
struct Group {
  std::vector<Index> parts{};
  SurfaceMesh surface{};
  std::vector<Index> part_of_triangle{};
};

std::vector<Group> take_groups(const JointedModel& model, const std::vector<Index>& group_of_part) {
  std::vector<Group> out(static_cast<std::size_t>(1 + *std::max_element(group_of_part.begin(), group_of_part.end())));
  for (std::size_t p = 0; p < model.parts.size(); ++p) {
    Group& group = out[static_cast<std::size_t>(group_of_part[p])];
    group.parts.push_back(static_cast<Index>(p));
    for (const Index t : model.parts[p].triangles) {
      group.surface.triangles.push_back(model.surface.triangles[static_cast<std::size_t>(t)]);
      group.part_of_triangle.push_back(static_cast<Index>(p));
    }
  }
  for (Group& group : out) {  // its own vertices only
    std::vector<Index> own(model.surface.vertices.size(), -1);
    for (Triangle& t : group.surface.triangles)
      for (Index& v : t) {
        Index& number = own[static_cast<std::size_t>(v)];
        if (number < 0) {
          number = static_cast<Index>(group.surface.vertices.size());
          group.surface.vertices.push_back(model.surface.vertices[static_cast<std::size_t>(v)]);
        }
        v = number;
      }
  }
  return out;
}

/// The finest division of several parts in one piece rules, as the grid is theirs together.
PartOptions group_options(const Group& group, const std::vector<PartOptions>& options) {
  if (group.parts.size() == 1) return options[static_cast<std::size_t>(group.parts.front())];
  PartOptions out{.cells = Subdivision::kUniform};
  for (const Index p : group.parts) {
    const PartOptions& part = options[static_cast<std::size_t>(p)];
    if (part.cells == Subdivision::kRigid) continue;
    if (part.cells == Subdivision::kOctree) out.cells = part.cells, out.octree_levels = part.octree_levels;
    if (part.cell_size > 0.0)
      out.cell_size = out.cell_size > 0.0 ? std::min(out.cell_size, part.cell_size) : part.cell_size;
  }
  return out;
}

void place_cells(const JointedModel& model, const Group& group, PoseStructure& out) {
  const auto grid = static_cast<Index>(out.grids.size() - 1);
  std::vector<bool> met(model.parts.size(), false);
  const bool several = group.parts.size() > 1;
  const SurfaceLocator locator(group.surface.vertices, group.surface.triangles);
  for (const Cell& cell : out.grids.back().cells) {
    const Index part = several ? group.part_of_triangle[static_cast<std::size_t>(locator.nearest(cell.centre).triangle)]
                               : group.parts.front();
    met[static_cast<std::size_t>(part)] = true;
    out.cells.push_back({grid, cell, part, -1});
  }
  for (const Index p : group.parts)
    if (!met[static_cast<std::size_t>(p)])
      throw InvalidArgument(
          "part " + in_quotes(model.parts[static_cast<std::size_t>(p)].name) +
          " gets no cell of its own; expected a smaller cell_size for the parts it is in one piece with");
}

/// Numbers the sets of cells that move as one and adds up their volume.
void make_bodies(DisjointSets& sets, const std::vector<bool>& pinned, PoseStructure& out) {
  const std::vector<Index> label = sets.labels();
  const auto count = label.empty() ? 0 : 1 + *std::max_element(label.begin(), label.end());
  out.bodies.assign(static_cast<std::size_t>(count), {});
  const auto volume = [](const Cell& c) { return 8.0 * c.half.prod(); };
  for (std::size_t i = 0; i < out.cells.size(); ++i) {
    PlacedCell& c = out.cells[i];
    c.body = label[i];
    PoseBody& body = out.bodies[static_cast<std::size_t>(c.body)];
    body.centre += volume(c.cell) * c.cell.centre;
    body.volume += volume(c.cell);
    body.pinned = body.pinned || pinned[static_cast<std::size_t>(c.part)];
  }
  for (PoseBody& body : out.bodies) body.centre /= body.volume;
  for (const PlacedCell& c : out.cells) {
    PoseBody& body = out.bodies[static_cast<std::size_t>(c.body)];
    body.radius_squared +=
        volume(c.cell) / body.volume * ((c.cell.centre - body.centre).squaredNorm() + c.cell.half.squaredNorm() / 3.0);
  }
}

Index first_cell_of(const PoseStructure& structure, Index part) {
  const auto found =
      std::find_if(structure.cells.begin(), structure.cells.end(), [&](const PlacedCell& c) { return c.part == part; });
  return static_cast<Index>(found - structure.cells.begin());
}

/// Rigid parts, joints' regions and what fixed joints hold become one. @return per joint a cell of each side
std::vector<std::array<Index, 2>> join_cells(const JointedModel& model, const std::vector<PartOptions>& options,
                                             const PoseStructure& structure, DisjointSets& sets) {
  std::vector<Index> first(model.parts.size(), -1);
  for (std::size_t i = 0; i < structure.cells.size(); ++i) {
    const auto part = static_cast<std::size_t>(structure.cells[i].part);
    if (first[part] < 0) first[part] = static_cast<Index>(i);
    if (options[part].cells == Subdivision::kRigid) sets.join(first[part], static_cast<Index>(i));
  }
  std::vector<std::array<Index, 2>> out;
  const std::vector<ClaimedCells> claimed = claim_cells(model, structure, options);
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const ModelJoint& joint = model.joints[j];
    for (const auto* side : {&claimed[j].a, &claimed[j].b})
      for (const Index c : *side) sets.join(side->front(), c);
    const Index a = claimed[j].a.empty() ? first_cell_of(structure, joint.a) : claimed[j].a.front();
    const Index b = claimed[j].b.empty() ? first_cell_of(structure, joint.b) : claimed[j].b.front();
    if (joint.joint.type == JointType::kFixed) sets.join(a, b);
    out.push_back({a, b});
  }
  return out;
}

}  // namespace

PoseStructure build_structure(const JointedModel& model, const std::vector<PartOptions>& options,
                              const std::vector<bool>& pinned, StrainWeights weights) {
  for (const PartOptions& part : options) part.validate();
  PoseStructure out;
  Eigen::AlignedBox3d box;
  for (const Vec3& p : model.surface.vertices) box.extend(p);
  out.size = box.diagonal().norm();
  out.group_of_part = groups_of(model);
  for (const Group& group : take_groups(model, out.group_of_part)) {
    out.grids.push_back(make_cells(group.surface, group_options(group, options)));
    place_cells(model, group, out);
  }
  DisjointSets sets(out.cells.size());
  const auto joint_cells = join_cells(model, options, out, sets);
  make_bodies(sets, pinned, out);
  link_bodies(model, options, weights, out);
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const Index a = out.cells[static_cast<std::size_t>(joint_cells[j][0])].body,
                b = out.cells[static_cast<std::size_t>(joint_cells[j][1])].body;
    if (a != b) out.joints.push_back({a, b, static_cast<Index>(j), model.joints[j].a, model.joints[j].joint});
  }
  return out;
}

BodyPoses rest_poses(const PoseStructure& structure) {
  BodyPoses out;
  for (const PoseBody& body : structure.bodies) out.push_back({{}, body.centre});
  return out;
}

}  // namespace limber::internal
