#include "ranges/orbit_index.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

#include "constants.h"
#include "tuning.h"

namespace limber::internal {
namespace {

using Kind = MotionPath::Kind;

/// Sine of the angle between an orbit and a plane below which round-off tells where they meet.
constexpr double kAlong = 1e-9;

/// The zero of a function that changes its sign between two places once: regula falsi after Illinois.
template <class F>
double zero_between(const F& f, double a, double fa, double b, double fb) {
  constexpr double kClose = 1e-14;  // round-off
  for (std::size_t step = 0;
       step < tuning().ranges.points.helix_steps && std::abs(b - a) > kClose * (1.0 + std::abs(b)) && fb != 0.0;
       ++step) {
    const double c = b - fb * (b - a) / (fb - fa), fc = f(c);
    if ((fc < 0.0) != (fb < 0.0))
      a = b, fa = fb;
    else
      fa *= 0.5;
    b = c, fb = fc;
  }
  return b;
}

std::vector<OrbitBox> boxes_of(const std::vector<OrbitFace>& faces) {
  std::vector<OrbitBox> boxes;
  boxes.reserve(faces.size());
  for (const OrbitFace& face : faces) boxes.push_back(face.box);
  return boxes;
}

}  // namespace

OrbitIndex::OrbitIndex(const PathFrame& frame, std::span<const OrbitBody> bodies, const std::vector<OrbitFace>& faces)
    : frame_(frame), tree_(boxes_of(faces)) {
  for (const OrbitBody& body : bodies) closed_.push_back(body.closed);
  faces_.reserve(faces.size());
  for (const Index number : tree_.order()) faces_.emplace_back(faces[static_cast<std::size_t>(number)], frame.kind());
}

OrbitIndex::Face::Face(const OrbitFace& face, Kind kind)
    : plane{face.normal, face.offset},
      low(face.across * face.sector.cosine_low),
      high(face.across * face.sector.cosine_high),
      across(face.across),
      heading(face.heading),
      bearing(face.sector.bearing),
      sector(face.sector.half),
      body(face.body),
      one_sided(face.one_sided && !face.narrow),
      narrow(face.narrow) {
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3& a = face.corners[i];
    Vec3 inward = face.normal.cross(face.corners[(i + 1) % 3] - a);
    if (kind == Kind::kTranslation)
      inward = std::copysign(1.0, face.normal.x()) * Vec3::UnitX().cross(face.corners[(i + 1) % 3] - a);
    sides[i] = {inward, inward.dot(a)};
  }
  std::tie(low_x, high_x) = std::minmax({face.corners[0].x(), face.corners[1].x(), face.corners[2].x()});
}

// The helices of a screw repeat after a turn: what lies beside the first lies beside the last.
void OrbitIndex::gather(const Orbit& orbit, double around, std::vector<Index>& near) const {
  near.clear();
  OrbitBox box = frame_.box_of(orbit);
  box.grow(around);
  const auto add = [&](Index face) {
    near.push_back(face);
    return false;
  };
  tree_.any_overlapping(box, add);
  if (frame_.kind() != Kind::kScrew) return;
  const double turn = 2.0 * kPi * std::abs(frame_.pitch());
  for (const double by : {turn, -2.0 * turn}) {
    box.low[1] += by, box.high[1] += by;
    tree_.any_overlapping(box, add);
  }
  std::sort(near.begin(), near.end());
  near.erase(std::unique(near.begin(), near.end()), near.end());
}

void OrbitIndex::crossings(const Orbit& orbit, const std::vector<Index>& near, std::vector<Crossing>& out) const {
  out.clear();
  switch (frame_.kind()) {
    case Kind::kRotation:
      for (const Index face : near) cross_circle(faces_[static_cast<std::size_t>(face)], orbit, out);
      break;
    case Kind::kTranslation:
      for (const Index face : near) cross_line(faces_[static_cast<std::size_t>(face)], orbit, out);
      break;
    case Kind::kScrew: {
      const OrbitBox point = frame_.box_of(orbit);
      for (const Index face : near)
        if (tree_.box(face).overlaps(point)) cross_helix(faces_[static_cast<std::size_t>(face)], orbit, out);
    }
  }
  std::sort(out.begin(), out.end(), [](const Crossing& a, const Crossing& b) {
    return std::tie(a.body, a.t, a.sign) < std::tie(b.body, b.t, b.sign);
  });
}

// Plane n·q = c with q = (x, r cos θ, r sin θ):  r h cos(θ − β) = c − n_x x,  h = |(n_y, n_z)|, β its angle. Most faces
// are passed by, which is told without an angle: cos θ and sin θ come from those of β and θ − β.
void OrbitIndex::cross_circle(const Face& face, const Orbit& orbit, std::vector<Crossing>& out) const {
  const auto [r, x] = orbit.plane;
  const Vec3& n = face.plane.normal;
  const double distance = face.plane.offset - n.x() * x;
  if ((distance < r * face.low) | (distance > r * face.high)) return;
  if (!(face.across > kAlong) || !(r > 0.0)) return;
  const double cosine = std::clamp(distance / (r * face.across), -1.0, 1.0);
  const double sine = std::sqrt(std::max(1.0 - cosine * cosine, 0.0)), to_plane = r / face.across;
  for (const int side : {-1, 1}) {
    const double s = side * sine;
    if (!face.holds({x, to_plane * (n.y() * cosine - n.z() * s), to_plane * (n.z() * cosine + n.y() * s)})) continue;
    // d/dθ cos(θ − β) = −sin: + half goes inward
    out.push_back({wrapped(face.heading + side * std::acos(cosine) - orbit.phase), face.body, side,
                   face.slope(face.across * sine), face.one_sided});
  }
}

void OrbitIndex::cross_line(const Face& face, const Orbit& orbit, std::vector<Crossing>& out) const {
  const Vec3& n = face.plane.normal;
  if (!(std::abs(n.x()) > kAlong)) return;
  const auto [y, z] = orbit.plane;
  if (!face.holds({0.0, y, z})) return;
  const double x = (face.plane.offset - n.y() * y - n.z() * z) / n.x();
  out.push_back({x - orbit.phase, face.body, n.x() < 0.0 ? 1 : -1, face.slope(n.x()), face.one_sided});
}

// The same plane along x = x₀ + pitch t:  f(t) = r h cos(θ₀ + t − β) + n_x pitch t + n_x x₀ − c. Between the zeros of
// f', r h sin(θ₀ + t − β) = n_x pitch, f is monotonic; the triangle's extent along x and its sector bound t.
void OrbitIndex::cross_helix(const Face& face, const Orbit& orbit, std::vector<Crossing>& out) const {
  constexpr double kMargin = 1e-9;  // rad: a triangle across the axis has no extent along it
  const auto [r, x0] = orbit.plane;
  const double pitch = frame_.pitch();
  const auto [first, last] = std::minmax({(face.low_x - x0) / pitch, (face.high_x - x0) / pitch});
  const Span along{first - kMargin * (1.0 + std::abs(first)), last + kMargin * (1.0 + std::abs(last))};
  const double bearing = face.bearing - orbit.phase;
  const double turns = std::ceil((along.low - bearing - face.sector) / (2.0 * kPi));
  for (double middle = bearing + 2.0 * kPi * turns; middle - face.sector <= along.high; middle += 2.0 * kPi) {
    const Span part{std::max(along.low, middle - face.sector), std::min(along.high, middle + face.sector)};
    if (part.low <= part.high) cross_helix_part(face, orbit, part, out);
  }
}

void OrbitIndex::cross_helix_part(const Face& face, const Orbit& orbit, const Span& part,
                                  std::vector<Crossing>& out) const {
  const Vec3& n = face.plane.normal;
  const auto [r, x0] = orbit.plane;
  const double pitch = frame_.pitch(), h = face.across, beta = face.heading;
  const auto point = [&, r = r, x0 = x0](double t) {
    return Vec3(x0 + pitch * t, r * std::cos(orbit.phase + t), r * std::sin(orbit.phase + t));
  };
  const auto f = [&](double t) { return n.dot(point(t)) - face.plane.offset; };
  // f' has two zeros a turn, and a part is one turn at most. A zero that is not in it stands at its start.
  std::array<double, 2> extremes{part.low, part.low};
  if (const double sine = n.x() * pitch / (r * h); r * h > 0.0 && std::abs(sine) < 1.0)
    for (std::size_t k = 0; k < 2; ++k) {
      const double base = (k == 0 ? std::asin(sine) : kPi - std::asin(sine)) + beta - orbit.phase;
      const double t = base + 2.0 * kPi * std::ceil((part.low - base) / (2.0 * kPi));
      if (t < part.high) extremes[k] = t;
    }
  const auto [earlier, later] = std::minmax(extremes[0], extremes[1]);
  const std::array<double, 4> cuts{part.low, earlier, later, part.high};
  for (std::size_t i = 0; i + 1 < cuts.size(); ++i) {
    const double at_low = f(cuts[i]), at_high = f(cuts[i + 1]);
    if ((at_low < 0.0) == (at_high < 0.0)) continue;
    const double t = zero_between(f, cuts[i], at_low, cuts[i + 1], at_high);
    if (!face.holds(point(t))) continue;
    const double rate = n.x() * pitch - r * h * std::sin(orbit.phase + t - beta);
    out.push_back({t, face.body, at_low < 0.0 ? -1 : 1, face.slope(rate / std::hypot(r, pitch)), face.one_sided});
  }
}

void OrbitIndex::pieces(const Orbit& orbit, double nudge, const std::vector<Index>& near,
                        std::vector<OrbitPiece>& out) const {
  thread_local std::vector<Crossing> found;
  out.clear();
  if (near.empty()) return;
  // Directions without relation to the axes a model is built along.
  constexpr std::array<std::array<double, 2>, 4> kBeside{
      {{0, 0}, {0.8253, 0.5647}, {-0.7431, 0.6692}, {0.1219, -0.9925}}};
  const auto balanced = [&](const Orbit& o) {
    crossings(o, near, found);
    for (std::size_t i = 0; i < found.size();) {
      int sum = 0;
      const Index body = found[i].body;
      for (; i < found.size() && found[i].body == body; ++i) sum += found[i].sign;
      if (sum != 0 && closed_[static_cast<std::size_t>(body)]) return false;
    }
    return true;
  };
  Orbit beside = orbit;
  for (const auto& direction : kBeside) {
    for (std::size_t i = 0; i < 2; ++i) beside.plane[i] = orbit.plane[i] + nudge * direction[i];
    if (frame_.kind() != Kind::kTranslation) beside.plane[0] = std::max(beside.plane[0], 0.0);
    if (balanced(beside)) break;
  }
  for (std::size_t i = 0; i < found.size();) {
    std::size_t end = i;
    while (end < found.size() && found[end].body == found[i].body) ++end;
    int sum = 0;
    for (std::size_t k = i; k < end; ++k) sum += found[k].sign;
    if (closed_[static_cast<std::size_t>(found[i].body)] && sum == 0)
      add_solid(std::span(found).subspan(i, end - i), out);
    else
      for (std::size_t k = i; k < end; ++k)
        out.push_back({found[k].t, found[k].t, found[k].body, found[k].sign, found[k].slope, found[k].slope,
                       found[k].one_sided, found[k].one_sided});
    i = end;
  }
  std::sort(out.begin(), out.end(), [](const OrbitPiece& a, const OrbitPiece& b) {
    return std::tie(a.low, a.high, a.body) < std::tie(b.low, b.high, b.body);
  });
}

// A line starts outside. A circle starts wherever; some of it is outside, where the winding number is least.
void OrbitIndex::add_solid(std::span<const Crossing> of_body, std::vector<OrbitPiece>& out) const {
  const bool circle = frame_.kind() == Kind::kRotation;
  int winding = 0, least = 0;
  for (const Crossing& c : of_body) least = std::min(least, winding += c.sign);
  winding = circle ? -least : 0;
  Crossing entered{.t = -kPi};
  for (const Crossing& c : of_body) {
    const int before = winding;
    winding += c.sign;
    if (before == 0 && winding != 0) entered = c;
    if (before != 0 && winding == 0)
      out.push_back({entered.t, c.t, c.body, 0, entered.slope, c.slope, entered.one_sided, c.one_sided});
  }
  if (winding != 0)
    out.push_back({entered.t, kPi, of_body.front().body, 0, entered.slope, 0.0, entered.one_sided, false});
}

}  // namespace limber::internal
