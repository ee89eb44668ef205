#include "thumbnail.h"

#include <zlib.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "limber/core/error.h"

namespace limber::tools {
namespace {

using Colour = std::array<std::uint8_t, 3>;

constexpr Colour kBackground{255, 255, 255};
constexpr double kBend = 0.1;  // of a body's size

struct Point {
  Vec3 at;             // right, up, towards the eye
  double moved = 0.0;  // share of the largest way
};

/// Axes of the picture: right, up, towards the eye.
Mat3 view() {
  Mat3 axes;
  axes.row(2) = Vec3(0.5, -0.75, 0.45).normalized();
  axes.row(0) = Vec3::UnitZ().cross(Vec3(axes.row(2))).normalized();
  axes.row(1) = Vec3(axes.row(2)).cross(Vec3(axes.row(0)));
  return axes;
}

std::vector<Point> bent(const ModalModel& body, const Mat3& axes) {
  const ModalSurface& surface = body.render();
  Eigen::AlignedBox3d box;
  for (const Vec3f& v : surface.rest) box.extend(v.cast<double>());
  double most = 0.0;
  const auto shape = [&](Index v) {
    return body.modes() > 0 ? Vec3(surface.basis.shape(v, 0).cast<double>()) : Vec3(Vec3::Zero());
  };
  for (Index v = 0; v < surface.vertices(); ++v) most = std::max(most, shape(v).norm());
  const double by = most > 0.0 ? kBend * box.diagonal().norm() / most : 0.0;
  std::vector<Point> points;
  for (Index v = 0; v < surface.vertices(); ++v) {
    const Vec3 way = shape(v), rest = surface.rest[static_cast<std::size_t>(v)].cast<double>();
    points.push_back({axes * (body.data().origin_in_input + rest + by * way), most > 0.0 ? way.norm() / most : 0.0});
  }
  return points;
}

/// Triangles by depth, each of one colour.
class Canvas {
 public:
  Canvas(int width, int height)
      : width_(width),
        height_(height),
        pixels_(static_cast<std::size_t>(width * height), kBackground),
        depths_(pixels_.size(), -std::numeric_limits<double>::infinity()) {}

  /// Corners in pixels.
  void fill(const std::array<Vec3, 3>& p, const Colour& colour) {
    const double area = cross(p[0], p[1], p[2]);
    if (area == 0.0) return;
    const auto [low, high] = bounds(p);
    for (int y = low[1]; y <= high[1]; ++y)
      for (int x = low[0]; x <= high[0]; ++x) {
        const Vec3 at(x + 0.5, y + 0.5, 0.0);
        const Vec3 share = Vec3(cross(p[1], p[2], at), cross(p[2], p[0], at), cross(p[0], p[1], at)) / area;
        if (share.minCoeff() < 0.0) continue;
        const double depth = share[0] * p[0].z() + share[1] * p[1].z() + share[2] * p[2].z();
        const auto i = static_cast<std::size_t>(y * width_ + x);
        if (depth <= depths_[i]) continue;
        depths_[i] = depth;
        pixels_[i] = colour;
      }
  }
  const std::vector<Colour>& pixels() const { return pixels_; }

 private:
  static double cross(const Vec3& a, const Vec3& b, const Vec3& c) {
    return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
  }
  std::array<std::array<int, 2>, 2> bounds(const std::array<Vec3, 3>& p) const {
    const auto pixel = [](double x, int count) { return static_cast<int>(std::clamp(x, 0.0, count - 1.0)); };
    const auto [left, right] = std::minmax({p[0].x(), p[1].x(), p[2].x()});
    const auto [top, bottom] = std::minmax({p[0].y(), p[1].y(), p[2].y()});
    return {{{pixel(left, width_), pixel(top, height_)}, {pixel(right, width_), pixel(bottom, height_)}}};
  }

  int width_, height_;
  std::vector<Colour> pixels_;
  std::vector<double> depths_;
};

/// Blue at rest to orange where it moves most, darker where the surface turns away.
Colour shade(double moved, double facing) {
  const double light = 0.35 + 0.65 * std::abs(facing);
  const auto mix = [&](double rest, double most) {
    return static_cast<std::uint8_t>(light * (rest + moved * (most - rest)));
  };
  return {mix(120, 255), mix(150, 160), mix(200, 60)};
}

void add_number(std::string& bytes, std::uint32_t number) {
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>((number >> shift) & 0xff);
}

void add_chunk(std::string& png, const std::string& kind, const std::string& data) {
  add_number(png, static_cast<std::uint32_t>(data.size()));
  const std::string body = kind + data;
  png += body;
  add_number(png, static_cast<std::uint32_t>(
                      crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()))));
}

std::string deflated(const std::string& bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::string packed(size, '\0');
  if (compress2(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(bytes.data()),
                static_cast<uLong>(bytes.size()), Z_BEST_COMPRESSION) != Z_OK)
    throw ComputationError("a picture cannot be packed: not enough memory");
  packed.resize(size);
  return packed;
}

/// W3C, Portable Network Graphics, second edition: eight bits a channel, no filter.
std::string png(const std::vector<Colour>& pixels, int width, int height) {
  std::string head, rows, file = "\x89PNG\r\n\x1a\n";
  add_number(head, static_cast<std::uint32_t>(width)), add_number(head, static_cast<std::uint32_t>(height));
  head += std::string("\x08\x02\x00\x00\x00", 5);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (i % static_cast<std::size_t>(width) == 0) rows += '\0';
    for (const std::uint8_t channel : pixels[i]) rows += static_cast<char>(channel);
  }
  add_chunk(file, "IHDR", head);
  add_chunk(file, "IDAT", deflated(rows));
  add_chunk(file, "IEND", "");
  return file;
}

}  // namespace

std::string thumbnail(const Asset& asset, int width, int height) {
  if (width < 1 || height < 1) throw InvalidArgument("thumbnail: a picture has at least one pixel");
  const Mat3 axes = view();
  std::vector<std::vector<Point>> bodies;
  Eigen::AlignedBox3d box;
  for (const auto& body : asset.bodies) {
    bodies.push_back(bent(*body, axes));
    for (const Point& point : bodies.back()) box.extend(point.at);
  }
  Canvas canvas(width, height);
  if (!box.isEmpty()) {
    constexpr double kMargin = 0.92;
    const Vec3 size = box.sizes().cwiseMax(1e-300), middle = box.center();
    const double by = kMargin * std::min(width / size.x(), height / size.y());
    const auto pixel = [&](const Vec3& p) {
      return Vec3(0.5 * width + by * (p.x() - middle.x()), 0.5 * height - by * (p.y() - middle.y()), p.z());
    };
    for (std::size_t b = 0; b < bodies.size(); ++b)
      for (const Triangle& t : asset.bodies[b]->render().triangles) {
        std::array<Vec3, 3> corners;
        double moved = 0.0;
        for (std::size_t c = 0; c < 3; ++c) {
          const Point& point = bodies[b][static_cast<std::size_t>(t[static_cast<int>(c)])];
          corners[c] = point.at;
          moved += point.moved / 3.0;
        }
        const Vec3 normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        const double length = normal.norm();
        for (Vec3& corner : corners) corner = pixel(corner);
        if (length > 0.0) canvas.fill(corners, shade(moved, normal.z() / length));
      }
  }
  return png(canvas.pixels(), width, height);
}

}  // namespace limber::tools
