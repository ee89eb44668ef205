/// @file limber/precompute/spectrum_slice.h
/// The modes of one body between two frequencies, so that a large body's spectrum can be computed on several machines.
///
/// A slice is computed by itself: shift and invert at the middle of its interval of λ, whose modes are the nearest to
/// it. Sylvester's law of inertia counts the eigenvalues below both ends; a slice whose modes are fewer is an error.
/// ModalAnalysisOptions::slices joins slices: they must follow each other from 0 Hz on, and agree about the counts
/// where they meet. Then no mode between them is missing.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "limber/core/jobs.h"
#include "limber/mesh/tet_mesh.h"
#include "limber/model/material.h"
#include "limber/precompute/fem.h"

namespace limber {

/// From low to high, Hz. 0 ≤ low < high; low = 0 begins above the motions that deform nothing.
struct FrequencyBand {
  double low = 0.0, high = 0.0;
  void validate() const;  ///< @throws InvalidArgument
};

struct SpectrumSlice {
  FrequencyBand band = {};
  int of = 1;                            ///< slices in all, as the caller was told
  int below_low = 0, below_high = 0;     ///< eigenvalues below the ends, those of zero among them
  bool counted = true;                   ///< by inertia; else those found, and some may be missing
  std::string problem = {};              ///< SHA-256 of K, M and the free nodes: what a slice fits
  Index nodes = 0;                       ///< of the body
  std::vector<double> eigenvalues = {};  ///< ascending, rad²/s²
  std::vector<double> shapes = {};       ///< as ModalAnalysis::shapes

  int modes() const { return static_cast<int>(eigenvalues.size()); }
};

/// A file of slices: a line of JSON, then the numbers, little-endian.
std::string slice_bytes(std::span<const SpectrumSlice> slices);
/// @throws InputError naming the file where it is no such file, is cut off or damaged
std::vector<SpectrumSlice> read_slices(const std::filesystem::path& path);

/// A body for eigenproblem_bytes(); all must outlive the call.
struct EigenproblemInput {
  const TetMesh* mesh = nullptr;
  std::span<const Material> materials;
  std::span<const Index> fixed_nodes;
};

/// The file that limber-eigen computes slices from on many processes: mesh, materials, what is fixed and the motions
/// that deform nothing. K is assembled once to tell by its hash which body it is, and forgotten.
/// @throws InvalidArgument unless each mesh is one body
std::string eigenproblem_bytes(std::span<const EigenproblemInput> bodies, MassKind mass, Jobs& jobs = serial_jobs());

}  // namespace limber
