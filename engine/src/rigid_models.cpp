#include "rigid_models.h"

namespace limber::internal {

template <class Make>
RigidModel RigidModels::find_or_make(const std::shared_ptr<const Shape>& shape, const MassProperties& mass,
                                     const Make& make) {
  std::erase_if(made_, [](const Made& m) { return m.of.expired() || m.model.expired(); });
  for (const Made& m : made_)
    if (m.of.lock() == shape && m.mass.mass == mass.mass && m.mass.center_of_mass == mass.center_of_mass &&
        m.mass.inertia == mass.inertia)
      return {m.model.lock(), m.shape.lock()};
  RigidModel fresh = make();
  made_.push_back({shape, mass, fresh.model, fresh.shape});
  return fresh;
}

RigidModel RigidModels::get(const std::shared_ptr<const Shape>& shape, const MassProperties& mass) {
  return find_or_make(shape, mass, [&] { return make_rigid_model(shape, mass); });
}

RigidModel RigidModels::get_kinematic(const std::shared_ptr<const Shape>& shape) {
  return find_or_make(shape, {}, [&] { return make_kinematic_model(shape); });
}

}  // namespace limber::internal
