// limber-precompute with limber-eigen on several processes, against ARPACK's route.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>

#include "limber/core/file.h"
#include "mesh_files.h"
#include "run_program.h"
#include "sample_meshes.h"
#include "tet_box.h"

namespace limber {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using Report = nlohmann::json;

struct Engines : ::testing::Test {
  const samples::Folder folder;

  void SetUp() override {
    if (!fs::exists(fs::path(LIMBER_BIN_DIR) / "limber-eigen"))
      GTEST_SKIP() << "limber-eigen is not built: MPI or SLEPc is missing";
    // A square section, whose bending modes come in pairs.
    write_file(folder / "bar.msh", samples::msh2(testing::tet_box(10, 3, 3, {0.5, 0.1, 0.1}), false));
  }
  testing::ProgramResult run(std::vector<std::string> arguments, std::vector<std::string> more = {}) const {
    arguments.insert(arguments.end(), more.begin(), more.end());
    return testing::run_program("limber-precompute", arguments, folder / "");
  }
  Report report(const std::vector<std::string>& arguments, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> all = arguments;
    for (const char* a : {"-o", "asset.glb", "--report", "report.json"}) all.emplace_back(a);
    const testing::ProgramResult r = run(all, more);
    EXPECT_EQ(r.exit_code, 0) << r.err;
    return r.exit_code == 0 ? Report::parse(read_file(folder / "report.json")) : Report();
  }
  void expect_equal_frequencies(const std::vector<std::string>& arguments,
                                const std::vector<std::string>& processes) const {
    const auto expected = report(arguments)["frequencies_hz"].get<std::vector<double>>();
    for (const std::string& n : processes) {
      const Report r = report(arguments, {"--engine", "slepc", "--processes", n});
      ASSERT_TRUE(r.is_object());
      EXPECT_TRUE(r["certified"]);
      EXPECT_EQ(r["engine"]["peak_memory_bytes"].size(), std::stoul(n));
      const auto found = r["frequencies_hz"].get<std::vector<double>>();
      ASSERT_EQ(found.size(), expected.size()) << n;
      for (std::size_t i = 0; i < found.size(); ++i)
        EXPECT_NEAR(found[i], expected[i], 1e-9 * expected[i]) << n << " processes, mode " << i;
    }
  }
  /// Orthonormal columns that span the modes of a file with one slice.
  Eigen::MatrixXd span_of(const std::string& file) const {
    const std::string bytes = read_file(folder / file);
    const std::size_t line = bytes.find('\n') + 1;
    const Report body = Report::parse(bytes.substr(0, line))["bodies"][0];
    const Eigen::Index modes = body["below_high"].get<int>() - body["below_low"].get<int>(),
                       rows = 3 * body["nodes"].get<int>();
    Eigen::MatrixXd W(rows, modes);
    std::memcpy(W.data(), bytes.data() + line + sizeof(double) * modes, sizeof(double) * W.size());
    return Eigen::HouseholderQR<Eigen::MatrixXd>(W).householderQ() * Eigen::MatrixXd::Identity(rows, modes);
  }
};

TEST_F(Engines, FindTheSameFrequenciesOnOneTwoAndFourProcesses) {
  expect_equal_frequencies({"bar.msh", "--material", "steel", "--modes", "20"}, {"1", "2"});
  expect_equal_frequencies({"bar.msh", "--material", "steel", "--modes", "6"}, {"4"});
}

TEST_F(Engines, AgreeAboutTwoBodiesAndFixedNodes) {
  const fs::path cases = fs::path(LIMBER_SOURCE_DIR) / "tests/data/reference-modal";
  for (const char* name : {"two_bodies", "pinned_node"}) {
    const Report reference = Report::parse(read_file(cases / (std::string(name) + ".json")));
    std::vector<std::string> arguments = {(cases / reference["mesh"].get<std::string>()).string(),
                                          "--material",
                                          "steel",
                                          "--modes",
                                          "10",
                                          "--mass",
                                          "consistent"};
    if (reference["fixed"].is_object())
      arguments.insert(arguments.end(),
                       {"--fix", "nodes:" + std::to_string(reference["fixed"]["nodes_index0"][0].get<int>())});
    expect_equal_frequencies(arguments, {"2"});
  }
}

TEST_F(Engines, WithoutAFactorFindTheSameAndProveNothing) {
  const std::vector<std::string> bar = {"bar.msh", "--material", "steel", "--modes", "8"};
  const auto expected = report(bar)["frequencies_hz"].get<std::vector<double>>();
  const Report r = report(bar, {"--engine", "lobpcg"});
  ASSERT_TRUE(r.is_object());
  EXPECT_FALSE(r["certified"]);
  const auto found = r["frequencies_hz"].get<std::vector<double>>();
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], expected[i], 1e-9 * expected[i]) << i;
}

TEST_F(Engines, AreAskedForBeforeAnyWork) {
  const std::string path = std::getenv("PATH");
  ::setenv("PATH", (folder / "").c_str(), 1);
  const testing::ProgramResult r = run({"missing.msh", "--engine", "slepc", "-o", "a.glb"});
  ::setenv("PATH", path.c_str(), 1);
  EXPECT_NE(r.exit_code, 0);
  EXPECT_THAT(r.err, HasSubstr("mpirun is not on PATH"));
}

TEST_F(Engines, SlicesOfBothSpanTheSameModesAndJoin) {
  const std::vector<std::string> bar = {"bar.msh", "--material", "steel"};
  const auto whole = report(bar, {"--modes", "30"})["frequencies_hz"].get<std::vector<double>>();
  const auto middle = [&](std::size_t i) { return std::to_string(0.5 * (whole[i] + whole[i + 1])); };
  const std::string cut = middle(9), end = middle(21);
  const std::vector<std::string> upper = {"--slice", cut + "," + end, "--of", "2"}, slepc = {"--engine", "slepc"};
  EXPECT_EQ(run(bar, {"--slice", "0," + cut, "--of", "2", "-o", "low"}).exit_code, 0);
  auto with_output = [&](std::vector<std::string> more, const std::string& output) {
    more.insert(more.end(), upper.begin(), upper.end());
    more.insert(more.end(), {"-o", output});
    return run(bar, more);
  };
  EXPECT_EQ(with_output({}, "arpack").exit_code, 0);
  const testing::ProgramResult r = with_output({"--engine", "slepc", "--processes", "2"}, "slepc");
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const Eigen::MatrixXd A = span_of("arpack"), B = span_of("slepc");
  ASSERT_EQ(A.cols(), B.cols());
  EXPECT_LT(Eigen::JacobiSVD<Eigen::MatrixXd>(B - A * (A.transpose() * B)).singularValues()[0], 1e-7);
  EXPECT_EQ(report(bar, {"--merge", "low", "--merge", "slepc"})["frequencies_hz"].size(), 22u);
}

/// limber-eigen on two processes, the second of which may be another file.
struct ManyProcesses : Engines {
  void SetUp() override {
    Engines::SetUp();
    if (IsSkipped()) return;
    ASSERT_EQ(run({"bar.msh", "--material", "steel", "--bodies", "-o", "bar.bodies"}).exit_code, 0);
  }
  std::string error(const std::string& second = (fs::path(LIMBER_BIN_DIR) / "limber-eigen").string()) const {
    std::vector<std::string> arguments = {"--quiet", "--oversubscribe", "--allow-run-as-root", "-n", "1"};
    const std::vector<std::string> options = {"bar.bodies", "--modes", "10", "-o", "slices"};
    arguments.push_back((fs::path(LIMBER_BIN_DIR) / "limber-eigen").string());
    arguments.insert(arguments.end(), options.begin(), options.end());
    arguments.insert(arguments.end(), {":", "-n", "1", second});
    arguments.insert(arguments.end(), options.begin(), options.end());
    const testing::ProgramResult r = testing::run_program("/usr/bin/mpirun", arguments, folder / "");
    EXPECT_NE(r.exit_code, 0);
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
    EXPECT_FALSE(fs::exists(folder / "slices"));
    return r.err;
  }
};

TEST_F(ManyProcesses, RefuseABodyThatWasCutOffOrDamaged) {
  const std::string whole = read_file(folder / "bar.bodies");
  write_file(folder / "bar.bodies", std::string_view(whole).substr(0, whole.size() - 100));
  EXPECT_THAT(error(), HasSubstr("bar.bodies\": has " + std::to_string(whole.size() - 100) + " bytes"));
  std::string damaged = whole;
  damaged[whole.size() - 100] ^= 1;
  write_file(folder / "bar.bodies", damaged);
  EXPECT_THAT(error(), HasSubstr("damaged"));
}

TEST_F(ManyProcesses, RefuseDifferentBuilds) {
  const fs::path other = folder / "other";
  fs::copy(fs::path(LIMBER_BIN_DIR) / "limber-eigen", other);
  std::ofstream(other, std::ios::app) << ' ';
  EXPECT_THAT(error(other.string()), HasSubstr("process 1 has another build"));
}

TEST_F(Engines, TellWhatIsWrongInOneLineAndLeaveNothingBehind) {
  const auto error = [&](const std::vector<std::string>& more) {
    const testing::ProgramResult r = run({"bar.msh", "--material", "steel", "-o", "a.glb"}, more);
    EXPECT_NE(r.exit_code, 0);
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
    EXPECT_EQ(std::distance(fs::directory_iterator(folder / ""), fs::directory_iterator()), 1);
    return r.err;
  };
  EXPECT_THAT(error({"--engine", "slepc", "--modes", "400"}), HasSubstr("use --engine arpack"));
  EXPECT_THAT(error({"--processes", "2"}), HasSubstr("--engine"));
  EXPECT_THAT(error({"--bodies", "--engine", "slepc"}), HasSubstr("--bodies excludes --engine"));
}

TEST_F(Engines, SayWhatIsLostWithAProcessThatIsKilled) {
  const fs::path mpirun = folder / "mpirun";
  std::ofstream(mpirun) << "#!/bin/sh\nexec /usr/bin/mpirun --quiet --oversubscribe --allow-run-as-root -n 2 sh -c "
                           "'test $OMPI_COMM_WORLD_RANK = 0 || kill -9 $$; sleep 5'\n";
  fs::permissions(mpirun, fs::perms::owner_all);
  const std::string path = std::getenv("PATH");
  ::setenv("PATH", (mpirun.parent_path().string() + ":" + path).c_str(), 1);
  const testing::ProgramResult r =
      run({"bar.msh", "--material", "steel", "--engine", "slepc", "--processes", "2", "-o", "a.glb"});
  ::setenv("PATH", path.c_str(), 1);
  EXPECT_EQ(r.exit_code, 1);
  EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
  EXPECT_THAT(r.err, HasSubstr("one of 2 processes was ended, as for lack of memory: its factor and modes are lost"));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder / ""), fs::directory_iterator()), 2);
}

}  // namespace
}  // namespace limber
