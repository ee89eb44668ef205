#include "limber/collision/contact_finder.h"
#include "limber/collision/manifold_finder.h"
#include "objects.h"

namespace limber::c {

static ContactOptions to_cpp(const limber_contact_options& o) {
  return {.solver = checked_enum<ContactSolver>(o.solver, 2, "contact solver"),
          .small_steps = {.substeps = o.substeps, .slop = o.slop, .push_speed = o.push_speed},
          .friction = o.friction,
          .rolling_friction = o.rolling_friction,
          .recovery_speed = o.recovery_speed,
          .residual_compliance = o.residual_compliance,
          .compliance = o.compliance};
}

/// Who finds the contacts that the solver of these options answers.
static std::unique_ptr<ContactSource> make_source(const limber_contact_options& o) {
  if (!o.find_contacts) return nullptr;
  if (o.solver == LIMBER_CONTACT_EXACT) return std::make_unique<ContactFinder>();
  return std::make_unique<ManifoldFinder>();
}

static limber_contact_event to_c(const World& world, const ContactEvent& e) {
  return {e.id,
          to_c(world.id_of(e.a)),
          to_c(world.id_of(e.b)),
          static_cast<limber_contact_phase>(e.phase),
          to_c(e.position),
          to_c(e.normal),
          to_c(e.impulse),
          e.approach};
}

static limber_hit_event to_c(const HitEvent& e) {
  return {to_c(e.a),        to_c(e.b),      e.user_data_a, e.user_data_b,
          to_c(e.position), to_c(e.normal), e.speed,       to_c(e.impulse)};
}

static BodyFilter to_cpp(const limber_query_filter* filter) {
  BodyFilter out;
  if (filter == nullptr) return out;
  out.mask = filter->mask;
  if (filter->accepts != nullptr)
    out.accepts = [filter](BodyId id) { return filter->accepts(filter->context, to_c(id)); };
  return out;
}

static Ray ray(const limber_vec3& from, const limber_vec3& way) { return {.from = to_cpp(from), .way = to_cpp(way)}; }

static limber_hit to_c(const BodyHit& h) {
  return {to_c(h.body),     h.at.has_value(), h.at ? to_c(*h.at) : limber_surface_point{},
          to_c(h.position), to_c(h.normal),   h.fraction,
          h.distance,       h.user_data};
}

static void answer(const std::optional<BodyHit>& found_hit, bool* found, limber_hit* hit) {
  bool& any = required(found, "found");
  limber_hit& place = required(hit, "hit");
  if (found_hit) place = to_c(*found_hit);
  any = found_hit.has_value();
}

static void answer_bodies(const std::vector<BodyId>& bodies, limber_body_id* ids, size_t capacity, size_t* count) {
  answer(bodies, ids, capacity, count, [](BodyId id) { return to_c(id); });
}

}  // namespace limber::c

using namespace limber;
using namespace limber::c;

extern "C" {

limber_contact_options limber_default_contact_options(void) {
  const ContactOptions o{};
  return {static_cast<limber_contact_solver>(o.solver),
          true,
          o.small_steps.substeps,
          o.small_steps.slop,
          o.small_steps.push_speed,
          o.friction,
          o.rolling_friction,
          o.recovery_speed,
          o.residual_compliance,
          o.compliance};
}

limber_result limber_world_set_contacts(limber_world* world, const limber_contact_options* options) {
  return guarded([&] {
    World& w = world_of(world);
    const limber_contact_options chosen = options != nullptr ? *options : limber_default_contact_options();
    const ContactOptions answered = to_cpp(chosen);
    auto source = make_source(chosen);
    w.set_contact_source(source.get(), answered);
    world->source = std::move(source);
  });
}

limber_result limber_world_set_contact_veto(limber_world* world, bool (*veto)(void*, const limber_contact*),
                                            void* context) {
  return guarded([&] {
    World& w = world_of(world);
    if (veto == nullptr) return w.set_contact_veto({});
    w.set_contact_veto([&w, veto, context](const ContactPoint& p) {
      const limber_contact contact{
          p.id, to_c(w.id_of(p.a.body)), to_c(w.id_of(p.b.body)), to_c(p.position), to_c(p.normal), p.gap};
      return veto(context, &contact);
    });
  });
}

limber_result limber_world_contact_events(const limber_world* world, limber_contact_event* events, size_t capacity,
                                          size_t* count) {
  return guarded([&] {
    const World& w = world_of(world);
    answer(w.contact_events(), events, capacity, count, [&w](const ContactEvent& e) { return to_c(w, e); });
  });
}

limber_result limber_world_hit_events(const limber_world* world, limber_hit_event* events, size_t capacity,
                                      size_t* count) {
  return guarded([&] {
    answer(world_of(world).hit_events(), events, capacity, count, [](const HitEvent& e) { return to_c(e); });
  });
}

limber_result limber_world_contact_impulse(const limber_world* world, limber_body_id a, limber_body_id b,
                                           limber_vec3* impulse) {
  return guarded([&] { required(impulse, "impulse") = to_c(world_of(world).contact_impulse(to_cpp(a), to_cpp(b))); });
}

limber_result limber_world_set_surface_velocity(limber_world* world, limber_body_id id, limber_vec3 velocity) {
  return guarded([&] { world_of(world).set_surface_velocity(to_cpp(id), to_cpp(velocity)); });
}

limber_result limber_world_surface_velocity(const limber_world* world, limber_body_id id, limber_vec3* velocity) {
  return guarded([&] { required(velocity, "velocity") = to_c(world_of(world).surface_velocity(to_cpp(id))); });
}

limber_result limber_world_add_sensor(limber_world* world, const limber_shape* shape, limber_transform pose,
                                      limber_filter filter, limber_body_id* id) {
  return guarded([&] {
    limber_body_id& out = required(id, "id");
    out = to_c(world_of(world).add_sensor(shape_of(shape), to_cpp(pose), to_cpp(filter)));
  });
}

limber_result limber_world_set_sensor_pose(limber_world* world, limber_body_id id, limber_transform pose) {
  return guarded([&] { world_of(world).set_sensor_pose(to_cpp(id), to_cpp(pose)); });
}

limber_result limber_world_sensor_events(const limber_world* world, limber_sensor_event* events, size_t capacity,
                                         size_t* count) {
  return guarded([&] {
    answer(world_of(world).sensor_events(), events, capacity, count, [](const SensorEvent& e) {
      return limber_sensor_event{to_c(e.sensor), to_c(e.body), e.began, e.user_data_sensor, e.user_data_body};
    });
  });
}

limber_result limber_world_list_inside(const limber_world* world, limber_body_id sensor, limber_body_id* ids,
                                       size_t capacity, size_t* count) {
  return guarded([&] {
    world_of(world).list_inside(to_cpp(sensor), world->bodies);
    answer_bodies(world->bodies, ids, capacity, count);
  });
}

limber_query_filter limber_default_query_filter(void) { return {BodyFilter{}.mask, nullptr, nullptr}; }

limber_result limber_world_cast_ray(const limber_world* world, limber_vec3 from, limber_vec3 way,
                                    const limber_query_filter* filter, bool* found, limber_hit* hit) {
  return guarded([&] { answer(world_of(world).cast_ray(ray(from, way), to_cpp(filter)), found, hit); });
}

limber_result limber_world_cast_ray_all(const limber_world* world, limber_vec3 from, limber_vec3 way,
                                        const limber_query_filter* filter, limber_hit* hits, size_t capacity,
                                        size_t* count) {
  return guarded([&] {
    world_of(world).cast_ray(ray(from, way), world->hits, to_cpp(filter));
    answer(world->hits, hits, capacity, count, [](const BodyHit& h) { return to_c(h); });
  });
}

limber_result limber_world_cast_shape(const limber_world* world, const limber_shape* shape, limber_transform pose,
                                      limber_vec3 way, const limber_query_filter* filter, bool* found,
                                      limber_hit* hit) {
  return guarded([&] {
    const World& w = world_of(world);
    answer(w.cast_shape(*shape_of(shape), to_cpp(pose), to_cpp(way), to_cpp(filter)), found, hit);
  });
}

limber_result limber_world_find_overlaps(const limber_world* world, const limber_shape* shape, limber_transform pose,
                                         const limber_query_filter* filter, limber_body_id* ids, size_t capacity,
                                         size_t* count) {
  return guarded([&] {
    world_of(world).find_overlaps(*shape_of(shape), to_cpp(pose), world->bodies, to_cpp(filter));
    answer_bodies(world->bodies, ids, capacity, count);
  });
}

limber_result limber_world_nearest_point(const limber_world* world, limber_vec3 point, double max_distance,
                                         const limber_query_filter* filter, bool* found, limber_hit* hit) {
  return guarded(
      [&] { answer(world_of(world).nearest_point(to_cpp(point), max_distance, to_cpp(filter)), found, hit); });
}

}  // extern "C"
