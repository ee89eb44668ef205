/// @file job_process.h
/// A program that runs beside this one, within limits of time and memory.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace limber::tools {

struct JobLimits {
  double seconds = 0.0;  ///< by the clock; 0: none
  double bytes = 0.0;    ///< of memory that it may ask for; 0: none
};

struct JobEnd {
  int exit_code = 0;         ///< where signal is 0
  int signal = 0;            ///< that ended it
  bool over_time = false;    ///< it was ended for it
  double seconds = 0.0;      ///< by the clock
  double peak_memory = 0.0;  ///< bytes resident
  std::string message;       ///< the last line that it wrote to stderr
};

class JobProcess {
 public:
  /// Starts it; stdout goes nowhere, stderr to a file. It ends with this program, however that ends.
  /// @throws InputError if it cannot be started
  JobProcess(const std::filesystem::path& program, const std::vector<std::string>& arguments,
             const std::filesystem::path& errors, const JobLimits& limits);
  JobProcess(JobProcess&& other) noexcept;
  JobProcess& operator=(JobProcess&&) = delete;
  ~JobProcess();  ///< Ends it.

  /// How it ended; none while it runs. Ends it when its time is over.
  std::optional<JobEnd> poll();

 private:
  pid_t process_ = -1;
  std::filesystem::path errors_;
  JobLimits limits_;
  bool over_time_ = false;
  std::chrono::steady_clock::time_point began_;
};

}  // namespace limber::tools
