// Poses to begin from anew where steps from the pose at hand end at a local minimum.
#pragma once

#include <vector>

#include "solver/pose_solver.h"

namespace limber::internal {

/// Poses whose joints stand anywhere their limits let them, spread evenly: number n has coordinate k at the part
/// n √p_k − ⌊n √p_k⌋ of its range, p_k the k-th prime (Richtmyer's sequence). Bodies that strain links keep their place
/// among each other. A joint that closes a chain is left as it comes.
class PoseStarts {
 public:
  /// The structure must outlive it.
  explicit PoseStarts(const PoseStructure& structure);

  /// @param from where pinned bodies stand, and what bodies without joints keep. @param number ≥ 1
  Pose start(const Pose& from, int number) const;

 private:
  /// A joint by which a set of bodies is placed from one that stands already.
  struct Placing {
    std::size_t joint = 0;
    bool b_stands = false;
    std::vector<std::size_t> bodies{};  // those it places
  };
  const PoseStructure* structure_;
  std::vector<Placing> order_;
};

}  // namespace limber::internal
