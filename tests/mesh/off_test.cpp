// OFF in its variants, and heads that lie.
#include <gmock/gmock.h>

#include "limber/core/error.h"
#include "limber/mesh/read_mesh.h"
#include "same_mesh.h"
#include "sample_meshes.h"

namespace limber {
namespace {

using namespace samples;
using ::testing::HasSubstr;

constexpr const char* kFaces = "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";

class OffFormat : public ::testing::Test {
 protected:
  SurfaceMesh read(const std::string& bytes, const std::string& name = "a.off") const {
    Warnings warnings;
    return read_surface_mesh(folder_.write(name, bytes), warnings);
  }
  std::string complaint(const std::string& bytes) const {
    try {
      read(bytes);
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
      return e.what();
    }
    return {};
  }
  const Folder folder_;
};

TEST_F(OffFormat, IsReadInAllItsVariants) {
  const std::string faces = kFaces, plain = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
  for (const std::string& text : std::vector<std::string>{
           "OFF\n4 4 6\n" + plain + faces, "OFF 4 4 6\n" + plain + faces, "4 4 6\n" + plain + faces,
           "OFF\n4 4\n" + plain + faces, "# a remark\nOFF # another\n\n4 4 0\n# and\n" + plain + "\n" + faces,
           "OFF\r\n4 4 6\r\n0 0 0\r\n1 0 0\r\n0 1 0\r\n0 0 1\r\n3 0 2 1\r\n3 0 1 3\r\n3 0 3 2\r\n3 1 2 3\r\n",
           "COFF\n4 4 6\n0 0 0 1 0 0 1\n1 0 0 1 0 0 1\n0 1 0 1 0 0 1\n0 0 1 1 0 0 1\n" + faces,
           "NOFF\n4 4 6\n0 0 0 1 0 0\n1 0 0 1 0 0\n0 1 0 1 0 0\n0 0 1 1 0 0\n" + faces,
           "STCN4OFF\n4 4 6\n0 0 0 2 9 9\n2 0 0 2 9 9\n0 2 0 2 9 9\n0 0 2 2 9 9\n" + faces,
           "nOFF 3\n4 4 6\n" + plain + faces,
           "OFF\n4 4 6\n" + plain + "3 0 2 1 255 0 0\n3 0 1 3 0.5 0.5 0.5 1\n3 0 3 2 7\n3 1 2 3\n"}) {
    const SurfaceMesh s = read(text);
    EXPECT_EQ(s.vertices.size(), 4u) << text;
    EXPECT_TRUE(surface_quality(s).closed_manifold()) << text;
    EXPECT_DOUBLE_EQ(enclosed_volume(s), 1.0 / 6.0) << text;
  }
}

TEST_F(OffFormat, IsReadInBinary) {
  Bytes b(true);
  b.text("CNOFF BINARY\n").raw(std::int32_t{4}).raw(std::int32_t{4}).raw(std::int32_t{6});
  for (const auto& x : std::vector<std::array<float, 3>>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}) {
    for (const float c : x) b.raw(c);
    for (int passed_over = 0; passed_over < 7; ++passed_over) b.raw(9.F);
  }
  for (const auto& t : std::vector<std::array<std::int32_t, 3>>{{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}) {
    b.raw(std::int32_t{3});
    for (const auto v : t) b.raw(v);
    b.raw(std::int32_t{1}).raw(0.5F);
  }
  EXPECT_DOUBLE_EQ(enclosed_volume(read(b.str())), 1.0 / 6.0);
}

TEST_F(OffFormat, IsRefusedInOneLineWhereItsHeadLies) {
  const std::string body = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n" + std::string(kFaces);
  EXPECT_THAT(complaint("OFF\n5 4 6\n" + body), HasSubstr("line"));
  EXPECT_THAT(complaint("OFF\n3 4 6\n" + body), HasSubstr("line"));
  EXPECT_THAT(complaint("OFF\n200000000 4 6\n" + body), HasSubstr("200000000 as the number of vertices, but only"));
  EXPECT_THAT(complaint("OFF\n4 200000000 6\n" + body), HasSubstr("as the number of faces, but only"));
  EXPECT_THAT(complaint("OFF\n-4 4 6\n" + body), HasSubstr("expected 0 or more"));
  EXPECT_THAT(complaint("OFF\n4 1 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 4\n"),
              HasSubstr("names vertex 4, expected 0 to 3"));
  EXPECT_THAT(complaint("OFF\n4 1 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n999999 0 1 3\n"), HasSubstr("999999 as the corners"));
  EXPECT_THAT(complaint("nOFF 4\n4 4 6\n" + body), HasSubstr("4 dimensions, expected 3"));
  EXPECT_THAT(complaint("4OFF\n1 0 0\n0 0 0 0\n"), HasSubstr("infinity"));
  EXPECT_THAT(complaint("XOFF\n4 4 6\n" + body), HasSubstr("XOFF"));
}

}  // namespace
}  // namespace limber
