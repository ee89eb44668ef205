#include "bake/modal_blocks.h"

#include <algorithm>

#include "limber/mesh/ten_node_tet.h"

namespace limber::internal {
namespace {

/// Column `mode` of W or M W at a node.
Vec3 at_node(std::span<const double> shapes, Index nodes, Index mode, Index node) {
  return Eigen::Map<const Vec3>(shapes.data() + 3 * (static_cast<std::size_t>(mode) * nodes + node));
}

Vec3 at_vertex(const ModalAnalysis& a, Index mode, const NodeShares& v) {
  Vec3 u = Vec3::Zero();
  for (std::size_t c = 0; c < v.count; ++c) u += v.share[c] * at_node(a.shapes, a.nodes, mode, v.node[c]);
  return u;
}

ModalBasis basis_at_nodes(std::span<const double> shapes, Index nodes, std::span<const Index> kept) {
  ModalBasis basis(nodes, static_cast<Index>(kept.size()));
  for (Index n = 0; n < nodes; ++n)
    for (std::size_t m = 0; m < kept.size(); ++m)
      basis.set(n, static_cast<Index>(m), at_node(shapes, nodes, kept[m], n).cast<float>());
  return basis;
}

}  // namespace

std::vector<NodeShares> shares_of(const Embedding& embedding, const TetMesh& mesh) {
  std::vector<NodeShares> shares;
  shares.reserve(embedding.vertices.size());
  for (const EmbeddedVertex& v : embedding.vertices) shares.push_back(node_shares(mesh, v));
  return shares;
}

double largest_displacement(const ModalAnalysis& a, Index mode, std::span<const NodeShares> vertices) {
  double largest = 0.0;
  for (const NodeShares& v : vertices) largest = std::max(largest, at_vertex(a, mode, v).norm());
  return largest;
}

ModalSurface modal_surface(const PlacedSurface& placed, const ModalAnalysis& a, const TetMesh& mesh,
                           std::span<const Index> kept, const Vec3& origin) {
  ModalSurface s;
  s.triangles = placed.surface.triangles;
  for (const Vec3& x : placed.surface.vertices) s.rest.push_back((x - origin).cast<float>());
  s.basis = ModalBasis(s.vertices(), static_cast<Index>(kept.size()));
  const std::vector<NodeShares> shares = shares_of(placed.embedding, mesh);
  for (Index v = 0; v < s.vertices(); ++v)
    for (std::size_t m = 0; m < kept.size(); ++m)
      s.basis.set(v, static_cast<Index>(m), at_vertex(a, kept[m], shares[v]).cast<float>());
  return s;
}

ModalVolume modal_volume(const ModalAnalysis& a, const TetMesh& mesh, std::span<const Index> kept, const Vec3& origin) {
  ModalVolume volume;
  for (const Vec3& x : mesh.nodes) volume.rest.push_back(x - origin);
  volume.tets = mesh.has_mid_edge_nodes() ? split_into_eight(mesh).tets : mesh.tets;
  volume.basis = basis_at_nodes(a.shapes, a.nodes, kept);
  volume.mass_times_basis = basis_at_nodes(a.mass_times_shapes, a.nodes, kept);
  return volume;
}

void add_inertial_integrals(ModalModelData& data, const ModalAnalysis& a, const TetMesh& mesh,
                            std::span<const Index> kept) {
  for (const Index mode : kept) {
    Vec3 momentum = Vec3::Zero();
    Mat3 moment = Mat3::Zero();
    for (Index n = 0; n < a.nodes; ++n) {
      const Vec3 mw = at_node(a.mass_times_shapes, a.nodes, mode, n);
      momentum += mw;
      moment += (mesh.nodes[n] - data.origin_in_input) * mw.transpose();
    }
    // Free modes are M-orthogonal to translations: what the sum leaves is round-off.
    data.participation.push_back(data.motion == FrameMotion::kFree ? Vec3(Vec3::Zero()) : momentum);
    data.moments.push_back(moment);
  }
}

}  // namespace limber::internal
