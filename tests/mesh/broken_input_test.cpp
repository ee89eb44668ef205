// Wrong files: one clear line each, whatever is wrong, and never anything but InputError.
#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <random>

#include "broken_meshes.h"
#include "limber/core/error.h"
#include "limber/mesh/read_mesh.h"

namespace limber {
namespace {

using namespace samples;
using ::testing::HasSubstr;

/// What reading says, empty if it goes well.
std::string complaint(const fs::path& path) {
  Warnings warnings;
  try {
    read_mesh(path, warnings);
  } catch (const InputError& e) {
    return e.what();
  }
  return {};
}

void expect_one_clear_line(const fs::path& path, const std::string& says) {
  const std::string message = complaint(path);
  EXPECT_FALSE(message.empty()) << "no error";
  EXPECT_THAT(message, HasSubstr(path.string()));
  EXPECT_THAT(message, HasSubstr(says));
  EXPECT_EQ(message.find_first_of("\n\r"), std::string::npos) << message;
  EXPECT_LT(message.size(), path.string().size() + 400);
}

TEST(BrokenFile, SaysWhereWhatWasSeenAndWhatWasExpected) {
  const Folder folder;
  const auto all = broken_meshes();
  ASSERT_GE(all.size(), 60u);
  for (const Broken& b : all) {
    SCOPED_TRACE(b.name);
    expect_one_clear_line(folder.write(b.name, b.bytes), b.says);
  }
}

TEST(BrokenFile, OfTetgenNamesTheFileOfThePairThatIsWrong) {
  const Folder folder;
  const auto node = tetgen_node(two_cubes(), 1), ele = tetgen_ele(two_cubes(), 1);
  const auto expect = [&](const std::string& n, const std::string& e, const std::string& wrong,
                          const std::string& says) {
    folder.write("pair.node", n);
    folder.write("pair.ele", e);
    for (const char* given : {"pair.node", "pair.ele"}) {
      const auto message = complaint(folder / given);
      EXPECT_THAT(message, HasSubstr((folder / wrong).string()));
      EXPECT_THAT(message, HasSubstr(says));
      EXPECT_EQ(message.find('\n'), std::string::npos);
    }
  };
  expect(with(node, "13 3 1 1", "13 2 1 1"), ele, "pair.node", "seen 2, expected a dimension");
  expect(with(node, "\n1 0 0 0", "\n2 0 0 0"), ele, "pair.node", "seen 2, expected a node number from 0 to 1");
  expect(with(node, "\n3 ", "\n4 "), ele, "pair.node", "seen 4, expected a node number from 3 to 3");
  expect(with(node, "13 3", "12 3"), ele, "pair.node", "the head counts fewer nodes");
  expect(with(node, "13 3", "1300000 3"), ele, "pair.node", "bytes follow");
  expect(node, with(ele, "12 4 1", "12 10 1"), "pair.ele", "expected a node from 1 to 13");
  expect(node, with(ele, "\n1 1 ", "\n1 0 "), "pair.ele", "seen 0, expected a node from 1 to 13");
  expect(node, with(ele, " 21\n", " 21.5\n"), "pair.ele", "expected a whole number as region attribute");
  expect(node, cut(ele, 0.6), "pair.ele", "");
  fs::remove(folder / "pair.ele");
  EXPECT_THAT(complaint(folder / "pair.node"), HasSubstr((folder / "pair.ele").string() + "\": No such file"));
}

TEST(BrokenFile, ThatIsNoReadableFileIsTold) {
  const Folder folder;
  for (const char* extension : {".msh", ".mesh", ".vtk", ".node", ".obj", ".stl", ".ply", ".xyz"}) {
    SCOPED_TRACE(extension);
    expect_one_clear_line(folder / (std::string("missing") + extension), "No such file");
    expect_one_clear_line(folder.write(std::string("empty") + extension, ""),
                          extension == std::string(".node") ? "" : "empty");
    fs::create_directory(folder / (std::string("folder") + extension));
    expect_one_clear_line(folder / (std::string("folder") + extension),
                          extension == std::string(".node") ? "" : "directory");
  }
  expect_one_clear_line(folder.write("cube.step", "ISO-10303-21;"), "the format is not known, expected Gmsh .msh");
  if (::geteuid() == 0) return;  // root reads everything
  const auto locked = folder.write("locked.obj", obj(cube_surface()));
  ::chmod(locked.c_str(), 0);
  expect_one_clear_line(locked, "Permission denied");
}

TEST(BrokenFile, OfTheOtherKindIsTold) {
  const Folder folder;
  Warnings warnings;
  const auto tets = folder.write("tets.msh", msh2(two_cubes(), true));
  const auto message_of = [](const auto& read) {
    try {
      read();
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  EXPECT_THAT(message_of([&] { read_surface_mesh(tets, warnings); }),
              HasSubstr("holds tetrahedra, expected a surface"));
}

/// All samples, small: damage can be tried at every place.
std::vector<Sample> all_samples() {
  auto all = tet_samples();
  for (const Sample& s : surface_samples()) all.push_back(s);
  return all;
}

/// Reading either works or throws InputError with one line. @return whether it threw
bool survives(const Folder& folder, const Sample& sample) {
  const auto path = sample.write(folder);
  const auto message = complaint(path);  // anything but InputError fails the test by itself
  EXPECT_EQ(message.find_first_of("\n\r"), std::string::npos) << message;
  return !message.empty();
}

TEST(DamagedFile, CutAnywhereIsAnErrorOrStillAMesh) {
  const Folder folder;
  for (const Sample& whole : all_samples()) {
    SCOPED_TRACE(whole.name);
    std::size_t refused = 0;
    for (std::size_t length = 1; length < whole.bytes.size(); ++length) {
      Sample part = whole;
      part.bytes.resize(length);
      refused += survives(folder, part) ? 1 : 0;
    }
    // Only a cut in the last line or in data that limber does not use can go unseen.
    EXPECT_GT(refused, whole.bytes.size() * 2 / 3);
  }
}

TEST(DamagedFile, WithFlippedBitsIsAnErrorOrStillAMesh) {
  const Folder folder;
  std::mt19937 random(20030611);
  for (const Sample& whole : all_samples()) {
    SCOPED_TRACE(whole.name);
    for (int trial = 0; trial < 1000; ++trial) {
      Sample damaged = whole;
      for (int flips = 1 + trial % 3; flips > 0; --flips)
        damaged.bytes[random() % damaged.bytes.size()] ^= static_cast<char>(1u << random() % 8);
      survives(folder, damaged);
    }
  }
}

}  // namespace
}  // namespace limber
