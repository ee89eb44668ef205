#include "ranges/triangle_crossings.h"

#include <algorithm>
#include <cmath>

#include "constants.h"

namespace limber::internal {
namespace {

using Kind = MotionPath::Kind;

constexpr double kInstant = 1e-13;    // rad or length: roots that are nearer are one
constexpr double kPartOfTurn = 0.25;  // rad: so long a part of a screw's way is looked at together
constexpr int kMostSteps = 60;        // halves alone reach the last bit in as many
constexpr double kFlat = 1e-3;        // of the slack: what varies by less over an interval has one root there

/// A triangle and its plane.
struct Plane {
  std::array<Vec3, 3> corners;
  Vec3 normal;
  double offset = 0.0;
};

/// Where an edge passes the plane of a triangle, if it does so inside of it.
bool pierces(const Vec3& p, const Vec3& q, const Plane& face, Vec3& at) {
  const double from = face.normal.dot(p) - face.offset, to = face.normal.dot(q) - face.offset;
  if ((from > 0.0) == (to > 0.0)) return false;
  at = p + from / (from - to) * (q - p);
  for (std::size_t i = 0; i < 3; ++i)
    if (face.normal.cross(face.corners[(i + 1) % 3] - face.corners[i]).dot(at - face.corners[i]) < 0.0) return false;
  return true;
}

/// True if two triangles cross. @param segment out: the ends of what they share
bool share(const Plane& a, const Plane& b, std::array<Vec3, 2>& segment) {
  int count = 0;
  const auto add = [&](const Vec3& at) {
    if (count == 0) segment = {at, at};
    if (count > 0 && (at - segment[0]).squaredNorm() > (segment[1] - segment[0]).squaredNorm()) segment[1] = at;
    ++count;
  };
  Vec3 at;
  for (std::size_t i = 0; i < 3; ++i) {
    if (pierces(a.corners[i], a.corners[(i + 1) % 3], b, at)) add(at);
    if (pierces(b.corners[i], b.corners[(i + 1) % 3], a, at)) add(at);
  }
  return count > 0;
}

}  // namespace

MeetingFace::MeetingFace(const OrbitFace& face) : corners(face.corners), normal(face.normal), offset(face.offset) {
  for (std::size_t i = 0; i < 3; ++i) {
    directions[i] = corners[(i + 1) % 3] - corners[i];
    units[i] = directions[i].normalized();
    moments[i] = corners[i].cross(units[i]);
    sides[i] = normal.cross(directions[i]).normalized();
    radii[i] = corners[i].tail<2>().norm();
  }
  across = normal.tail<2>().norm();
}

TriangleCrossings::Position TriangleCrossings::position(double t) const {
  if (frame_.kind() == Kind::kTranslation) return {.t = t};
  return {t, std::cos(t), std::sin(t)};
}

double TriangleCrossings::t_of(const Position& at) const {
  return frame_.kind() == Kind::kRotation ? std::atan2(at.sine, at.cosine) : at.t;
}

Vec3 TriangleCrossings::turned(const Vec3& d, const Position& at) const {
  return {d.x(), at.cosine * d.y() - at.sine * d.z(), at.sine * d.y() + at.cosine * d.z()};
}

// @param sense −1: φ_{−t}
Vec3 TriangleCrossings::moved(const Vec3& p, const Position& at, double sense) const {
  Vec3 out = turned(p, {at.t, at.cosine, sense * at.sine});
  if (frame_.kind() == Kind::kTranslation) out.x() += sense * at.t;
  if (frame_.kind() == Kind::kScrew) out.x() += sense * frame_.pitch() * at.t;
  return out;
}

// True if the corners of one triangle stay on one side of the other's plane all the way.
bool TriangleCrossings::one_side(const MeetingFace& moving, const MeetingFace& fixed, const Interval& window) const {
  if (frame_.kind() == Kind::kTranslation) return false;
  const bool screw = frame_.kind() == Kind::kScrew;
  const double advanced = screw ? 0.5 * frame_.pitch() * (window.low + window.high) : 0.0;
  const double more = screw ? 0.5 * std::abs(frame_.pitch()) * window.width() : 0.0;
  const auto stays = [&](const MeetingFace& of, const MeetingFace& over, double sense) {
    double low = kInfinity, high = -kInfinity;
    for (std::size_t i = 0; i < 3; ++i) {
      const double middle = over.normal.x() * (of.corners[i].x() + sense * advanced) - over.offset;
      const double half = over.across * of.radii[i] + std::abs(over.normal.x()) * more;
      low = std::min(low, middle - half), high = std::max(high, middle + half);
    }
    return low > 0.0 || high < 0.0;
  };
  return stays(moving, fixed, 1.0) || stays(fixed, moving, -1.0);
}

double TriangleCrossings::Height::at(double t) const {
  return a + d * t + (b + e * t) * std::cos(t) + (c + f * t) * std::sin(t);
}

double TriangleCrossings::Height::rate(double t) const {
  return d + (c + f * t + e) * std::cos(t) + (f - b - e * t) * std::sin(t);
}

// The height of φ_t(point) over a plane. @param sense −1: of φ_{−t}(point)
TriangleCrossings::Height TriangleCrossings::height(const Vec3& p, const MeetingFace& over, double sense) const {
  const Vec3& n = over.normal;
  if (frame_.kind() == Kind::kTranslation) return {.a = n.dot(p) - over.offset, .d = sense * n.x()};
  return {.a = n.x() * p.x() - over.offset,
          .b = n.y() * p.y() + n.z() * p.z(),
          .c = sense * (n.z() * p.y() - n.y() * p.z()),
          .d = frame_.kind() == Kind::kScrew ? sense * n.x() * frame_.pitch() : 0.0};
}

// The reciprocal product of a line (d, m) that moves and one (e, k) that stays.
TriangleCrossings::Height TriangleCrossings::product(const Vec3& d, const Vec3& m, const Vec3& e, const Vec3& k) const {
  if (frame_.kind() == Kind::kTranslation) return {.a = m.dot(e) + d.dot(k), .d = d.y() * e.z() - d.z() * e.y()};
  Height h{.a = m.x() * e.x() + d.x() * k.x(),
           .b = m.y() * e.y() + m.z() * e.z() + d.y() * k.y() + d.z() * k.z(),
           .c = m.y() * e.z() - m.z() * e.y() + d.y() * k.z() - d.z() * k.y()};
  if (frame_.kind() == Kind::kScrew) {
    h.e = frame_.pitch() * (d.y() * e.z() - d.z() * e.y());
    h.f = -frame_.pitch() * (d.z() * e.z() + d.y() * e.y());
  }
  return h;
}

void TriangleCrossings::roots(const Height& h, const Interval& window) {
  roots_.clear();
  switch (frame_.kind()) {
    case Kind::kTranslation:
      if (h.d != 0.0) roots_.push_back({.t = -h.a / h.d});
      return;
    case Kind::kRotation: {
      // With (b, c) = r (cos β, sin β): cos(t − β) = −a/r.
      const double r2 = h.b * h.b + h.c * h.c;
      if (!(h.a * h.a <= r2) || r2 == 0.0) return;
      const double cosine = -h.a / r2, sine = std::sqrt(r2 - h.a * h.a) / r2;
      roots_.push_back({0.0, h.b * cosine - h.c * sine, h.c * cosine + h.b * sine});
      roots_.push_back({0.0, h.b * cosine + h.c * sine, h.c * cosine - h.b * sine});
      return;
    }
    case Kind::kScrew:
      bracketed_roots(h, window.low, window.high);
  }
}

// Bounds of the first and second derivative part an interval until it holds no root, or one.
void TriangleCrossings::bracketed_roots(const Height& h, double low, double high) {
  const double furthest = std::max(std::abs(low), std::abs(high));
  const double turning = std::abs(h.b) + std::abs(h.c) + (std::abs(h.e) + std::abs(h.f)) * furthest;
  const double growing = std::abs(h.e) + std::abs(h.f);
  const double first = std::abs(h.d) + turning + growing, second = turning + 2.0 * growing;
  const auto search = [&](auto&& self, double from, double to) -> void {
    const double middle = 0.5 * (from + to), half = 0.5 * (to - from);
    if (std::abs(h.at(middle)) > first * half) return;
    const bool flat = first * half <= kFlat * slack_;
    if (std::abs(h.rate(middle)) <= second * half && !flat) {
      self(self, from, middle);
      self(self, middle, to);
      return;
    }
    if (flat) return roots_.push_back(position(middle));
    const bool starts_above = h.at(from) > 0.0;
    if (starts_above == (h.at(to) > 0.0)) return;
    // Newton's steps, and halves where they leave the bracket.
    double below = from, above = to, t = middle;
    for (int i = 0; i < kMostSteps; ++i) {
      const double value = h.at(t);
      ((value > 0.0) == starts_above ? below : above) = t;
      double next = t - value / h.rate(t);
      if (!(next > below && next < above)) next = 0.5 * (below + above);
      const double step = std::abs(next - t);
      t = next;
      if (step <= kInstant * (1.0 + furthest)) break;
    }
    roots_.push_back(position(t));
  };
  if (low <= high) search(search, low, high);
}

bool TriangleCrossings::over(const Vec3& p, const MeetingFace& face) const {
  for (std::size_t i = 0; i < 3; ++i)
    if (face.sides[i].dot(p - face.corners[i]) < -slack_) return false;
  return true;
}

void TriangleCrossings::corners_on_faces(const MeetingFace& moving, const MeetingFace& fixed, const Interval& window) {
  for (const Vec3& p : moving.corners) {
    roots(height(p, fixed, 1.0), window);
    for (const Position& t : roots_)
      if (const Vec3 at = moved(p, t); over(at, fixed)) meetings_.push_back({t_of(t), at});
  }
  for (const Vec3& q : fixed.corners) {
    roots(height(q, moving, -1.0), window);
    for (const Position& t : roots_)
      if (over(moved(q, t, -1.0), moving)) meetings_.push_back({t_of(t), q});
  }
}

void TriangleCrossings::edges_on_edges(const MeetingFace& moving, const MeetingFace& fixed, const Interval& window) {
  constexpr double kParallel = 1e-12;  // sine: lines that are parallel meet nowhere in particular
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      const Vec3& e = fixed.directions[j];
      roots(product(moving.units[i], moving.moments[i], fixed.units[j], fixed.moments[j]), window);
      for (const Position& t : roots_) {
        const Vec3 p = moved(moving.corners[i], t), d = turned(moving.directions[i], t);
        const Vec3 n = d.cross(e), apart = fixed.corners[j] - p;
        const double n2 = n.squaredNorm(), d2 = d.squaredNorm(), e2 = e.squaredNorm();
        if (!(n2 > kParallel * kParallel * d2 * e2)) continue;
        const double along = apart.cross(e).dot(n) / n2, beside = apart.cross(d).dot(n) / n2;
        const double more = slack_ / std::sqrt(d2), other = slack_ / std::sqrt(e2);
        if (along < -more || along > 1.0 + more || beside < -other || beside > 1.0 + other) continue;
        meetings_.push_back({t_of(t), fixed.corners[j] + beside * e});
      }
    }
}

bool TriangleCrossings::crosses(const MeetingFace& moving, const MeetingFace& fixed, double t,
                                std::array<Vec3, 2>& segment) const {
  const Position at = position(t);
  Plane m{{}, turned(moving.normal, at)};
  for (std::size_t i = 0; i < 3; ++i) m.corners[i] = moved(moving.corners[i], at);
  m.offset = m.normal.dot(m.corners[0]);
  return share(m, {fixed.corners, fixed.normal, fixed.offset}, segment);
}

bool cross_as_drawn(const OrbitFace& a, const OrbitFace& b, std::array<Vec3, 2>& segment) {
  return share({a.corners, a.normal, a.offset}, {b.corners, b.normal, b.offset}, segment);
}

void TriangleCrossings::find(const MeetingFace& moving, const MeetingFace& fixed, const Interval& window,
                             std::vector<TriangleCrossing>& out) {
  meetings_.clear();
  const int parts = frame_.kind() == Kind::kScrew ? std::max(1, static_cast<int>(window.width() / kPartOfTurn)) : 1;
  for (int i = 0; i < parts; ++i) {
    Interval part = window;
    if (parts > 1) part.low = window.low + i * window.width() / parts;
    if (parts > 1) part.high = window.low + (i + 1) * window.width() / parts;
    if (one_side(moving, fixed, part)) continue;
    corners_on_faces(moving, fixed, part);
    edges_on_edges(moving, fixed, part);
  }
  std::stable_sort(meetings_.begin(), meetings_.end(), [](const Meeting& a, const Meeting& b) { return a.t < b.t; });
  TriangleCrossing c;
  const auto between = [&](const Meeting& from, const Meeting& to) {
    if (!(to.t - from.t > kInstant)) return;
    if (!crosses(moving, fixed, 0.5 * (from.t + to.t), c.at_middle)) return;
    c.low = from.t, c.high = to.t, c.first = from.point, c.last = to.point;
    out.push_back(c);
  };
  for (std::size_t i = 1; i < meetings_.size(); ++i) between(meetings_[i - 1], meetings_[i]);
  if (frame_.kind() != Kind::kRotation) return;
  if (!meetings_.empty()) {
    Meeting around = meetings_.front();
    around.t += 2.0 * kPi;
    between(meetings_.back(), around);
  } else if (crosses(moving, fixed, 0.0, c.at_middle)) {
    c.low = -kPi, c.high = kPi, c.first = c.last = c.at_middle[0];
    out.push_back(c);
  }
}

}  // namespace limber::internal
