/// @file precompute_arguments.h
/// The arguments of limber-precompute, uninterpreted, and what they mean.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "assembly_baking.h"
#include "bake_farm.h"
#include "limber/precompute/bake.h"
#include "limber/precompute/tetrahedralise.h"
#include "program.h"

namespace CLI {
class App;
}

namespace limber::tools {

struct MaterialArguments {
  std::string file, name;
  std::optional<double> youngs_modulus, poisson_ratio, density, loss_factor;
};

struct ModeArguments {
  int modes = 64;
  std::string mass, elements, frequency_error, damping_ratio;
  std::string load = "sudden";
  std::vector<double> rayleigh;
  SceneLimits limits;
  int blas_threads = 1;
  bool no_certify = false;
};

struct GeometryArguments {
  std::vector<std::string> fixes;
  std::string render_surface, collision_surface;
  int collision_triangles = 0;
  TetrahedralisationOptions tets;
  double scale = 1.0;
  std::optional<double> merge_nodes;
};

/// Of the blocks that an asset may have beside its modes.
struct ResponseArguments {
  std::vector<std::string> residuals;
  double residual_megabytes = 32.0;
  std::string skin, sound;
  bool volume_block = false;
};

struct AssemblyArguments {
  AssemblyOptions options;
  bool auto_joints = false;
  std::string components = "auto";
  std::string scene;
};

/// Of a spectrum that is computed in parts, or elsewhere.
struct SliceArguments {
  std::vector<double> band;  ///< Hz; empty: none
  int of = 1;
  std::vector<std::string> merge;  ///< files
  bool bodies = false;             ///< written for limber-eigen instead
  std::string engine = "arpack";
  int processes = 1;  ///< of limber-eigen

  bool by_processes() const { return engine != "arpack"; }
};

struct PrecomputeArguments {
  std::string mesh, output;
  bool list_materials = false;
  MaterialArguments material;
  ModeArguments modal;
  GeometryArguments geometry;
  ResponseArguments response;
  AssemblyArguments assembly;
  SliceArguments slice;
  FarmArguments farm;
};

/// Declares them all; `a` must outlive the parsing.
void declare_options(CLI::App& app, PrecomputeArguments& a);

/// What the arguments say of the bake, and of the input what files of materials say of it.
struct AskedBake {
  BakeOptions options;
  std::vector<std::string> shell_groups;  ///< of the input surface: shells of regions, which do not bound the body
};

/// Reads the file of materials, and shells that it names. @throws InvalidArgument or InputError in the user's words, as
/// all below do
AskedBake asked_bake(Program& program, const PrecomputeArguments& a);

/// --frequency-error as a ratio; 0 if it is not given.
double frequency_error_of(const PrecomputeArguments& a);

/// Quadratic elements where limber makes the tets; each kind with the mass by which its frequencies err less.
void choose_elements(const PrecomputeArguments& a, bool made_here, bool has_mid_edge_nodes, BakeOptions& options);

/// Takes the modes of --merge, all of them unless --modes says fewer. @param modes_given --modes is
void read_slices_of(Program& program, const PrecomputeArguments& a, bool modes_given, BakeOptions& options);

/// Options for assemblies alone, and for single bodies alone.
void check_assembly(const PrecomputeArguments& a);

}  // namespace limber::tools
