#include "rigid_models.h"

namespace limber::internal {

RigidModel RigidModels::get(const std::shared_ptr<const Shape>& shape, const MassProperties& mass) {
  std::erase_if(made_, [](const Made& m) { return m.of.expired() || m.model.expired(); });
  for (const Made& m : made_)
    if (m.of.lock() == shape && m.mass.mass == mass.mass && m.mass.center_of_mass == mass.center_of_mass &&
        m.mass.inertia == mass.inertia)
      return {m.model.lock(), m.shape.lock()};
  RigidModel fresh = make_rigid_model(shape, mass);
  made_.push_back({shape, mass, fresh.model, fresh.shape});
  return fresh;
}

}  // namespace limber::internal
