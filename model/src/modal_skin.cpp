#include "limber/model/modal_skin.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "limber/core/error.h"

namespace limber {
namespace {

using Share = std::pair<double, std::size_t>;  // weight, handle
using Shares = std::array<Share, SkinInfluences::kMost>;

bool comes_first(const Share& a, const Share& b) {
  return a.first > b.first || (a.first == b.first && a.second < b.second);
}

/// Rounds weights of sum 1 to multiples of kUnit; the largest takes what rounding leaves.
void round_to_unit(Shares& shares) {
  double rest = 1.0;
  for (std::size_t i = 1; i < shares.size(); ++i) {
    shares[i].first = std::round(shares[i].first / SkinInfluences::kUnit) * SkinInfluences::kUnit;
    rest -= shares[i].first;
  }
  shares[0].first = rest;
  std::sort(shares.begin(), shares.end(), comes_first);
}

}  // namespace

SkinInfluences skin_influences(std::span<const double> weights) {
  if (weights.empty() || weights.size() > static_cast<std::size_t>(ModalSkin::kMaxHandles))
    throw InvalidArgument("skin_influences: " + std::to_string(weights.size()) + " weights, expected 1 to " +
                          std::to_string(ModalSkin::kMaxHandles));
  std::vector<Share> all;
  for (std::size_t h = 0; h < weights.size(); ++h) all.emplace_back(std::max(0.0, weights[h]), h);
  all.resize(std::max(all.size(), SkinInfluences::kMost), {0.0, 0});
  std::stable_sort(all.begin(), all.end(), comes_first);
  if (!(all[0].first > 0.0 && std::isfinite(all[0].first)))
    throw InvalidArgument("skin_influences: no weight is above 0 and finite");
  const double fifth = all.size() > SkinInfluences::kMost ? all[SkinInfluences::kMost].first : 0.0;
  Shares kept;
  double sum = 0.0;
  for (std::size_t i = 0; i < kept.size(); ++i) {
    kept[i] = {all[i].first - fifth, all[i].second};
    sum += kept[i].first;
  }
  for (Share& share : kept) share.first = sum > 0.0 ? share.first / sum : 0.25;  // five or more alike: the first four
  round_to_unit(kept);
  SkinInfluences out;
  for (std::size_t i = 0; i < kept.size(); ++i) {
    out.weight[i] = static_cast<float>(kept[i].first);
    out.handle[i] = kept[i].first > 0.0 ? static_cast<std::uint8_t>(kept[i].second) : std::uint8_t{0};
  }
  return out;
}

}  // namespace limber
