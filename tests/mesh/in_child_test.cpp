// Whatever work does in a child, its parent lives and says so in one line.
#include "in_child.h"

#include <gmock/gmock.h>

#include <csignal>
#include <vector>

namespace limber::internal {
namespace {

using ::testing::HasSubstr;

std::string complaint(const ChildLimits& limits, const std::function<void(MessageWriter&)>& work) {
  try {
    in_child("\"a.x\"", limits, work);
  } catch (const InputError& e) {
    EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
    return e.what();
  }
  return {};
}

TEST(InChild, HandsBackWhatWasWritten) {
  const std::string long_text(1 << 20, 'x');  // more than a pipe holds
  MessageReader message = in_child("\"a.x\"", {}, [&](MessageWriter& to) {
    to.put(3.5);
    to.put(long_text);
    to.put(Vec3(1, 2, 3));
    to.put(Index{-7});
  });
  EXPECT_EQ(message.get<double>(), 3.5);
  EXPECT_EQ(message.get_text(), long_text);
  EXPECT_EQ(message.get_vector(), Vec3(1, 2, 3));
  EXPECT_EQ(message.get<Index>(), -7);
  EXPECT_THROW(message.get<char>(), InputError);
}

TEST(InChild, ThrowsWhatTheWorkThrows) {
  EXPECT_EQ(complaint({}, [](MessageWriter&) { throw InputError("\"a.x\": line 3"); }), "\"a.x\": line 3");
  EXPECT_EQ(complaint({}, [](MessageWriter&) { throw std::runtime_error("why"); }), "\"a.x\": why");
}

TEST(InChild, OutlivesSignals) {
  for (const int signal : {SIGSEGV, SIGABRT, SIGFPE})
    EXPECT_THAT(complaint({}, [signal](MessageWriter&) { std::raise(signal); }),
                HasSubstr("signal " + std::to_string(signal)));
}

TEST(InChild, EndsAtItsLimits) {
  EXPECT_THAT(complaint({.cpu_seconds = 1},
                        [](MessageWriter& to) {
                          for (volatile bool always = true; always;) {
                          }
                          to.put(0);
                        }),
              HasSubstr("more than 1 s"));
#if !defined(__SANITIZE_ADDRESS__)
  EXPECT_THAT(complaint({.more_bytes = std::size_t{64} << 20},
                        [](MessageWriter& to) { to.put(std::vector<char>(std::size_t{1} << 28, 'x').back()); }),
              HasSubstr("more than 64 MB"));
#endif
}

TEST(InChild, PrintsNothing) {
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  in_child("\"a.x\"", {}, [](MessageWriter&) {
    std::fputs("a remark", stderr);
    std::fputs("another", stdout);
    std::fflush(nullptr);
  });
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "");
}

}  // namespace
}  // namespace limber::internal
