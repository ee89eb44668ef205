/// @file limber/posing/jointed_model.h
/// A model to be posed: a surface, the parts that its triangles belong to, and the joints between parts.
///
/// Parts are sets of triangles. Parts that share vertices are one piece of material cut in two: a joint between them is
/// a *virtual joint* [X09 4.4] (the ears of a bunny), and the surface goes over smoothly from one to the other. Parts
/// that share none meet in joints only.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "limber/articulation/detect_joints.h"
#include "limber/articulation/joints_file.h"
#include "limber/mesh/grouped_surface.h"
#include "limber/model/joint_spec.h"

namespace limber {

struct ModelPart {
  std::string name{};              ///< unique, not empty
  std::vector<Index> triangles{};  ///< of the surface, ascending; at least one
};

struct ModelJoint {
  Index a = 0, b = 0;  ///< parts; b moves, a stays where the coordinates are told
  JointSpec joint{};
  /// Region that moves with the joint as one: cells of a deformable part in it share a transformation [X09 4.1]. None:
  /// the cell nearest to the joint's origin.
  std::optional<OrientedBox> influence{};
};

struct JointedModel {
  SurfaceMesh surface{};
  std::vector<ModelPart> parts{};
  std::vector<ModelJoint> joints{};

  /// The part of this name. @throws InvalidArgument naming the nearest name there is
  Index part_named(const std::string& name) const;
  /// @throws InvalidArgument naming the part or joint and what is wrong with it
  void validate() const;
};

/// A model whose parts and joints a joints file tells. Limits that the file leaves out are open. Influence boxes are
/// found: around the surfaces' contact (limber/articulation/contact_region.h), for parts that share vertices around
/// those. @param name of the file, for messages. @throws InputError naming a component whose faces the surface has not,
/// or a face that is in no component
JointedModel jointed_model(const GroupedSurface& surface, const JointsFile& file, const std::string& name);

/// A model as detection found it.
JointedModel jointed_model(const Assembly& assembly, const std::vector<DetectedJoint>& joints);

}  // namespace limber
