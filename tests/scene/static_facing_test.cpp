// Static meshes that look the wrong way: closed ones are turned, open ones are told.
#include <gmock/gmock.h>

#include <filesystem>

#include "block_model.h"
#include "limber/core/file.h"
#include "limber/mesh/surface_mesh.h"
#include "limber/scene/scene_model.h"

namespace limber {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const std::string kCorners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n";
const std::string kClosed = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
const std::string kInsideOut = "f 2 4 3 1\nf 7 8 6 5\nf 5 6 2 1\nf 4 8 7 3\nf 3 7 5 1\nf 6 8 4 2\n";

class StaticFacing : public ::testing::Test {
 protected:
  SceneModels models(const std::string& faces, const std::string& more = "") const {
    write_file(file_, kCorners + faces);
    const std::string scene =
        R"({"step": 0.01, "steps": 1, "contact": {}, "assets": {"block": "some/block.glb"},
            "bodies": [{"name": "b", "asset": "block"}],
            "statics": [{"name": "slab", "shape": {"mesh": {"file": ")" +
        file_.filename().string() + "\"}}" + more + "}]}";
    return make_models(parse_scene(scene, "\"test.json\"", file_.parent_path()), {{"block", testing::block_asset(1)}});
  }
  static double volume(const SceneModels& m) {
    const auto& mesh = std::get<TriangleMesh>(*m.shape_of_static[0]);
    return enclosed_volume({mesh.vertices, mesh.triangles});
  }
  ~StaticFacing() override { std::filesystem::remove(file_); }

 private:
  std::filesystem::path file_ =
      std::filesystem::path(::testing::TempDir()) /
      (std::string("limber_facing_") + ::testing::UnitTest::GetInstance()->current_test_info()->name() + ".obj");
};

TEST_F(StaticFacing, AClosedMeshInsideOutIsTurnedWithAWarning) {
  const SceneModels turned = models(kInsideOut), right = models(kClosed);
  EXPECT_NEAR(volume(turned), 1.0, 1e-15);
  EXPECT_THAT(turned.warnings, ElementsAre(HasSubstr("1 closed shells were inside out")));
  EXPECT_NEAR(volume(right), 1.0, 1e-15);
  EXPECT_THAT(right.warnings, IsEmpty());
}

TEST_F(StaticFacing, AnOpenMeshThatLooksDownIsTold) {
  EXPECT_THAT(models("f 1 3 4 2\n").warnings, Contains(HasSubstr("passes through")));
  EXPECT_THAT(models("f 2 4 3 1\n").warnings, Not(Contains(HasSubstr("passes through"))));
  // Turned over by its placement; a wall.
  EXPECT_THAT(models("f 2 4 3 1\n", R"(, "orientation": [0, 1, 0, 0])").warnings,
              Contains(HasSubstr("passes through")));
  EXPECT_THAT(models("f 1 3 7 5\n").warnings, Not(Contains(HasSubstr("passes through"))));
}

}  // namespace
}  // namespace limber
