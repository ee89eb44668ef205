#include "limber/model/residual_compliance.h"

#include <algorithm>
#include <string>

#include "limber/core/error.h"

namespace limber {
namespace {
constexpr std::size_t kBlock = 9;
}

std::string_view to_string(ResidualCompliance::Form form) {
  return form == ResidualCompliance::Form::kFull ? "full" : "local";
}

ResidualCompliance::ResidualCompliance(Form form, Index vertices) : form_(form), vertices_(vertices) {
  if (vertices < 0)
    throw InvalidArgument("ResidualCompliance: " + std::to_string(vertices) + " vertices, expected 0 or more");
  values_.resize(value_count(form, vertices));
}

std::size_t ResidualCompliance::value_count(Form form, Index vertices) {
  const auto n = static_cast<std::size_t>(vertices);
  return kBlock * (form == Form::kFull ? n * (n + 1) / 2 : n);
}

std::size_t ResidualCompliance::place(Index a, Index b) const {
  const auto row = static_cast<std::size_t>(a);
  return kBlock * (form_ == Form::kFull ? row * (row + 1) / 2 + static_cast<std::size_t>(b) : row);
}

Mat3 ResidualCompliance::block(Index a, Index b) const {
  if (a != b && form_ == Form::kLocal) return Mat3::Zero();
  const auto stored = Eigen::Map<const Eigen::Matrix3f>(&values_[place(std::max(a, b), std::min(a, b))]);
  return a >= b ? Mat3(stored.cast<double>()) : Mat3(stored.transpose().cast<double>());
}

void ResidualCompliance::set(Index a, Index b, const Mat3& G) {
  if (a != b && form_ == Form::kLocal) return;
  Eigen::Map<Eigen::Matrix3f> stored(&values_[place(std::max(a, b), std::min(a, b))]);
  stored = (a >= b ? G : Mat3(G.transpose())).cast<float>();
}

}  // namespace limber
