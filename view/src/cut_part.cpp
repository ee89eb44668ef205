#include "cut_part.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "limber/core/disjoint_sets.h"
#include "limber/core/error.h"
#include "limber/internal/strict_json.h"

namespace limber::internal {
namespace {

using Edge = std::pair<Index, Index>;  // vertices, the smaller first

Edge edge_of(Index a, Index b) { return {std::min(a, b), std::max(a, b)}; }

/// What a stroke sees: the side of its plane, and whether a point lies between its ends.
class Blade {
 public:
  explicit Blade(const PoseStroke& stroke)
      : eye_(stroke.eye),
        across_(stroke.from.cross(stroke.to).normalized()),
        before_(across_.cross(stroke.from)),
        behind_(stroke.to.cross(across_)) {
    if (!across_.allFinite() || across_.norm() < 0.5)
      throw InvalidArgument("PagePose::cut: the line has no length, expected one across a part: draw it longer");
  }
  double height(const Vec3& p) const { return (p - eye_).dot(across_); }
  bool between(const Vec3& p) const { return (p - eye_).dot(before_) > 0.0 && (p - eye_).dot(behind_) > 0.0; }

 private:
  Vec3 eye_, across_, before_, behind_;
};

/// A share of an edge between a cut and its ends: no triangle becomes a needle.
constexpr double kLeast = 0.05;

/// New vertices, at rest, where a part's edges are cut.
std::map<Edge, Index> cut_edges(SurfaceMesh& surface, const ModelPart& part, const Blade& blade,
                                std::span<const Vec3> posed) {
  std::map<Edge, Index> cuts;
  for (const Index t : part.triangles) {
    const Triangle corners = surface.triangles[static_cast<std::size_t>(t)];
    for (std::size_t k = 0; k < 3; ++k) {
      const Edge edge = edge_of(corners[k], corners[(k + 1) % 3]);
      const auto a = static_cast<std::size_t>(edge.first), b = static_cast<std::size_t>(edge.second);
      const double ha = blade.height(posed[a]), hb = blade.height(posed[b]);
      if ((ha > 0.0) == (hb > 0.0) || cuts.contains(edge)) continue;
      const double s = std::clamp(ha / (ha - hb), kLeast, 1.0 - kLeast);
      if (!blade.between(posed[a] + s * (posed[b] - posed[a]))) continue;
      cuts.emplace(edge, static_cast<Index>(surface.vertices.size()));
      surface.vertices.push_back(surface.vertices[a] + s * (surface.vertices[b] - surface.vertices[a]));
    }
  }
  return cuts;
}

/// A triangle's pieces where some of its edges are cut, two at most; the same way round.
std::vector<Triangle> split(const Triangle& t, const std::map<Edge, Index>& cuts) {
  std::array<Index, 3> middle{};
  int count = 0;
  std::size_t whole = 0, cut = 0;  // an edge that is not cut, one that is
  for (std::size_t k = 0; k < 3; ++k) {
    const auto found = cuts.find(edge_of(t[k], t[(k + 1) % 3]));
    middle[k] = found == cuts.end() ? -1 : found->second;
    count += found == cuts.end() ? 0 : 1;
    (found == cuts.end() ? whole : cut) = k;
  }
  if (count == 0) return {t};
  if (count == 1) {
    const Index a = t[cut], b = t[(cut + 1) % 3], c = t[(cut + 2) % 3], m = middle[cut];
    return {{a, m, c}, {m, b, c}};
  }
  const Index a = t[whole], b = t[(whole + 1) % 3], c = t[(whole + 2) % 3];
  const Index bc = middle[(whole + 1) % 3], ca = middle[(whole + 2) % 3];
  return {{c, ca, bc}, {a, b, bc}, {a, bc, ca}};
}

/// All triangles at cut edges in pieces, whichever part they are of.
void split_triangles(JointedModel& model, const std::map<Edge, Index>& cuts) {
  for (ModelPart& part : model.parts) {
    const std::size_t count = part.triangles.size();
    for (std::size_t i = 0; i < count; ++i) {
      const auto t = static_cast<std::size_t>(part.triangles[i]);
      const std::vector<Triangle> pieces = split(model.surface.triangles[t], cuts);
      model.surface.triangles[t] = pieces.front();
      for (std::size_t k = 1; k < pieces.size(); ++k) {
        part.triangles.push_back(static_cast<Index>(model.surface.triangles.size()));
        model.surface.triangles.push_back(pieces[k]);
      }
    }
  }
}

double area_of(const SurfaceMesh& surface, Index triangle) {
  const Triangle& t = surface.triangles[static_cast<std::size_t>(triangle)];
  const auto at = [&](std::size_t k) -> const Vec3& { return surface.vertices[static_cast<std::size_t>(t[k])]; };
  return 0.5 * (at(1) - at(0)).cross(at(2) - at(0)).norm();
}

/// What hangs together of a part once the seam is cut.
struct Piece {
  double area = 0.0, height = 0.0;                             // over the blade, the sum over its area
  bool beside_above = false, beside_below = false;             // it meets the seam from there
  bool whole() const { return beside_above == beside_below; }  // the seam is not its edge
  bool above() const { return whole() ? height > 0.0 : beside_above; }
};

/// Per triangle of the part its piece. Pieces meet at edges that are not of the seam.
std::vector<Index> pieces_of(const JointedModel& model, const ModelPart& part, const std::set<Index>& seam) {
  DisjointSets pieces(part.triangles.size());
  std::map<Edge, Index> first;
  for (std::size_t i = 0; i < part.triangles.size(); ++i) {
    const Triangle& t = model.surface.triangles[static_cast<std::size_t>(part.triangles[i])];
    for (std::size_t k = 0; k < 3; ++k) {
      const Edge edge = edge_of(t[k], t[(k + 1) % 3]);
      if (seam.contains(edge.first) && seam.contains(edge.second)) continue;
      if (const auto [found, fresh] = first.emplace(edge, static_cast<Index>(i)); !fresh)
        pieces.join(found->second, static_cast<Index>(i));
    }
  }
  return pieces.labels();
}

/// @param heights of the model's vertices over the blade, as they are seen
void add_triangle(const JointedModel& model, Index triangle, const std::set<Index>& seam,
                  const std::vector<double>& heights, Piece& piece) {
  const double area = area_of(model.surface, triangle);
  piece.area += area;
  const Triangle& t = model.surface.triangles[static_cast<std::size_t>(triangle)];
  const auto on_seam = std::count_if(t.begin(), t.end(), [&](Index v) { return seam.contains(v); });
  for (const Index v : t) {
    const double height = heights[static_cast<std::size_t>(v)];
    piece.height += area * height / 3.0;
    if (on_seam < 2 || seam.contains(v)) continue;
    (height > 0.0 ? piece.beside_above : piece.beside_below) = true;
  }
}

/// Per triangle of the part whether it goes: with the side of the blade that has less of the part's area.
std::vector<bool> taken_off(const JointedModel& model, const ModelPart& part, const std::set<Index>& seam,
                            const std::vector<double>& heights) {
  const std::vector<Index> piece_of = pieces_of(model, part, seam);
  std::vector<Piece> pieces(1 + static_cast<std::size_t>(*std::max_element(piece_of.begin(), piece_of.end())));
  for (std::size_t i = 0; i < piece_of.size(); ++i)
    add_triangle(model, part.triangles[i], seam, heights, pieces[static_cast<std::size_t>(piece_of[i])]);
  double above = 0.0, below = 0.0;
  bool cut_above = false, cut_below = false;
  for (const Piece& piece : pieces) {
    (piece.above() ? above : below) += piece.area;
    if (!piece.whole()) (piece.above() ? cut_above : cut_below) = true;
  }
  if (!cut_above || !cut_below)
    throw InvalidArgument(
        "PagePose::cut: the line meets " + std::to_string(seam.size()) + " edges of part " + in_quotes(part.name) +
        " and leaves it in one piece, expected a line right across: " + "begin and end it beside the part");
  std::vector<bool> taken;
  for (const Index piece : piece_of)
    taken.push_back(pieces[static_cast<std::size_t>(piece)].above() == (above < below));
  return taken;
}

std::string free_name(const JointedModel& model) {
  for (std::size_t number = model.parts.size() + 1;; ++number) {
    std::string name = "part " + std::to_string(number);
    if (std::none_of(model.parts.begin(), model.parts.end(), [&](const ModelPart& p) { return p.name == name; }))
      return name;
  }
}

Vec3 middle_of(const JointedModel& model, const ModelPart& part) {
  Vec3 sum = Vec3::Zero();
  for (const Index t : part.triangles)
    for (const Index v : model.surface.triangles[static_cast<std::size_t>(t)])
      sum += model.surface.vertices[static_cast<std::size_t>(v)] / 3.0;
  return sum / static_cast<double>(part.triangles.size());
}

/// A ball in the middle of a seam, its first axis towards the middle of the part that was taken off.
ModelJoint ball_at(const JointedModel& model, const std::set<Index>& seam, Index part, Index taken) {
  Eigen::AlignedBox3d box;
  for (const Index v : seam) box.extend(model.surface.vertices[static_cast<std::size_t>(v)]);
  ModelJoint out{.a = part, .b = taken};
  out.joint.type = JointType::kBall;
  out.joint.frame.origin = box.center();
  const Vec3 along = middle_of(model, model.parts[static_cast<std::size_t>(taken)]) - box.center();
  out.joint.frame.axes = Eigen::Quaterniond::FromTwoVectors(Vec3::UnitX(), along).toRotationMatrix();
  out.influence = OrientedBox{{box.center(), Mat3::Identity()}, 0.5 * box.diagonal()};
  return out;
}

/// Joints of the part go with the piece that is nearer.
void share_joints(JointedModel& model, Index part, Index taken) {
  const auto distance = [&](Index p, const Vec3& point) {
    double least = std::numeric_limits<double>::infinity();
    for (const Index t : model.parts[static_cast<std::size_t>(p)].triangles)
      for (const Index v : model.surface.triangles[static_cast<std::size_t>(t)])
        least = std::min(least, (model.surface.vertices[static_cast<std::size_t>(v)] - point).norm());
    return least;
  };
  for (ModelJoint& joint : model.joints)
    for (Index* end : {&joint.a, &joint.b})
      if (*end == part && distance(taken, joint.joint.frame.origin) < distance(part, joint.joint.frame.origin))
        *end = taken;
}

}  // namespace

JointedModel cut_part(const JointedModel& model, Index part, const PoseStroke& stroke, std::span<const Vec3> posed) {
  if (part < 0 || static_cast<std::size_t>(part) >= model.parts.size())
    throw InvalidArgument("PagePose::cut: there is no part " + std::to_string(part) + ", expected 0 to " +
                          std::to_string(model.parts.size() - 1));
  JointedModel out = model;
  const Blade blade(stroke);
  const std::map<Edge, Index> cuts = cut_edges(out.surface, model.parts[static_cast<std::size_t>(part)], blade, posed);
  split_triangles(out, cuts);
  std::vector<double> heights;  // 0 on the seam
  for (const Vec3& p : posed) heights.push_back(blade.height(p));
  heights.resize(out.surface.vertices.size(), 0.0);
  std::set<Index> seam;
  for (const auto& cut : cuts) seam.insert(cut.second);
  const ModelPart whole = out.parts[static_cast<std::size_t>(part)];
  const std::vector<bool> goes = taken_off(out, whole, seam, heights);
  ModelPart rest{.name = whole.name, .triangles = {}}, taken{.name = free_name(model), .triangles = {}};
  for (std::size_t i = 0; i < whole.triangles.size(); ++i)
    (goes[i] ? taken : rest).triangles.push_back(whole.triangles[i]);
  const auto number = static_cast<Index>(out.parts.size());
  out.parts[static_cast<std::size_t>(part)] = std::move(rest);
  out.parts.push_back(std::move(taken));
  share_joints(out, part, number);
  out.joints.push_back(ball_at(out, seam, part, number));
  return out;
}

}  // namespace limber::internal
