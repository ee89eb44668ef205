// VTK legacy files, versions 1 to 5.1, text and binary (always big-endian), as the VTK file format document describes
// them: UNSTRUCTURED_GRID and POLYDATA.
#include <algorithm>
#include <array>
#include <cctype>
#include <optional>

#include "formats/file_scanner.h"
#include "formats/mesh_file.h"
#include "formats/number_types.h"

namespace limber::internal {
namespace {

/// Cell types of VTK that limber knows by name.
enum CellType : int {
  kTriangleCell = 5,
  kStripCell = 6,
  kPolygonCell = 7,
  kPixelCell = 8,
  kQuadCell = 9,
  kTetCell = 10,
  kQuadraticTetCell = 24
};

/// Types 11 to 14 are first-order solids; the quadratic and higher ones of a surface or a solid lie from 22 on.
bool is_curve_or_point(int type) {
  return (type >= 0 && type <= 4) || type == 21 || type == 35 || type == 68 || type == 75;
}

/// Whole numbers given to each cell.
struct CellField {
  std::string name;
  std::vector<int> values;
};

class VtkReader {
 public:
  VtkReader(const FileBytes& file, Warnings& warnings)
      : in_(file.bytes, file.name, {}), warnings_(warnings), regions_(mesh_.tets) {}

  MeshFile read() {
    read_head();
    while (!in_.at_end()) read_section();
    if (polydata_ ? mesh_.polygons.size() == 0 : types_.empty()) in_.fail("the file ends, expected cells");
    if (!polydata_) assemble();
    return std::move(mesh_);
  }

 private:
  // --- the head and the sections

  void read_head() {
    if (const auto magic = in_.rest_of_line(); !magic.starts_with("# vtk DataFile Version"))
      in_.fail("seen " + shown(magic) + ", expected # vtk DataFile Version");
    in_.rest_of_line();  // the title, anything
    const auto form = in_.word("ASCII or BINARY");
    if (form != "ASCII" && form != "BINARY") in_.fail("seen " + shown(form) + ", expected ASCII or BINARY");
    encoding_ = form == "ASCII" ? Encoding::kText : Encoding::kBigEndian;
    in_.expect("DATASET");
    const auto kind = in_.word("a kind of data set");
    polydata_ = kind == "POLYDATA";
    if (!polydata_ && kind != "UNSTRUCTURED_GRID")
      in_.fail("seen " + shown(kind) + ", expected UNSTRUCTURED_GRID or POLYDATA");
  }

  void read_section() {
    const std::string word = upper(in_.word("a keyword"));
    if (word == "POINTS")
      read_points();
    else if (word == "CELLS" && !polydata_)
      cells_ = read_cells();
    else if (word == "CELL_TYPES" && !polydata_)
      read_cell_types();
    else if (word == "POLYGONS" && polydata_)
      push_polygons(read_cells());
    else if (word == "TRIANGLE_STRIPS" && polydata_)
      push_strips(read_cells());
    else if ((word == "VERTICES" || word == "LINES") && polydata_)
      read_cells();
    else if (word == "CELL_DATA")
      start_data(true);
    else if (word == "POINT_DATA")
      start_data(false);
    else if (word == "METADATA")
      skip_metadata();
    else
      read_attribute(word);
  }

  void read_points() {
    if (std::exchange(has_points_, true)) in_.fail("a second section POINTS, expected one");
    const auto count = in_.count(1, "number of points");
    const std::string type = data_type();
    check_room(3 * static_cast<std::uint64_t>(count), type, "coordinates");
    mesh_.tets.nodes.reserve(static_cast<std::size_t>(count));
    with_type(type, [&]<class T>(T) {
      const auto next = [&] { return static_cast<double>(in_.number<T>(encoding_, "a coordinate")); };
      for (Index i = 0; i < count; ++i) {
        const double x = next(), y = next(), z = next();
        mesh_.tets.nodes.emplace_back(x, y, z);
      }
    });
  }

  // --- cells

  Polygons read_cells() {
    if (!has_points_) in_.fail("cells stand before the points, expected POINTS first");
    const auto first = in_.integer("a number of cells"), second = in_.integer("a size");
    // Version 5 counts offsets, one more than cells, and follows with two arrays.
    in_.checked_count(second, 1, "size of the cells");
    start_data_line("a size");
    if (next_is("OFFSETS")) return read_offset_cells(first, second);
    return read_counted_cells(in_.checked_count(first, 1, "number of cells"), second);
  }

  /// Each cell is its number of points, then the points.
  Polygons read_counted_cells(Index count, std::int64_t numbers) {
    Polygons cells;
    cells.ends.reserve(static_cast<std::size_t>(count));
    std::int64_t used = 0;
    for (Index i = 0; i < count; ++i) {
      const auto size = in_.number<std::int32_t>(encoding_, "a number of points");
      if (size < 0 || size > numbers - used - 1)
        in_.fail("cell " + std::to_string(i) + ": seen " + std::to_string(size) +
                 " as its number of points, expected 0 to " +
                 std::to_string(std::max<std::int64_t>(numbers - used - 1, 0)));
      for (Index k = 0; k < size; ++k)
        cells.corners.push_back(point_index(in_.number<std::int32_t>(encoding_, "a point")));
      cells.close();
      used += 1 + size;
    }
    if (used != numbers)
      in_.fail("the cells take " + std::to_string(used) + " numbers, expected " + std::to_string(numbers));
    return cells;
  }

  /// OFFSETS type, offsets, CONNECTIVITY type, points.
  Polygons read_offset_cells(std::int64_t offsets, std::int64_t points) {
    Polygons cells;
    in_.expect("OFFSETS");
    const auto offset_type = integer_type();
    std::int64_t last = -1;  // the first offset is 0 and begins the first cell
    read_integers(offset_type, static_cast<std::uint64_t>(in_.checked_count(offsets, 1, "number of offsets")), "offset",
                  [&](std::int64_t end) {
                    if (end < std::max<std::int64_t>(last, 0) || end > (last < 0 ? 0 : points))
                      in_.fail("seen offset " + std::to_string(end) + ", expected " +
                               std::to_string(std::max<std::int64_t>(last, 0)) + " to " +
                               std::to_string(last < 0 ? 0 : points));
                    if (last >= 0) cells.ends.push_back(static_cast<std::size_t>(end));
                    last = end;
                  });
    if (std::max<std::int64_t>(last, 0) != points)
      in_.fail("the last offset is " + std::to_string(last) + ", expected " + std::to_string(points) +
               ", the size of CONNECTIVITY");
    in_.expect("CONNECTIVITY");
    const auto point_type = integer_type();
    cells.corners.reserve(static_cast<std::size_t>(in_.checked_count(points, 1, "size of CONNECTIVITY")));
    read_integers(point_type, static_cast<std::uint64_t>(points), "point",
                  [&](std::int64_t point) { cells.corners.push_back(point_index(point)); });
    return cells;
  }

  Index point_index(std::int64_t point) const {
    const auto points = static_cast<std::int64_t>(mesh_.tets.nodes.size());
    if (point < 0 || point >= points)
      in_.fail("a cell names point " + std::to_string(point) + ", expected 0 to " + std::to_string(points - 1));
    return static_cast<Index>(point);
  }

  void read_cell_types() {
    const auto count = in_.count(1, "number of cell types");
    if (static_cast<std::size_t>(count) != cells_.size())
      in_.fail("seen " + std::to_string(count) + " cell types, expected " + std::to_string(cells_.size()) +
               ", the number of CELLS");
    start_data_line("the number of cell types");
    check_room(static_cast<std::uint64_t>(count), "int", "cell types");
    for (Index i = 0; i < count; ++i) {
      const int type = in_.number<std::int32_t>(encoding_, "a cell type");
      check_cell(i, type);
      types_.push_back(type);
    }
  }

  void check_cell(Index cell, int type) const {
    const auto size = cells_[cell].size();
    const std::size_t wanted = type == kTriangleCell                                         ? 3
                               : type == kQuadraticTetCell                                   ? 10
                               : type == kTetCell || type == kQuadCell || type == kPixelCell ? 4
                                                                                             : 0;
    if (wanted != 0 && size != wanted)
      in_.fail("cell " + std::to_string(cell) + " of type " + std::to_string(type) + " has " + std::to_string(size) +
               " points, expected " + std::to_string(wanted));
    if (wanted == 0 && type != kStripCell && type != kPolygonCell && !is_curve_or_point(type))
      in_.fail("cell " + std::to_string(cell) + " has type " + std::to_string(type) +
               "; of cells only tetrahedra (10, 24) and flat polygons (5, 6, 7, 8, 9) are read: remesh with "
               "first-order tetrahedra");
  }

  void assemble() {
    const CellField* field = region_field();
    for (std::size_t i = 0; i < types_.size(); ++i) {
      const auto c = cells_[i];
      if (types_[i] == kTetCell || types_[i] == kQuadraticTetCell) {
        if (!push_tet(mesh_.tets, c, kVtkMidEdges))
          in_.fail("tetrahedra of 4 and of 10 nodes in one file, expected one kind");
        regions_.push(0, field ? field->values[i] : 0, [](int tag) { return std::to_string(tag); });
      } else if (types_[i] == kPixelCell) {
        mesh_.polygons.push(std::array{c[0], c[1], c[3], c[2]});
      } else if (types_[i] == kStripCell) {
        push_strip(c);
      } else if (types_[i] >= kTriangleCell) {
        if (types_[i] <= kQuadCell) mesh_.polygons.push(c);
      }
    }
    GroupCollector().finish(mesh_.tets);
  }

  void push_polygons(const Polygons& cells) {
    for (std::size_t i = 0; i < cells.size(); ++i) mesh_.polygons.push(cells[i]);
  }
  void push_strips(const Polygons& cells) {
    for (std::size_t i = 0; i < cells.size(); ++i) push_strip(cells[i]);
  }
  /// Every second triangle of a strip runs the other way.
  void push_strip(std::span<const Index> c) {
    for (std::size_t i = 2; i < c.size(); ++i)
      mesh_.polygons.push(i % 2 == 0 ? std::array{c[i - 2], c[i - 1], c[i]} : std::array{c[i - 1], c[i - 2], c[i]});
  }

  /// The field that tells regions: one of the usual names, else the only one there is.
  const CellField* region_field() {
    for (const char* usual :
         {"region",     "regions",     "region_id",     "regionid",  "material",      "materials", "material_id",
          "materialid", "materialids", "gmsh:physical", "medit:ref", "cellentityids", "cell_tags", "tag",
          "tags",       "label",       "labels",        "ref",       "attribute",     "attributes"})
      for (const CellField& f : fields_)
        if (lower_case(f.name) == usual) return &f;
    if (fields_.size() == 1 && distinct_values(fields_[0]) <= kMostRegions) return &fields_[0];
    if (!fields_.empty())
      warnings_.push_back(in_.name() +
                          ": none of the whole-number cell fields is taken for regions; name the one meant " +
                          "\"region\"");
    return nullptr;
  }
  static std::size_t distinct_values(const CellField& field) {
    auto values = field.values;
    std::sort(values.begin(), values.end());
    return static_cast<std::size_t>(std::unique(values.begin(), values.end()) - values.begin());
  }

  // --- data on cells and points

  void start_data(bool of_cells) {
    const auto items = in_.count(1, "number of data items");
    data_items_ = static_cast<std::uint64_t>(items);
    of_cells_ = of_cells;
    if (of_cells && !polydata_ && data_items_ != cells_.size())
      in_.fail("CELL_DATA for " + std::to_string(items) + " cells, expected " + std::to_string(cells_.size()));
  }

  void read_attribute(const std::string& keyword) {
    constexpr std::pair<const char*, int> kFixedSize[] = {{"VECTORS", 3},   {"NORMALS", 3},    {"TENSORS", 9},
                                                          {"TENSORS6", 6},  {"GLOBAL_IDS", 1}, {"PEDIGREE_IDS", 1},
                                                          {"EDGE_FLAGS", 1}};
    for (const auto& [name, components] : kFixedSize)
      if (keyword == name) return read_fixed(components);
    if (keyword == "SCALARS") return read_scalars();
    if (keyword == "FIELD") return read_field();
    if (keyword == "COLOR_SCALARS" || keyword == "LOOKUP_TABLE") return skip_colors(keyword == "LOOKUP_TABLE");
    if (keyword == "TEXTURE_COORDINATES") {
      in_.word("a name");
      const auto dimension = in_.integer(1, 3, "a dimension");
      return skip_array(data_type(), static_cast<std::uint64_t>(dimension), data_items_);
    }
    in_.fail("seen " + shown(keyword) + ", expected a keyword of VTK such as CELLS or CELL_DATA");
  }

  void read_fixed(int components) {
    in_.word("a name");
    skip_array(data_type(), static_cast<std::uint64_t>(components), data_items_);
  }

  void read_scalars() {
    const std::string name(in_.word("a name"));
    const std::string type = lower_case(in_.word("a data type"));
    const auto components = in_.more_on_line() ? in_.integer(1, 4, "a number of components") : 1;
    start_data_line("a data type");
    if (next_is("LOOKUP_TABLE")) {
      in_.expect("LOOKUP_TABLE");
      in_.word("a table's name");
      start_data_line("a table's name");
    }
    read_array(name, type, static_cast<std::uint64_t>(components), data_items_);
  }

  void read_field() {
    in_.word("a name");
    const auto arrays = in_.count(8, "number of arrays");
    for (Index i = 0; i < arrays; ++i) {
      if (in_.peek_word() == "METADATA") {
        in_.expect("METADATA");
        skip_metadata();
      }
      const std::string name(in_.word("an array's name"));
      const auto components = in_.count(1, "number of components"), items = in_.count(1, "number of tuples");
      read_array(name, data_type(), static_cast<std::uint64_t>(components), static_cast<std::uint64_t>(items));
    }
  }

  /// Keeps whole numbers, one per cell, for region_field().
  void read_array(const std::string& name, const std::string& type, std::uint64_t components, std::uint64_t items) {
    const bool whole = type != "float" && type != "double" && type != "bit";
    if (!whole || !of_cells_ || polydata_ || components != 1 || items != cells_.size())
      return skip_array(type, components, items);
    CellField field{name, {}};
    read_integers(type, items, "whole number", [&](std::int64_t value) {
      if (value < std::numeric_limits<int>::min() || value > std::numeric_limits<int>::max())
        in_.fail("seen " + std::to_string(value) + " in cell field " + shown(name) + ", expected a 32-bit number");
      field.values.push_back(static_cast<int>(value));
    });
    fields_.push_back(std::move(field));
  }

  void skip_array(const std::string& type, std::uint64_t components, std::uint64_t items) {
    check_room(components * items, type, "values");
    if (encoding_ == Encoding::kText)
      for (std::uint64_t i = 0; i < components * items; ++i) in_.word("a value");
    else
      in_.skip_bytes(type == "bit" ? (components * items + 7) / 8 : components * items * size_of(type), "values");
  }

  /// Colours are bytes in binary files and fractions in text.
  void skip_colors(bool table) {
    in_.word("a name");
    const auto number = in_.count(1, "number of colour values");
    start_data_line("a number");
    const auto [components, items] = table ? std::pair<std::uint64_t, std::uint64_t>(4, number)
                                           : std::pair<std::uint64_t, std::uint64_t>(number, data_items_);
    skip_array("unsigned_char", components, items);
  }

  /// Ends at an empty line.
  void skip_metadata() {
    in_.rest_of_line();
    while (in_.remaining() > 0 && !in_.rest_of_line().empty()) {
    }
  }

  // --- types and numbers

  template <class F>
  void with_type(const std::string& type, F&& use) const {
    with_number_type(type, in_, std::forward<F>(use));
  }

  std::size_t size_of(const std::string& type) const {
    std::size_t size = 1;
    if (type != "bit") with_type(type, [&]<class T>(T) { size = sizeof(T); });
    return size;
  }

  /// A data type; the data begin on the next line.
  std::string data_type() {
    std::string type = lower_case(in_.word("a data type"));
    start_data_line("a data type");
    return type;
  }
  std::string integer_type() {
    std::string type = data_type();
    if (type == "float" || type == "double") in_.fail("seen " + shown(type) + ", expected a type of whole numbers");
    return type;
  }

  void start_data_line(const char* after) {
    if (encoding_ != Encoding::kText) in_.end_line(after);
  }

  /// True if a keyword stands where numbers may begin.
  bool next_is(std::string_view keyword) {
    return encoding_ == Encoding::kText ? in_.peek_word() == keyword : in_.starts_with(keyword);
  }

  /// Hands `count` whole numbers of a type to `use`, after a check that they can be there.
  template <class F>
  void read_integers(const std::string& type, std::uint64_t count, const char* expected, F&& use) {
    check_room(count, type, expected);
    with_type(type, [&]<class T>(T) {
      if constexpr (std::integral<T>)
        for (std::uint64_t i = 0; i < count; ++i) use(static_cast<std::int64_t>(in_.number<T>(encoding_, expected)));
    });
  }

  /// Checks that so many numbers can still follow; a number in text takes two bytes with its blank.
  void check_room(std::uint64_t numbers, const std::string& type, const char* items) const {
    const std::uint64_t bytes = encoding_ == Encoding::kText ? 2 : type == "bit" ? 1 : size_of(type);
    const std::uint64_t most = type == "bit" ? 8 * (in_.remaining() + 1) : (in_.remaining() + 1) / bytes;
    if (numbers > most)
      in_.fail("expected " + std::to_string(numbers) + " " + items + ", but only " + std::to_string(in_.remaining()) +
               " bytes follow: a wrong count, or the file is cut short");
  }

  static std::string upper(std::string_view word) {
    std::string out(word);
    std::transform(out.begin(), out.end(), out.begin(),
                   [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    return out;
  }

  static constexpr std::size_t kMostRegions = 256;  // more distinct numbers are cell ids, not regions

  FileScanner in_;
  Warnings& warnings_;
  MeshFile mesh_;
  RegionTable regions_;
  Encoding encoding_ = Encoding::kText;
  bool polydata_ = false, has_points_ = false, of_cells_ = false;
  std::uint64_t data_items_ = 0;
  Polygons cells_;  // of any kind
  std::vector<int> types_;
  std::vector<CellField> fields_;
};

}  // namespace

MeshFile read_vtk(const FileBytes& file, Warnings& warnings) { return VtkReader(file, warnings).read(); }

}  // namespace limber::internal
