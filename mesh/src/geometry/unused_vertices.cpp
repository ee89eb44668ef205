#include "limber/mesh/unused_vertices.h"

namespace limber {

void drop_unused_vertices(SurfaceMesh& surface, const std::string& name, Warnings& warnings) {
  std::vector<Index> new_index(surface.vertices.size(), -1);
  for (const Triangle& t : surface.triangles)
    for (const Index v : t) new_index[v] = 0;
  Index kept = 0;
  for (std::size_t i = 0; i < new_index.size(); ++i) {
    if (new_index[i] < 0) continue;
    surface.vertices[kept] = surface.vertices[i];
    new_index[i] = kept++;
  }
  const auto gone = static_cast<Index>(surface.vertices.size()) - kept;
  surface.vertices.resize(static_cast<std::size_t>(kept));
  for (Triangle& t : surface.triangles)
    for (Index& v : t) v = new_index[v];
  if (gone > 0)
    warnings.push_back(name + ": " + std::to_string(gone) + " vertices belong to no triangle and have been left out");
}

}  // namespace limber
