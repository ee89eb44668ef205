#include <array>
#include <cstdio>

#include "limber/model/morph_targets.h"
#include "limber/scene/run.h"

namespace limber {
namespace {

std::string number(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", x);
  return text;
}

/// A CSV field: in quotes where it holds what would end it.
std::string field(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

}  // namespace

const std::string& Trajectory::name(std::size_t body) const {
  return body < bodies.size() ? bodies[body].name : statics.at(body - bodies.size()).name;
}

std::span<const double> BodyTrack::amplitudes_at(std::size_t key) const {
  const auto k = static_cast<std::size_t>(model->modes());
  return std::span(amplitudes).subspan(key * k, k);
}

std::span<const double> BodyTrack::rates_at(std::size_t key) const {
  const auto k = static_cast<std::size_t>(model->modes());
  return std::span(rates).subspan(key * k, k);
}

std::string energies_csv(const Trajectory& trajectory) {
  std::string csv = "time_s,body,kinetic_rigid_J,potential_J,kinetic_modal_J,elastic_J,total_J\n";
  for (std::size_t key = 0; key < trajectory.times.size(); ++key)
    for (const BodyTrack& body : trajectory.bodies) {
      const BodyEnergy& e = body.energies[key];
      csv += number(trajectory.times[key]) + "," + field(body.name);
      for (const double x : {e.kinetic_rigid, e.potential, e.kinetic_modal, e.elastic, e.total()})
        csv += "," + number(x);
      csv += "\n";
    }
  return csv;
}

std::string contacts_csv(const Trajectory& trajectory) {
  constexpr std::array kPhases{"begun", "lasting", "ended"};
  std::string csv = "time_s,phase,a,b,x_m,y_m,z_m,normal_x,normal_y,normal_z,impulse_x_Ns,impulse_y_Ns,impulse_z_Ns\n";
  for (const ContactRecord& c : trajectory.contacts) {
    csv += number(c.time) + "," + kPhases[static_cast<std::size_t>(c.phase)] + "," + field(trajectory.name(c.a)) + "," +
           field(trajectory.name(c.b));
    for (const Vec3& v : {c.position, c.normal, c.impulse})
      for (int i = 0; i < 3; ++i) csv += "," + number(v[i]);
    csv += "\n";
  }
  return csv;
}

std::string sensors_csv(const Trajectory& trajectory) {
  std::string csv = "time_s,event,sensor,body\n";
  for (const SensorRecord& e : trajectory.sensor_events)
    csv += number(e.time) + "," + (e.began ? "entered" : "left") + "," + field(trajectory.sensors.at(e.sensor)) + "," +
           field(trajectory.name(e.body)) + "\n";
  return csv;
}

std::string mode_energies_csv(const Trajectory& trajectory) {
  std::string csv = "time_s";
  for (const BodyTrack& body : trajectory.bodies) {
    csv += "," + field(body.name + " all modes");
    for (Index m = 0; m < body.model->modes(); ++m)
      csv += "," + field(body.name + " " + mode_target_name(m, body.model->modes(), body.model->frequency_hz(m)));
  }
  csv += "\n";
  for (std::size_t key = 0; key < trajectory.times.size(); ++key) {
    csv += number(trajectory.times[key]);
    for (const BodyTrack& body : trajectory.bodies) {
      const auto z = body.amplitudes_at(key), zdot = body.rates_at(key);
      const auto& lambda = body.model->data().eigenvalues;
      csv += "," + number(body.energies[key].kinetic_modal + body.energies[key].elastic);
      for (std::size_t m = 0; m < z.size(); ++m)
        csv += "," + number(0.5 * (zdot[m] * zdot[m] + lambda[m] * z[m] * z[m]));
    }
    csv += "\n";
  }
  return csv;
}

}  // namespace limber
