#include "orbit_index.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace limber::internal {
namespace {

using Kind = MotionPath::Kind;
constexpr double kPi = std::numbers::pi;
constexpr Index kLeaf = 4;

/// Within (−π, π]. @pre |angle| < 4π
double wrapped(double angle) {
  while (angle > kPi) angle -= 2.0 * kPi;
  while (angle <= -kPi) angle += 2.0 * kPi;
  return angle;
}

/// Distance of the origin from a segment in the plane.
double distance_to_segment(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector2d d = b - a;
  const double length2 = d.squaredNorm();
  const double s = length2 > 0.0 ? std::clamp(-a.dot(d) / length2, 0.0, 1.0) : 0.0;
  return (a + s * d).norm();
}

/// Smallest distance from the axis over a triangle.
double least_radius(std::span<const Vec3, 3> c) {
  std::array<Eigen::Vector2d, 3> p;
  for (std::size_t i = 0; i < 3; ++i) p[i] = c[i].tail<2>();
  std::array<double, 3> side{};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto& a = p[i];
    const auto& b = p[(i + 1) % 3];
    side[i] = a.x() * b.y() - a.y() * b.x();
  }
  const auto [low, high] = std::minmax_element(side.begin(), side.end());
  if (*low >= 0.0 || *high <= 0.0) return 0.0;
  double least = distance_to_segment(p[0], p[1]);
  least = std::min(least, distance_to_segment(p[1], p[2]));
  return std::min(least, distance_to_segment(p[2], p[0]));
}

/// The angles about the axis that a triangle covers: middle and half width.
std::pair<double, double> sector_of(const OrbitIndex::Face& f) {
  if (!(f.box.low[0] > 0.0)) return {0.0, kPi};
  const auto angle = [&](std::size_t i) { return std::atan2(f.corners[i].z(), f.corners[i].y()); };
  const double start = angle(0);
  const auto [low, high] = std::minmax({0.0, wrapped(angle(1) - start), wrapped(angle(2) - start)});
  if (high - low >= kPi) return {0.0, kPi};
  constexpr double kMargin = 1e-9;
  return {start + 0.5 * (low + high), 0.5 * (high - low) + kMargin};
}

/// Tangent of the angle whose cosine is given.
double slope_of(double cosine) { return std::sqrt(std::max(1.0 - cosine * cosine, 0.0)) / std::abs(cosine); }

/// The zero of a function that changes its sign between two places once: regula falsi after Illinois.
template <class F>
double zero_between(const F& f, double a, double fa, double b, double fb) {
  constexpr int kMostSteps = 60;
  constexpr double kClose = 1e-14;
  for (int step = 0; step < kMostSteps && std::abs(b - a) > kClose * (1.0 + std::abs(b)) && fb != 0.0; ++step) {
    const double c = b - fb * (b - a) / (fb - fa), fc = f(c);
    if ((fc < 0.0) != (fb < 0.0))
      a = b, fa = fb;
    else
      fa *= 0.5;
    b = c, fb = fc;
  }
  return b;
}

/// Whether a point of the triangle's plane lies inside it; on an edge counts.
bool inside(const OrbitIndex::Face& f, const Vec3& q) {
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3& a = f.corners[i];
    const Vec3& b = f.corners[(i + 1) % 3];
    if ((b - a).cross(q - a).dot(f.normal) < 0.0) return false;
  }
  return true;
}

}  // namespace

void OrbitBox::add(double first, double second) {
  low = {std::min(low[0], first), std::min(low[1], second)};
  high = {std::max(high[0], first), std::max(high[1], second)};
}

void OrbitBox::add(const OrbitBox& other) {
  add(other.low[0], other.low[1]);
  add(other.high[0], other.high[1]);
}

void OrbitBox::grow(double by) {
  for (std::size_t i = 0; i < 2; ++i) low[i] -= by, high[i] += by;
}

bool OrbitBox::overlaps(const OrbitBox& other) const {
  return low[0] <= other.high[0] && other.low[0] <= high[0] && low[1] <= other.high[1] && other.low[1] <= high[1];
}

PathFrame::PathFrame(const MotionPath& path) : kind_(path.kind), pitch_(path.pitch), origin_(path.origin) {
  Index least = 0;
  path.axis.cwiseAbs().minCoeff(&least);
  const Vec3 y = path.axis.cross(Vec3::Unit(least)).normalized();
  axes_.col(0) = path.axis;
  axes_.col(1) = y;
  axes_.col(2) = path.axis.cross(y);
}

Orbit PathFrame::orbit_of(const Vec3& p) const {
  if (kind_ == Kind::kTranslation) return {{p.y(), p.z()}, p.x()};
  return {{std::hypot(p.y(), p.z()), p.x()}, std::atan2(p.z(), p.y())};
}

// Helices of one radius differ in x − pitch θ, which is the same after a turn.
double PathFrame::start_of_helix(const Orbit& orbit) const {
  const double turn = 2.0 * kPi * std::abs(pitch_), s = orbit.plane[1] - pitch_ * orbit.phase;
  return s - turn * std::floor(s / turn);
}

OrbitBox PathFrame::box_of(const Orbit& orbit) const {
  OrbitBox box;
  box.add(orbit.plane[0], kind_ == Kind::kScrew ? start_of_helix(orbit) : orbit.plane[1]);
  return box;
}

OrbitBox PathFrame::plane_point(const Vec3& p) const {
  OrbitBox box;
  if (kind_ == Kind::kTranslation)
    box.add(p.y(), p.z());
  else
    box.add(std::hypot(p.y(), p.z()), p.x());
  return box;
}

OrbitBox PathFrame::box_of(std::span<const Vec3, 3> corners) const {
  OrbitBox box;
  for (const Vec3& c : corners) box.add(plane_point(c));
  if (kind_ != Kind::kTranslation) box.low[0] = least_radius(corners);
  return box;
}

double PathFrame::speed(const Orbit& orbit) const {
  switch (kind_) {
    case Kind::kRotation:
      return orbit.plane[0];
    case Kind::kScrew:
      return std::hypot(orbit.plane[0], pitch_);
    case Kind::kTranslation:
      break;
  }
  return 1.0;
}

OrbitIndex::OrbitIndex(const PathFrame& frame, std::span<const MotionBody> bodies, std::vector<Face> faces)
    : frame_(frame), faces_(std::move(faces)) {
  for (const MotionBody& body : bodies) closed_.push_back(body.closed);
  nodes_.reserve(faces_.size() + 1);
  if (!faces_.empty()) build(0, static_cast<Index>(faces_.size()));
}

Index OrbitIndex::build(Index first, Index count) {
  const auto id = static_cast<Index>(nodes_.size());
  nodes_.emplace_back();
  OrbitBox box;
  for (Index i = first; i < first + count; ++i) box.add(faces_[i].box);
  nodes_[id].box = box;
  if (count <= kLeaf) {
    nodes_[id].first = first;
    nodes_[id].count = count;
    return id;
  }
  const std::size_t axis = box.high[0] - box.low[0] >= box.high[1] - box.low[1] ? 0 : 1;
  const auto middle = [&](const Face& f) { return f.box.low[axis] + f.box.high[axis]; };
  const auto begin = faces_.begin() + first;
  std::nth_element(begin, begin + count / 2, begin + count,
                   [&](const Face& a, const Face& b) { return middle(a) < middle(b); });
  build(first, count / 2);
  const Index right = build(first + count / 2, count - count / 2);
  nodes_[id].right = right;
  return id;
}

bool OrbitIndex::meets(const OrbitBox& box) const {
  std::vector<Index> stack;
  if (!nodes_.empty()) stack.push_back(0);
  while (!stack.empty()) {
    const Node& node = nodes_[stack.back()];
    const Index next = stack.back() + 1;
    stack.pop_back();
    if (!node.box.overlaps(box)) continue;
    if (node.right >= 0) {
      stack.push_back(node.right);
      stack.push_back(next);
      continue;
    }
    for (Index i = node.first; i < node.first + node.count; ++i)
      if (faces_[i].box.overlaps(box)) return true;
  }
  return false;
}

void OrbitIndex::crossings(const Orbit& orbit, std::vector<Crossing>& out) const {
  out.clear();
  if (nodes_.empty()) return;
  const OrbitBox point = frame_.box_of(orbit);
  std::array<Index, 64> stack;  // a tree split at the median is never that deep
  std::size_t depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const Index id = stack[--depth];
    const Node& node = nodes_[id];
    if (!node.box.overlaps(point)) continue;
    if (node.right >= 0) {
      stack[depth++] = node.right;
      stack[depth++] = id + 1;
      continue;
    }
    for (Index i = node.first; i < node.first + node.count; ++i)
      if (faces_[i].box.overlaps(point)) cross(faces_[i], orbit, out);
  }
  std::sort(out.begin(), out.end(), [](const Crossing& a, const Crossing& b) {
    return std::tie(a.body, a.t, a.sign) < std::tie(b.body, b.t, b.sign);
  });
}

void OrbitIndex::cross(const Face& face, const Orbit& orbit, std::vector<Crossing>& out) const {
  switch (frame_.kind()) {
    case Kind::kRotation:
      return cross_circle(face, orbit, out);
    case Kind::kTranslation:
      return cross_line(face, orbit, out);
    case Kind::kScrew:
      return cross_helix(face, orbit, out);
  }
}

// Plane n·q = c with q = (x, r cos θ, r sin θ):  r h cos(θ − β) = c − n_x x,  h = |(n_y, n_z)|, β its angle.
void OrbitIndex::cross_circle(const Face& face, const Orbit& orbit, std::vector<Crossing>& out) const {
  constexpr double kAlong = 1e-9;  // sine of the angle below which the circle runs along the plane
  const auto [r, x] = orbit.plane;
  if (!(face.across > kAlong) || !(r > 0.0)) return;
  const double cosine = (face.offset - face.normal.x() * x) / (r * face.across);
  if (!(cosine >= face.cosine_low && cosine <= face.cosine_high)) return;
  const double half = std::acos(cosine), slope = slope_of(face.across * std::sin(half));
  for (const int side : {-1, 1}) {
    const double theta = face.heading + side * half;
    if (std::abs(wrapped(theta - face.bearing)) > face.sector) continue;
    if (inside(face, {x, r * std::cos(theta), r * std::sin(theta)}))
      out.push_back(
          {wrapped(theta - orbit.phase), face.body, side, slope});  // d/dθ cos(θ − β) = −sin: + half goes inward
  }
}

void OrbitIndex::cross_line(const Face& face, const Orbit& orbit, std::vector<Crossing>& out) const {
  constexpr double kAlong = 1e-9;
  const Vec3& n = face.normal;
  if (!(std::abs(n.x()) > kAlong)) return;
  const auto [y, z] = orbit.plane;
  const double x = (face.offset - n.y() * y - n.z() * z) / n.x();
  if (inside(face, {x, y, z})) out.push_back({x - orbit.phase, face.body, n.x() < 0.0 ? 1 : -1, slope_of(n.x())});
}

// The same plane along x = x₀ + pitch t:  f(t) = r h cos(θ₀ + t − β) + n_x pitch t + n_x x₀ − c. Between the zeros of
// f', r h sin(θ₀ + t − β) = n_x pitch, f is monotonic; the triangle's extent along x and its sector bound t.
void OrbitIndex::cross_helix(const Face& face, const Orbit& orbit, std::vector<Crossing>& out) const {
  constexpr double kMargin = 1e-9;  // rad: a triangle across the axis has no extent along it
  const auto [r, x0] = orbit.plane;
  const double pitch = frame_.pitch();
  const auto [low_x, high_x] = std::minmax({face.corners[0].x(), face.corners[1].x(), face.corners[2].x()});
  const auto [first, last] = std::minmax({(low_x - x0) / pitch, (high_x - x0) / pitch});
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
  const Vec3& n = face.normal;
  const auto [r, x0] = orbit.plane;
  const double pitch = frame_.pitch(), h = face.across, beta = face.heading;
  const auto point = [&, r = r, x0 = x0](double t) {
    return Vec3(x0 + pitch * t, r * std::cos(orbit.phase + t), r * std::sin(orbit.phase + t));
  };
  const auto f = [&](double t) { return n.dot(point(t)) - face.offset; };
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
    if (!inside(face, point(t))) continue;
    const double rate = n.x() * pitch - r * h * std::sin(orbit.phase + t - beta);
    out.push_back({t, face.body, at_low < 0.0 ? -1 : 1, slope_of(rate / std::hypot(r, pitch))});
  }
}

void OrbitIndex::pieces(const Orbit& orbit, double nudge, std::vector<OrbitPiece>& out) const {
  thread_local std::vector<Crossing> found;
  out.clear();
  // Directions without relation to the axes a model is built along.
  constexpr std::array<std::array<double, 2>, 4> kBeside{
      {{0, 0}, {0.8253, 0.5647}, {-0.7431, 0.6692}, {0.1219, -0.9925}}};
  const auto balanced = [&](const Orbit& o) {
    crossings(o, found);
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
        out.push_back({found[k].t, found[k].t, found[k].body, found[k].sign, found[k].slope, found[k].slope});
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
  double start = -kPi, slope = 0.0;
  for (const Crossing& c : of_body) {
    const int before = winding;
    winding += c.sign;
    if (before == 0 && winding != 0) start = c.t, slope = c.slope;
    if (before != 0 && winding == 0) out.push_back({start, c.t, c.body, 0, slope, c.slope});
  }
  if (winding != 0) out.push_back({start, kPi, of_body.front().body, 0, slope, 0.0});
}

namespace {

OrbitIndex::Face face_of(const std::array<Vec3, 3>& corners) {
  OrbitIndex::Face f;
  f.corners = corners;
  f.normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).stableNormalized();
  f.offset = f.normal.dot(corners[0]);
  f.across = std::hypot(f.normal.y(), f.normal.z());
  f.heading = std::atan2(f.normal.z(), f.normal.y());
  return f;
}

/// A screw's face: the helices that can meet it as a box from 0 to a turn, or one that reaches beyond
/// and a copy of the face one turn lower.
void add_helices(const PathFrame& frame, OrbitIndex::Face face, std::vector<OrbitIndex::Face>& faces) {
  const double turn = 2.0 * kPi * std::abs(frame.pitch()), half = std::abs(frame.pitch()) * face.sector;
  const auto [low_x, high_x] = std::minmax({face.corners[0].x(), face.corners[1].x(), face.corners[2].x()});
  double low = low_x - frame.pitch() * face.bearing - half, high = high_x - frame.pitch() * face.bearing + half;
  const double down = high - low < turn ? turn * std::floor(low / turn) : low;
  face.box.low[1] = low - down;
  face.box.high[1] = high - low < turn ? high - down : turn;
  faces.push_back(face);
  if (face.box.high[1] <= turn || high - low >= turn) return;
  face.box.low[1] -= turn;
  face.box.high[1] -= turn;
  faces.push_back(face);
}

}  // namespace

namespace {

void set_sector(OrbitIndex::Face& face) {
  std::tie(face.bearing, face.sector) = sector_of(face);
  const double off = std::abs(wrapped(face.bearing - face.heading));
  if (off > face.sector) face.cosine_high = std::cos(off - face.sector);
  if (off + face.sector < kPi) face.cosine_low = std::cos(off + face.sector);
}

}  // namespace

OrbitBox reach_of(const PathFrame& frame, std::span<const MotionBody> bodies) {
  OrbitBox reach;
  for (const MotionBody& b : bodies)
    for (const Vec3& p : b.surface->vertices) reach.add(frame.plane_point(frame.to_path(p)));
  if (frame.kind() != Kind::kTranslation) reach.low[0] = 0.0;  // faces pass nearer to the axis than their corners
  if (frame.kind() == Kind::kScrew) reach.low[1] = -1e300, reach.high[1] = 1e300;
  return reach;
}

std::vector<OrbitIndex::Face> orbit_faces(const PathFrame& frame, std::span<const MotionBody> bodies,
                                          const OrbitBox& reach) {
  std::vector<OrbitIndex::Face> faces;
  std::vector<Vec3> local;
  std::vector<OrbitBox> plane;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const SurfaceMesh& surface = *bodies[b].surface;
    if (!reach_of(frame, bodies.subspan(b, 1)).overlaps(reach)) continue;
    const bool inside_out = bodies[b].closed && enclosed_volume(surface) < 0.0;
    local.clear(), plane.clear();
    for (const Vec3& p : surface.vertices) {
      local.push_back(frame.to_path(p));
      plane.push_back(frame.plane_point(local.back()));
    }
    for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
      const Triangle& v = surface.triangles[t];
      OrbitBox rough = plane[v[0]];
      rough.add(plane[v[1]]), rough.add(plane[v[2]]);
      if (frame.kind() != Kind::kTranslation) rough.low[0] = 0.0;
      if (!rough.overlaps(reach)) continue;
      std::array<Vec3, 3> corners{local[v[0]], local[v[1]], local[v[2]]};
      if (inside_out) std::swap(corners[1], corners[2]);
      OrbitIndex::Face face = face_of(corners);
      face.body = static_cast<Index>(b);
      face.triangle = static_cast<Index>(t);
      face.flipped = inside_out;
      face.box = frame.box_of(face.corners);
      if (frame.kind() != Kind::kTranslation) set_sector(face);
      if (frame.kind() == Kind::kScrew)
        add_helices(frame, face, faces);
      else if (face.box.overlaps(reach))
        faces.push_back(face);
    }
  }
  return faces;
}

}  // namespace limber::internal
