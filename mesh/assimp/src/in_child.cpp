#include "in_child.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <exception>
#include <fstream>
#include <new>

namespace limber::internal {
namespace {

constexpr char kDone = 'd', kThrown = 't';  // first byte of a message

void set_limit(int resource, rlim_t soft, rlim_t hard) {
  rlimit limit{};
  getrlimit(static_cast<__rlimit_resource>(resource), &limit);
  limit.rlim_max = std::min(limit.rlim_max, hard);
  limit.rlim_cur = std::min(limit.rlim_max, soft);
  setrlimit(static_cast<__rlimit_resource>(resource), &limit);
}

#if defined(__SANITIZE_ADDRESS__)  // reserves terabytes of addresses
void limit_addresses(std::size_t) {}
#else
/// @param more bytes of address space beside those that this process has
void limit_addresses(std::size_t more) {
  std::size_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  const rlim_t bytes = pages * static_cast<std::size_t>(sysconf(_SC_PAGESIZE)) + more;
  set_limit(RLIMIT_AS, bytes, bytes);
}
#endif

void limit_this_process(const ChildLimits& limits) {
  const auto seconds = static_cast<rlim_t>(limits.cpu_seconds);
  set_limit(RLIMIT_CPU, seconds, seconds + 1);
  set_limit(RLIMIT_CORE, 0, 0);
  limit_addresses(limits.more_bytes);
  for (const int signal : {SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGXCPU}) std::signal(signal, SIG_DFL);
  const int nothing = open("/dev/null", O_WRONLY | O_CLOEXEC);
  dup2(nothing, STDOUT_FILENO);
  dup2(nothing, STDERR_FILENO);
}

void write_all(int file, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = write(file, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return;
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

std::string read_all(int file) {
  std::string bytes;
  std::array<char, 1 << 16> part{};
  for (;;) {
    const ssize_t size = read(file, part.data(), part.size());
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) return bytes;
    bytes.append(part.data(), static_cast<std::size_t>(size));
  }
}

[[noreturn]] void run_child(int to_parent, const ChildLimits& limits, const std::function<void(MessageWriter&)>& work) {
  limit_this_process(limits);
  MessageWriter message;
  char kind = kDone;
  std::string thrown;
  try {
    work(message);
  } catch (const std::bad_alloc&) {
    kind = kThrown;
    thrown = "reading it takes more than " + std::to_string(limits.more_bytes >> 20) + " MB of memory";
  } catch (const std::exception& e) {
    kind = kThrown;
    thrown = e.what();
  }
  write_all(to_parent, {&kind, 1});
  write_all(to_parent, kind == kDone ? message.bytes() : thrown);
  _exit(0);  // what the parent has buffered is the parent's to write
}

std::string why_it_ended(int status, const ChildLimits& limits) {
  if (!WIFSIGNALED(status)) return "Assimp ended without a word";
  const int signal = WTERMSIG(status);
  if (signal == SIGXCPU || signal == SIGKILL)
    return "reading it takes more than " + std::to_string(limits.cpu_seconds) + " s";
  return "Assimp broke down on it (signal " + std::to_string(signal) + "): the file is damaged, or Assimp has a fault";
}

}  // namespace

MessageReader in_child(const std::string& name, const ChildLimits& limits,
                       const std::function<void(MessageWriter&)>& work) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) throw InputError(name + ": no pipe to a child process: " + std::strerror(errno));
  const pid_t child = fork();
  if (child < 0) {
    const int failed = errno;
    close(ends[0]), close(ends[1]);
    throw InputError(name + ": no child process to read it in: " + std::strerror(failed));
  }
  if (child == 0) {
    close(ends[0]);
    run_child(ends[1], limits, work);
  }
  close(ends[1]);
  std::string message = read_all(ends[0]);
  close(ends[0]);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (message.empty() || !WIFEXITED(status)) throw InputError(name + ": " + why_it_ended(status, limits));
  const char kind = message.front();
  message.erase(0, 1);
  if (kind == kThrown) throw InputError(message.starts_with(name) ? message : name + ": " + message);
  return MessageReader(std::move(message));
}

}  // namespace limber::internal
