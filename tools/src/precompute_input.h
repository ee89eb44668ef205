/// @file precompute_input.h
/// Reads what limber-precompute bakes; fills surfaces with tets.
#pragma once

#include <chrono>
#include <nlohmann/json.hpp>

#include "limber/mesh_assimp/file_unit.h"
#include "precompute_arguments.h"
#include "program.h"

namespace limber::tools {

/// Seconds of stages, into a report.
class Stopwatch {
 public:
  explicit Stopwatch(nlohmann::ordered_json& seconds) : seconds_(seconds) {}
  template <class F>
  auto time(const char* stage, F&& work) {
    const auto start = std::chrono::steady_clock::now();
    auto result = work();
    add(stage, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
    return result;
  }
  void add(const char* stage, double seconds) { seconds_[stage] = seconds; }

 private:
  nlohmann::ordered_json& seconds_;
};

/// Tells which unit of the file counts.
void tell_unit(Program& program, const FileUnit& unit);

/// @param asked what --frequency-error bakes its tries with, and what materials want of the surface. The report gets
/// `surface`, `unit` and `merged_nodes`.
BakeInput read_input(Program& program, const PrecomputeArguments& a, const AskedBake& asked, Stopwatch& stopwatch);

}  // namespace limber::tools
