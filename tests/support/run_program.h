/// @file run_program.h
/// Runs one of limber's programs as a user would, and keeps what it said.
#pragma once

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "folders.h"

namespace limber::testing {

struct ProgramResult {
  int exit_code = -1;  ///< −1: ended by a signal
  std::string out, err;
};

/// @param name of a program of limber, or an absolute path
/// @param folder where the program runs; stdout and stderr pass through files in it, removed afterwards
/// @param largest_file bytes beyond which no file may grow, as on a disk that fills; none: no limit
inline ProgramResult run_program(const std::string& name, const std::vector<std::string>& arguments,
                                 const std::filesystem::path& folder, std::optional<rlim_t> largest_file = {}) {
  const auto out = folder / ".stdout", err = folder / ".stderr";
  const std::string program = (std::filesystem::path(LIMBER_BIN_DIR) / name).string();
  const pid_t child = ::fork();
  if (child == 0) {
    const auto redirect = [](const std::filesystem::path& path, int to) {
      ::dup2(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600), to);
    };
    redirect(out, STDOUT_FILENO);
    redirect(err, STDERR_FILENO);
    if (::chdir(folder.c_str()) != 0) ::_exit(126);
    if (largest_file) {
      const rlimit limit{*largest_file, *largest_file};
      ::setrlimit(RLIMIT_FSIZE, &limit);
    }
    std::vector<char*> argv{const_cast<char*>(program.c_str())};
    for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
    argv.push_back(nullptr);
    ::execv(program.c_str(), argv.data());
    ::_exit(127);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  const auto text = [](const std::filesystem::path& path) {
    std::ostringstream s;
    s << std::ifstream(path).rdbuf();
    std::filesystem::remove(path);
    return s.str();
  };
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, text(out), text(err)};
}

}  // namespace limber::testing
