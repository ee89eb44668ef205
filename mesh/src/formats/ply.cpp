// PLY, text and binary of either byte order: any elements and properties; vertices and faces are kept.
#include <array>
#include <optional>

#include "formats/file_scanner.h"
#include "formats/mesh_file.h"

namespace limber::internal {
namespace {

enum class Type { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };

struct Property {
  std::string name;
  Type type;
  std::optional<Type> count;  ///< of a list: the type of its length
};

struct Element {
  std::string name;
  std::int64_t count;
  std::vector<Property> properties;
};

std::size_t size_of(Type type) {
  constexpr std::size_t kSizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<int>(type)];
}

class PlyReader {
 public:
  explicit PlyReader(const FileBytes& file) : in_(file.bytes, file.name, {}) {}

  MeshFile read() {
    read_head();
    for (const Element& e : elements_) {
      if (e.properties.empty()) continue;  // takes no bytes, whatever its count
      in_.checked_count(e.count, least_bytes(e), ("number of elements " + shown(e.name)).c_str());
      if (e.name == "vertex")
        read_vertices(e);
      else if (e.name == "face")
        read_faces(e);
      else if (e.name == "tristrips")
        read_strips(e);
      else
        for (std::int64_t i = 0; i < e.count; ++i) skip(e.properties);
    }
    check_corners();
    return std::move(mesh_);
  }

 private:
  // --- the head

  void read_head() {
    in_.expect("ply");
    in_.expect("format");
    read_format(in_.word("a format"));
    in_.rest_of_line();  // the version
    for (;;) {
      const std::string keyword(in_.word("end_header"));
      if (keyword == "end_header") break;
      if (keyword == "element")
        read_element();
      else if (keyword == "property")
        read_property();
      else if (keyword != "comment" && keyword != "obj_info")
        in_.fail("seen " + shown(keyword) + ", expected element, property, comment or end_header");
      in_.rest_of_line();
    }
    if (encoding_ != Encoding::kText) in_.end_line("end_header");
  }

  void read_format(std::string_view format) {
    if (format == "ascii")
      encoding_ = Encoding::kText;
    else if (format == "binary_little_endian")
      encoding_ = Encoding::kLittleEndian;
    else if (format == "binary_big_endian")
      encoding_ = Encoding::kBigEndian;
    else
      in_.fail("seen " + shown(format) + ", expected ascii, binary_little_endian or binary_big_endian");
  }

  void read_element() {
    const std::string name(in_.word("an element's name"));
    for (const Element& e : elements_)
      if (e.name == name) in_.fail("a second element " + shown(name) + ", expected one");
    elements_.push_back({name, in_.integer(0, std::numeric_limits<Index>::max(), "an element's count"), {}});
  }

  void read_property() {
    if (elements_.empty()) in_.fail("a property stands before the first element");
    auto word = in_.word("a type");
    std::optional<Type> count;
    if (word == "list") {
      count = type(in_.word("a type"));
      if (*count == Type::kFloat || *count == Type::kDouble)
        in_.fail("a list's length is a fraction, expected an integer type");
      word = in_.word("a type");
    }
    const Type item = type(word);
    elements_.back().properties.push_back({std::string(in_.word("a property's name")), item, count});
  }

  Type type(std::string_view word) const {
    constexpr std::pair<std::string_view, Type> kTypes[] = {
        {"char", Type::kInt8},   {"int8", Type::kInt8},     {"uchar", Type::kUint8},   {"uint8", Type::kUint8},
        {"short", Type::kInt16}, {"int16", Type::kInt16},   {"ushort", Type::kUint16}, {"uint16", Type::kUint16},
        {"int", Type::kInt32},   {"int32", Type::kInt32},   {"uint", Type::kUint32},   {"uint32", Type::kUint32},
        {"float", Type::kFloat}, {"float32", Type::kFloat}, {"double", Type::kDouble}, {"float64", Type::kDouble}};
    for (const auto& [name, known] : kTypes)
      if (word == name) return known;
    in_.fail("seen " + shown(word) + ", expected a type of PLY such as float or uchar");
  }

  std::size_t least_bytes(const Element& e) const {
    if (encoding_ == Encoding::kText) return 2 * e.properties.size() - 1;
    std::size_t bytes = 0;
    for (const Property& p : e.properties) bytes += size_of(p.count.value_or(p.type));
    return bytes;
  }

  // --- the body

  void read_vertices(const Element& e) {
    const int axis[3] = {property(e, "x"), property(e, "y"), property(e, "z")};
    mesh_.tets.nodes.reserve(static_cast<std::size_t>(e.count));
    for (std::int64_t i = 0; i < e.count; ++i) {
      Vec3 x = Vec3::Zero();
      for (int p = 0; p < static_cast<int>(e.properties.size()); ++p) {
        int a = 0;
        while (a < 3 && axis[a] != p) ++a;
        if (a < 3)
          x[a] = real(e.properties[p].type);
        else
          skip(e.properties[p]);
      }
      mesh_.tets.nodes.push_back(x);
    }
  }

  int property(const Element& e, std::string_view name) const {
    for (std::size_t p = 0; p < e.properties.size(); ++p)
      if (e.properties[p].name == name && !e.properties[p].count) return static_cast<int>(p);
    in_.fail("the element \"vertex\" has no property " + shown(name) + ", expected x, y and z");
  }

  void read_faces(const Element& e) {
    bool found = false;
    for (const Property& p : e.properties) found = found || is_corners(p);
    if (!found) in_.fail("the element \"face\" has no list \"vertex_indices\"");
    for (std::int64_t i = 0; i < e.count; ++i)
      for (const Property& p : e.properties) is_corners(p) ? read_corners(p) : skip(p);
  }

  static bool is_corners(const Property& p) {
    return p.count && p.type != Type::kFloat && p.type != Type::kDouble &&
           (p.name == "vertex_indices" || p.name == "vertex_index");
  }

  void read_corners(const Property& p) {
    const auto corners = list_length(p);
    for (Index c = 0; c < corners; ++c) {
      const auto vertex = integer(p.type);
      if (vertex < 0 || vertex > std::numeric_limits<Index>::max())
        in_.fail("a face names vertex " + std::to_string(vertex) + ", expected 0 or more");
      mesh_.polygons.corners.push_back(static_cast<Index>(vertex));
    }
    mesh_.polygons.close();
  }

  /// Lists of vertices, each three in a row a triangle, every other one turned; −1 begins the next strip.
  void read_strips(const Element& e) {
    for (std::int64_t i = 0; i < e.count; ++i)
      for (const Property& p : e.properties) is_corners(p) ? read_strip(p) : skip(p);
  }
  void read_strip(const Property& p) {
    const auto length = list_length(p);
    std::vector<Index> strip;
    for (Index c = 0; c < length; ++c) {
      const auto vertex = integer(p.type);
      if (vertex < -1 || vertex > std::numeric_limits<Index>::max())
        in_.fail("a strip names vertex " + std::to_string(vertex) + ", expected 0 or more, or -1 between strips");
      strip.push_back(static_cast<Index>(vertex));
      const std::size_t n = strip.size();
      if (vertex == -1) {
        strip.clear();
      } else if (n >= 3) {
        const Index a = strip[n - 3], b = strip[n - 2], last = strip[n - 1];
        const bool degenerate = a == b || b == last || last == a;  // strips are joined by triangles of no area
        if (!degenerate) mesh_.polygons.push(n % 2 == 1 ? std::array{a, b, last} : std::array{b, a, last});
      }
    }
  }

  /// After the last element: faces may stand before the vertices.
  void check_corners() const {
    const auto vertices = static_cast<Index>(mesh_.tets.nodes.size());
    for (std::size_t i = 0; i < mesh_.polygons.size(); ++i)
      for (const Index v : mesh_.polygons[i])
        if (v >= vertices) throw_face(i, v, vertices);
  }
  [[noreturn]] void throw_face(std::size_t face, Index vertex, Index vertices) const {
    in_.fail("face " + std::to_string(face) + " (counted from 0) names vertex " + std::to_string(vertex) +
             ", expected 0 to " + std::to_string(vertices - 1));
  }

  Index list_length(const Property& p) {
    const auto length = integer(*p.count);
    return in_.checked_count(length, encoding_ == Encoding::kText ? 1 : size_of(p.type), "length of a list");
  }

  void skip(const std::vector<Property>& properties) {
    for (const Property& p : properties) skip(p);
  }
  void skip(const Property& p) {
    const Index values = p.count ? list_length(p) : 1;
    if (encoding_ != Encoding::kText)
      return in_.skip_bytes(static_cast<std::uint64_t>(values) * size_of(p.type), "a value");
    for (Index i = 0; i < values; ++i) in_.word("a value");
  }

  double real(Type type) {
    switch (type) {
      case Type::kFloat:
        return static_cast<double>(in_.number<float>(encoding_, "a number"));
      case Type::kDouble:
        return in_.number<double>(encoding_, "a number");
      default:
        return static_cast<double>(integer(type));
    }
  }

  std::int64_t integer(Type type) {
    switch (type) {
      case Type::kInt8:
        return in_.number<std::int8_t>(encoding_, "an integer");
      case Type::kUint8:
        return in_.number<std::uint8_t>(encoding_, "an integer");
      case Type::kInt16:
        return in_.number<std::int16_t>(encoding_, "an integer");
      case Type::kUint16:
        return in_.number<std::uint16_t>(encoding_, "an integer");
      case Type::kInt32:
        return in_.number<std::int32_t>(encoding_, "an integer");
      default:
        return in_.number<std::uint32_t>(encoding_, "an integer");
    }
  }

  FileScanner in_;
  MeshFile mesh_;
  Encoding encoding_ = Encoding::kText;
  std::vector<Element> elements_;
};

}  // namespace

MeshFile read_ply(const FileBytes& file) { return PlyReader(file).read(); }

}  // namespace limber::internal
