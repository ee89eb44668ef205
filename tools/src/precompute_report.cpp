#include "precompute_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>

namespace limber::tools {
namespace {

using Json = nlohmann::ordered_json;

Json json(const Vec3& v) { return {v.x(), v.y(), v.z()}; }
Json json(const Mat3& m) {
  Json rows = Json::array();
  for (int r = 0; r < 3; ++r) rows.push_back({m(r, 0), m(r, 1), m(r, 2)});
  return rows;
}
Json json(const EmbeddingReport& e) {
  return {{"vertices", e.vertices}, {"outside", e.outside}, {"max_distance", e.max_distance}};
}

Json json(const ResidualReport& r) {
  Json form;
  if (r.form) form = to_string(*r.form);
  Json captured = Json::array();
  for (const CapturedLoad& load : r.captured) captured.push_back({{"at", json(load.at)}, {"share", load.share}});
  return {{"modes", r.modes}, {"captured", captured}, {"form", form}, {"vertices", r.vertices}, {"bytes", r.bytes}};
}

Json json(const SkinReport& r) {
  if (r.handles == 0) return nullptr;
  Json modes = Json::array();
  for (const SkinReport::Mode& m : r.modes)
    modes.push_back({{"mode", m.mode}, {"degrees", SkinReport::kDegrees}, {"energy_ratio", m.energy}});
  return {{"handles", r.handles}, {"ground", r.ground}, {"spread", r.spread}, {"bytes", r.bytes}, {"modes", modes}};
}

Json json(const SoundReport& r) {
  if (r.audible == 0) return nullptr;
  return {{"modes", r.modes},
          {"audible", r.audible},
          {"overdamped", r.overdamped},
          {"frequencies_hz", {r.lowest_hz, r.highest_hz}},
          {"loss_factors", {r.lowest_loss, r.highest_loss}},
          {"bytes", r.bytes}};
}

double least_share(const std::vector<CapturedLoad>& captured) {
  double least = 1.0;
  for (const CapturedLoad& load : captured) least = std::min(least, load.share);
  return least;
}

/// Mass, centre and inertia of all bodies together.
struct Total {
  double mass = 0.0, volume = 0.0;
  Vec3 center = Vec3::Zero();
  Mat3 inertia = Mat3::Zero();
};

Total total_of(const std::vector<BodyReport>& bodies) {
  Total t;
  for (const BodyReport& b : bodies) {
    t.mass += b.solid.mass;
    t.volume += b.solid.volume;
    t.center += b.solid.mass * b.solid.center_of_mass;
  }
  t.center /= t.mass;
  for (const BodyReport& b : bodies) {
    const Vec3 d = b.solid.center_of_mass - t.center;
    t.inertia += b.solid.inertia + b.solid.mass * (d.squaredNorm() * Mat3::Identity() - d * d.transpose());
  }
  return t;
}

/// One elastic mode of one body, for merging.
struct BodyMode {
  double hz = 0.0;
  Index body = 0, mode = 0;
};

/// Modes of all bodies, ascending, as far as the list has no holes.
std::vector<BodyMode> merged_modes(const std::vector<BodyReport>& bodies) {
  std::vector<BodyMode> modes;
  double complete_to = std::numeric_limits<double>::infinity();
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const auto& hz = bodies[b].modes.frequencies_hz;
    for (std::size_t m = 0; m < hz.size(); ++m) modes.push_back({hz[m], static_cast<Index>(b), static_cast<Index>(m)});
    if (!bodies[b].modes.all) complete_to = std::min(complete_to, hz.empty() ? 0.0 : hz.back());
  }
  std::stable_sort(modes.begin(), modes.end(), [](const BodyMode& a, const BodyMode& b) { return a.hz < b.hz; });
  std::erase_if(modes, [&](const BodyMode& m) { return m.hz > complete_to; });
  return modes;
}

Json discarded(Index index, const DroppedMode& d) {
  return {{"index", index}, {"reason", to_string(d.reason)}, {"value", d.value}, {"limit", d.limit}};
}

void add_modes(Json& report, const std::vector<BodyReport>& bodies) {
  const auto modes = merged_modes(bodies);
  Json hz = Json::array(), errors = Json::array(), kept = Json::array(), dropped = Json::array(), owner = Json::array();
  for (std::size_t i = 0; i < modes.size(); ++i) {
    const ModeSelection& s = bodies[modes[i].body].modes.selection;
    hz.push_back(modes[i].hz);
    errors.push_back(bodies[modes[i].body].modes.frequency_errors[static_cast<std::size_t>(modes[i].mode)]);
    owner.push_back(modes[i].body);
    if (std::binary_search(s.kept.begin(), s.kept.end(), modes[i].mode)) {
      kept.push_back(i);
      continue;
    }
    for (const DroppedMode& d : s.dropped)
      if (d.mode == modes[i].mode) dropped.push_back(discarded(static_cast<Index>(i), d));
  }
  report["frequencies_hz"] = std::move(hz);
  report["frequency_errors"] = std::move(errors);
  if (bodies.size() > 1) report["body_of_frequency"] = std::move(owner);
  report["kept"] = std::move(kept);
  report["discarded"] = std::move(dropped);
}

Json json(const std::vector<RegionReport>& regions) {
  Json all = Json::array();
  for (const RegionReport& r : regions)
    all.push_back({{"name", r.name}, {"tets", r.tets}, {"volume", r.volume}, {"mass", r.mass}});
  return all;
}

Json json(const BodyReport& b) {
  Json dropped = Json::array();
  for (const DroppedMode& d : b.modes.selection.dropped) dropped.push_back(discarded(d.mode, d));
  return {{"name", b.name},
          {"motion", to_string(b.freedom.motion)},
          {"nodes", b.mesh.nodes},
          {"tets", b.mesh.tets},
          {"nodes_per_tet", b.mesh.nodes_per_tet},
          {"mass", b.solid.mass},
          {"volume", b.solid.volume},
          {"center_of_mass", json(b.solid.center_of_mass)},
          {"inertia", json(b.solid.inertia)},
          {"regions", json(b.regions)},
          {"zero_modes", b.freedom.zero_modes()},
          {"mechanisms", b.freedom.mechanisms},
          {"frequencies_hz", b.modes.frequencies_hz},
          {"frequency_errors", b.modes.frequency_errors},
          {"kept", b.modes.selection.kept},
          {"discarded", std::move(dropped)},
          {"certified", b.accuracy.certified},
          {"residual_max", b.accuracy.residual_max},
          {"residual_bound", b.accuracy.residual_bound},
          {"backward_error_max", b.accuracy.backward_error_max},
          {"orthogonality_max", b.accuracy.orthogonality_max},
          {"solves", b.solves},
          {"render_surface", json(b.surfaces.render)},
          {"collision_surface", json(b.surfaces.collision)},
          {"collision_triangles", b.surfaces.collision_triangles},
          {"collision_error", b.surfaces.collision_error},
          {"residual_compliance", json(b.residual)},
          {"skin", json(b.skin)},
          {"sound", json(b.sound)}};
}

template <class F>
double largest(const std::vector<BodyReport>& bodies, F value) {
  double most = 0.0;
  for (const BodyReport& b : bodies) most = std::max(most, value(b));
  return most;
}

template <class F>
auto sum(const std::vector<BodyReport>& bodies, F value) {
  decltype(value(bodies[0])) total{};
  for (const BodyReport& b : bodies) total += value(b);
  return total;
}

/// "  skin of 13 handles, spread 12.1 deg: 0.08 MB, 0.02 s; energy of mode 0 at 30, 60, 90, 120 deg: 1.00, …"
std::string skin_summary(const SkinReport& r) {
  std::string text = fmt::format("  skin of {} handles, spread {:.1f} deg: {:.2f} MB, {:.2g} s", r.handles,
                                 r.spread * 180.0 / std::numbers::pi, 1e-6 * static_cast<double>(r.bytes), r.seconds);
  for (const SkinReport::Mode& m : r.modes)
    text += fmt::format("{} mode {}: {:.2f}",
                        &m == r.modes.data() ? "; energy over the mode's at 30, 60, 90, 120 deg," : ";", m.mode,
                        fmt::join(m.energy, ", "));
  return text + "\n";
}

std::string region_summary(const std::vector<RegionReport>& regions) {
  std::string text;
  for (const RegionReport& r : regions)
    text += fmt::format("  region \"{}\": {} tets by their centroids, {:.4g} m^3, {:.4g} kg\n", r.name, r.tets,
                        r.volume, r.mass);
  return text;
}

/// "  lowest ten modes: within 0.4 % of the continuum's, as their stresses tell"
std::string error_summary(const BodyReport& b) {
  const std::size_t told = std::min<std::size_t>(b.modes.frequency_errors.size(), kModesTold);
  return fmt::format("  lowest {}: frequencies within {:.2g} % of the continuum's, as their stresses tell\n",
                     told == 1 ? std::string("elastic mode") : fmt::format("{} elastic modes", told),
                     100.0 * largest_frequency_error(b));
}

}  // namespace

double largest_frequency_error(const BodyReport& b) {
  double largest = 0.0;
  for (std::size_t m = 0; m < std::min<std::size_t>(b.modes.frequency_errors.size(), kModesTold); ++m)
    largest = std::max(largest, std::abs(b.modes.frequency_errors[m]));
  return largest;
}

void warn_of_stiff_elements(const std::vector<BodyReport>& bodies, Warnings& warnings) {
  constexpr double kTold = 0.05;
  std::string stiff;
  for (const BodyReport& b : bodies)
    if (const double error = largest_frequency_error(b); b.mesh.nodes_per_tet == 4 && error > kTold)
      stiff += fmt::format("{}\"{}\" by {:.0f} %", stiff.empty() ? "" : ", ", b.name, 100.0 * error);
  if (!stiff.empty())
    warnings.push_back(
        "the lowest frequencies are too high by estimate, and by more where that is much: " + stiff +
        "; linear elements are too stiff where parts bend with fewer than four cells across, and near nu = 1/2: "
        "--elements quadratic or a smaller --cell-size mends it");
}

void add_bake(Json& report, const std::vector<BodyReport>& bodies) {
  const Total total = total_of(bodies);
  report["nodes"] = sum(bodies, [](const BodyReport& b) { return b.mesh.nodes; });
  report["tets"] = sum(bodies, [](const BodyReport& b) { return b.mesh.tets; });
  report["components"] = bodies.size();
  report["mass"] = total.mass;
  report["volume"] = total.volume;
  report["center_of_mass"] = json(total.center);
  report["inertia"] = json(total.inertia);
  report["zero_modes"] = sum(bodies, [](const BodyReport& b) { return b.freedom.zero_modes(); });
  report["mechanisms"] = sum(bodies, [](const BodyReport& b) { return b.freedom.mechanisms; });
  add_modes(report, bodies);
  report["certified"] =
      std::all_of(bodies.begin(), bodies.end(), [](const BodyReport& b) { return b.accuracy.certified; });
  report["residual_max"] = largest(bodies, [](const BodyReport& b) { return b.accuracy.residual_max; });
  report["backward_error_max"] = largest(bodies, [](const BodyReport& b) { return b.accuracy.backward_error_max; });
  report["orthogonality_max"] = largest(bodies, [](const BodyReport& b) { return b.accuracy.orthogonality_max; });
  report["bodies"] = Json::array();
  for (const BodyReport& b : bodies) report["bodies"].push_back(json(b));
}

void add_bake_seconds(Json& seconds, const std::vector<BodyReport>& bodies) {
  seconds["assemble"] = sum(bodies, [](const BodyReport& b) { return b.seconds.modes.assemble; });
  seconds["order"] = sum(bodies, [](const BodyReport& b) { return b.seconds.modes.order; });
  seconds["factor"] = sum(bodies, [](const BodyReport& b) { return b.seconds.modes.factor; });
  seconds["iterate"] = sum(bodies, [](const BodyReport& b) { return b.seconds.modes.iterate; });
  seconds["certify"] = sum(bodies, [](const BodyReport& b) { return b.seconds.modes.certify; });
  seconds["estimate"] = sum(bodies, [](const BodyReport& b) { return b.seconds.estimate; });
  seconds["residual"] = sum(bodies, [](const BodyReport& b) { return b.residual.seconds; });
  seconds["skin"] = sum(bodies, [](const BodyReport& b) { return b.skin.seconds; });
  seconds["sound"] = sum(bodies, [](const BodyReport& b) { return b.sound.seconds; });
  seconds["embed"] = sum(bodies, [](const BodyReport& b) { return b.seconds.embed; });
}

std::string bake_summary(const std::vector<BodyReport>& bodies) {
  std::string text;
  for (const BodyReport& b : bodies) {
    std::map<std::string_view, int> reasons;
    for (const DroppedMode& d : b.modes.selection.dropped) ++reasons[to_string(d.reason)];
    std::string why;
    for (const auto& [reason, count] : reasons) why += fmt::format(", {} {}", count, reason);
    text += fmt::format("{}: {} nodes, {} tets of {}, {:.6g} kg, {} frame, {} zero modes\n", b.name, b.mesh.nodes,
                        b.mesh.tets, b.mesh.nodes_per_tet, b.solid.mass, to_string(b.freedom.motion),
                        b.freedom.zero_modes());
    if (b.regions.size() > 1) text += region_summary(b.regions);
    if (!b.modes.frequencies_hz.empty())
      text += fmt::format("  {} elastic modes, {:.6g} to {:.6g} Hz{}; {} kept{}\n", b.modes.frequencies_hz.size(),
                          b.modes.frequencies_hz.front(), b.modes.frequencies_hz.back(),
                          b.accuracy.certified ? ", none missed (certified)" : ", not certified",
                          b.modes.selection.kept.size(), why);
    if (!b.modes.frequency_errors.empty()) text += error_summary(b);
    if (b.residual.modes > 0)
      text += fmt::format(
          "  {} residual modes at chosen places, of whose static compliance the others show {:.0f} % and more\n",
          b.residual.modes, 100.0 * least_share(b.residual.captured));
    if (b.residual.form)
      text += fmt::format("  residual compliance of {} vertices, {}: {:.2f} MB, {:.2g} s\n", b.residual.vertices,
                          *b.residual.form == ResidualCompliance::Form::kFull ? "all pairs" : "single vertices",
                          1e-6 * static_cast<double>(b.residual.bytes), b.residual.seconds);
    if (b.skin.handles > 0) text += skin_summary(b.skin);
    if (b.sound.audible > 0)
      text +=
          fmt::format("  sound of {} modes, {:.6g} to {:.6g} Hz, loss factors {:.2g} to {:.2g}: {:.2f} MB, {:.2g} s\n",
                      b.sound.modes, b.sound.lowest_hz, b.sound.highest_hz, b.sound.lowest_loss, b.sound.highest_loss,
                      1e-6 * static_cast<double>(b.sound.bytes), b.sound.seconds);
  }
  return text;
}

}  // namespace limber::tools
