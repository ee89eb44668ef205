#include "residual_factor.h"
#include "tuning.h"

#include <algorithm>

namespace limber {
void ResidualFactor::set(const IslandBodies& bodies, const ConstraintRows& rows, double step) {
  const auto count = static_cast<std::size_t>(bodies.count());
  if (bodies_.size() < count) bodies_.resize(count), pairs_.resize(count);
  for (std::size_t b = 0; b < count; ++b) bodies_[b].rows.clear(), bodies_[b].rank = 0, pairs_[b].clear();
  own_.assign(static_cast<std::size_t>(rows.size()), {});
  for (const ConstraintRows::Flexibility& g : rows.flexibility()) {
    if (g.body < 0) continue;
    const Index local = bodies.local(g.body);
    const auto number = [&](Index at) { return static_cast<Index>(number_in(local, static_cast<std::size_t>(at))); };
    pairs_[static_cast<std::size_t>(local)].push_back({number(g.i), number(g.j), g.value / step, g.body});
  }
  for (std::size_t b = 0; b < count; ++b)
    if (!pairs_[b].empty()) factor(bodies_[b], pairs_[b]);
}

/// Gives the row one where it has none.
std::size_t ResidualFactor::number_in(Index local, std::size_t at) {
  for (Own& own : own_[at]) {
    if (own.local == local) return own.number;
    if (own.local >= 0) continue;
    std::vector<std::size_t>& rows = bodies_[static_cast<std::size_t>(local)].rows;
    own = {local, rows.size()};
    rows.push_back(at);
    return own.number;
  }
  return 0;  // not reached: a row has two sides
}

void ResidualFactor::factor(Body& body, std::span<const ConstraintRows::Flexibility> pairs) {
  const std::size_t n = body.rows.size();
  const internal::MatrixView S = matrix_.need(n, n);
  std::fill_n(S.values, n * S.stride, 0.0);
  for (const ConstraintRows::Flexibility& g : pairs) {
    const auto i = static_cast<std::size_t>(g.i), j = static_cast<std::size_t>(g.j);
    S.row(i)[j] += g.value;
    if (i != j) S.row(j)[i] += g.value;
  }
  cholesky_.factor(S, n, internal::kConstraintsTuning.rows.indentation_pivot);
  body.rank = cholesky_.rank();
  body.values.resize(n * body.rank);
  for (std::size_t c = 0; c < body.rank; ++c)
    for (std::size_t i = 0; i < n; ++i) body.values[i * body.rank + c] = cholesky_.columns().row(c)[i];
}

std::span<const double> ResidualFactor::row(Index local, std::size_t at) const {
  const Body& body = bodies_[static_cast<std::size_t>(local)];
  for (const Own& own : own_[at])
    if (own.local == local) return std::span(body.values).subspan(own.number * body.rank, body.rank);
  return {};
}

}  // namespace limber
