#include "limber/model/modal_basis.h"

#include <algorithm>
#include <new>
#include <string>

#include "limber/core/error.h"

namespace limber {
namespace {
constexpr std::align_val_t kAlignment{64};
}

void ModalBasis::Free::operator()(float* p) const { ::operator delete[](p, kAlignment); }

ModalBasis::ModalBasis(Index vertices, Index modes) : vertices_(vertices), modes_(modes) {
  if (vertices < 0 || modes < 0)
    throw InvalidArgument("ModalBasis: " + std::to_string(vertices) + " vertices, " + std::to_string(modes) +
                          " modes, expected 0 or more of each");
  const std::size_t count = static_cast<std::size_t>(tiles()) * modes * 3 * kTile;
  data_.reset(static_cast<float*>(::operator new[](std::max<std::size_t>(count, 1) * sizeof(float), kAlignment)));
  std::fill_n(data_.get(), count, 0.0f);
}

}  // namespace limber
