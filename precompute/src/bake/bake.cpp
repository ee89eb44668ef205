#include "limber/precompute/bake.h"

#include <algorithm>
#include <limits>

#include "bake/bake_body.h"
#include "bake/body_surfaces.h"
#include "limber/core/error.h"
#include "limber/mesh/ten_node_tet.h"
#include "regions/assign_regions.h"

namespace limber {
namespace {

std::vector<char> selected_flags(const TetMesh& mesh, std::span<const NodeSelector> selectors) {
  std::vector<char> selected(mesh.nodes.size(), 0);
  for (const NodeSelector& s : selectors)
    for (const Index n : select_nodes(mesh, s)) selected[n] = 1;
  return selected;
}

/// Makes the mesh's tets those that are asked for, and flags of nodes those of its new nodes: a middle that is added is
/// held where both ends of its edge are, as a four-node tet would hold it, and loaded nowhere.
void use_elements(Elements elements, TetMesh& mesh, std::vector<char>& fixed, std::vector<char>& loaded) {
  if (elements == Elements::kLinear && mesh.has_mid_edge_nodes()) {
    const std::vector<Index> node_of = drop_mid_edge_nodes(mesh);
    for (std::vector<char>* flags : {&fixed, &loaded}) {
      for (std::size_t n = 0; n < node_of.size(); ++n) (*flags)[n] = (*flags)[static_cast<std::size_t>(node_of[n])];
      flags->resize(node_of.size());
    }
  }
  if (elements == Elements::kQuadratic && !mesh.has_mid_edge_nodes()) {
    add_mid_edge_nodes(mesh);
    fixed.resize(mesh.nodes.size(), 0);
    loaded.resize(mesh.nodes.size(), 0);
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
      for (std::size_t e = 0; e < kTetEdges.size(); ++e)
        fixed[mesh.mid_edge_nodes[t][e]] =
            static_cast<char>(fixed[mesh.tets[t][kTetEdges[e][0]]] && fixed[mesh.tets[t][kTetEdges[e][1]]]);
  }
}

/// A node that does not move answers no load.
void warn_of_fixed_loads(std::span<const char> loaded, std::span<const char> fixed, Warnings& warnings) {
  std::size_t chosen = 0, idle = 0;
  for (std::size_t n = 0; n < loaded.size(); ++n) {
    chosen += loaded[n] ? 1 : 0;
    idle += loaded[n] && fixed[n] ? 1 : 0;
  }
  if (idle > 0)
    warnings.push_back("residual: " + std::to_string(idle) + " of the " + std::to_string(chosen) +
                       " chosen nodes are fixed and get no residual modes");
}

/// The body that has the node nearest to a patch's centre.
Index body_of(const AttachmentPatch& patch, const TetMesh& mesh, std::span<const Index> component) {
  Index body = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    for (const Index n : mesh.tets[t]) {
      const double distance = (mesh.nodes[static_cast<std::size_t>(n)] - patch.center).squaredNorm();
      if (distance < least) least = distance, body = component[t];
    }
  return body;
}

void warn_of_unused_nodes(const TetMesh& mesh, std::span<const char> fixed, Warnings& warnings) {
  std::vector<char> used(mesh.nodes.size(), 0);
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    for (const Index n : TetNodes(mesh, t)) used[n] = 1;
  std::size_t unused = 0, to_be_fixed = 0;
  for (std::size_t n = 0; n < used.size(); ++n) {
    if (used[n]) continue;
    ++unused;
    if (fixed[n]) ++to_be_fixed;
  }
  if (unused == 0) return;
  std::string message = "mesh: " + std::to_string(unused) + " of " + std::to_string(mesh.nodes.size()) +
                        " nodes belong to no tetrahedron and have been dropped";
  if (to_be_fixed > 0) message += ", " + std::to_string(to_be_fixed) + " of them were to be fixed";
  warnings.push_back(message);
}

/// The mesh as it is analysed, cut into bodies.
struct Bodies {
  std::vector<Material> materials;  // one per region of the whole mesh
  std::vector<internal::BodyInput> bodies;
};

Bodies make_bodies(const BakeInput& input, const BakeOptions& options, Warnings& warnings) {
  options.validate();
  if (input.mesh.tets.empty()) throw InputError("bake: the mesh holds no tetrahedra");
  TetMesh mesh = input.mesh;
  Bodies made;
  made.materials = internal::assign_regions(mesh, options.materials, options.regions, input.named_faces);
  auto fixed = selected_flags(input.mesh, options.fixed);
  auto loaded = selected_flags(input.mesh, options.residual.nodes);
  warn_of_unused_nodes(input.mesh, fixed, warnings);
  warn_of_fixed_loads(loaded, fixed, warnings);

  use_elements(options.elements, mesh, fixed, loaded);
  const auto component = connected_components(mesh);
  const Index bodies = 1 + *std::max_element(component.begin(), component.end());
  auto render = internal::deal_if_any(input.render, mesh, component, bodies, "render");
  auto collision = internal::deal_if_any(input.collision, mesh, component, bodies, "collision");
  for (Index b = 0; b < bodies; ++b) {
    internal::BodyInput& body = made.bodies.emplace_back();
    body.name = bodies == 1 ? input.name : input.name + "_" + std::to_string(b + 1);
    body.part = extract_component(mesh, component, b);
    for (std::size_t n = 0; n < body.part.node_of.size(); ++n) {
      if (fixed[body.part.node_of[n]])
        body.fixed.push_back(static_cast<Index>(n));
      else if (loaded[body.part.node_of[n]])
        body.residual_nodes.push_back(static_cast<Index>(n));
    }
    for (const AttachmentPatch& patch : options.residual.patches)
      if (body_of(patch, mesh, component) == b) body.patches.push_back(patch);
    body.render = std::move(render[b]);
    body.collision = std::move(collision[b]);
  }
  return made;
}

}  // namespace

BakeResult bake(const BakeInput& input, const BakeOptions& options, Warnings& warnings, Jobs& jobs) {
  const Bodies made = make_bodies(input, options, warnings);
  BakeResult result;
  result.asset.provenance = input.provenance;
  for (const internal::BodyInput& body : made.bodies) {
    internal::BakedBody baked =
        internal::bake_body(body, made.materials, options, result.bodies.emplace_back(), warnings, jobs);
    result.asset.bodies.push_back(std::move(baked.model));
    result.asset.sounds.push_back(std::move(baked.sound));
    result.asset.frequency_errors.push_back(result.bodies.back().modes.kept_errors);
  }
  return result;
}

std::vector<SpectrumSlice> bake_slices(const BakeInput& input, const BakeOptions& options, const FrequencyBand& band,
                                       Warnings& warnings, Jobs& jobs) {
  const Bodies made = make_bodies(input, options, warnings);
  std::vector<SpectrumSlice> slices;
  for (const internal::BodyInput& body : made.bodies)
    slices.push_back(analyse_slice(body.part.mesh, made.materials, body.fixed, band, options.analysis, warnings, jobs));
  return slices;
}

std::string bake_eigenproblems(const BakeInput& input, const BakeOptions& options, Warnings& warnings, Jobs& jobs) {
  const Bodies made = make_bodies(input, options, warnings);
  std::vector<EigenproblemInput> bodies;
  for (const internal::BodyInput& body : made.bodies) bodies.push_back({&body.part.mesh, made.materials, body.fixed});
  return eigenproblem_bytes(bodies, options.analysis.mass, jobs);
}

}  // namespace limber
