// Stands in if Bullet is not found.
#include "limber/core/error.h"
#include "stability_scenes.h"

namespace limber::testing {

bool has_bullet() { return false; }

StabilityResult run_by_bullet(const StabilityCase&, int) {
  throw InvalidArgument("run_by_bullet: this build found no Bullet (apt-get install libbullet-dev)");
}

}  // namespace limber::testing
