// limber-simulate: plays a scene at a fixed step; records it, samples its energies, reports.

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <chrono>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "limber/scene/manifest.h"
#include "limber/scene/recording.h"
#include "limber/scene/run.h"
#include "limber/scene/scene_file.h"
#include "limber/scene/scene_model.h"
#include "limber/scene/soundtrack.h"
#include "limber/sound/wav.h"
#include "program.h"

namespace limber::tools {
namespace {

using Clock = std::chrono::steady_clock;
using Json = nlohmann::ordered_json;

struct Arguments {
  std::string scene;
  std::int64_t steps = -1;
  std::string record, energies, mode_energies, contacts, sensors, manifest, sound;
  double full_scale = 0.0;
  SoundtrackOptions soundtrack;
  double record_frame_rate = 60.0;
  RecordingOptions recording;
  bool reconstruct = false;
};

void declare(CLI::App& app, Arguments& a) {
  app.add_option("SCENE.json", a.scene, "scene file (docs/formats/scene.md)")->required();
  app.add_option("--steps", a.steps, "steps to take; default: as the scene says")
      ->type_name("N")
      ->check(CLI::Range(std::int64_t{0}, std::int64_t{1'000'000'000}));
  app.add_option("--record", a.record, "write the motion as an animated GLB")->type_name("OUT.glb");
  app.add_option("--record-frame-rate", a.record_frame_rate,
                 "keys per second shown, at most one per step; for the energies too")
      ->type_name("HZ")
      ->check(positive_number())
      ->capture_default_str();
  app.add_option("--slow-motion", a.recording.slow_motion,
                 "seconds shown per second simulated, with as many more keys: 100 shows what rings at 1 kHz as 10 Hz")
      ->type_name("FACTOR")
      ->check(positive_number())
      ->capture_default_str();
  app.add_flag("--unsigned-weights", a.recording.unsigned_weights,
               "keep morph weights in [0, 1], for viewers that clamp them (Blender, Assimp)");
  app.add_option("--energies", a.energies, "write each body's energies over time")->type_name("FILE.csv");
  app.add_option("--mode-energies", a.mode_energies, "write each mode's energy over time")->type_name("FILE.csv");
  app.add_option("--contacts", a.contacts,
                 "write what touched in each step: time, bodies, place, normal, impulse; for scenes with contact")
      ->type_name("FILE.csv");
  app.add_option("--sensors", a.sensors,
                 "write who came into the scene's sensors and left them: time, event, sensor, body")
      ->type_name("FILE.csv");
  app.add_option(
         "--manifest", a.manifest,
         "write what the scene is played without, why, and what each of it saves in bytes and time: it is played "
         "again with each put back")
      ->type_name("FILE.json");
  app.add_option("--sound", a.sound, "write what one hears at the scene's microphones, of bodies baked with --sound")
      ->type_name("OUT.wav");
  app.add_option("--sound-rate", a.soundtrack.sample_rate, "samples per second")
      ->type_name("HZ")
      ->check(CLI::Range(8000, 384000))
      ->capture_default_str();
  app.add_option("--sound-full-scale", a.full_scale,
                 "pressure that is full scale; default: 1/0.9 of the loudest sample")
      ->type_name("PA")
      ->check(positive_number());
  app.add_flag("--reconstruct", a.reconstruct, "also make positions and normals at every key, to time it");
}

Json vector(const Vec3& v) { return Json::array({v.x(), v.y(), v.z()}); }

Json energy(const BodyEnergy& e) {
  return {{"kinetic_rigid", e.kinetic_rigid},
          {"potential", e.potential},
          {"kinetic_modal", e.kinetic_modal},
          {"elastic", e.elastic},
          {"total", e.total()}};
}

Json manifest(const ModelManifest& m) {
  Json dropped = Json::array(), left_out = Json::array();
  for (const ModelSaving& l : m.left_out)
    left_out.push_back({{"what", to_string(l.what)}, {"why", l.why}, {"bytes", l.bytes}});
  for (const DroppedMode& d : m.dropped)
    dropped.push_back({{"mode", d.mode}, {"reason", to_string(d.reason)}, {"value", d.value}, {"limit", d.limit}});
  return {{"asset", m.asset},
          {"file", m.file},
          {"body", m.body},
          {"modes_in_asset", m.modes_in_asset},
          {"modes", m.modes},
          {"dropped", dropped},
          {"dropped_displacement", m.dropped_displacement ? Json(*m.dropped_displacement) : Json()},
          {"left_out", left_out},
          {"bytes_in_asset", m.bytes_in_asset},
          {"bytes", m.bytes},
          {"multiply_adds_in_asset", m.multiply_adds_in_asset},
          {"multiply_adds", m.multiply_adds}};
}

Json bodies(const Trajectory& trajectory) {
  Json all = Json::array();
  for (const BodyTrack& b : trajectory.bodies) {
    const RigidTransform& end = b.poses.back();
    all.push_back({{"name", b.name},
                   {"model", b.model->name()},
                   {"modes", b.model->modes()},
                   {"mass", b.model->data().mass},
                   {"position", vector(end.p)},
                   {"orientation", Json::array({end.q.w, end.q.x, end.q.y, end.q.z})},
                   {"angular_velocity", vector(b.angular_velocities.back())},
                   {"energy_before", energy(b.energies.front())},
                   {"energy_after", energy(b.energies.back())}});
  }
  return all;
}

Json loads(const std::vector<LoadReport>& reports) {
  Json all = Json::array();
  for (const LoadReport& l : reports)
    all.push_back({{"body", l.body}, {"step", l.step}, {"delay", l.delay}, {"point", vector(l.point)}});
  return all;
}

Json contact(const Scene& scene) {
  const ContactOptions& c = *scene.contacts.options;
  const SceneContactRule& rule = scene.contacts.rule;
  return {{"finder", to_string(scene.contacts.finder)},
          {"method", to_string(rule.method)},
          {"friction_model", to_string(rule.friction)},
          {"guard", to_string(rule.guard)},
          {"friction", c.friction},
          {"rolling_friction", c.rolling_friction},
          {"recovery_speed", c.recovery_speed},
          {"residual_compliance", c.residual_compliance},
          {"penalty_frequency", rule.penalty_frequency},
          {"penalty_damping", rule.penalty_damping}};
}

Json handles(const std::vector<HandleReport>& reports) {
  Json all = Json::array();
  for (const HandleReport& h : reports)
    all.push_back({{"body", h.body},
                   {"step", h.step},
                   {"point", vector(h.point)},
                   {"largest_error", h.largest_error},
                   {"force", vector(h.force)},
                   {"largest_force", h.largest_force}});
  return all;
}

Json joints(const std::vector<JointReport>& reports) {
  Json all = Json::array();
  for (const JointReport& j : reports) {
    const auto count = static_cast<std::size_t>(j.view.coordinates);
    const auto first = [&](const std::array<double, 3>& x) {
      return std::vector<double>(x.begin(), x.begin() + count);
    };
    all.push_back({{"a", j.a.empty() ? Json() : Json(j.a)},
                   {"b", j.b},
                   {"position", first(j.view.position)},
                   {"force", first(j.view.force)},
                   {"lock_force", vector(j.view.lock_force)},
                   {"largest_distance_error", j.largest_distance_error},
                   {"largest_angle_error", j.largest_angle_error},
                   {"largest_limit_excess", j.largest_limit_excess}});
  }
  return all;
}

Json constraints(const ConstraintSummary& sum) {
  return {{"limit_steps", sum.limit_steps},
          {"failed_steps", sum.failed_steps},
          {"largest_residual", sum.largest_residual},
          {"energy_removed", sum.energy_removed},
          {"contacts_begun", sum.begun},
          {"contacts_ended", sum.ended},
          {"largest_contact_impulse", sum.largest_impulse}};
}

Json recording_report(const Arguments& a, const Trajectory& trajectory, const Recording& recording) {
  Json models = Json::array();
  for (const RecordedModel& m : recording.models)
    models.push_back({{"name", m.name},
                      {"modes", m.modes},
                      {"recorded", m.recorded},
                      {"scales", m.scales},
                      {"faster_than_half_the_key_rate", m.too_fast}});
  return {{"file", std::filesystem::path(a.record).filename().string()},
          {"bytes", recording.glb.size()},
          {"keys", trajectory.times.size()},
          {"key_interval", trajectory.key_interval},
          {"slow_motion", a.recording.slow_motion},
          {"weights", a.recording.unsigned_weights ? "unsigned" : "signed"},
          {"models", models}};
}

void report_run(Json& report, const Scene& scene, const SceneModels& models, const RunResult& result) {
  report["scene"] = scene.name;
  report["step"] = scene.step;
  report["steps"] = result.steps;
  report["substeps"] = scene.substeps;
  report["solver"] = to_string(scene.contacts.solver);
  report["small_steps"] = scene.contacts.small_steps.substeps;
  report["gravity"] = vector(scene.gravity);
  report["models"] = Json::array();
  for (const ModelManifest& m : models.manifest) report["models"].push_back(manifest(m));
  report["bodies"] = bodies(result.trajectory);
  report["asleep"] = result.asleep;
  report["strikes"] = loads(result.strikes);
  report["forces"] = loads(result.forces);
  report["handles"] = handles(result.handles);
  report["joints"] = joints(result.joints);
  report["contact"] = scene.contacts.options ? contact(scene) : Json();
  report["constraints"] = constraints(result.constraints);
  report["energy_before"] = result.energy_before;
  report["energy_after"] = result.energy_after;
  report["state_hash"] = fmt::format("{:016x}", result.state_hash);
}

double per(double total, double count) { return count > 0.0 ? total / count : 0.0; }

double body_steps(const RunResult& r) {
  return static_cast<double>(r.steps) * static_cast<double>(r.trajectory.bodies.size());
}

std::string models_text(const SceneModels& models) {
  std::string text;
  for (const ModelManifest& m : models.manifest) {
    text += fmt::format("  {}: {} modes", m.body, m.modes);
    if (m.modes != m.modes_in_asset)
      text += fmt::format(" of {}; what the scene does not need saves {:.0f} % of {:.1f} MB", m.modes_in_asset,
                          100.0 * (1.0 - per(static_cast<double>(m.bytes), static_cast<double>(m.bytes_in_asset))),
                          1e-6 * static_cast<double>(m.bytes_in_asset));
    text += "\n";
  }
  return text;
}

std::string loads_text(const Scene& scene, const RunResult& result) {
  std::string text;
  for (const LoadReport& l : result.strikes)
    text += fmt::format("  strike  {} at {:.6g} s, point ({:.4g}, {:.4g}, {:.4g}) m\n", l.body,
                        static_cast<double>(l.step) * scene.step + l.delay, l.point.x(), l.point.y(), l.point.z());
  for (const LoadReport& l : result.forces)
    text += fmt::format("  force   {} from {:.6g} s, point ({:.4g}, {:.4g}, {:.4g}) m\n", l.body,
                        static_cast<double>(l.step) * scene.step, l.point.x(), l.point.y(), l.point.z());
  return text;
}

std::string constraints_text(const Scene& scene, const RunResult& r) {
  std::string text;
  for (const HandleReport& h : r.handles)
    text += fmt::format("  handle  {} from {:.6g} s, off by at most {:.3g} m\n", h.body,
                        static_cast<double>(h.step) * scene.step, h.largest_error);
  for (const JointReport& j : r.joints)
    text += fmt::format("  joint   {} to {}, off by at most {:.3g} m\n", j.a.empty() ? "the world" : j.a, j.b,
                        j.largest_distance_error);
  if (scene.contacts.options)
    text += fmt::format("  contact {} begun, {} ended, largest impulse {:.4g} N s\n", r.constraints.begun,
                        r.constraints.ended, r.constraints.largest_impulse);
  return text;
}

std::string summary(const Scene& scene, const SceneModels& models, const RunResult& r) {
  std::string text = fmt::format("{}: {} steps of {:.6g} s, {} {}\n", scene.name, r.steps, scene.step,
                                 r.trajectory.bodies.size(), r.trajectory.bodies.size() == 1 ? "body" : "bodies");
  text += models_text(models) + loads_text(scene, r) + constraints_text(scene, r);
  text += fmt::format("  energy  {:.9g} J before, {:.9g} J after\n", r.energy_before, r.energy_after);
  text += fmt::format("  advance {:.1f} ns per step and body\n", 1e9 * per(r.seconds_advance, body_steps(r)));
  if (r.reconstructed_vertices > 0)
    text += fmt::format("  draw    {:.2f} ns per vertex, positions and normals\n",
                        1e9 * per(r.seconds_reconstruct, static_cast<double>(r.reconstructed_vertices)));
  return text + fmt::format("  state   {:016x}\n", r.state_hash);
}

void record(Program& program, const Arguments& a, const Trajectory& trajectory) {
  if (a.record.empty()) return;
  program.progress().stage("recording");
  const Recording recording = make_recording(trajectory, a.recording);
  program.write_file(a.record, recording.glb);
  program.report()["recording"] = recording_report(a, trajectory, recording);
  program.warnings().insert(program.warnings().end(), recording.warnings.begin(), recording.warnings.end());
  program.print(fmt::format("  {}: {} keys every {:.6g} s, {:.1f} MB\n", a.record, trajectory.times.size(),
                            trajectory.key_interval, 1e-6 * static_cast<double>(recording.glb.size())));
}

void write_sound(Program& program, const Arguments& a, const Scene& scene, const std::map<std::string, Asset>& assets,
                 const RunResult& result) {
  if (a.sound.empty()) return;
  program.progress().stage("sounding");
  Soundtrack track = make_soundtrack(scene, assets, result, a.soundtrack);
  constexpr double kLoudest = 0.9;  // of full scale
  const double full = a.full_scale > 0.0 ? a.full_scale : track.loudest > 0.0 ? track.loudest / kLoudest : 1.0;
  for (float& p : track.samples) p = static_cast<float>(p / full);
  program.write_file(a.sound, wav_bytes(track.samples, track.channels, static_cast<int>(track.sample_rate)));
  const double seconds = static_cast<double>(track.samples.size()) / track.channels / track.sample_rate;
  program.report()["sound"] = {{"file", std::filesystem::path(a.sound).filename().string()},
                               {"seconds", seconds},
                               {"channels", track.channels},
                               {"sample_rate", track.sample_rate},
                               {"blows", track.blows},
                               {"loudest", track.loudest},
                               {"full_scale", full}};
  program.print(fmt::format("  {}: {:.3g} s of {} blows, loudest {:.3g} Pa, full scale {:.3g} Pa\n", a.sound, seconds,
                            track.blows, track.loudest, full));
  if (track.loudest > full)
    program.warnings().push_back(
        fmt::format("the sound's loudest sample is {:.3g} of full scale: players cut it off; "
                    "give a larger --sound-full-scale, or none",
                    track.loudest / full));
  if (track.silent_bodies > 0)
    program.warnings().push_back(fmt::format(
        "{} of the scene's bodies are silent: their assets were baked without --sound", track.silent_bodies));
}

void warn_of_limits(Program& program, const RunResult& r) {
  const ConstraintSummary& sum = r.constraints;
  if (sum.limit_steps + sum.failed_steps == 0) return;
  program.warnings().push_back(
      fmt::format("of {} steps {} ended at a limit of the solver and {} failed: contacts, joints or handles are off by "
                  "up to {:.3g} "
                  "tolerances; try \"small_steps\", \"substeps\" or a smaller \"step\"",
                  r.steps, sum.limit_steps, sum.failed_steps, sum.largest_residual));
}

/// Without what differs between equal runs, and that.
std::pair<Json, Json> measured(const SceneManifest& m) {
  Json out{
      {"bytes", m.bytes},         {"bytes_with_all", m.bytes_with_all},  {"difference_with_all", m.difference_with_all},
      {"body_steps", m.steps},    {"body_steps_asleep", m.asleep_steps}, {"unused_contact_methods", m.unused_methods},
      {"left_out", Json::array()}};
  Json seconds{{"step", m.seconds}, {"step_with_all", m.seconds_with_all}, {"left_out", Json::array()}};
  for (const ManifestItem& i : m.left_out) {
    out["left_out"].push_back({{"what", i.what},
                               {"why", i.why},
                               {"bytes", i.bytes},
                               {"difference", i.difference},
                               {"bound", i.bound ? Json(*i.bound) : Json()}});
    seconds["left_out"].push_back({{"what", i.what}, {"saved_per_step", i.seconds}});
  }
  return {std::move(out), std::move(seconds)};
}

void write_manifest(Program& program, const Arguments& a, const Scene& scene, const SceneUse& use) {
  if (a.manifest.empty()) return;
  program.progress().stage("playing the scene with each put back that it does without");
  std::map<std::string, Asset> assets;
  for (const auto& [name, file] : scene.assets) assets.emplace(name, read_asset(file));
  constexpr double kKeyRate = 10.0;  // Hz, at which positions are compared
  const SceneManifest m = measure_manifest(scene, assets, use, {.steps = a.steps, .key_rate = kKeyRate});
  std::string text;
  for (const ManifestItem& i : m.left_out)
    text += fmt::format("  without {:<19} {:>10.3f} MB, {:>9.2f} us a step, {:.1e} m elsewhere: {}\n", i.what,
                        1e-6 * static_cast<double>(i.bytes), 1e6 * i.seconds, i.difference, i.why);
  program.print(text);
  auto [out, seconds] = measured(m);
  Json whole{{"program", "limber-simulate"}, {"scene", scene.name}};
  whole.update(out);
  whole["models"] = program.report().at("models");
  whole["seconds"] = std::move(seconds);
  program.write_file(a.manifest, whole.dump(2) + "\n");
}

void simulate(Program& program, const Arguments& a) {
  const auto began = Clock::now();
  program.progress().stage("reading the scene");
  const Scene scene = read_scene(a.scene);
  program.add_input(a.scene);
  for (const auto& file : files_of(scene)) program.add_input(file);
  const bool sampled = !a.record.empty() || !a.energies.empty() || !a.mode_energies.empty() || a.reconstruct;
  const SceneUse use{.drawn = !a.record.empty() || a.reconstruct, .reached_into = false};
  std::map<std::string, Asset> assets;
  if (!a.sound.empty())
    for (const auto& [name, file] : scene.assets) assets.emplace(name, read_asset(file));
  const SceneModels models = a.sound.empty() ? load_models(scene, use) : make_models(scene, assets, use);
  program.warnings() = models.warnings;
  program.progress().stage("simulating");
  const RunResult result = run_scene(scene, models,
                                     {.steps = a.steps,
                                      .key_rate = sampled ? a.record_frame_rate * a.recording.slow_motion : 0.0,
                                      .reconstruct = a.reconstruct,
                                      .keep_contacts = !a.contacts.empty(),
                                      .keep_blows = !a.sound.empty(),
                                      .progress = [&](double done) { program.progress().fraction(done); }});
  program.print(summary(scene, models, result));
  report_run(program.report(), scene, models, result);
  record(program, a, result.trajectory);
  if (!a.energies.empty()) program.write_file(a.energies, energies_csv(result.trajectory));
  if (!a.mode_energies.empty()) program.write_file(a.mode_energies, mode_energies_csv(result.trajectory));
  if (!a.contacts.empty()) program.write_file(a.contacts, contacts_csv(result.trajectory));
  if (!a.sensors.empty()) program.write_file(a.sensors, sensors_csv(result.trajectory));
  write_sound(program, a, scene, assets, result);
  write_manifest(program, a, scene, use);
  warn_of_limits(program, result);
  program.report()["seconds"] = {
      {"total", std::chrono::duration<double>(Clock::now() - began).count()},
      {"advance", result.seconds_advance},
      {"advance_per_step_and_body", per(result.seconds_advance, body_steps(result))},
      {"reconstruct", result.seconds_reconstruct},
      {"reconstruct_per_vertex", per(result.seconds_reconstruct, static_cast<double>(result.reconstructed_vertices))}};
}

}  // namespace
}  // namespace limber::tools

int main(int argc, char** argv) {
  using namespace limber::tools;
  Program program(
      "limber-simulate",
      "Plays a scene at a fixed step: bodies that vibrate, fly, touch, hang on joints and are held. Vibration "
      "and free flight are exact over a step of any length.");
  Arguments arguments;
  declare(program.options(), arguments);
  return program.run(argc, argv, [&] { simulate(program, arguments); });
}
