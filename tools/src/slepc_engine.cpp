#include "slepc_engine.h"

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <thread>
#include <vector>

#include "job_process.h"
#include "limber/core/error.h"
#include "limber/core/file.h"

namespace limber::tools {
namespace {

namespace fs = std::filesystem;

/// Removes itself.
struct TemporaryFile {
  fs::path path;
  ~TemporaryFile() {
    std::error_code ignored;
    fs::remove(path, ignored);
  }
};

fs::path on_path(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');)
    if (::access((fs::path(folder) / name).c_str(), X_OK) == 0) return fs::path(folder) / name;
  throw InputError("--engine: " + name + " is not on PATH, expected Open MPI's (Debian: openmpi-bin)");
}

std::vector<std::string> arguments(const PrecomputeArguments& a, const fs::path& eigen, const fs::path& bodies,
                                   const fs::path& slices, const fs::path& report) {
  std::vector<std::string> list{"--quiet", "--oversubscribe", "-n", std::to_string(a.slice.processes)};
  if (::geteuid() == 0) list.emplace_back("--allow-run-as-root");
  list.insert(list.end(), {eigen, bodies, "-o", slices, "--report", report, "--modes", std::to_string(a.modal.modes)});
  if (a.slice.engine == "lobpcg") list.emplace_back("--without-factor");
  if (!a.slice.band.empty())
    list.insert(list.end(), {"--slice", fmt::format("{},{}", a.slice.band[0], a.slice.band[1]), "--of",
                             std::to_string(a.slice.of)});
  return list;
}

JobEnd wait_for(JobProcess& job) {
  while (true) {
    if (const std::optional<JobEnd> end = job.poll()) return *end;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

/// What limber-eigen said, without its name; empty if it said nothing.
std::string words_of(const fs::path& errors) {
  const std::string name = "limber-eigen: ";
  std::ifstream lines(errors);
  for (std::string line; std::getline(lines, line);)
    if (line.rfind(name, 0) == 0 && line.find(": warning: ") == std::string::npos) return line.substr(name.size());
  return "";
}

}  // namespace

fs::path limber_eigen_file() { return fs::read_symlink("/proc/self/exe").parent_path() / "limber-eigen"; }

EigenLauncher find_eigen_launcher() {
  const fs::path eigen = limber_eigen_file();
  if (fs::exists(eigen)) return {on_path("mpirun"), eigen};
  throw InputError("--engine: " + eigen.string() +
                   " is missing: it is built where CMake finds MPI and SLEPc (scripts/install-dependencies --slepc)");
}

std::string run_limber_eigen(const EigenLauncher& launcher, Program& program, const PrecomputeArguments& a,
                             const std::string& bodies) {
  const std::string slices = a.output + ".slices";
  const TemporaryFile stored{a.output + ".bodies"}, report{a.output + ".eigen.json"}, errors{a.output + ".errors"};
  limber::write_file(stored.path, bodies);
  JobProcess job(launcher.mpirun, arguments(a, launcher.eigen, stored.path, slices, report.path), errors.path, {});
  const JobEnd end = wait_for(job);
  if (end.exit_code != 0 || end.signal != 0) {
    const std::string words = words_of(errors.path);
    throw ComputationError("limber-eigen: " + (words.empty() ? fmt::format("one of {} processes was ended, as for lack "
                                                                           "of memory: its factor and modes are lost",
                                                                           a.slice.processes)
                                                             : words));
  }
  nlohmann::ordered_json told = nlohmann::ordered_json::parse(read_file(report.path));
  for (const char* key : {"program", "version", "warnings"}) told.erase(key);
  program.report()["engine"] = std::move(told);
  return slices;
}

}  // namespace limber::tools
