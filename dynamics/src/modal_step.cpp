#include "limber/dynamics/modal_step.h"

#include <algorithm>
#include <cmath>

namespace limber {

void ModalStep::set(std::span<const double> lambda, std::span<const double> decay, double length, double static_above) {
  table_.set(lambda, decay, length);
  position_response_.resize(lambda.size());
  velocity_response_.resize(lambda.size());
  for (std::size_t i = 0; i < lambda.size(); ++i) {
    const bool answers_statically = std::sqrt(std::max(lambda[i] - decay[i] * decay[i], 0.0)) > static_above;
    position_response_[i] =
        answers_statically ? 1.0 / (lambda[i] * length) : table_.at(static_cast<Index>(i)).z_g / length;
    velocity_response_[i] = answers_statically ? 0.0 : 1.0;
  }
}

}  // namespace limber
