// The frame that all programs share: exit codes, one line per error, files that appear whole or not at all.
#include "program.h"

#include <gtest/gtest.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "limber/core/error.h"

namespace limber::tools {
namespace {

namespace fs = std::filesystem;

class ProgramTest : public ::testing::Test {
 protected:
  ProgramTest() : program_("limber-test", "Tests the frame.") {
    program_.options().add_option("--steps", steps_, "how many")->type_name("N");
    program_.options().add_option("--mass", mass_, "how heavy")->type_name("KG")->check(positive_number());
    folder_ = fs::path(::testing::TempDir()) / ::testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    fs::create_directory(folder_);
  }
  ~ProgramTest() override { fs::remove_all(folder_); }

  /// @return the exit code; stdout and stderr are in out_ and err_
  int run(
      std::vector<std::string> arguments, const std::function<void()>& work = [] {}) {
    arguments.insert(arguments.begin(), "limber-test");
    std::vector<const char*> argv;
    for (const auto& a : arguments) argv.push_back(a.c_str());
    ::testing::internal::CaptureStdout();
    ::testing::internal::CaptureStderr();
    const int code = program_.run(static_cast<int>(argv.size()), argv.data(), work);
    out_ = ::testing::internal::GetCapturedStdout();
    err_ = ::testing::internal::GetCapturedStderr();
    return code;
  }

  void expect_one_line_error(const std::string& holds) const {
    EXPECT_EQ(std::count(err_.begin(), err_.end(), '\n'), 1) << err_;
    EXPECT_TRUE(err_.starts_with("limber-test: ")) << err_;
    EXPECT_NE(err_.find(holds), std::string::npos) << err_;
  }

  bool folder_is_empty() const { return fs::is_empty(folder_); }
  std::string in_folder(const std::string& name) const { return (folder_ / name).string(); }

  Program program_;
  int steps_ = 0;
  double mass_ = 1.0;
  fs::path folder_;
  std::string out_, err_;
};

TEST_F(ProgramTest, HelpNamesOptionsUnitsAndExitCodes) {
  EXPECT_EQ(run({"--help"}), 0);
  for (const char* word : {"--mass KG", "--report FILE.json", "--version", "Exit codes"})
    EXPECT_NE(out_.find(word), std::string::npos) << word << "\n" << out_;
  EXPECT_TRUE(err_.empty());
}

TEST_F(ProgramTest, VersionIsOneLine) {
  EXPECT_EQ(run({"--version"}), 0);
  EXPECT_EQ(out_, program_.name_and_version() + "\n");
}

TEST_F(ProgramTest, AnUnknownOptionNamesTheNearestOne) {
  EXPECT_EQ(run({"--stesp=3"}), 2);
  expect_one_line_error("did you mean \"--steps\"");
}

TEST_F(ProgramTest, AStrayArgumentIsWrongUsage) {
  EXPECT_EQ(run({"stray"}), 2);
  expect_one_line_error("\"stray\" was not expected");
}

TEST_F(ProgramTest, WrongNumbersAreWrongUsage) {
  for (const char* bad : {"nan", "inf", "-1", "0", "heavy", "1e999"}) {
    EXPECT_EQ(run({"--mass", bad}), 2) << bad;
    expect_one_line_error("--mass");
  }
  EXPECT_EQ(run({"--steps", "2.5"}), 2);
  expect_one_line_error("--steps");
}

TEST_F(ProgramTest, ExitCodeTellsWhoseFaultItWas) {
  EXPECT_EQ(run({}, [] {}), 0);
  EXPECT_EQ(run({}, [] { throw InputError("\"a.msh\" line 3: is flat"); }), 1);
  expect_one_line_error("\"a.msh\" line 3: is flat");
  EXPECT_EQ(run({}, [] { throw ComputationError("no answer"); }), 1);
  EXPECT_EQ(run({}, [] { throw InvalidArgument("step: is 0, expected > 0"); }), 2);
  EXPECT_EQ(run({}, [] { throw std::bad_alloc(); }), 1);
  expect_one_line_error("memory");
}

TEST_F(ProgramTest, AMessageStaysOneLineWhateverAFileIsCalled) {
  EXPECT_EQ(run({}, [] { throw InputError("read \"two\nlines\": missing"); }), 1);
  expect_one_line_error("read \"two lines\": missing");
}

TEST_F(ProgramTest, ReportHasProgramVersionFindingsAndWarnings) {
  EXPECT_EQ(run({"--report", in_folder("r.json")},
                [&] {
                  program_.report()["answer"] = 42;
                  program_.warnings().push_back("Something is odd.");
                }),
            0);
  const auto report = nlohmann::json::parse(read_file(in_folder("r.json")));
  EXPECT_EQ(report.at("program"), "limber-test");
  EXPECT_EQ(report.at("answer"), 42);
  EXPECT_EQ(report.at("warnings").at(0), "Something is odd.");
  EXPECT_EQ(err_, "limber-test: warning: Something is odd.\n");
}

TEST_F(ProgramTest, NothingIsWrittenWhenTheWorkFails) {
  EXPECT_EQ(run({"--report", in_folder("r.json")},
                [&] {
                  program_.write_file(in_folder("first.bin"), "whole");
                  throw ComputationError("failed later");
                }),
            1);
  // The files are held until the program object goes or another run commits them: neither has happened.
  EXPECT_FALSE(fs::exists(in_folder("first.bin")));
  EXPECT_FALSE(fs::exists(in_folder("r.json")));
}

TEST_F(ProgramTest, TwoOutputsMayNotShareAName) {
  EXPECT_EQ(run({"--report", in_folder("same")}, [&] { program_.write_file(in_folder("same"), "x"); }), 2);
  expect_one_line_error("two outputs have the same name");
  EXPECT_FALSE(fs::exists(in_folder("same")));
}

TEST_F(ProgramTest, TwoSpellingsOfOnePathAreOneOutput) {
  const auto here = fs::current_path();
  fs::current_path(folder_);
  fs::create_directory("inner");
  EXPECT_EQ(run({"--report", "inner/../same"}, [&] { program_.write_file("same", "x"); }), 2);
  fs::current_path(here);
  expect_one_line_error("two outputs have the same name");
  EXPECT_FALSE(fs::exists(in_folder("same")));
}

TEST_F(ProgramTest, AnInputIsNeverOverwritten) {
  limber::write_file(in_folder("input"), "precious");
  fs::create_symlink("input", in_folder("link"));
  for (const char* output : {"input", "link", "./input"}) {
    EXPECT_EQ(run({},
                  [&] {
                    program_.add_input(in_folder("input"));
                    program_.write_file(in_folder(output), "x");
                  }),
              2);
    expect_one_line_error("is an input too");
    EXPECT_EQ(read_file(in_folder("input")), "precious");
  }
}

TEST_F(ProgramTest, AReportThatCannotBeWrittenKeepsTheOtherOutputsBack) {
  EXPECT_EQ(run({"--report", in_folder("missing/r.json")}, [&] { program_.write_file(in_folder("first.bin"), "x"); }),
            1);
  expect_one_line_error("missing/r.json");
  EXPECT_FALSE(fs::exists(in_folder("first.bin")));
}

TEST_F(ProgramTest, ProgressIsSilentWhenPiped) {
  EXPECT_EQ(run({},
                [&] {
                  program_.progress().stage("waiting");
                  std::this_thread::sleep_for(std::chrono::milliseconds(1300));
                }),
            0);
  EXPECT_TRUE(err_.empty()) << err_;
  EXPECT_TRUE(folder_is_empty());
}

}  // namespace
}  // namespace limber::tools
