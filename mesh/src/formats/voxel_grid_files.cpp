// Regular grids from files: VTK legacy STRUCTURED_POINTS as the VTK file format document describes it, and NRRD
// (teem.sourceforge.net/nrrd/format.html) with attached raw data.
#include <algorithm>
#include <cctype>
#include <map>
#include <optional>
#include <sstream>

#include "formats/number_types.h"
#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/mesh/voxel_grid.h"

namespace limber {
namespace {

using internal::Encoding;
using internal::FileScanner;
using internal::lower_case;
using internal::shown;
using internal::with_number_type;

/// The least bytes that a number of a type takes.
std::size_t bytes_of(const std::string& type, Encoding encoding, const FileScanner& in) {
  std::size_t bytes = 0;
  with_number_type(type, in, [&]<class T>(T) { bytes = encoding == Encoding::kText ? 2 : sizeof(T); });
  return bytes;
}

std::vector<double> read_numbers(FileScanner& in, const std::string& type, Encoding encoding, std::size_t count) {
  if (count > (in.remaining() + 1) / bytes_of(type, encoding, in))
    in.fail("expected " + std::to_string(count) + " values, but only " + std::to_string(in.remaining()) +
            " bytes follow: a wrong count, or the file is cut short");
  std::vector<double> values;
  values.reserve(count);
  with_number_type(type, in, [&]<class T>(T) {
    for (std::size_t i = 0; i < count; ++i) values.push_back(static_cast<double>(in.number<T>(encoding, "a value")));
  });
  return values;
}

class StructuredPoints {
 public:
  StructuredPoints(std::string_view bytes, const std::string& name) : in_(bytes, name, {}) {}

  VoxelGrid read() {
    in_.rest_of_line();  // # vtk DataFile Version, by which the file was known
    in_.rest_of_line();  // the title
    const auto form = in_.word("ASCII or BINARY");
    if (form != "ASCII" && form != "BINARY") in_.fail("seen " + shown(form) + ", expected ASCII or BINARY");
    encoding_ = form == "ASCII" ? Encoding::kText : Encoding::kBigEndian;
    in_.expect("DATASET");
    if (const auto kind = in_.word("a kind of data set"); kind != "STRUCTURED_POINTS")
      in_.fail("seen " + shown(kind) + ", expected STRUCTURED_POINTS");
    while (!in_.at_end()) read_section(lower_case(in_.word("a keyword")));
    return grid_;
  }

 private:
  void read_section(const std::string& word) {
    if (word == "dimensions") {
      for (Index& count : grid_.counts) count = static_cast<Index>(in_.integer(1, 1'000'000, "a dimension"));
    } else if (word == "origin") {
      for (int a = 0; a < 3; ++a) grid_.origin[a] = in_.real();
    } else if (word == "spacing" || word == "aspect_ratio") {
      for (int a = 0; a < 3; ++a) grid_.step(a, a) = in_.real();
    } else if (word == "point_data" || word == "cell_data") {
      start_data(word == "cell_data");
    } else if (word == "scalars") {
      const std::string name(in_.word("a name")), type = lower_case(in_.word("a data type"));
      const auto components = in_.more_on_line() ? in_.integer(1, 4, "a number of components") : 1;
      end_line("a data type");
      if (in_.peek_word() == "LOOKUP_TABLE") {
        in_.expect("LOOKUP_TABLE");
        in_.word("a table's name");
        end_line("a table's name");
      }
      keep(name, static_cast<std::size_t>(components), type);
    } else if (word == "field") {
      in_.word("a name");
      for (auto arrays = in_.integer(0, 1000, "a number of arrays"); arrays > 0; --arrays) {
        const std::string name(in_.word("an array's name"));
        const auto components = in_.integer(1, 1000, "a number of components");
        if (const auto items = in_.integer("a number of tuples"); static_cast<std::uint64_t>(items) != samples_)
          in_.fail("seen " + std::to_string(items) + " tuples, expected " + std::to_string(samples_));
        const std::string type = lower_case(in_.word("a data type"));
        end_line("a data type");
        keep(name, static_cast<std::size_t>(components), type);
      }
    } else {
      in_.fail("seen " + shown(word) +
               ", expected DIMENSIONS, ORIGIN, SPACING, POINT_DATA, CELL_DATA, SCALARS or FIELD");
    }
  }

  /// Cells are one fewer than points along an axis, and their samples lie in the middle.
  void start_data(bool of_cells) {
    if (samples_ > 0) in_.fail("data of points and of cells, or twice, expected one section of data");
    grid_.of_cells = of_cells;
    if (of_cells)
      for (int a = 0; a < 3; ++a) {
        grid_.counts[a] = std::max<Index>(grid_.counts[a] - 1, 1);
        grid_.origin[a] += 0.5 * grid_.step(a, a);
      }
    samples_ = grid_.samples();
    if (const auto items = in_.integer("a number of data items"); static_cast<std::uint64_t>(items) != samples_)
      in_.fail("seen " + std::to_string(items) + " data items, expected " + std::to_string(samples_) +
               " by DIMENSIONS");
  }

  void keep(const std::string& name, std::size_t components, const std::string& type) {
    if (samples_ == 0) in_.fail("an array stands before POINT_DATA and CELL_DATA");
    std::vector<double> values = read_numbers(in_, type, encoding_, components * samples_);
    if (components == 1) grid_.fields.push_back({name, std::move(values)});
  }

  void end_line(const char* after) {
    if (encoding_ != Encoding::kText) in_.end_line(after);
  }

  FileScanner in_;
  VoxelGrid grid_;
  Encoding encoding_ = Encoding::kText;
  std::size_t samples_ = 0;
};

class Nrrd {
 public:
  Nrrd(std::string_view bytes, const std::string& name) : in_(bytes, name, {}) {}

  VoxelGrid read() {
    read_head();
    const auto dimension = numbers("dimension", 1)[0];
    if (dimension != 3.0 && dimension != 4.0) in_.fail("dimension is not 3 or 4");
    skipped_ = dimension == 4.0 ? 1 : 0;
    const std::vector<double> sizes = numbers("sizes", skipped_ + 3);
    for (const double size : sizes)
      if (!(size >= 1.0 && size <= 1e6)) in_.fail("sizes: expected 1 to 1000000 along each axis");
    for (std::size_t a = 0; a < 3; ++a) grid_.counts[a] = static_cast<Index>(sizes[skipped_ + a]);
    place();
    const std::size_t fields = skipped_ == 1 ? static_cast<std::size_t>(sizes[0]) : 1;
    const std::vector<double> values = read_numbers(in_, type(), encoding(), fields * grid_.samples());
    for (std::size_t f = 0; f < fields; ++f) {
      VoxelGrid::Field field{.name = skipped_ == 1 ? std::to_string(f) : head_["content"], .values = {}};
      for (std::size_t i = f; i < values.size(); i += fields) field.values.push_back(values[i]);
      grid_.fields.push_back(std::move(field));
    }
    return grid_;
  }

 private:
  /// "key: value" lines up to an empty one; "key:=value" and comments are passed over.
  void read_head() {
    in_.rest_of_line();  // NRRD000n, by which the file was known
    while (in_.remaining() > 0) {
      const std::string_view line = in_.rest_of_line();
      if (line.empty()) return;
      const std::size_t colon = line.find(':');
      if (line.front() == '#' || line.find(":=") == colon) continue;
      if (colon == std::string_view::npos)
        in_.fail("seen " + shown(line) + ", expected a field such as sizes: 10 10 10");
      std::string_view value = line.substr(colon + 1);
      while (!value.empty() && value.front() == ' ') value.remove_prefix(1);
      head_[lower_case(line.substr(0, colon))] = value;
    }
    in_.fail("the file ends, expected an empty line and the data");
  }

  const std::string& field(const std::string& key) {
    if (!head_.contains(key)) in_.fail("field \"" + key + "\" is missing");
    return head_[key];
  }

  /// All numbers of a text in which brackets and commas stand between them; those of `none` and `nan` are left out.
  std::vector<double> numbers(const std::string& key, std::size_t count) {
    std::string text = field(key);
    std::replace_if(
        text.begin(), text.end(), [](char c) { return c == '(' || c == ')' || c == ','; }, ' ');
    FileScanner words(text, in_.name() + ": " + key, {});
    std::vector<double> found;
    while (!words.at_end()) {
      if (const std::string word = lower_case(words.peek_word()); word == "none" || word == "nan")
        words.word("a number");
      else
        found.push_back(words.real());
    }
    if (found.size() != count)
      in_.fail(key + ": seen " + std::to_string(found.size()) + " numbers, expected " + std::to_string(count));
    return found;
  }

  /// What each word of a field about the axes says of the three in space, which must agree.
  std::optional<std::string> of_axes(const std::string& key) {
    if (!head_.contains(key)) return std::nullopt;
    std::istringstream words(head_[key]);
    std::vector<std::string> all;
    for (std::string word; words >> word;) all.push_back(lower_case(word));
    if (all.size() > 3) all.erase(all.begin(), all.end() - 3);
    if (all.size() != 3 || all[0] != all[1] || all[1] != all[2])
      in_.fail(key + ": expected the same for the three axes in space");
    return all[0];
  }

  void place() {
    const std::string centering = of_axes("centers").value_or(of_axes("centerings").value_or("cell"));
    grid_.of_cells = centering != "node";
    if (head_.contains("space directions")) {
      const std::vector<double> d = numbers("space directions", 9);
      for (int a = 0; a < 3; ++a)
        for (int x = 0; x < 3; ++x) grid_.step(x, a) = d[static_cast<std::size_t>(3 * a + x)];
      if (head_.contains("space origin")) {
        const std::vector<double> o = numbers("space origin", 3);
        grid_.origin = Vec3(o[0], o[1], o[2]);
      }
      const double metres = unit();
      grid_.step *= metres, grid_.origin *= metres;
      return;
    }
    const std::vector<double> spacings = numbers("spacings", 3);
    const std::vector<double> mins =
        head_.contains("axis mins") ? numbers("axis mins", 3) : std::vector<double>(3, 0.0);
    for (int a = 0; a < 3; ++a) {
      const auto i = static_cast<std::size_t>(a);
      grid_.step(a, a) = spacings[i];
      grid_.origin[a] = mins[i] + (grid_.of_cells ? 0.5 * spacings[i] : 0.0);  // the least edge of the first cell
    }
  }

  double unit() {
    if (!head_.contains("space units")) return 1.0;
    std::string text = head_["space units"];
    std::replace(text.begin(), text.end(), '"', ' ');
    head_["space units"] = text;
    const std::string unit = *of_axes("space units");
    const std::map<std::string, double> known{{"m", 1.0}, {"cm", 1e-2}, {"mm", 1e-3}, {"um", 1e-6}};
    if (!known.contains(unit)) in_.fail("space units: seen " + shown(unit) + ", expected m, cm, mm or um");
    return known.at(unit);
  }

  std::string type() {
    static const std::map<std::string, std::string> kVtkName{{"float", "float"},
                                                             {"double", "double"},
                                                             {"uchar", "unsigned_char"},
                                                             {"unsigned char", "unsigned_char"},
                                                             {"uint8", "unsigned_char"},
                                                             {"uint8_t", "unsigned_char"},
                                                             {"signed char", "char"},
                                                             {"int8", "char"},
                                                             {"int8_t", "char"},
                                                             {"short", "short"},
                                                             {"int16", "short"},
                                                             {"int16_t", "short"},
                                                             {"ushort", "unsigned_short"},
                                                             {"unsigned short", "unsigned_short"},
                                                             {"uint16", "unsigned_short"},
                                                             {"uint16_t", "unsigned_short"},
                                                             {"int", "int"},
                                                             {"int32", "int"},
                                                             {"int32_t", "int"},
                                                             {"uint", "unsigned_int"},
                                                             {"unsigned int", "unsigned_int"},
                                                             {"uint32", "unsigned_int"},
                                                             {"uint32_t", "unsigned_int"}};
    const std::string name = lower_case(field("type"));
    if (!kVtkName.contains(name)) in_.fail("type: seen " + shown(name) + ", expected one of numbers, such as float");
    return kVtkName.at(name);
  }

  Encoding encoding() {
    for (const char* key : {"data file", "datafile"})
      if (head_.contains(key)) in_.fail("its data lie in another file, expected them in this one");
    if (const std::string seen = lower_case(field("encoding")); seen != "raw")
      in_.fail("encoding: seen " + shown(seen) + ", expected raw");
    if (!head_.contains("endian")) return Encoding::kLittleEndian;  // numbers of one byte have none
    const std::string endian = lower_case(field("endian"));
    if (endian != "little" && endian != "big") in_.fail("endian: seen " + shown(endian) + ", expected little or big");
    return endian == "big" ? Encoding::kBigEndian : Encoding::kLittleEndian;
  }

  FileScanner in_;
  VoxelGrid grid_;
  std::map<std::string, std::string> head_;
  std::size_t skipped_ = 0;  // axes before those in space
};

}  // namespace

VoxelGrid read_voxel_grid(const std::filesystem::path& path) {
  const std::string bytes = read_file(path), name = internal::shown_path(path);
  VoxelGrid grid;
  if (bytes.starts_with("NRRD"))
    grid = Nrrd(bytes, name).read();
  else if (bytes.starts_with("# vtk DataFile"))
    grid = StructuredPoints(bytes, name).read();
  else
    throw InputError(name + ": is neither VTK legacy nor NRRD");
  validate(grid, name);
  return grid;
}

}  // namespace limber
