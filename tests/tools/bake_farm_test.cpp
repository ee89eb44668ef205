// limber-precompute --manifest as a user runs it: many bakes, each in a process of its own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "limber/core/file.h"
#include "mesh_files.h"
#include "run_program.h"
#include "sample_meshes.h"
#include "tet_box.h"

namespace limber {
namespace {

namespace fs = std::filesystem;
using limber::testing::ProgramResult;
using limber::testing::run_program;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Json = nlohmann::json;

class BakeFarm : public ::testing::Test {
 protected:
  BakeFarm() {
    for (int i = 1; i <= 3; ++i)
      write_file(folder / name(i), samples::msh2(testing::tet_box(2 + i, 1, 1, {0.3, 0.05, 0.02}), false));
    write_file(folder / "broken.msh", "no mesh\n");
  }
  static std::string name(int i) { return "bar" + std::to_string(i) + ".msh"; }

  ProgramResult run(std::vector<std::string> arguments) const {
    return run_program("limber-precompute", arguments, folder / "");
  }
  /// All four meshes, with the same options. @return the lines of this run
  std::vector<Json> bake_all(std::vector<std::string> more, const std::string& output = "out") const {
    std::vector<std::string> arguments{"--manifest", "*.msh", "-o", output, "--material", "steel", "--modes", "4"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return lines(run(arguments).out);
  }
  static std::vector<Json> lines(const std::string& text) {
    std::vector<Json> all;
    std::istringstream stream(text);
    for (std::string line; std::getline(stream, line);)
      if (line.starts_with("{")) all.push_back(Json::parse(line));
    return all;
  }
  static std::vector<std::string> statuses(const std::vector<Json>& results) {
    std::vector<std::string> all;
    for (const Json& result : results) all.push_back(result["status"]);
    return all;
  }
  std::string bytes(const std::string& file) const { return read_file(folder / file); }
  const samples::Folder folder;
};

TEST_F(BakeFarm, JobsGiveTheBytesOfSingleBakesAndOneThatFailsStopsNone) {
  const ProgramResult many = run({"--manifest", "*.msh", "-o", "out", "--material", "steel", "--modes", "4"});
  EXPECT_EQ(many.exit_code, 1);
  EXPECT_EQ(many.err, "limber-precompute: 1 of 4 jobs failed\n");
  const std::vector<Json> results = lines(many.out);
  EXPECT_THAT(statuses(results), ElementsAre("baked", "baked", "baked", "failed"));
  EXPECT_THAT(results[3]["message"].get<std::string>(), HasSubstr("line 1: seen \"no\""));
  EXPECT_EQ(results[0]["nodes"], 16);
  for (int i = 1; i <= 3; ++i) {
    ASSERT_EQ(run({name(i), "-o", "single.glb", "--material", "steel", "--modes", "4"}).exit_code, 0);
    EXPECT_EQ(bytes("out/bar" + std::to_string(i) + ".glb"), bytes("single.glb")) << i;
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(folder / "out"), fs::directory_iterator()), 3);
}

TEST_F(BakeFarm, AManifestSaysWhatEachJobIsTold) {
  write_file(folder / "jobs.jsonl",
             "{\"mesh\": \"bar1.msh\", \"output\": \"a/one.glb\", \"options\": {\"modes\": 2, \"fix\": "
             "[\"nodes:0\", \"nodes:1\"]}}\n\n"
             "{\"mesh\": \"bar1.msh\", \"output\": \"b/two.glb\", \"options\": {\"material\": \"nylon\", "
             "\"keep-all\": true}}\n");
  const ProgramResult r = run({"--manifest", "jobs.jsonl", "--material", "steel", "--modes", "4"});
  ASSERT_EQ(r.exit_code, 0) << r.err;
  ASSERT_EQ(
      run({"bar1.msh", "-o", "one.glb", "--material", "steel", "--modes", "2", "--fix", "nodes:0", "--fix", "nodes:1"})
          .exit_code,
      0);
  ASSERT_EQ(run({"bar1.msh", "-o", "two.glb", "--material", "nylon", "--modes", "4", "--keep-all"}).exit_code, 0);
  EXPECT_EQ(bytes("a/one.glb"), bytes("one.glb"));
  EXPECT_EQ(bytes("b/two.glb"), bytes("two.glb"));
}

TEST_F(BakeFarm, ShardsAndSingleJobsTogetherAreTheWhole) {
  EXPECT_THAT(statuses(bake_all({"--shard", "1/2"})), ElementsAre("baked", "baked"));
  EXPECT_FALSE(fs::exists(folder / "out/bar2.glb"));
  const std::vector<Json> second = bake_all({"--shard", "2/2", "--at-once", "2"});
  EXPECT_EQ(second.size(), 2U);
  EXPECT_TRUE(fs::exists(folder / "out/bar2.glb"));
  const std::vector<Json> one = bake_all({"--job", "3"}, "alone");
  ASSERT_EQ(one.size(), 1U);
  EXPECT_EQ(one[0]["job"], 3);
  EXPECT_EQ(bytes("alone/bar3.glb"), bytes("out/bar3.glb"));
}

TEST_F(BakeFarm, ResumingLeavesOutWhatIsThereAndMakesAgainWhatIsNot) {
  const auto resumed = [&](std::vector<std::string> more = {}) {
    more.insert(more.end(), {"--results", "r.jsonl", "--resume"});
    const std::size_t before = fs::exists(folder / "r.jsonl") ? lines(bytes("r.jsonl")).size() : 0;
    bake_all(more);
    std::vector<Json> all = lines(bytes("r.jsonl"));
    std::vector<std::string> outputs;
    for (std::size_t i = before; i < all.size(); ++i)
      if (all[i]["status"] == "baked") outputs.push_back(fs::path(all[i]["output"].get<std::string>()).stem());
    return outputs;
  };
  EXPECT_THAT(resumed(), ElementsAre("bar1", "bar2", "bar3"));
  EXPECT_THAT(resumed(), ElementsAre());
  fs::last_write_time(folder / name(1), fs::file_time_type::clock::now());
  EXPECT_THAT(resumed(), ElementsAre()) << "a date is no content";
  write_file(folder / "out/bar2.glb", "cut");
  EXPECT_THAT(resumed(), ElementsAre("bar2"));
  write_file(folder / name(3), samples::msh2(testing::tet_box(3, 1, 1, {0.4, 0.05, 0.02}), false));
  EXPECT_THAT(resumed(), ElementsAre("bar3"));
  EXPECT_THAT(resumed({"--keep-all"}), ElementsAre("bar1", "bar2", "bar3"));
}

TEST_F(BakeFarm, ALineOfResultsThatWasCutOffIsNone) {
  bake_all({"--results", "r.jsonl"});
  const std::string text = bytes("r.jsonl");
  const std::string first = text.substr(0, text.find('\n') + 1), cut = text.substr(first.size(), 40);
  write_file(folder / "r.jsonl", first + cut);
  bake_all({"--results", "r.jsonl", "--resume"});
  const std::string now = bytes("r.jsonl");
  ASSERT_TRUE(now.starts_with(first + cut + "\n"));
  EXPECT_THAT(statuses(lines(now.substr(first.size() + cut.size() + 1))), ElementsAre("baked", "baked", "failed"));
}

TEST_F(BakeFarm, TheCacheGivesTheSameBytesAndADamagedEntryIsMadeAgain) {
  EXPECT_THAT(statuses(bake_all({"--cache", "cache"})), ElementsAre("baked", "baked", "baked", "failed"));
  EXPECT_THAT(statuses(bake_all({"--cache", "cache"}, "again")), ElementsAre("cached", "cached", "cached", "failed"));
  for (const char* file : {"bar1.glb", "bar2.glb", "bar3.glb"})
    EXPECT_EQ(bytes(std::string("out/") + file), bytes(std::string("again/") + file));
  for (const auto& entry : fs::recursive_directory_iterator(folder / "cache"))
    if (entry.path().extension() == ".glb") fs::resize_file(entry.path(), fs::file_size(entry.path()) / 2);
  EXPECT_THAT(statuses(bake_all({"--cache", "cache"}, "third")), ElementsAre("baked", "baked", "baked", "failed"));
  EXPECT_EQ(bytes("out/bar1.glb"), bytes("third/bar1.glb"));
}

TEST_F(BakeFarm, AJobThatTakesTooLongOrTooMuchIsStoppedAndLeavesNothing) {
  const std::vector<Json> slow = bake_all({"--seconds-a-job", "0.001"});
  EXPECT_EQ(slow[0]["status"], "over time");
  const std::vector<Json> large = bake_all({"--megabytes-a-job", "1"});
  EXPECT_NE(large[0]["status"], "baked");
  EXPECT_FALSE(large[0]["message"].get<std::string>().empty());
  EXPECT_TRUE(fs::is_empty(folder / "out"));
}

TEST_F(BakeFarm, AnAssetThatCannotTakeItsPlaceFailsItsJobAlone) {
  fs::create_directories(folder / "out/bar2.glb/kept");
  const std::vector<Json> results = bake_all({});
  EXPECT_THAT(statuses(results), ElementsAre("baked", "failed", "baked", "failed"));
  EXPECT_THAT(results[1]["message"].get<std::string>(), HasSubstr("bar2.glb"));
  EXPECT_TRUE(fs::exists(folder / "out/bar2.glb/kept"));
}

TEST_F(BakeFarm, ThePageShowsEachAssetAndGroupsWhatFailed) {
  write_file(folder / "broken2.msh", "no mesh either\n");
  bake_all({"--results", "r.jsonl"});
  const ProgramResult r = run({"--summary", "r.jsonl", "-o", "page.html"});
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const std::string page = bytes("page.html");
  EXPECT_THAT(page, HasSubstr("3 of 5 assets baked"));
  EXPECT_THAT(page, HasSubstr("2 × failed: &quot;…&quot;: line #: seen &quot;…&quot;"));
  std::size_t pictures = 0;
  for (std::size_t at = 0; (at = page.find("data:image/png;base64,iVBORw0KGgo", at)) != std::string::npos; ++at)
    ++pictures;
  EXPECT_EQ(pictures, 3U);
}

struct WrongUse {
  const char* name;
  std::string manifest;
  std::vector<std::string> arguments;
  const char* message;
  int exit_code;
};

class WrongBakeFarm : public BakeFarm, public ::testing::WithParamInterface<WrongUse> {};

TEST_P(WrongBakeFarm, IsOneLineBeforeAnythingIsBaked) {
  write_file(folder / "jobs.jsonl", GetParam().manifest);
  std::vector<std::string> arguments{"--material", "steel", "--manifest", "jobs.jsonl"};
  arguments.insert(arguments.end(), GetParam().arguments.begin(), GetParam().arguments.end());
  const ProgramResult r = run(arguments);
  EXPECT_EQ(r.exit_code, GetParam().exit_code);
  EXPECT_THAT(r.err, HasSubstr(GetParam().message));
  EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1);
  EXPECT_FALSE(fs::exists(folder / "a.glb"));
}

const std::string kGood = "{\"mesh\": \"bar1.msh\", \"output\": \"a.glb\"}\n";

INSTANTIATE_TEST_SUITE_P(
    Uses, WrongBakeFarm,
    ::testing::Values(
        WrongUse{
            "NoJson", kGood + "bar2.msh\n", {}, "jobs.jsonl: line 2: no JSON; a manifest has one object a line", 1},
        WrongUse{"SameOutput", kGood + kGood, {}, "line 2: the output", 1},
        WrongUse{"NoOutput", kGood + "{\"mesh\": \"bar2.msh\"}\n", {}, "line 2: \"output\" is missing", 1},
        WrongUse{"UnknownOption",
                 kGood + "{\"mesh\": \"bar2.msh\", \"output\": \"b.glb\", \"options\": {\"mode\": 3}}\n",
                 {},
                 "line 2: the option \"mode\" is unknown; did you mean \"modes\"?",
                 1},
        WrongUse{"UnknownKey", "{\"mesh\": \"bar2.msh\", \"out\": \"b.glb\"}\n", {}, "line 1: the key \"out\"", 1},
        WrongUse{"ShardOutOfRange", kGood, {"--shard", "3/2"}, "--shard 3/2: expected I/N", 2},
        WrongUse{"JobOutOfRange", kGood, {"--job", "2"}, "--job 2: jobs.jsonl has 1 jobs", 2},
        WrongUse{"Empty", "\n", {}, "jobs.jsonl: has no jobs", 1}),
    [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace limber
