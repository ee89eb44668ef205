/// @file limber/posing/pose_recording.h
/// A sequence of poses as a GLB that any glTF viewer plays: a node per part. A part that moves as one has keys of place
/// and attitude; one that bends has a morph target for each frame, shown alone at its own time.
#pragma once

#include <memory>
#include <string>

#include "limber/posing/posing_session.h"

namespace limber {

class PoseRecording {
 public:
  /// @param metres_per_unit of the model, > 0 @throws InvalidArgument
  explicit PoseRecording(const PosingSession& session, double metres_per_unit = 1.0);
  ~PoseRecording();
  PoseRecording(PoseRecording&&) noexcept;
  PoseRecording& operator=(PoseRecording&&) noexcept;

  /// Adds the pose as it is. @param time s, ≥ 0, after the frames before
  /// @throws InvalidArgument if it is not, or other parts bend than at the recording's start
  void add(double time, const PosingSession& session);

  /// The file's bytes. @throws InvalidArgument if there is no frame
  std::string glb() const;

  /// Morph targets of the part that has most: many viewers hold 256 at most.
  std::size_t most_targets() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
