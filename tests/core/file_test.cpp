#include "limber/core/file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <csignal>
#include <filesystem>

#include "limber/core/error.h"

namespace limber {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class FileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder = fs::path(::testing::TempDir()) /
             ("limber_file_" + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
    fs::remove_all(folder);
    fs::create_directories(folder);
  }
  void TearDown() override { fs::remove_all(folder); }
  std::size_t files_in_folder() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
  }
  fs::path folder;
};

std::string message_of(const auto& action) {
  try {
    action();
  } catch (const InputError& e) {
    return e.what();
  }
  return "no error";
}

TEST_F(FileTest, WhatIsWrittenIsRead) {
  const std::string bytes("a\0b\n", 4);
  write_file(folder / "x", bytes);
  EXPECT_EQ(read_file(folder / "x"), bytes);
  EXPECT_EQ(files_in_folder(), 1u);
}

TEST_F(FileTest, MissingEmptyDirectoryAndTooLargeAreOneLineEach) {
  write_file(folder / "large", "12345");
  write_file(folder / "empty", "");
  EXPECT_THAT(message_of([&] { read_file(folder / "none"); }), HasSubstr("No such file"));
  EXPECT_THAT(message_of([&] { read_file(folder / "empty"); }), HasSubstr("empty"));
  EXPECT_THAT(message_of([&] { read_file(folder); }), HasSubstr("directory"));
  EXPECT_THAT(message_of([&] { read_file(folder / "large", 4); }), HasSubstr("5 bytes, expected at most 4"));
}

TEST_F(FileTest, WriteThatCannotFinishLeavesTheOldFileAndNoOther) {
  write_file(folder / "x", "old");
  // A file-size limit fails the write as a full disk does: part of the bytes go out, then an error.
  signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  rlimit small = before;
  small.rlim_cur = 1000;
  setrlimit(RLIMIT_FSIZE, &small);
  const std::string message = message_of([&] { write_file(folder / "x", std::string(5000, 'n')); });
  setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_THAT(message, HasSubstr("nothing was written"));
  EXPECT_EQ(read_file(folder / "x"), "old");
  EXPECT_EQ(files_in_folder(), 1u);
}

TEST_F(FileTest, ADeviceIsNotReplacedByAFile) {
  const auto pipe = folder / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THAT(message_of([&] { write_file(pipe, "x"); }), HasSubstr("is not a regular file"));
  EXPECT_TRUE(fs::is_fifo(pipe));
}

TEST_F(FileTest, FilesThatBelongTogetherAppearTogetherOrNotAtAll) {
  write_file(folder / "a", "old");
  try {
    OutputFiles files;
    files.add(folder / "a", "new");
    files.add(folder / "missing" / "b", "new");
    files.commit();
    FAIL() << "expected InputError";
  } catch (const InputError&) {
  }
  EXPECT_EQ(read_file(folder / "a"), "old");
  EXPECT_EQ(files_in_folder(), 1u);
}

}  // namespace
}  // namespace limber
