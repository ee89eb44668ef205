#include <algorithm>

#include "world_impl.h"

namespace limber {

std::optional<BodyHit> World::cast_ray(const Ray& ray, const BodyFilter& filter) const {
  internal::BodyQueries& queries = impl_->probes.queries;
  const auto hit = queries.index().cast_ray(ray, queries.filter(filter));
  if (!hit) return {};
  return queries.told(*hit);
}

void World::cast_ray(const Ray& ray, std::vector<BodyHit>& hits, const BodyFilter& filter) const {
  internal::BodyQueries& queries = impl_->probes.queries;
  queries.index().cast_ray(ray, queries.hits, queries.filter(filter));
  hits.clear();
  for (const SpatialIndex::Hit& hit : queries.hits) {
    const BodyHit told = queries.told(hit);  // of a compound's parts, the first counts
    const auto same = [&](const BodyHit& known) { return known.body == told.body; };
    if (!impl_->bodies.has_parts() || std::ranges::none_of(hits, same)) hits.push_back(told);
  }
}

std::optional<BodyHit> World::cast_shape(const Shape& shape, const RigidTransform& pose, const Vec3& way,
                                         const BodyFilter& filter) const {
  internal::BodyQueries& queries = impl_->probes.queries;
  const auto hit = queries.index().cast_shape(shape, pose, way, queries.filter(filter));
  if (!hit) return {};
  return queries.told(*hit);
}

void World::find_overlaps(const Shape& shape, const RigidTransform& pose, std::vector<BodyId>& bodies,
                          const BodyFilter& filter) const {
  internal::BodyQueries& queries = impl_->probes.queries;
  queries.find_overlaps(shape, pose, queries.filter(filter));
  bodies.clear();
  for (const Index body : queries.found) bodies.push_back(impl_->bodies.id(body));
}

std::optional<BodyHit> World::nearest_point(const Vec3& point, double max_distance, const BodyFilter& filter) const {
  internal::BodyQueries& queries = impl_->probes.queries;
  const auto hit = queries.index().nearest_point(point, max_distance, queries.filter(filter));
  if (!hit) return {};
  return queries.told(*hit);
}

}  // namespace limber
