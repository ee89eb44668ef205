#include <gmock/gmock.h>

#include "limber/core/error.h"
#include "limber/mesh_assimp/read_motion_clip.h"
#include "limber/mesh_assimp/read_surface_mesh.h"
#include "same_mesh.h"
#include "sample_meshes.h"

namespace limber {
namespace {

using namespace samples;
using ::testing::HasSubstr;

std::string off(const SurfaceMesh& s) {
  std::string out = "OFF\n" + std::to_string(s.vertices.size()) + " " + std::to_string(s.triangles.size()) + " 0\n";
  for (const Vec3& x : s.vertices) out += joined(x) + "\n";
  for (const Triangle& t : s.triangles) out += "3" + joined(t) + "\n";
  return out;
}

/// The unit cube as glTF with its buffer beside it, shown by two nodes: one moved to x = 2, one mirrored in x.
void write_gltf(const Folder& folder) {
  const auto cube = cube_surface();
  Bytes b;
  for (const Vec3& x : cube.vertices)
    for (int a = 0; a < 3; ++a) b.raw(static_cast<float>(x[a]));
  for (const Triangle& t : cube.triangles)
    for (const Index v : t) b.raw(static_cast<std::uint16_t>(v));
  folder.write("cube.bin", b.str());
  folder.write("cubes.gltf", R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
    "nodes": [{"mesh": 0, "translation": [2, 0, 0]}, {"mesh": 0, "scale": [-1, 1, 1]}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": [0,0,0], "max": [1,1,1]},
                  {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"}],
    "bufferViews": [{"buffer": 0, "byteLength": 96}, {"buffer": 0, "byteOffset": 96, "byteLength": 72}],
    "buffers": [{"uri": "cube.bin", "byteLength": 168}]})");
}

/// Two bones; the second turns about z by 90 degrees in the second frame, when the first has moved.
const char* const kBvh = R"(HIERARCHY
ROOT hips
{
  OFFSET 1 2 3
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT arm
  {
    OFFSET 10 0 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 5 0 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.25
1 2 3 0 0 0 0 0 0
4 2 3 0 0 0 90 0 0
)";

TEST(MotionClip, HasJointsWhereTheirAnglesPutThem) {
  const Folder folder;
  const MotionClip clip = read_motion_clip(folder.write("clip.bvh", kBvh));
  ASSERT_EQ(clip.joints.size(), 3u);
  EXPECT_EQ(clip.joints[1].name, "arm");
  EXPECT_EQ(clip.joints[2].parent, 1);
  EXPECT_LT((clip.joints[2].rest.p - Vec3(16, 2, 3)).norm(), 1e-5);
  ASSERT_EQ(clip.times, (std::vector<double>{0.0, 0.25}));
  EXPECT_LT((clip.poses[0][2].p - Vec3(16, 2, 3)).norm(), 1e-5);
  EXPECT_LT((clip.poses[1][1].p - Vec3(14, 2, 3)).norm(), 1e-5);
  EXPECT_LT((clip.poses[1][2].p - Vec3(14, 7, 3)).norm(), 1e-5);
}

TEST(MotionClip, CutAnywhereItIsRefusedInOneLine) {
  const Folder folder;
  const std::string whole = kBvh;
  for (std::size_t length = 1; length < whole.size() - 6; length += 7) try {
      read_motion_clip(folder.write("cut.bvh", whole.substr(0, length)));
      ADD_FAILURE() << "taken: " << length << " of " << whole.size();
    } catch (const InputError& e) {
      EXPECT_THAT(e.what(), HasSubstr("cut.bvh"));
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
    }
  EXPECT_THROW(read_motion_clip(folder.write("cube.off", off(cube_surface()))), InputError);
}

TEST(AssimpReader, GivesTheSameSurfaceFromOff) {
  const Folder folder;
  Warnings warnings;
  const auto s = read_any_surface_mesh(folder.write("cube.off", off(cube_surface())), warnings);
  EXPECT_EQ(corner_positions(s), corner_positions(cube_surface()));
  EXPECT_EQ(s.vertices.size(), 8u);
}

TEST(AssimpReader, PlacesMeshesByTheirNodesAndKeepsTheOutsideOut) {
  const Folder folder;
  write_gltf(folder);
  Warnings warnings;
  const auto s = read_any_surface_mesh(folder / "cubes.gltf", warnings);
  const auto quality = surface_quality(s);
  EXPECT_TRUE(quality.closed_manifold());
  EXPECT_EQ(quality.components, 2);
  EXPECT_DOUBLE_EQ(enclosed_volume(s), 2.0);  // were the mirrored one inside out, 0
  double low = 0.0, high = 0.0;
  for (const Vec3& x : s.vertices) low = std::min(low, x[0]), high = std::max(high, x[0]);
  EXPECT_DOUBLE_EQ(low, -1.0);
  EXPECT_DOUBLE_EQ(high, 3.0);
  EXPECT_THAT(warnings, ::testing::IsEmpty());
}

TEST(AssimpReader, AgreesWithLimbersOwnReaders) {
  const Folder folder;
  for (const Sample& sample : surface_samples()) {
    if (sample.name.starts_with("binary") || sample.name.ends_with(".ply"))
      continue;  // Assimp takes neither as they are
    SCOPED_TRACE(sample.name);
    Warnings warnings;
    const auto path = sample.write(folder);
    EXPECT_EQ(corner_positions(read_surface_mesh_with_assimp(path, warnings)),
              corner_positions(read_surface_mesh(path, warnings)));
  }
}

TEST(AssimpReader, ReadsTheModelsOfGlmark) {
  const fs::path models = "/usr/share/glmark2/models";
  if (!fs::exists(models)) GTEST_SKIP() << "Debian package glmark2-data is not installed";
  Warnings warnings;
  const auto cube = read_any_surface_mesh(models / "cube.3ds", warnings);
  EXPECT_TRUE(surface_quality(cube).closed_manifold());
  EXPECT_NEAR(enclosed_volume(cube), 8.0, 1e-5);  // a cube of side 2, in floats
  for (const char* soup : {"cat.3ds", "horse.3ds"}) {
    const auto s = read_any_surface_mesh(models / soup, warnings);
    EXPECT_GT(s.triangles.size(), 5000u) << soup;
    EXPECT_FALSE(surface_quality(s).closed_manifold()) << soup;
  }
}

TEST(AssimpReader, FailsInOneLineAndPrintsNothing) {
  const Folder folder;
  const auto message_of = [](const fs::path& path) {
    Warnings warnings;
    try {
      read_any_surface_mesh(path, warnings);
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  for (const auto& [name, bytes] :
       std::vector<std::pair<std::string, std::string>>{{"cut.gltf", R"({"asset": {"version": "2.0")"},
                                                        {"junk.glb", std::string("glTF\2\0\0\0\xff\xff\xff\xff", 12)},
                                                        {"cut.off", "OFF\n3 1 0\n0 0 0\n1 0"},
                                                        {"points.off", "OFF\n1 0 0\n0 0 0\n"},
                                                        {"what.3ds", "MM\xff\xff\xff\xff"},
                                                        {"nothing.xyzzy", "hello"}}) {
    const auto message = message_of(folder.write(name, bytes));
    EXPECT_THAT(message, HasSubstr((folder / name).string()));
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }
  EXPECT_THAT(message_of(folder / "missing.glb"), HasSubstr("No such file"));
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

/// Assimp 5.2 leaves a pointer unset on two groups of RAW.
TEST(AssimpReader, TellsInOneLineWhereAssimpBreaksDown) {
  const Folder folder;
  const auto path = folder.write("two.raw", "a\n0 0 0 1 0 0 0 1 0\nb\n0 0 1 1 0 1 0 1 1\n");
  for (int trial = 0; trial < 3; ++trial) {
    Warnings warnings;
    std::string message;
    try {
      // Another Assimp may read it; what counts is that this process lives.
      EXPECT_EQ(read_any_surface_mesh(path, warnings).triangles.size(), 2u);
    } catch (const InputError& e) {
      message = e.what();
    }
    if (message.empty()) continue;
    EXPECT_THAT(message, HasSubstr("two.raw"));
    EXPECT_EQ(message.find('\n'), std::string::npos);
  }
}

TEST(AnyMesh, IsTetsOrASurface) {
  const Folder folder;
  Warnings warnings;
  EXPECT_TRUE(std::holds_alternative<TetMesh>(read_any_mesh(folder.write("a.msh", msh2(two_cubes(), true)), warnings)));
  EXPECT_TRUE(std::holds_alternative<SurfaceMesh>(read_any_mesh(folder.write("a.off", off(cube_surface())), warnings)));
}

}  // namespace
}  // namespace limber
