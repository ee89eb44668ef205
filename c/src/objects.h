// What the opaque types of the C interface are.
#pragma once

#include <cstddef>
#include <exception>
#include <memory>
#include <mutex>
#include <vector>

#include "conversion.h"
#include "limber/core/jobs.h"
#include "limber/model/asset.h"

struct limber_asset {
  limber::Asset asset;
};

struct limber_shape {
  std::shared_ptr<const limber::Shape> shape;
};

struct limber_snapshot {
  std::vector<std::byte> bytes;
};

namespace limber::c {

// A limber_model is a ModalModel seen from C, where the type is never complete.
inline const limber_model* to_c(const ModalModel& model) { return reinterpret_cast<const limber_model*>(&model); }
inline const ModalModel& to_cpp(const limber_model& model) { return reinterpret_cast<const ModalModel&>(model); }

/// Threads that the caller lends, or none.
class CallerJobs final : public Jobs {
 public:
  /// @throws InvalidArgument if there is a concurrency and no loop
  explicit CallerJobs(const limber_jobs& jobs);
  void parallel_for(std::size_t count, std::size_t grain,
                    const std::function<void(std::size_t, std::size_t)>& body) override;
  int concurrency() const override { return jobs_.concurrency > 0 ? jobs_.concurrency : 1; }
  const limber_jobs& lent() const { return jobs_; }

 private:
  limber_jobs jobs_;
};

}  // namespace limber::c

struct limber_world {
  limber_world(const limber::WorldOptions& options, const limber_jobs& lent) : jobs(lent), world(options, jobs) {}

  limber::c::CallerJobs jobs;
  std::unique_ptr<limber::ContactSource> source;  // outlives the world, as the jobs do
  limber::StageTimes times;
  limber::World world;
  // Lists on their way to the caller, so that a warm call allocates nothing.
  mutable std::vector<limber::BodyId> bodies;
  mutable std::vector<limber::HandleId> handles;
  mutable std::vector<limber::JointId> joints;
  mutable std::vector<limber::BodyHit> hits;
  mutable std::vector<limber::DrawTarget> targets;
};

namespace limber::c {

inline World& world_of(limber_world* world) { return required(world, "world").world; }
inline const World& world_of(const limber_world* world) { return required(world, "world").world; }
inline const std::shared_ptr<const Shape>& shape_of(const limber_shape* shape) {
  return required(shape, "shape").shape;
}
inline std::vector<ShapePart> parts_of(const limber_shape_part* parts, std::size_t count) {
  std::vector<ShapePart> out;
  for (const limber_shape_part& part : array(parts, count, "parts"))
    out.push_back({.shape = shape_of(part.shape), .pose = to_cpp(part.pose)});
  return out;
}

}  // namespace limber::c
