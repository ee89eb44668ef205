/// @file stored_body.h
/// A body in a file, from which processes that share its eigenproblem read their parts: mesh, materials, what is fixed
/// and the motions that deform nothing. A line of JSON, then for each body, little-endian: its fixed nodes (int32),
/// all coordinates (double), the null motions (for each free node three rows of zero_modes doubles), the tets (each
/// its nodes and its region, int32) and the free nodes in their order of elimination (int32).
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <vector>

#include "limber/core/error.h"
#include "limber/model/material.h"
#include "limber/precompute/fem.h"

namespace limber::internal {

/// Without its arrays.
struct StoredBody {
  std::string problem = {};  ///< SpectrumSlice::problem
  Index nodes = 0, tets = 0, fixed = 0;
  int nodes_per_tet = 4;
  MassKind mass = MassKind::kLumped;
  double stiffness_unit = 1.0, mass_unit = 1.0;  ///< as in EigenBody
  int zero_modes = 0;                            ///< columns of the null motions, orthonormal in the mass
  std::vector<Index> pins = {};                  ///< ElasticInverse::pinned()
  std::vector<Material> materials = {};          ///< of the regions
  std::uint64_t begin = 0;                       ///< where its arrays are in the file; set by a reader

  Index free_nodes() const { return nodes - fixed; }
  double eigenvalue_unit() const { return stiffness_unit / mass_unit; }
  std::uint64_t coordinates_begin() const { return begin + sizeof(Index) * fixed; }
  std::uint64_t motions_begin() const { return coordinates_begin() + 3 * sizeof(double) * nodes; }
  std::uint64_t tets_begin() const {
    return motions_begin() + 3 * sizeof(double) * static_cast<std::uint64_t>(free_nodes()) * zero_modes;
  }
  std::uint64_t order_begin() const {
    return tets_begin() + sizeof(Index) * static_cast<std::uint64_t>(tets) * (nodes_per_tet + 1);
  }
  std::uint64_t end() const { return order_begin() + sizeof(Index) * free_nodes(); }
};

/// The first line of a file, which states the hash of the arrays behind it.
std::string stored_bodies_line(std::span<const StoredBody> bodies, const std::string& arrays);

/// Reads the file once, to see that it is whole.
/// @throws InputError naming the file where it is no such file, is cut off or damaged
std::vector<StoredBody> read_stored_bodies(const std::filesystem::path& path);

/// Reads records of `length` numbers from a place on, in pieces, so that none but the caller's are held.
/// @param take called with each record's number and its first value
template <class T, class Take>
void for_each_record(const std::filesystem::path& path, std::uint64_t begin, Index count, int length, Take take) {
  constexpr Index kRecords = 1 << 14;
  std::ifstream file(path, std::ios::binary);
  file.seekg(static_cast<std::streamoff>(begin));
  std::vector<T> piece(static_cast<std::size_t>(kRecords) * length);
  for (Index first = 0; first < count; first += kRecords) {
    const Index here = std::min(kRecords, count - first);
    file.read(reinterpret_cast<char*>(piece.data()), static_cast<std::streamsize>(sizeof(T)) * here * length);
    if (!file) throw InputError("\"" + path.string() + "\": cannot be read to its end");
    for (Index i = 0; i < here; ++i) take(first + i, piece.data() + static_cast<std::size_t>(i) * length);
  }
}

}  // namespace limber::internal
