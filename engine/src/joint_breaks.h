// Joints that broke in the last step.
#pragma once

#include <span>
#include <tuple>
#include <vector>

#include "body_table.h"
#include "constraint_stage.h"
#include "limber/engine/world.h"

namespace limber::internal {

class JointBreaks {
 public:
  /// Those whose force is larger than their strength, as of the last step; they are still there.
  void find(const ConstraintStage& constraints, const BodyTable& bodies);
  std::span<const JointBreak> events() const { return events_; }

 private:
  friend struct limber::StateFields;
  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.events_);
  }

  std::vector<JointBreak> events_;  // by place
};

}  // namespace limber::internal
