// limber-eigen: the modes of bodies that limber-precompute --bodies wrote, by many processes.

#include <dlfcn.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <CLI/CLI.hpp>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <thread>

#include "distributed_body.h"
#include "eigen/hertz.h"
#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/model/sha256.h"
#include "limber/precompute/spectrum_slice.h"
#include "parallel_modes.h"
#include "program.h"

namespace limber::tools {
namespace {

using internal::DistributedBody;
using internal::ParallelModes;
using internal::process;
using internal::processes;
using internal::StoredBody;

struct Arguments {
  std::string bodies, output;
  int modes = 64, of = 1;
  std::vector<double> band;
  bool without_factor = false, estimate = false;
};

void declare_options(CLI::App& app, Arguments& a) {
  app.add_option("BODIES", a.bodies, "file that limber-precompute --bodies wrote")->required();
  app.add_option("-o,--output", a.output, "file of slices to write, for limber-precompute --merge")->type_name("FILE");
  app.add_option("--modes", a.modes, "elastic modes wanted, the lowest")
      ->type_name("N")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  app.add_option("--slice", a.band, "instead: the modes between two frequencies")
      ->type_name("HZ,HZ")
      ->delimiter(',')
      ->expected(2);
  app.add_flag("--without-factor", a.without_factor,
               "by LOBPCG with multigrid, in less memory and without proof that no mode is missed");
  app.add_flag("--estimate", a.estimate, "tell what the factor takes on this many processes, and compute nothing");
  app.add_option("--of", a.of, "how many slices there are in all")->type_name("N")->check(CLI::Range(1, 1'000'000));
}

ParallelModes modes_of(DistributedBody& body, const Arguments& a) {
  if (a.estimate) return internal::estimated_factor(body);
  if (a.without_factor) return internal::lowest_modes_without_factor(body, a.modes);
  if (a.band.empty()) return internal::lowest_parallel_modes(body, a.modes);
  const double unit = body.stored().eigenvalue_unit();
  return internal::parallel_modes_between(body, internal::eigenvalue_of_hz(a.band[0]) / unit,
                                          internal::eigenvalue_of_hz(a.band[1]) / unit);
}

/// On the first process whole, on others without shapes.
SpectrumSlice slice_of(const DistributedBody& body, const ParallelModes& modes, const Arguments& a) {
  const StoredBody& stored = body.stored();
  const double unit = stored.eigenvalue_unit();
  SpectrumSlice slice{.band = {0.0, internal::hz_of_eigenvalue(modes.high * unit)},
                      .of = a.of,
                      .below_low = modes.below_low,
                      .below_high = modes.below_high,
                      .counted = !a.without_factor,
                      .problem = stored.problem,
                      .nodes = stored.nodes};
  if (!a.band.empty()) slice.band = {a.band[0], a.band[1]};
  for (const double lambda : modes.lambda) slice.eigenvalues.push_back(lambda * unit);
  const double root = 1.0 / std::sqrt(stored.mass_unit);
  for (const auto& column : modes.W.colwise()) {
    const std::vector<double> all = body.gathered(root * column);
    slice.shapes.insert(slice.shapes.end(), all.begin(), all.end());
  }
  return slice;
}

/// Seconds by stage: by the clock of the first process, and of all processors together.
void tell_seconds(const internal::Stages& stages, nlohmann::ordered_json& body) {
  for (const auto& [stage, time] : stages.times()) {
    double cpu = 0.0;
    MPI_Reduce(&time.cpu, &cpu, 1, MPI_DOUBLE, MPI_SUM, 0, PETSC_COMM_WORLD);
    body["seconds"][stage] = time.clock;
    body["cpu_seconds"][stage] = cpu;
  }
}

/// Peak resident memory of every process.
std::vector<double> peak_memory_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const double here = 1024.0 * static_cast<double>(usage.ru_maxrss);
  std::vector<double> all(static_cast<std::size_t>(processes()));
  MPI_Gather(&here, 1, MPI_DOUBLE, all.data(), 1, MPI_DOUBLE, 0, PETSC_COMM_WORLD);
  return all;
}

/// What the first process writes and tells.
struct Outcome {
  std::vector<SpectrumSlice> slices;
  nlohmann::ordered_json bodies = nlohmann::ordered_json::array();
  std::vector<double> peak_memory_bytes;
};

/// Machines of one run may have different programs or libraries, whose collective calls would not fit each other.
void expect_one_build() {
  char library[256];
  internal::check(SlepcGetVersion(library, sizeof library));
  const std::string mine = sha256_hex(read_file("/proc/self/exe") + library);
  std::string all(mine.size() * static_cast<std::size_t>(processes()), '\0');
  const auto length = static_cast<int>(mine.size());
  MPI_Allgather(mine.data(), length, MPI_CHAR, all.data(), length, MPI_CHAR, PETSC_COMM_WORLD);
  for (int k = 1; k < processes(); ++k)
    if (all.compare(mine.size() * static_cast<std::size_t>(k), mine.size(), all, 0, mine.size()) != 0)
      throw InputError(
          fmt::format("process {} has another build of limber-eigen or SLEPc than process 0, expected the same", k));
}

Outcome compute(const Arguments& a) {
  expect_one_build();
  if (a.output.empty() != a.estimate) throw InvalidArgument("--output is needed, and not for --estimate");
  if (!a.band.empty()) FrequencyBand{a.band[0], a.band[1]}.validate();
  if (a.without_factor && !a.band.empty())
    throw InvalidArgument("--slice counts by a factor: it and --without-factor exclude each other");
  Outcome outcome;
  for (const StoredBody& stored : internal::read_stored_bodies(a.bodies)) {
    if (stored.free_nodes() == 0) {
      outcome.slices.push_back({.band = {0.0, 1.0}, .of = a.of, .problem = stored.problem, .nodes = stored.nodes});
      continue;
    }
    DistributedBody body(a.bodies, stored);
    const ParallelModes modes = modes_of(body, a);
    if (!a.estimate) outcome.slices.push_back(slice_of(body, modes, a));
    body.stages().lap("gather");
    nlohmann::ordered_json told{{"nodes", stored.nodes},
                                {"modes", modes.lambda.size()},
                                {"factor_entries", modes.factor_entries},
                                {"factor_flops", modes.factor_flops},
                                {"factor_memory_bytes", modes.factor_memory}};
    tell_seconds(body.stages(), told);
    outcome.bodies.push_back(std::move(told));
  }
  outcome.peak_memory_bytes = peak_memory_bytes();
  return outcome;
}

void tell(Program& program, const Arguments& a, Outcome outcome) {
  for (const auto& body : a.estimate ? outcome.bodies : nlohmann::ordered_json())
    program.print(
        fmt::format("{} nodes: a factor of {:.3g} GB made by {:.3g} Gflop; MUMPS takes up to {:.3g} GB a process\n",
                    body["nodes"].get<int>(), 8e-9 * body["factor_entries"].get<double>(),
                    1e-9 * body["factor_flops"].get<double>(), 1e-9 * body["factor_memory_bytes"].get<double>()));
  for (const SpectrumSlice& slice : outcome.slices)
    program.print(fmt::format("{} to {} Hz: {} modes, {} eigenvalues below, {} below the upper end\n", slice.band.low,
                              slice.band.high, slice.modes(), slice.below_low, slice.below_high));
  program.report()["processes"] = processes();
  program.report()["bodies"] = std::move(outcome.bodies);
  program.report()["peak_memory_bytes"] = std::move(outcome.peak_memory_bytes);
  if (!a.estimate) program.write_file(a.output, slice_bytes(outcome.slices));
}

/// As limber-precompute does: threads that wait for each other cost more than they save on a busy machine.
void use_one_blas_thread() {
  using SetThreads = void (*)(int);
  if (auto set = reinterpret_cast<SetThreads>(dlsym(RTLD_DEFAULT, "openblas_set_num_threads"))) set(1);
}

int run_first(int argc, char** argv) {
  Program program("limber-eigen",
                  "Computes vibration modes of large bodies on many processes (mpirun -n N limber-eigen ...), by SLEPc "
                  "and MUMPS.");
  Arguments arguments;
  declare_options(program.options(), arguments);
  return program.run(argc, argv, [&] { tell(program, arguments, compute(arguments)); });
}

/// Says nothing but why it fails, and that after the first process, which ends all if it fails too.
int run_other(int argc, char** argv) {
  const auto let_the_first_speak = [] { std::this_thread::sleep_for(std::chrono::seconds(1)); };
  CLI::App options;
  std::string report;
  options.set_version_flag("--version", "");
  options.add_option("--report", report);
  Arguments arguments;
  declare_options(options, arguments);
  try {
    options.parse(argc, argv);
    compute(arguments);
    return 0;
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return 0;
    let_the_first_speak();
    return 2;
  } catch (const std::exception& e) {
    let_the_first_speak();
    std::fprintf(stderr, "limber-eigen: process %d: %s\n", process(), e.what());
    return 1;
  }
}

}  // namespace
}  // namespace limber::tools

int main(int argc, char** argv) {
  using namespace limber;
  if (SlepcInitialize(nullptr, nullptr, nullptr, nullptr) != 0) return 1;
  PetscPushErrorHandler(PetscReturnErrorHandler, nullptr);
  tools::use_one_blas_thread();
  const int code = internal::process() == 0 ? tools::run_first(argc, argv) : tools::run_other(argc, argv);
  if (code != 0 && internal::processes() > 1) MPI_Abort(MPI_COMM_WORLD, code);  // others may wait for this one
  SlepcFinalize();
  return code;
}
