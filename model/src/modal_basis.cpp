#include "limber/model/modal_basis.h"

#include <string>

#include "limber/core/error.h"

namespace limber {

ModalBasis::ModalBasis(Index vertices, Index modes) : vertices_(vertices), modes_(modes) {
  if (vertices < 0 || modes < 0)
    throw InvalidArgument("ModalBasis: " + std::to_string(vertices) + " vertices, " + std::to_string(modes) +
                          " modes, expected 0 or more of each");
  data_ = AlignedArray<float>(static_cast<std::size_t>(tiles()) * modes * 3 * kTile);
}

}  // namespace limber
