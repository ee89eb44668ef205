// limber-benchmark's long programs as a user runs them, made short: what they tell and write as they go.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "run_program.h"

namespace limber {
namespace {

using ::testing::HasSubstr;
using testing::ProgramResult;

class BenchmarkProgram : public ::testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directories(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  ProgramResult run(const std::vector<std::string>& arguments) const {
    return testing::run_program("limber-benchmark", arguments, folder_);
  }
  std::string bytes(const std::string& name) const {
    std::ostringstream s;
    s << std::ifstream(folder_ / name).rdbuf();
    return s.str();
  }
  std::ptrdiff_t lines(const std::string& name) const {
    const std::string text = bytes(name);
    return std::count(text.begin(), text.end(), '\n');
  }
  nlohmann::json json(const std::string& name) const { return nlohmann::json::parse(bytes(name)); }
  bool exists(const std::string& name) const { return std::filesystem::exists(folder_ / name); }

  /// One folder a test: tests run side by side.
  const std::filesystem::path folder_ =
      std::filesystem::path(::testing::TempDir()) /
      (std::string("limber_benchmark_") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
};

TEST_F(BenchmarkProgram, SoakTellsOfEachSeedWhichLawsItsStepsKept) {
  const ProgramResult r = run({"soak", "--steps", "20", "--seed", "1,2", "--csv", "s.csv", "--report", "s.json"});
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const auto report = json("s.json");
  ASSERT_EQ(report.at("seeds").size(), 2u);
  long broken = 0;
  for (const auto& seed : report.at("seeds")) {
    EXPECT_EQ(seed.at("steps"), 20);
    EXPECT_EQ(seed.at("laws").at("finite").at("broken"), 0);
    for (const auto& law : seed.at("laws")) broken += law.at("broken").get<long>();
  }
  EXPECT_EQ(lines("s.csv"), 1 + broken);
  EXPECT_FALSE(exists("s.csv.part"));
}

TEST_F(BenchmarkProgram, StabilityTellsEachSceneAndWritesEachCase) {
  const ProgramResult r = run({"stability", "--random", "0", "--scene", "flight,handle", "--every", "40", "--steps",
                               "2", "--csv", "s.csv", "--report", "s.json"});
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(r.out, HasSubstr("flight: "));
  EXPECT_THAT(r.out, HasSubstr("handle: "));
  EXPECT_EQ(lines("s.csv"), 1 + json("s.json").at("cases").get<long>());
  EXPECT_FALSE(exists("s.csv.part"));
}

/// A run that fails at its end leaves the rows that it came to.
TEST_F(BenchmarkProgram, WhatFailsLeavesItsRows) {
  std::ofstream(folder_ / "limits.json") << "{}";
  const ProgramResult r = run({"stability", "--random", "0", "--scene", "flight", "--every", "40", "--steps", "2",
                               "--csv", "s.csv", "--check", "limits.json"});
  EXPECT_EQ(r.exit_code, 1);
  EXPECT_FALSE(exists("s.csv"));
  EXPECT_GT(lines("s.csv.part"), 1);
}

}  // namespace
}  // namespace limber
