// limber-inspect: what is inside an asset.

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>

#include "limber/mesh/surface_mesh.h"
#include "limber/model/asset.h"
#include "limber/model/audio_gltf.h"
#include "limber/model/morph_targets.h"
#include "limber/scene/recording.h"
#include "limber/scene/scene_model.h"
#include "limber/sound/radiation.h"
#include "limber/sound/synthesizer.h"
#include "limber/sound/wav.h"
#include "program.h"

namespace limber::tools {
namespace {

using Json = nlohmann::ordered_json;

/// A blow that is to be heard.
struct RingArguments {
  std::string output;
  int body = 0, vertex = 0;
  double impulse = 0.01, contact_time = 1e-4, seconds = 10.0;
};

struct Arguments {
  std::string asset, frequencies, clips, audio;
  RingArguments ring;
};

/// One mode as people and tables want it.
struct ModeLine {
  Index mode = 0;
  double eigenvalue = 0.0;       // rad²/s²
  double frequency_hz = 0.0;     // undamped
  double damped_hz = 0.0;        // 0: it creeps back without swinging
  double damping_ratio = 0.0;    // infinite for a damped mechanism
  double decay = 0.0;            // 1/s
  double largest_shape = 0.0;    // kg^−½, over the render surface
  double frequency_error = 0.0;  // relative, estimated; NaN: not told
};

/// @param told frequency errors, or empty
std::vector<ModeLine> mode_lines(const ModalModel& model, const std::vector<double>& told) {
  std::vector<ModeLine> lines;
  for (Index i = 0; i < model.modes(); ++i) {
    const double lambda = model.data().eigenvalues[static_cast<std::size_t>(i)];
    const double decay = model.data().decays[static_cast<std::size_t>(i)];
    double largest = 0.0;
    for (Index v = 0; v < model.render().vertices(); ++v)
      largest = std::max(largest, model.render().basis.shape(v, i).cast<double>().norm());
    lines.push_back({.mode = i,
                     .eigenvalue = lambda,
                     .frequency_hz = model.frequency_hz(i),
                     .damped_hz = std::sqrt(std::max(lambda - decay * decay, 0.0)) / (2.0 * std::numbers::pi),
                     .damping_ratio = decay > 0.0 ? decay / std::sqrt(lambda) : 0.0,
                     .decay = decay,
                     .largest_shape = largest,
                     .frequency_error =
                         told.empty() ? std::numeric_limits<double>::quiet_NaN() : told[static_cast<std::size_t>(i)]});
  }
  return lines;
}

struct Box {
  Vec3 low, high;
};

Box box_of(const ModalSurface& surface) {
  Box box{surface.rest.front().cast<double>(), surface.rest.front().cast<double>()};
  for (const Vec3f& p : surface.rest) {
    box.low = box.low.cwiseMin(p.cast<double>());
    box.high = box.high.cwiseMax(p.cast<double>());
  }
  return box;
}

Json vector(const Vec3& v) { return Json::array({v.x(), v.y(), v.z()}); }

/// How much of the static compliance of single vertices the modes show: the least, and the middle one.
struct CapturedRange {
  double least = 1.0, median = 1.0;
};
CapturedRange captured_range(const ModalModel& model) {
  std::vector<double> shares = model.captured_shares();
  std::sort(shares.begin(), shares.end());
  return {shares.front(), shares[shares.size() / 2]};
}

Json residual_report(const ModalModel& model) {
  const auto& r = model.data().residual_compliance;
  if (!r) return {};
  const CapturedRange range = captured_range(model);
  return {{"form", to_string(r->form())},
          {"vertices", r->vertices()},
          {"captured", {{"least", range.least}, {"median", range.median}}}};
}

Json captured_report(const ModalModelData& d) {
  Json loads = Json::array();
  for (const CapturedLoad& load : d.captured)
    loads.push_back({{"at", vector(load.at + d.origin_in_input)}, {"share", load.share}});
  return loads;
}

Json surface_report(const ModalSurface& s) { return {{"vertices", s.vertices()}, {"triangles", s.triangles.size()}}; }

Json sound_report(const SoundModes* sound) {
  if (!sound) return {};
  const auto hz = [](double lambda) { return std::sqrt(lambda) / (2.0 * std::numbers::pi); };
  Json frequencies = Json::array(), losses = Json::array();
  for (std::size_t k = 0; k < sound->eigenvalues.size(); ++k) {
    frequencies.push_back(hz(sound->eigenvalues[k]));
    losses.push_back(2.0 * sound->decays[k] / std::sqrt(sound->eigenvalues[k]));
  }
  return {{"modes", sound->modes()},
          {"vertices", sound->vertices},
          {"contact_modulus", sound->contact_modulus},
          {"frequencies_hz", frequencies},
          {"loss_factors", losses}};
}

std::string sound_text(const SoundModes* sound) {
  if (!sound || sound->modes() == 0) return "";
  const auto hz = [](double lambda) { return std::sqrt(lambda) / (2.0 * std::numbers::pi); };
  return fmt::format("  sound           {} modes, {:.6g} to {:.6g} Hz, {:.2f} MB\n", sound->modes(),
                     hz(sound->eigenvalues.front()), hz(sound->eigenvalues.back()),
                     1e-6 * static_cast<double>(sizeof(float) * sound->shapes.size()));
}

Json body_report(const ModalModel& model, const std::vector<double>& told, const SoundModes* sound) {
  const ModalModelData& d = model.data();
  const Box box = box_of(d.render);
  Json inertia = Json::array();
  for (int r = 0; r < 3; ++r) inertia.push_back(vector(d.inertia.row(r).transpose()));
  Json modes = Json::array();
  for (const ModeLine& m : mode_lines(model, told))
    modes.push_back({{"mode", m.mode},
                     {"frequency_hz", m.frequency_hz},
                     {"damped_frequency_hz", m.damped_hz},
                     {"damping_ratio", m.damping_ratio},
                     {"decay", m.decay},
                     {"eigenvalue", m.eigenvalue},
                     {"largest_shape", m.largest_shape},
                     {"frequency_error", m.frequency_error}});
  return {
      {"name", d.name},
      {"motion", to_string(d.motion)},
      {"mass", d.mass},
      {"volume", d.volume},
      {"center_of_mass", vector(d.center_of_mass + d.origin_in_input)},
      {"inertia", inertia},
      {"origin_in_input", vector(d.origin_in_input)},
      {"box", {{"low", vector(box.low + d.origin_in_input)}, {"high", vector(box.high + d.origin_in_input)}}},
      {"render_surface", surface_report(d.render)},
      {"collision_surface", d.collision ? surface_report(*d.collision) : Json()},
      {"volume_block",
       d.volume_block ? Json{{"nodes", d.volume_block->rest.size()}, {"tets", d.volume_block->tets.size()}} : Json()},
      {"residual_compliance", residual_report(model)},
      {"captured", captured_report(d)},
      {"skin", d.skin ? Json{{"handles", d.skin->handles}} : Json()},
      {"sound", sound_report(sound)},
      {"memory_bytes", shape_bytes(d)},
      {"modes", modes}};
}

/// Notes that a user of the asset should know.
void warn(const ModalModel& model, const std::vector<double>& told, Warnings& warnings) {
  const std::string body = "Body \"" + model.name() + "\"";
  const auto lines = mode_lines(model, told);
  const auto mechanisms =
      std::count_if(lines.begin(), lines.end(), [](const ModeLine& m) { return m.eigenvalue == 0.0; });
  if (mechanisms > 0)
    warnings.push_back(fmt::format("{}: {} of its modes are mechanisms: parts that turn freely about shared nodes.",
                                   body, mechanisms));
  const auto unseen =
      std::count_if(lines.begin(), lines.end(), [](const ModeLine& m) { return m.largest_shape == 0.0; });
  if (unseen > 0) warnings.push_back(fmt::format("{}: {} of its modes do not move the render surface.", body, unseen));
  if (model.modes() > kMaxMorphTargets)
    warnings.push_back(fmt::format("{}: has {} modes, but many viewers hold at most {} morph targets.", body,
                                   model.modes(), kMaxMorphTargets));
  SurfaceMesh surface;
  for (const Vec3f& p : model.render().rest) surface.vertices.push_back(p.cast<double>());
  surface.triangles = model.render().triangles;
  if (const SurfaceQuality q = surface_quality(surface); q.boundary_edges > 0)
    warnings.push_back(fmt::format("{}: its render surface is open, with {} boundary edges.", body, q.boundary_edges));
}

std::string surfaces_text(const ModalModel& model) {
  const ModalModelData& d = model.data();
  std::string text =
      fmt::format("  drawn surface   {} vertices, {} triangles\n", d.render.vertices(), d.render.triangles.size());
  if (d.collision)
    text += fmt::format("  touched surface {} vertices, {} triangles\n", d.collision->vertices(),
                        d.collision->triangles.size());
  if (d.volume_block)
    text +=
        fmt::format("  volume block    {} nodes, {} tets\n", d.volume_block->rest.size(), d.volume_block->tets.size());
  if (const auto& r = d.residual_compliance) {
    const CapturedRange range = captured_range(model);
    text += fmt::format(
        "  residual        {}, of {} vertices; of their static compliance the modes show {:.0f} % ({:.0f} % and "
        "more)\n",
        to_string(r->form()), r->vertices(), 100.0 * range.median, 100.0 * range.least);
  }
  if (!d.captured.empty()) {
    const auto least = std::min_element(d.captured.begin(), d.captured.end(),
                                        [](const CapturedLoad& a, const CapturedLoad& b) { return a.share < b.share; });
    text += fmt::format(
        "  loads foreseen  at {} places, of whose static compliance the modes by frequency alone show {:.0f} % and "
        "more\n",
        d.captured.size(), 100.0 * least->share);
  }
  if (d.skin) text += fmt::format("  skin            {} handles\n", d.skin->handles);
  return text + fmt::format("  memory          {:.2f} MB\n", 1e-6 * static_cast<double>(shape_bytes(d)));
}

/// Of the lowest elastic modes of which an error is told; nothing where none is.
std::string errors_text(const std::vector<ModeLine>& lines) {
  constexpr int kTold = 10;
  double largest = 0.0;
  int modes = 0;
  for (const ModeLine& m : lines)
    if (modes < kTold && m.eigenvalue > 0.0 && !std::isnan(m.frequency_error))
      ++modes, largest = std::max(largest, std::abs(m.frequency_error));
  if (modes == 0) return "";
  return fmt::format(
      "  frequencies     of the {} lowest elastic modes: within {:.2g} % of the continuum's, estimated\n", modes,
      100.0 * largest);
}

std::string body_text(const ModalModel& model, const std::vector<double>& told, const SoundModes* sound,
                      std::size_t number) {
  const ModalModelData& d = model.data();
  const Box box = box_of(d.render);
  const Vec3 size = box.high - box.low, center = d.center_of_mass + d.origin_in_input;
  std::string text =
      fmt::format("body {} \"{}\": {} frame, {} modes\n", number, d.name, to_string(d.motion), model.modes());
  text += fmt::format("  mass            {:.6g} kg, volume {:.6g} m^3\n", d.mass, d.volume);
  text += fmt::format("  size            {:.4g} x {:.4g} x {:.4g} m\n", size.x(), size.y(), size.z());
  text += fmt::format("  centre of mass  ({:.6g}, {:.6g}, {:.6g}) m in the input mesh\n", center.x(), center.y(),
                      center.z());
  text += surfaces_text(model);
  text += sound_text(sound);
  const std::vector<ModeLine> lines = mode_lines(model, told);
  text += errors_text(lines);
  text += fmt::format("  {:>5} {:>14} {:>14} {:>14} {:>14} {:>14}\n", "mode", "frequency Hz", "damped Hz",
                      "damping ratio", "decay 1/s", "error of Hz %");
  for (const ModeLine& m : lines)
    text += fmt::format("  {:>5} {:>14.6g} {:>14.6g} {:>14.6g} {:>14.6g} {:>14}\n", m.mode, m.frequency_hz, m.damped_hz,
                        m.damping_ratio, m.decay,
                        std::isnan(m.frequency_error) ? "-" : fmt::format("{:+.2g}", 100.0 * m.frequency_error));
  return text;
}

std::string limits_text(const JointSpec& joint) {
  const auto range = [](const Interval& i, const char* unit) {
    return i.open() ? std::string() : fmt::format(", {:.4g} to {:.4g} {}", i.low, i.high, unit);
  };
  std::string text = range(joint.limits.rotation, "rad");
  for (const Interval& i : joint.limits.translation) text += range(i, "m");
  if (std::isfinite(joint.limits.cone)) text += fmt::format(", cone {:.4g} rad", joint.limits.cone);
  for (const Interval& i : joint.limits.euler) text += range(i, "rad");
  return text;
}

std::string body_name(const Asset& asset, Index body) {
  return body == AssetJoint::kWorld ? "the world" : "\"" + asset.bodies[static_cast<std::size_t>(body)]->name() + "\"";
}

std::string joints_text(const Asset& asset) {
  std::string text;
  for (const AssetJoint& joint : asset.joints) {
    const Vec3& at = joint.spec.frame.origin;
    text += fmt::format("joint {} to {}: {} at ({:.4g}, {:.4g}, {:.4g}) m{}", body_name(asset, joint.a),
                        body_name(asset, joint.b), to_string(joint.spec.type), at.x(), at.y(), at.z(),
                        limits_text(joint.spec));
    text += fmt::format(", patch {:.3g} m", joint.patch_radius);
    for (const JointActuation& a : joint.coordinates)
      text += fmt::format("{}{}{}", a.motor_max_force > 0.0 ? ", motor" : "",
                          a.drive_stiffness > 0.0 || a.drive_damping > 0.0 ? ", drive" : "",
                          a.friction > 0.0 ? ", friction" : "");
    text += "\n";
  }
  for (const auto& [a, b] : asset.apart)
    text += fmt::format("no contacts between {} and {}\n", body_name(asset, a), body_name(asset, b));
  return text;
}

Json interval_report(const Interval& i) {
  const auto end = [](double x) { return std::isfinite(x) ? Json(x) : Json(); };
  return Json::array({end(i.low), end(i.high)});
}

void report_machine(const Asset& asset, Json& report) {
  report["joints"] = Json::array();
  for (const AssetJoint& joint : asset.joints) {
    const JointLimits& l = joint.spec.limits;
    report["joints"].push_back(
        {{"a", joint.a == AssetJoint::kWorld ? Json() : Json(asset.bodies[static_cast<std::size_t>(joint.a)]->name())},
         {"b", asset.bodies[static_cast<std::size_t>(joint.b)]->name()},
         {"type", to_string(joint.spec.type)},
         {"origin", vector(joint.spec.frame.origin)},
         {"axis", vector(joint.spec.frame.axes.col(joint.spec.type == JointType::kPlanar ? 2 : 0))},
         {"rotation", interval_report(l.rotation)},
         {"translation", Json::array({interval_report(l.translation[0]), interval_report(l.translation[1])})},
         {"cone", std::isfinite(l.cone) ? Json(l.cone) : Json()},
         {"patch_radius", joint.patch_radius},
         {"collide", joint.collide}});
  }
  report["apart"] = Json::array();
  for (const auto& [a, b] : asset.apart)
    report["apart"].push_back(
        {asset.bodies[static_cast<std::size_t>(a)]->name(), asset.bodies[static_cast<std::size_t>(b)]->name()});
}

/// The area vectors of a vertex's triangles, unit: outwards.
Vec3 normal_at(const ModalSurface& surface, Index vertex) {
  Vec3 sum = Vec3::Zero();
  for (const Triangle& t : surface.triangles) {
    if (std::find(t.begin(), t.end(), vertex) == t.end()) continue;
    const auto corner = [&](int c) -> Vec3 {
      return surface.rest[static_cast<std::size_t>(t[static_cast<std::size_t>(c)])].cast<double>();
    };
    sum += (corner(1) - corner(0)).cross(corner(2) - corner(0));
  }
  return sum.normalized();
}

/// A note at one metre, struck inwards at a vertex of the surface that touches.
void ring(Program& program, const RingArguments& a, const Asset& asset) {
  if (a.output.empty()) return;
  constexpr double kRate = 48e3, kLoudest = 0.9;  // of full scale
  const auto body = static_cast<std::size_t>(a.body);
  if (body >= asset.bodies.size())
    throw InvalidArgument(
        fmt::format("--ring-body is {}, the asset has {} bodies, counted from 0", a.body, asset.bodies.size()));
  const SoundModes* modes = asset.sound(body);
  if (!modes)
    throw InvalidArgument(
        fmt::format("--ring: body \"{}\" has no sound; bake it with --sound", asset.bodies[body]->name()));
  const ModalSurface& surface = asset.bodies[body]->collision();
  if (a.vertex >= surface.vertices())
    throw InvalidArgument(fmt::format("--ring-vertex is {}, the surface that touches has {} vertices, counted from 0",
                                      a.vertex, surface.vertices()));
  const auto gains = monopole_gains(*modes, surface.rest, surface.triangles);
  Synthesizer synthesizer({.sample_rate = kRate, .channels = 1});
  synthesizer.add_body(std::make_shared<ModalSound>(*modes, gains, kRate));
  synthesizer.strike({.at = {.vertices = {a.vertex, a.vertex, a.vertex}},
                      .impulse = -a.impulse * normal_at(surface, a.vertex),
                      .contact_time = a.contact_time});
  std::vector<float> samples;
  constexpr std::size_t kPiece = 4800;
  const auto most = static_cast<std::size_t>(std::lround(a.seconds * kRate));
  while (!synthesizer.silent() && samples.size() < most) {
    samples.resize(std::min(most, samples.size() + kPiece));
    const auto begin = static_cast<std::size_t>(synthesizer.samples());
    synthesizer.render(std::span(samples).subspan(begin));
  }
  double loudest = 0.0;
  for (const float p : samples) loudest = std::max(loudest, std::abs(static_cast<double>(p)));
  const double full = loudest > 0.0 ? loudest / kLoudest : 1.0;
  for (float& p : samples) p = static_cast<float>(p / full);
  program.write_file(a.output, wav_bytes(samples, 1, static_cast<int>(kRate)));
  program.print(fmt::format("{}: {:.3g} s, loudest {:.3g} Pa at one metre, full scale {:.3g} Pa\n", a.output,
                            static_cast<double>(samples.size()) / kRate, loudest, full));
  program.report()["ring"] = {
      {"seconds", static_cast<double>(samples.size()) / kRate}, {"loudest", loudest}, {"full_scale", full}};
}

std::string provenance_text(const Provenance& p) {
  if (p.input.empty() && p.tool.empty()) return "";
  return fmt::format("baked from {} by {}{}\n", p.input.empty() ? "?" : p.input, p.tool.empty() ? "?" : p.tool,
                     p.options.empty() ? "" : ": " + p.options);
}

std::string csv_field(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string frequencies_csv(const Asset& asset) {
  std::string csv =
      "body,mode,frequency_hz,damped_frequency_hz,damping_ratio,decay_per_s,eigenvalue_rad2_per_s2,frequency_error\n";
  for (std::size_t i = 0; i < asset.bodies.size(); ++i)
    for (const ModeLine& m : mode_lines(*asset.bodies[i], asset.frequency_errors[i]))
      csv += fmt::format("{},{},{:.9g},{:.9g},{:.9g},{:.9g},{:.17g},{}\n", csv_field(asset.bodies[i]->name()), m.mode,
                         m.frequency_hz, m.damped_hz, m.damping_ratio, m.decay, m.eigenvalue,
                         std::isnan(m.frequency_error) ? "" : fmt::format("{:.3g}", m.frequency_error));
  return csv;
}

void inspect(Program& program, const Arguments& a) {
  program.progress().stage("reading the asset");
  program.add_input(a.asset);
  const Asset asset = read_asset(a.asset);
  const auto file_bytes = std::filesystem::file_size(a.asset);
  program.print(fmt::format("{}: {} {}, {:.2f} MB\n", a.asset, asset.bodies.size(),
                            asset.bodies.size() == 1 ? "body" : "bodies", 1e-6 * static_cast<double>(file_bytes)));
  program.print(provenance_text(asset.provenance));
  Json& report = program.report();
  report["file"] = std::filesystem::path(a.asset).filename().string();
  report["file_bytes"] = file_bytes;
  report["provenance"] = {{"tool", asset.provenance.tool},
                          {"input", asset.provenance.input},
                          {"input_hash", asset.provenance.input_hash},
                          {"options", asset.provenance.options}};
  report["bodies"] = Json::array();
  for (std::size_t i = 0; i < asset.bodies.size(); ++i) {
    const std::vector<double>& told = asset.frequency_errors[i];
    program.print(body_text(*asset.bodies[i], told, asset.sound(i), i));
    report["bodies"].push_back(body_report(*asset.bodies[i], told, asset.sound(i)));
    warn(*asset.bodies[i], told, program.warnings());
  }
  program.print(joints_text(asset));
  report_machine(asset, report);
  if (!a.frequencies.empty()) program.write_file(a.frequencies, frequencies_csv(asset));
  ring(program, a.ring, asset);
  if (!a.audio.empty()) program.write_file(a.audio, audio_glb_bytes(asset));
  if (!a.clips.empty()) program.write_file(a.clips, make_mode_clips(asset.bodies));
}

}  // namespace
}  // namespace limber::tools

int main(int argc, char** argv) {
  using namespace limber::tools;
  Program program("limber-inspect",
                  "Tells what is inside an asset: bodies, modes, frequencies, mass, sizes, memory, joints.");
  Arguments arguments;
  program.options().add_option("ASSET.glb", arguments.asset, "asset file, as limber-precompute makes it")->required();
  program.options()
      .add_option("--frequencies", arguments.frequencies, "write all frequencies as a table (Hz, 1/s)")
      ->type_name("FILE.csv");
  program.options()
      .add_option("--clips", arguments.clips,
                  "write one short clip a mode for any glTF viewer: bodies with a modal skin bend by it")
      ->type_name("FILE.glb");
  program.options()
      .add_option("--audio-gltf", arguments.audio,
                  "write the bodies and what one hears of them by the draft glTF extension KHR_audio_rigid_bodies")
      ->type_name("FILE.glb");
  RingArguments& note = arguments.ring;
  program.options()
      .add_option("--ring", note.output, "write the note of a blow, of a body baked with --sound, one metre away")
      ->type_name("OUT.wav");
  program.options()
      .add_option("--ring-vertex", note.vertex, "vertex of the surface that touches, struck inwards")
      ->type_name("V")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  program.options()
      .add_option("--ring-body", note.body, "which body of the asset, from 0")
      ->type_name("N")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  program.options()
      .add_option("--ring-impulse", note.impulse, "impulse of the blow")
      ->type_name("N_S")
      ->check(positive_number())
      ->capture_default_str();
  program.options()
      .add_option("--ring-contact-time", note.contact_time, "how long it touches")
      ->type_name("S")
      ->check(CLI::Range(1e-6, 10.0))
      ->capture_default_str();
  program.options()
      .add_option("--ring-seconds", note.seconds, "the most that is written")
      ->type_name("S")
      ->check(CLI::Range(0.01, 3600.0))
      ->capture_default_str();
  return program.run(argc, argv, [&] { inspect(program, arguments); });
}
