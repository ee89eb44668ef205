// glTF 2.0 at rest: nodes where their parents put them, skins where their joints are, morph targets by their default
// weights.
#include <array>
#include <utility>

#include "formats/gltf_file.h"
#include "formats/mesh_file.h"
#include "limber/core/error.h"
#include "limber/mesh/mend_surface.h"

namespace limber::internal {
namespace {

using Pose = Eigen::Matrix<double, 3, 4>;  // of points
using nlohmann::json;

/// Nodes may show a mesh again and again: what a small file may ask for.
constexpr std::size_t kMostVertices = 40'000'000;

Pose product(const Pose& a, const Pose& b) {
  Pose out = a.leftCols<3>() * b;
  out.col(3) += a.col(3);
  return out;
}

Pose from_columns(const double* m) {
  Pose out;
  for (int column = 0; column < 4; ++column)
    for (int row = 0; row < 3; ++row) out(row, column) = m[4 * column + row];
  return out;
}

Pose identity() {
  Pose out = Pose::Zero();
  out.leftCols<3>().setIdentity();
  return out;
}

Pose pose_of(const JsonObject& node) {
  if (node.has("matrix")) return from_columns(node.numbers("matrix", 16).data());
  Pose out = identity();
  if (node.has("rotation")) {
    const std::vector<double> q = node.numbers("rotation", 4);  // x, y, z, w
    const Eigen::Quaterniond turn(q[3], q[0], q[1], q[2]);
    if (!(turn.norm() > 0.0)) throw InputError(node.where("rotation") + ": is 0, expected a unit quaternion");
    out.leftCols<3>() = turn.normalized().toRotationMatrix();
  }
  out.leftCols<3>() *= node.vec3("scale", Vec3::Ones()).asDiagonal();
  out.col(3) = node.vec3("translation", Vec3::Zero());
  return out;
}

/// The nodes' poses in the world.
class Nodes {
 public:
  explicit Nodes(const GltfFile& file) : parent_(file.count("nodes"), -1) {
    children_.resize(parent_.size());
    for (std::size_t i = 0; i < parent_.size(); ++i) {
      const JsonObject node = file.item("nodes", i);
      world_.push_back(pose_of(node));
      if (node.has("children"))
        node.for_each("children", [&](const json& child, const std::string& where) { adopt(i, child, where); });
    }
    std::vector<std::size_t> order = without_parent();
    for (std::size_t k = 0; k < order.size(); ++k)
      for (const std::size_t child : children_[order[k]]) {
        world_[child] = product(world_[order[k]], world_[child]);
        order.push_back(child);
      }
    if (order.size() < parent_.size()) throw InputError(file.name() + ": has nodes that are their own ancestors");
  }

  std::size_t size() const { return parent_.size(); }
  const Pose& world(std::size_t node) const { return world_[node]; }

  /// A node and all below it, parents first.
  std::vector<std::size_t> below(std::size_t root) const {
    std::vector<std::size_t> stack = {root}, out;
    while (!stack.empty()) {
      out.push_back(stack.back());
      stack.pop_back();
      stack.insert(stack.end(), children_[out.back()].rbegin(), children_[out.back()].rend());
    }
    return out;
  }

  std::vector<std::size_t> without_parent() const {
    std::vector<std::size_t> out;
    for (std::size_t i = 0; i < parent_.size(); ++i)
      if (parent_[i] < 0) out.push_back(i);
    return out;
  }

  /// The number of a node as JSON names it.
  std::size_t number(const json& value, const std::string& where) const {
    if (!value.is_number_unsigned() || value.get<std::uint64_t>() >= parent_.size())
      throw InputError(where + ": is " + JsonObject::shown(value) + ", expected a node, 0 to " +
                       std::to_string(static_cast<std::int64_t>(parent_.size()) - 1));
    return value.get<std::size_t>();
  }

 private:
  void adopt(std::size_t node, const json& child, const std::string& where) {
    const std::size_t number_of_child = number(child, where);
    if (parent_[number_of_child] >= 0)
      throw InputError(where + ": is node " + std::to_string(number_of_child) + ", which has a parent already");
    parent_[number_of_child] = static_cast<std::int64_t>(node);
    children_[node].push_back(number_of_child);
  }

  std::vector<std::int64_t> parent_;  // −1: none
  std::vector<std::vector<std::size_t>> children_;
  std::vector<Pose> world_;
};

/// Vertices where they are shown, and whether each is seen in a mirror.
struct Shown {
  std::vector<Vec3> places;
  std::vector<char> mirrored;
};

class GltfReader {
 public:
  GltfReader(const std::filesystem::path& path, const FileBytes& bytes) : file_(path, bytes), nodes_(file_) {}

  MeshFile read(Warnings& warnings) {
    std::vector<char> shown(nodes_.size(), 0);
    for (const std::size_t root : roots())
      for (const std::size_t node : nodes_.below(root)) {
        const JsonObject object = file_.item("nodes", node);
        if (object.has("mesh") && !std::exchange(shown[node], 1)) add_node(node, object);
      }
    if (left_out_ > 0)
      warnings.push_back(file_.name() + ": " + std::to_string(left_out_) +
                         " sets of points or lines have been left out");
    return std::move(out_);
  }

 private:
  std::vector<std::size_t> roots() const {
    if (file_.count("scenes") == 0) return nodes_.without_parent();
    const JsonObject scene =
        file_.item("scenes", static_cast<std::size_t>(file_.root().integer("scene", 0, kMostItems, 0)));
    std::vector<std::size_t> roots;
    if (scene.has("nodes"))
      scene.for_each("nodes",
                     [&](const json& node, const std::string& where) { roots.push_back(nodes_.number(node, where)); });
    return roots;
  }

  /// A mesh as a node shows it. Vertices that differ in normal or texture alone become one.
  void add_node(std::size_t node, const JsonObject& object) {
    const JsonObject mesh = file_.item("meshes", static_cast<std::size_t>(object.integer("mesh", 0, kMostItems)));
    const std::string name = object.text("name", mesh.text("name", ""));
    const std::vector<Pose> joints = object.has("skin") ? joints_of(object) : std::vector<Pose>();
    SurfaceMesh shown;
    std::vector<std::pair<std::string, std::size_t>> materials;  // with the first triangle of each
    mesh.for_each("primitives", [&](const json& value, const std::string& where) {
      const JsonObject primitive(value, where);
      materials.emplace_back(material_of(primitive), shown.triangles.size());
      add_primitive(primitive, weights_of(object, mesh), joints, nodes_.world(node), shown);
    });
    weld_within(shown, 0.0);
    const std::size_t first_polygon = out_.polygons.size();
    for (const auto& [material, first] : materials) out_.groups.push_back({name, material, first_polygon + first});
    const auto base = static_cast<Index>(out_.tets.nodes.size());
    out_.tets.nodes.insert(out_.tets.nodes.end(), shown.vertices.begin(), shown.vertices.end());
    for (const Triangle& t : shown.triangles) out_.polygons.push(std::array{base + t[0], base + t[1], base + t[2]});
  }

  std::string material_of(const JsonObject& primitive) const {
    if (!primitive.has("material")) return "";
    return file_.item("materials", static_cast<std::size_t>(primitive.integer("material", 0, kMostItems)))
        .text("name", "");
  }

  /// Of morph targets: the node's, else the mesh's, else none.
  static std::vector<double> weights_of(const JsonObject& node, const JsonObject& mesh) {
    const JsonObject& has_them = node.has("weights") ? node : mesh;
    if (!has_them.has("weights")) return {};
    const json& weights = has_them.at("weights");
    return has_them.numbers("weights", weights.is_array() ? weights.size() : 0);
  }

  /// Per joint of a node's skin, what it does to a vertex.
  std::vector<Pose> joints_of(const JsonObject& node) {
    const JsonObject skin = file_.item("skins", static_cast<std::size_t>(node.integer("skin", 0, kMostItems)));
    std::vector<Pose> joints;
    skin.for_each("joints", [&](const json& joint, const std::string& where) {
      joints.push_back(nodes_.world(nodes_.number(joint, where)));
    });
    if (joints.empty()) throw InputError(skin.where("joints") + ": is empty, expected one joint or more");
    if (!skin.has("inverseBindMatrices")) return joints;
    const std::vector<double> bind =
        file_.numbers(static_cast<std::size_t>(skin.integer("inverseBindMatrices", 0, kMostItems)), "MAT4");
    if (bind.size() < 16 * joints.size())
      throw InputError(skin.where("inverseBindMatrices") + ": has " + std::to_string(bind.size() / 16) +
                       " matrices for " + std::to_string(joints.size()) + " joints");
    for (std::size_t j = 0; j < joints.size(); ++j) joints[j] = product(joints[j], from_columns(&bind[16 * j]));
    return joints;
  }

  /// @throws InputError if the accessor has another number of elements
  std::vector<double> numbers_for(const JsonObject& attributes, const std::string& key, std::string_view type,
                                  std::size_t components, std::size_t vertices) {
    std::vector<double> numbers = file_.numbers(static_cast<std::size_t>(attributes.integer(key, 0, kMostItems)), type);
    if (vertices > 0 && numbers.size() != components * vertices)
      throw InputError(attributes.where(key) + ": has " + std::to_string(numbers.size() / components) +
                       " elements for " + std::to_string(vertices) + " vertices");
    return numbers;
  }

  void add_primitive(const JsonObject& primitive, const std::vector<double>& weights, const std::vector<Pose>& joints,
                     const Pose& world, SurfaceMesh& out) {
    const std::int64_t mode = primitive.integer("mode", 0, 6, 4);
    if (mode < 4) {
      ++left_out_;
      return;
    }
    const JsonObject attributes(primitive.at("attributes"), primitive.where("attributes"));
    const std::vector<double> given = numbers_for(attributes, "POSITION", "VEC3", 3, 0);
    std::vector<Vec3> places(given.size() / 3);
    for (std::size_t v = 0; v < places.size(); ++v) places[v] = {given[3 * v], given[3 * v + 1], given[3 * v + 2]};
    vertices_read_ += places.size();
    if (vertices_read_ > kMostVertices)
      throw InputError(file_.name() + ": shows more than " + std::to_string(kMostVertices) + " vertices");
    morph(primitive, weights, places);
    const std::vector<Index> corners = corners_of(primitive, places.size());
    if (mode == 4 && corners.size() % 3 != 0)
      throw InputError(primitive.where() + ": its triangles have " + std::to_string(corners.size()) +
                       " corners, expected a multiple of 3");
    const bool skinned = !joints.empty() && attributes.has("JOINTS_0");
    const Shown shown = skinned ? posed(attributes, joints, std::move(places)) : placed(world, std::move(places));
    add_triangles(corners, mode, shown, out);
  }

  void morph(const JsonObject& primitive, const std::vector<double>& weights, std::vector<Vec3>& places) {
    if (!primitive.has("targets")) return;
    std::size_t target = 0;
    primitive.for_each("targets", [&](const json& value, const std::string& where) {
      const double weight = target < weights.size() ? weights[target] : 0.0;
      ++target;
      const JsonObject attributes(value, where);
      if (weight == 0.0 || !attributes.has("POSITION")) return;
      const std::vector<double> moved = numbers_for(attributes, "POSITION", "VEC3", 3, places.size());
      for (std::size_t v = 0; v < places.size(); ++v)
        places[v] += weight * Vec3(moved[3 * v], moved[3 * v + 1], moved[3 * v + 2]);
    });
  }

  static Shown placed(const Pose& world, std::vector<Vec3> places) {
    for (Vec3& p : places) p = world.leftCols<3>() * p + world.col(3);
    std::vector<char> mirrored(places.size(), world.leftCols<3>().determinant() < 0.0 ? 1 : 0);
    return {std::move(places), std::move(mirrored)};
  }

  /// Vertices as the joints of a skin hold them; the node that shows them counts for nothing.
  Shown posed(const JsonObject& attributes, const std::vector<Pose>& joints, std::vector<Vec3> places) {
    std::vector<Pose> blend(places.size(), Pose::Zero());
    std::vector<double> sum(places.size(), 0.0);
    std::vector<std::size_t> first(places.size(), 0);
    for (int set = 0; attributes.has("JOINTS_" + std::to_string(set)); ++set) {
      const std::string number = std::to_string(set);
      const std::vector<double> which = numbers_for(attributes, "JOINTS_" + number, "VEC4", 4, places.size());
      const std::vector<double> share = numbers_for(attributes, "WEIGHTS_" + number, "VEC4", 4, places.size());
      for (std::size_t k = 0; k < which.size(); ++k) {
        if (!(which[k] >= 0.0 && which[k] < static_cast<double>(joints.size())))
          throw InputError(attributes.where("JOINTS_" + number) + ": names joint " + std::to_string(which[k]) + " of " +
                           std::to_string(joints.size()));
        if (set == 0 && k % 4 == 0) first[k / 4] = static_cast<std::size_t>(which[k]);
        blend[k / 4] += share[k] * joints[static_cast<std::size_t>(which[k])];
        sum[k / 4] += share[k];
      }
    }
    Shown shown{std::move(places), {}};
    for (std::size_t v = 0; v < blend.size(); ++v) {
      // Weights are meant to have the sum 1; a vertex without any is its first joint's.
      const Pose pose = sum[v] > 0.0 ? Pose(blend[v] / sum[v]) : joints[first[v]];
      shown.places[v] = pose.leftCols<3>() * shown.places[v] + pose.col(3);
      shown.mirrored.push_back(pose.leftCols<3>().determinant() < 0.0 ? 1 : 0);
    }
    return shown;
  }

  std::vector<Index> corners_of(const JsonObject& primitive, std::size_t vertices) {
    std::vector<Index> corners;
    if (!primitive.has("indices")) {
      for (std::size_t v = 0; v < vertices; ++v) corners.push_back(static_cast<Index>(v));
      return corners;
    }
    for (const double v : numbers_for(primitive, "indices", "SCALAR", 1, 0)) {
      if (!(v >= 0.0 && v < static_cast<double>(vertices)))
        throw InputError(primitive.where("indices") + ": names vertex " + std::to_string(v) + " of " +
                         std::to_string(vertices));
      corners.push_back(static_cast<Index>(v));
    }
    return corners;
  }

  /// @param mode 4: triangles, 5: a strip, 6: a fan
  static void add_triangles(const std::vector<Index>& corners, std::int64_t mode, const Shown& shown,
                            SurfaceMesh& out) {
    const auto base = static_cast<Index>(out.vertices.size());
    out.vertices.insert(out.vertices.end(), shown.places.begin(), shown.places.end());
    const std::size_t step = mode == 4 ? 3 : 1;
    for (std::size_t i = 0; i + 2 < corners.size(); i += step) {
      const bool swapped = mode == 5 && i % 2 == 1;
      Triangle t = {mode == 6 ? corners[0] : corners[i], corners[swapped ? i + 2 : i + 1],
                    corners[swapped ? i + 1 : i + 2]};
      if (shown.mirrored[static_cast<std::size_t>(t[0])]) std::swap(t[1], t[2]);
      out.triangles.push_back({base + t[0], base + t[1], base + t[2]});
    }
  }

  GltfFile file_;
  Nodes nodes_;
  MeshFile out_;
  std::size_t left_out_ = 0, vertices_read_ = 0;
};

}  // namespace

MeshFile read_gltf(const std::filesystem::path& path, const FileBytes& file, Warnings& warnings) {
  return GltfReader(path, file).read(warnings);
}

}  // namespace limber::internal
