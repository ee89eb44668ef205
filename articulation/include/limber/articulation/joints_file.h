/// @file limber/articulation/joints_file.h
/// The joints file: components and joints of a model, for people to correct and programs to read
/// (docs/formats/joints.md).
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "limber/articulation/assembly.h"
#include "limber/articulation/detect_joints.h"
#include "limber/model/joint_spec.h"

namespace limber {

/// A part of the model: which faces of the input it has.
struct ComponentRecord {
  std::string name{};              ///< not empty, unique
  std::vector<FaceRange> faces{};  ///< ascending, disjoint; counted in file order from 0
};

struct AlternativeRecord {
  JointSpec joint{};  ///< limits open
  double confidence = 0.0;
  std::string reason{};
};

/// A joint between two components: b moves, a stays. Lengths in the input's own unit and frame.
struct JointRecord {
  Index a = 0, b = 0;  ///< components; different
  JointSpec joint{};
  bool limits_known = true;  ///< false: the file has no `limits`; they are to be found
  double confidence = 1.0;   ///< 0 … 1
  std::vector<AlternativeRecord> alternatives{};
  std::vector<std::string> reasons{};
};

struct JointsFile {
  std::vector<ComponentRecord> components{};
  std::vector<JointRecord> joints{};  ///< one per pair of components at most
};

/// Components of an assembly and detected joints with their limits as they stand.
JointsFile joints_file(const Assembly& assembly, const std::vector<DetectedJoint>& joints);

/// The text of a file; equal content gives equal bytes. Numbers read back to the same bits.
/// @throws InvalidArgument naming the joint and what is wrong with it (see JointSpec::validate())
std::string joints_text(const JointsFile& file);

/// @param name shown in messages, such as `"lamp.joints.json"`. @throws InputError in one line: file, place, what was
/// seen, what was expected
JointsFile parse_joints(std::string_view text, const std::string& name);
JointsFile read_joints(const std::filesystem::path& path);

/// How to make the components of `found` those of `kept`: parts of the file that consist of several found components
/// are merges, other names are renames. @throws InputError if a part of the file does not consist of whole found
/// components.
/// @param name of the file, for messages
ComponentOptions kept_components(const Assembly& found, const JointsFile& kept, const std::string& name);

/// Puts what a user's file says in place of what was detected. A joint of the file replaces the one detected between
/// the same components (by name): type, frame, pitch and, if the file has them, limits; confidence and alternatives
/// stay those that were found. Joints of the file that were not detected are added; detected ones between two
/// components of the file that the file leaves out are dropped. Each joint's reasons say so.
/// @return per joint whether its limits are the file's
/// @throws InputError naming a component of the file that `assembly` has not
std::vector<bool> keep_joints(const Assembly& assembly, const JointsFile& kept, const std::string& name,
                              std::vector<DetectedJoint>& joints);

}  // namespace limber
