#include "job_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <fstream>
#include <utility>

#include "limber/core/error.h"

namespace limber::tools {
namespace {

/// In the child; nothing here may allocate.
[[noreturn]] void become(const char* program, char* const* arguments, const char* errors, double bytes) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  const int nothing = open("/dev/null", O_RDWR), told = open(errors, O_WRONLY | O_CREAT | O_TRUNC, 0600);
  dup2(nothing, STDIN_FILENO), dup2(nothing, STDOUT_FILENO), dup2(told, STDERR_FILENO);
  const rlimit none{0, 0};
  setrlimit(RLIMIT_CORE, &none);
  if (bytes > 0.0) {
    const rlimit most{static_cast<rlim_t>(bytes), static_cast<rlim_t>(bytes)};
    setrlimit(RLIMIT_DATA, &most);
  }
  execv(program, arguments);
  _exit(127);
}

std::string last_line(const std::filesystem::path& file) {
  std::ifstream lines(file);
  std::string last;
  for (std::string line; std::getline(lines, line);)
    if (!line.empty()) last = line;
  return last;
}

}  // namespace

JobProcess::JobProcess(const std::filesystem::path& program, const std::vector<std::string>& arguments,
                       const std::filesystem::path& errors, const JobLimits& limits)
    : errors_(errors), limits_(limits), began_(std::chrono::steady_clock::now()) {
  std::vector<char*> pointers{const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) pointers.push_back(const_cast<char*>(argument.c_str()));
  pointers.push_back(nullptr);
  process_ = fork();
  if (process_ == 0) become(program.c_str(), pointers.data(), errors_.c_str(), limits_.bytes);
  if (process_ < 0) throw InputError(fmt::format("{}: cannot be started: {}", program.string(), std::strerror(errno)));
}

JobProcess::JobProcess(JobProcess&& other) noexcept
    : process_(std::exchange(other.process_, -1)),
      errors_(std::move(other.errors_)),
      limits_(other.limits_),
      over_time_(other.over_time_),
      began_(other.began_) {}

JobProcess::~JobProcess() {
  if (process_ < 0) return;
  kill(process_, SIGKILL);
  waitpid(process_, nullptr, 0);
}

std::optional<JobEnd> JobProcess::poll() {
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - began_;
  if (limits_.seconds > 0.0 && seconds.count() > limits_.seconds && !over_time_) {
    over_time_ = true;
    kill(process_, SIGKILL);
  }
  int status = 0;
  rusage usage{};
  if (wait4(process_, &status, WNOHANG, &usage) != process_) return std::nullopt;
  process_ = -1;
  return JobEnd{.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 0,
                .signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0,
                .over_time = over_time_,
                .seconds = seconds.count(),
                .peak_memory = 1024.0 * static_cast<double>(usage.ru_maxrss),
                .message = last_line(errors_)};
}

}  // namespace limber::tools
