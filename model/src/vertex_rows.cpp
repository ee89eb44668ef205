#include "limber/model/vertex_rows.h"

namespace limber {

VertexRows::VertexRows(const ModalBasis& basis)
    : vertices_(basis.vertices()),
      modes_(basis.modes()),
      stride_((basis.modes() + kPadding - 1) / kPadding * kPadding),
      data_(std::size_t{3} * static_cast<std::size_t>(vertices_) * static_cast<std::size_t>(stride_)) {
  for (Index v = 0; v < vertices_; ++v)
    for (Index m = 0; m < modes_; ++m) {
      const Vec3f u = basis.shape(v, m);
      for (int axis = 0; axis < 3; ++axis) data_[static_cast<std::size_t>(row(v, axis) - data_.data()) + m] = u[axis];
    }
}

}  // namespace limber
