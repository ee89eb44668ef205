#include "progress.h"

#include <unistd.h>

#include <cstdio>
#include <utility>

namespace limber::tools {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::seconds kPatience{1};
constexpr std::chrono::milliseconds kRedraw{250};

}  // namespace

Progress::Progress(std::string name) : name_(std::move(name)), terminal_(::isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() { clear(); }

void Progress::stage(std::string_view what) {
  if (!terminal_) return;
  const std::lock_guard lock(mutex_);
  stage_ = what;
  fraction_ = -1.0;
  if (watcher_.joinable()) return;
  began_ = Clock::now();
  watcher_ = std::jthread([this](const std::stop_token& stop) { watch(stop); });
}

void Progress::fraction(double done) {
  if (!terminal_) return;
  const std::lock_guard lock(mutex_);
  fraction_ = done;
}

void Progress::clear() {
  const std::lock_guard lock(mutex_);
  stage_.clear();
  if (std::exchange(drawn_, false)) std::fputs("\r\033[K", stderr);
}

void Progress::watch(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    wake_.wait_for(lock, stop, kRedraw, [] { return false; });
    const std::chrono::duration<double> elapsed = Clock::now() - began_;
    if (stage_.empty() || elapsed < kPatience) continue;
    std::fprintf(stderr, "\r\033[K%s: %s … ", name_.c_str(), stage_.c_str());
    if (fraction_ >= 0.0) std::fprintf(stderr, "%.0f %%, ", 100.0 * fraction_);
    std::fprintf(stderr, "%.1f s", elapsed.count());
    std::fflush(stderr);
    drawn_ = true;
  }
}

}  // namespace limber::tools
