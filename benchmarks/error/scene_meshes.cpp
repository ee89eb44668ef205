#include "scene_meshes.h"

#include "limber/core/error.h"
#include "tet_box.h"

namespace limber::testing {

TetMesh body_mesh(const ErrorBody& body, int times) {
  TetMesh mesh = tet_box(times * body.cells[0], times * body.cells[1], times * body.cells[2], body.size);
  if (!body.mirrored) return mesh;
  for (Vec3& node : mesh.nodes) node.x() = body.size.x() - node.x();
  for (Tet& t : mesh.tets) std::swap(t[2], t[3]);
  return mesh;
}

Index node_at(const TetMesh& mesh, const Vec3& at) {
  for (std::size_t v = 0; v < mesh.nodes.size(); ++v)
    if ((mesh.nodes[v] - at).norm() < 1e-6) return static_cast<Index>(v);
  throw InvalidArgument("node_at: no node is there");
}

std::vector<Vec3> compared_places(const ErrorBody& body) {
  std::vector<Vec3> places;
  for (const Vec3& x : body_mesh(body, 1).nodes)
    if (x.minCoeff() < 1e-9 || (body.size - x).minCoeff() < 1e-9) places.push_back(x);
  return places;
}

std::vector<Index> clamped_nodes(const ErrorBody& body, const TetMesh& mesh) {
  return body.clamped ? nodes_where(mesh, [](const Vec3& x) { return x.x() < 1e-9; }) : std::vector<Index>{};
}

double stable_step_of(const ErrorBody& body) {
  const TetMesh mesh = body_mesh(body, 1);
  return stable_step(NodalElasticity(mesh, body.material, ElasticLaw::kLinear, clamped_nodes(body, mesh)));
}

Eigen::VectorXd compared_masses(const ErrorBody& body) {
  const TetMesh mesh = body_mesh(body, 1);
  const NodalElasticity elasticity(mesh, body.material, ElasticLaw::kLinear);
  const std::vector<Vec3> places = compared_places(body);
  Eigen::VectorXd masses(static_cast<Eigen::Index>(places.size()));
  for (std::size_t i = 0; i < places.size(); ++i)
    masses[static_cast<Eigen::Index>(i)] = elasticity.node_masses()[node_at(mesh, places[i])];
  return masses;
}

Index compared_tip(const ErrorScene& scene) {
  const std::vector<Vec3> places = compared_places(scene.bodies[scene.tip_body]);
  for (std::size_t i = 0; i < places.size(); ++i)
    if ((places[i] - scene.tip).norm() < 1e-6) return static_cast<Index>(i);
  throw InvalidArgument("compared_tip: the tip of \"" + scene.name + "\" is no node of the surface");
}

}  // namespace limber::testing
