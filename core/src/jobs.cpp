#include "limber/core/jobs.h"

#include "limber/core/error.h"

namespace limber {

void SerialJobs::parallel_for(std::size_t count, std::size_t grain,
                              const std::function<void(std::size_t, std::size_t)>& body) {
  if (grain == 0) throw InvalidArgument("Jobs::parallel_for: grain is 0, expected at least 1");
  if (count > 0) body(0, count);
}

Jobs& serial_jobs() {
  static SerialJobs jobs;
  return jobs;
}

}  // namespace limber
