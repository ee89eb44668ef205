// Units and axes that files state: one box of 1 × 2 × 3 units, its corner at (0.2, −0.8, −1.4), in every format that
// states one.
#include <gmock/gmock.h>
#include <zlib.h>

#include "limber/core/error.h"
#include "limber/mesh_assimp/read_surface_mesh.h"
#include "sample_meshes.h"

namespace limber {
namespace {

using namespace samples;
using ::testing::HasSubstr;

const Vec3 kCorner(0.2, -0.8, -1.4);

SurfaceMesh box() {
  SurfaceMesh s = cube_surface();
  for (Vec3& p : s.vertices) p = kCorner + p.cwiseProduct(Vec3(1, 2, 3));
  return s;
}

/// Text made of a line for each item.
template <class Items, class Line>
std::string lines(const Items& items, Line&& line) {
  std::string out;
  for (const auto& item : items) out += line(item) + "\n";
  return out;
}

std::string text(double x) {
  auto out = exact();
  out << x;
  return out.str();
}

std::string model_3mf(const std::string& unit) {
  const SurfaceMesh s = box();
  return R"(<?xml version="1.0"?><!-- <model unit="foot"> --><model )" + unit +
         R"( xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources><object id="1" type="model"><mesh><vertices>)" +
         lines(s.vertices,
               [](const Vec3& p) {
                 return "<vertex x=\"" + text(p.x()) + "\" y=\"" + text(p.y()) + "\" z=\"" + text(p.z()) + "\"/>";
               }) +
         "</vertices><triangles>" +
         lines(s.triangles,
               [](const Triangle& t) {
                 return "<triangle v1=\"" + std::to_string(t[0]) + "\" v2=\"" + std::to_string(t[1]) + "\" v3=\"" +
                        std::to_string(t[2]) + "\"/>";
               }) +
         R"(</triangles></mesh></object></resources><build><item objectid="1"/></build></model>)";
}

std::string deflated(std::string in) {
  std::string out(in.size() + 1000, '\0');
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, 9, Z_DEFLATED, -15, 8, Z_DEFAULT_STRATEGY), Z_OK);
  stream.next_in = reinterpret_cast<unsigned char*>(in.data());
  stream.avail_in = static_cast<unsigned>(in.size());
  stream.next_out = reinterpret_cast<unsigned char*>(out.data());
  stream.avail_out = static_cast<unsigned>(out.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

std::string zip(const std::vector<std::pair<std::string, std::string>>& files) {
  Bytes all, directory;
  for (const auto& [name, bytes] : files) {
    const auto begin = static_cast<std::uint32_t>(all.str().size());
    const std::string packed = deflated(bytes);
    const auto common = [&](Bytes& b) {
      b.raw(std::uint16_t{20}).raw(std::uint16_t{0}).raw(std::uint16_t{8}).raw(std::uint32_t{0});
      b.raw(static_cast<std::uint32_t>(
          crc32(0, reinterpret_cast<const unsigned char*>(bytes.data()), static_cast<unsigned>(bytes.size()))));
      b.raw(static_cast<std::uint32_t>(packed.size())).raw(static_cast<std::uint32_t>(bytes.size()));
      b.raw(static_cast<std::uint16_t>(name.size())).raw(std::uint16_t{0});
    };
    common(all.text("PK\3\4"));
    all.text(name).text(packed);
    common(directory.text("PK\1\2").raw(std::uint16_t{20}));
    directory.raw(std::uint16_t{0}).raw(std::uint16_t{0}).raw(std::uint16_t{0}).raw(std::uint32_t{0}).raw(begin);
    directory.text(name);
  }
  const auto at = static_cast<std::uint32_t>(all.str().size());
  const auto count = static_cast<std::uint16_t>(files.size());
  all.text(directory.str()).text("PK\5\6").raw(std::uint32_t{0}).raw(count).raw(count);
  return all.raw(static_cast<std::uint32_t>(directory.str().size())).raw(at).raw(std::uint16_t{0}).str();
}

std::string file_3mf(const std::string& unit) {
  return zip(
      {{"[Content_Types].xml",
        R"(<?xml version="1.0"?><Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types"/>)"},
       {"_rels/.rels",
        R"(<?xml version="1.0"?><Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Target="/3D/3dmodel.model" Id="rel0" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>)"},
       {"3D/3dmodel.model", model_3mf(unit)}});
}

std::string amf(const std::string& unit) {
  const SurfaceMesh s = box();
  return R"(<?xml version="1.0"?><amf )" + unit + R"(><object id="0"><mesh><vertices>)" +
         lines(s.vertices,
               [](const Vec3& p) {
                 return "<vertex><coordinates><x>" + text(p.x()) + "</x><y>" + text(p.y()) + "</y><z>" + text(p.z()) +
                        "</z></coordinates></vertex>";
               }) +
         "</vertices><volume>" +
         lines(s.triangles,
               [](const Triangle& t) {
                 return "<triangle><v1>" + std::to_string(t[0]) + "</v1><v2>" + std::to_string(t[1]) + "</v2><v3>" +
                        std::to_string(t[2]) + "</v3></triangle>";
               }) +
         "</volume></mesh></object></amf>";
}

/// @param asset what stands in its <asset>
std::string collada(const std::string& asset) {
  const SurfaceMesh s = box();
  return R"(<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>)" +
         asset +
         R"(</asset><library_geometries><geometry id="g"><mesh><source id="p"><float_array id="pa" count="24">)" +
         lines(s.vertices, [](const Vec3& p) { return joined(p); }) +
         R"(</float_array><technique_common><accessor source="#pa" count="8" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="12"><input semantic="VERTEX" source="#v" offset="0"/><p>)" +
         lines(s.triangles, [](const Triangle& t) { return joined(t); }) +
         R"(</p></triangles></mesh></geometry></library_geometries><library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>)";
}

/// @param settings lines of GlobalSettings' Properties70
std::string fbx(const std::string& settings) {
  const SurfaceMesh s = box();
  std::string corners, polygons;
  for (const Vec3& p : s.vertices)
    for (const double c : p) corners += (corners.empty() ? "" : ",") + text(c);
  for (const Triangle& t : s.triangles)
    polygons += (polygons.empty() ? "" : ",") + std::to_string(t[0]) + "," + std::to_string(t[1]) + "," +
                std::to_string(-t[2] - 1);
  return "; FBX 7.4.0 project file\nFBXHeaderExtension:  {\n\tFBXHeaderVersion: 1003\n\tFBXVersion: 7400\n}\n"
         "GlobalSettings:  {\n\tVersion: 1000\n\tProperties70:  {\n" +
         settings +
         "\t}\n}\nObjects:  {\n\tGeometry: 1, \"Geometry::g\", \"Mesh\" {\n\t\tVertices: *24 {\n\t\t\ta: " + corners +
         "\n\t\t}\n\t\tPolygonVertexIndex: *36 {\n\t\t\ta: " + polygons +
         "\n\t\t}\n\t}\n\tModel: 2, \"Model::m\", \"Mesh\" {\n\t\tVersion: 232\n\t}\n}\n"
         "Connections:  {\n\tC: \"OO\",2,0\n\tC: \"OO\",1,2\n}\n";
}

struct Case {
  std::string file, bytes;
  double metres;
  char up;
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.file; }

std::vector<Case> cases() {
  const std::string up_z = "<up_axis>Z_UP</up_axis>", centimetres = R"(<unit name="cm" meter="0.01"/>)";
  return {{"default.3mf", file_3mf(""), 1e-3, 'z'},
          {"millimetres.3mf", file_3mf(R"(unit="millimeter")"), 1e-3, 'z'},
          {"microns.3mf", file_3mf(R"(unit="micron")"), 1e-6, 'z'},
          {"inches.3mf", file_3mf(R"(unit="inch")"), 0.0254, 'z'},
          {"feet.3mf", file_3mf("unit = 'foot'"), 0.3048, 'z'},
          {"metres.3mf", file_3mf(R"(unit="meter")"), 1.0, 'z'},
          {"default.amf", amf(""), 1e-3, 'z'},
          {"millimetres.amf", amf(R"(unit="millimeter" version="1.1")"), 1e-3, 'z'},
          {"inches.amf", amf(R"(unit="inch")"), 0.0254, 'z'},
          {"feet.amf", amf(R"(unit="feet")"), 0.3048, 'z'},
          {"default.dae", collada(""), 1.0, 'y'},
          {"centimetres.dae", collada(centimetres), 0.01, 'y'},
          {"z_up.dae", collada(up_z), 1.0, 'z'},
          {"x_up.dae", collada("<up_axis> X_UP </up_axis>"), 1.0, 'x'},
          {"centimetres_z_up.dae", collada(centimetres + up_z), 0.01, 'z'},
          {"default.fbx", fbx(""), 0.01, 'y'},
          {"metres.fbx", fbx("\t\tP: \"UnitScaleFactor\", \"double\", \"Number\", \"\",100\n"), 1.0, 'y'},
          {"inches_z_up.fbx",
           fbx("\t\tP: \"UpAxis\", \"int\", \"Integer\", \"\",2\n"
               "\t\tP: \"UnitScaleFactor\", \"double\", \"Number\", \"\",2.54\n"),
           0.0254, 'z'}};
}

class StatedUnit : public ::testing::TestWithParam<Case> {};

TEST_P(StatedUnit, CountsAndAxesStay) {
  const Folder folder;
  Warnings warnings;
  FileUnit unit;
  const auto path = folder.write(GetParam().file, GetParam().bytes);
  const SurfaceMesh s = read_any_surface_mesh(path, warnings, &unit);
  const double m = GetParam().metres;
  EXPECT_NEAR(unit.metres, m, 1e-7 * m);  // Assimp tells it in a float
  EXPECT_TRUE(unit.stated);
  EXPECT_EQ(unit.up, GetParam().up);
  EXPECT_NEAR(enclosed_volume(s), 6.0 * m * m * m, 1e-5 * m * m * m);
  Vec3 low = s.vertices.front();
  for (const Vec3& p : s.vertices) low = low.cwiseMin(p);
  EXPECT_LT((low - m * kCorner).norm(), 1e-6 * m);
  EXPECT_THAT(warnings, ::testing::IsEmpty());

  FileUnit of_groups;
  const GroupedSurface groups = read_any_grouped_surface(path, warnings, &of_groups);
  EXPECT_EQ(of_groups.metres, unit.metres);
  EXPECT_NEAR(enclosed_volume(groups.surface), 6.0 * m * m * m, 1e-5 * m * m * m);
}

INSTANTIATE_TEST_SUITE_P(OfFormats, StatedUnit, ::testing::ValuesIn(cases()), [](const auto& c) {
  std::string name = c.param.file;
  std::replace(name.begin(), name.end(), '.', '_');
  return name;
});

TEST(StatedUnit, AFileWithoutOneIsTakenAsMetres) {
  const Folder folder;
  Warnings warnings;
  FileUnit unit{.metres = 7.0, .stated = true, .up = 'x'};
  read_surface_mesh_with_assimp(folder.write("cube.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), warnings, &unit);
  EXPECT_EQ(unit.metres, 1.0);
  EXPECT_FALSE(unit.stated);
  EXPECT_EQ(unit.up, 0);
}

TEST(StatedUnit, OneThatIsNoLengthIsRefusedByName) {
  const Folder folder;
  for (const auto& [file, bytes, seen] :
       std::vector<std::array<std::string, 3>>{{"a.3mf", file_3mf(R"(unit="parsec")"), "parsec"},
                                               {"a.dae", collada(R"(<unit meter="0"/>)"), "0.000000"},
                                               {"b.dae", collada(R"(<unit meter="one"/>)"), "one"}})
    try {
      Warnings warnings;
      read_any_surface_mesh(folder.write(file, bytes), warnings);
      ADD_FAILURE() << file << " was taken";
    } catch (const InputError& e) {
      EXPECT_THAT(e.what(), HasSubstr(seen));
    }
}

}  // namespace
}  // namespace limber
