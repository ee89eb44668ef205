#include "file_unit.h"

#include <zlib.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "assimp_scene.h"
#include "limber/core/error.h"
#include "limber/core/file.h"

namespace limber::internal {
namespace {

/// As much of a document as can stand before its unit.
constexpr std::size_t kHead = 1 << 16;

// ZIP archives (PKWARE's APPNOTE, 4.3): a directory at the end names each file and where it begins.

std::uint32_t number(std::string_view bytes, std::size_t at, std::size_t size) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < size; ++i)
    value |= std::uint32_t{static_cast<unsigned char>(at + i < bytes.size() ? bytes[at + i] : 0)} << (8 * i);
  return value;
}

/// The first bytes of a deflated stream.
std::string inflated_head(std::string_view deflated) {
  std::string out(kHead, '\0');
  std::string in(deflated.substr(0, 4 * kHead));  // zlib does not promise to leave its input alone
  z_stream stream{};
  constexpr int kRaw = -15;
  if (inflateInit2(&stream, kRaw) != Z_OK) return {};
  stream.next_in = reinterpret_cast<unsigned char*>(in.data());
  stream.avail_in = static_cast<unsigned>(in.size());
  stream.next_out = reinterpret_cast<unsigned char*>(out.data());
  stream.avail_out = static_cast<unsigned>(out.size());
  inflate(&stream, Z_SYNC_FLUSH);
  out.resize(stream.total_out);
  inflateEnd(&stream);
  return out;
}

/// The first bytes of the first file in an archive whose name ends so; empty if there is none.
std::string head_in_archive(std::string_view archive, std::string_view ending) {
  const auto end = archive.rfind("PK\5\6");
  if (end == archive.npos) return {};
  std::size_t entry = number(archive, end + 16, 4);
  while (archive.substr(std::min(entry, archive.size())).starts_with("PK\1\2")) {
    const auto name = archive.substr(std::min(entry + 46, archive.size()), number(archive, entry + 28, 2));
    if (name.ends_with(ending)) {
      const std::size_t local = number(archive, entry + 42, 4);
      const std::size_t data = local + 30 + number(archive, local + 26, 2) + number(archive, local + 28, 2);
      const auto content = archive.substr(std::min(data, archive.size()), number(archive, entry + 20, 4));
      const bool stored = number(archive, entry + 10, 2) == 0;
      return stored ? std::string(content.substr(0, kHead)) : inflated_head(content);
    }
    entry += 46 + name.size() + number(archive, entry + 30, 2) + number(archive, entry + 32, 2);
  }
  return {};
}

// XML

/// Where the first start tag of an element begins, comments passed over, whatever its prefix; npos if there is none.
std::size_t find_element(std::string_view xml, std::string_view element) {
  for (auto at = xml.find('<'); at != xml.npos; at = xml.find('<', at + 1)) {
    if (xml.substr(at).starts_with("<!--")) {
      at = xml.find("-->", at);
      if (at == xml.npos) break;
      continue;
    }
    auto name = xml.substr(at + 1, xml.find_first_of(" \t\r\n/>", at) - at - 1);
    if (const auto colon = name.find(':'); colon != name.npos) name.remove_prefix(colon + 1);
    if (name == element) return at;
  }
  return xml.npos;
}

/// The value of an attribute of the first such element.
std::optional<std::string> attribute(std::string_view xml, std::string_view element, std::string_view wanted) {
  const auto begin = find_element(xml, element);
  if (begin == xml.npos) return std::nullopt;
  const std::string_view tag = xml.substr(begin, xml.find('>', begin) - begin);
  for (auto at = tag.find(wanted); at != tag.npos; at = tag.find(wanted, at + 1)) {
    const auto equals = tag.find_first_not_of(" \t\r\n", at + wanted.size());
    if (std::string_view(" \t\r\n").find(tag[at - 1]) == tag.npos || equals == tag.npos || tag[equals] != '=') continue;
    const auto quote = tag.find_first_of("\"'", equals);
    if (quote == tag.npos) return std::nullopt;
    return std::string(tag.substr(quote + 1, tag.find(tag[quote], quote + 1) - quote - 1));
  }
  return std::nullopt;
}

std::string text_of(std::string_view xml, std::string_view element) {
  const auto begin = find_element(xml, element);
  const auto text = xml.find('>', std::min(begin, xml.size()));
  if (text == xml.npos) return {};
  std::string value(xml.substr(text + 1, xml.find('<', text) - text - 1));
  std::erase_if(value, [](unsigned char c) { return c <= 32; });
  return value;
}

// Formats

/// 3MF Core Specification 1.3, 3.4; ASTM F2915 (AMF), 4.
double named_unit(std::string name, const std::filesystem::path& path) {
  std::transform(name.begin(), name.end(), name.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? c + 32 : c; });
  if (name.size() > 2 && name.ends_with('s')) name.pop_back();
  constexpr std::pair<const char*, double> kUnits[] = {{"micron", 1e-6},     {"micrometer", 1e-6}, {"millimeter", 1e-3},
                                                       {"centimeter", 1e-2}, {"inch", 0.0254},     {"inche", 0.0254},
                                                       {"foot", 0.3048},     {"feet", 0.3048},     {"meter", 1.0}};
  for (const auto& [known, metres] : kUnits)
    if (name == known) return metres;
  throw InputError(quoted_path(path) + ": the unit is \"" + one_line(name) +
                   "\", expected micron, millimeter, centimeter, inch, foot or meter");
}

double checked(double metres, const std::filesystem::path& path) {
  if (!(metres > 0.0 && std::isfinite(metres)))
    throw InputError(quoted_path(path) + ": the unit is " + std::to_string(metres) + " m, expected a length above 0");
  return metres;
}

UnitOfScene unit_of_collada(std::string_view xml, const std::filesystem::path& path) {
  UnitOfScene of{.unit = {.metres = 1.0, .stated = true, .up = 'y'}};  // the format's defaults
  if (const auto metres = attribute(xml, "unit", "meter")) {
    const auto [end, error] = std::from_chars(metres->data(), metres->data() + metres->size(), of.unit.metres);
    if (error != std::errc() || end != metres->data() + metres->size())
      throw InputError(quoted_path(path) + ": the unit is \"" + one_line(*metres) + "\", expected its metres");
    checked(of.unit.metres, path);
  }
  const std::string up = text_of(xml, "up_axis");
  if (up == "X_UP") of.unit.up = 'x';
  if (up == "Z_UP") of.unit.up = 'z';
  return of;
}

UnitOfScene unit_of_fbx(const aiScene& scene, const std::filesystem::path& path) {
  double centimetres = 1.0;
  int up = 1;
  if (scene.mMetaData != nullptr) {
    float narrow = 1.0F;
    if (!scene.mMetaData->Get("UnitScaleFactor", centimetres) && scene.mMetaData->Get("UnitScaleFactor", narrow))
      centimetres = static_cast<double>(narrow);
    scene.mMetaData->Get("UpAxis", up);
  }
  const double metres = checked(0.01 * centimetres, path);
  return {.unit = {.metres = metres, .stated = true, .up = up >= 0 && up < 3 ? "xyz"[up] : '\0'}, .factor = metres};
}

UnitOfScene unit_of_print(std::string_view xml, const char* root, const std::filesystem::path& path) {
  const double metres = named_unit(attribute(xml, root, "unit").value_or("millimeter"), path);
  return {.unit = {.metres = metres, .stated = true, .up = 'z'}, .factor = metres};
}

}  // namespace

UnitOfScene unit_of(const Assimp::Importer& importer, const aiScene& scene, const std::filesystem::path& path) {
  const auto is = [&](const char* extension) { return was_read_as(importer, extension); };
  const auto head = [&](std::string_view name_in_archive) {
    std::string bytes = read_file(path);
    if (bytes.starts_with("PK\3\4")) return head_in_archive(bytes, name_in_archive);
    bytes.resize(std::min(bytes.size(), kHead));
    return bytes;
  };
  if (is("3mf")) return unit_of_print(head(".model"), "model", path);
  if (is("amf")) return unit_of_print(head(".amf"), "amf", path);
  if (is("dae")) return unit_of_collada(head(".dae"), path);
  if (is("fbx")) return unit_of_fbx(scene, path);
  return {};
}

}  // namespace limber::internal
