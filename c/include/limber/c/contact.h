/// @file limber/c/contact.h
/// Contacts, sensors and queries in the C interface. Rules of all calls: limber/limber.h.
#pragma once

#include "limber/c/world.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum limber_contact_solver LIMBER_ENUM {
  LIMBER_CONTACT_GAME = 0,   ///< small steps: bounded work
  LIMBER_CONTACT_EXACT = 1,  ///< to Coulomb's law, in the time that it takes
} limber_contact_solver;

/// How bodies touch: docs/contact.md. The solver answers handles and joints too.
typedef struct limber_contact_options {
  limber_contact_solver solver;  ///< default game
  bool find_contacts;            ///< default true; false: bodies pass through each other
  int substeps;                  ///< of the game solver, ≥ 1: 4 for debris, 16 to 32 for towers; default 12
  double slop;               ///< of the game solver, ≥ 0: overlap left alone, a share of the thickness; default 2e-3
  double push_speed;         ///< of the game solver, m/s, ≥ 0: what overlaps is parted so fast at most; default 1
  double friction;           ///< μ ≥ 0 of bodies without their own; default 0.5
  double rolling_friction;   ///< ≥ 0, coefficient of rolling resistance of balls and capsules; default 0
  double recovery_speed;     ///< of the exact solver, m/s, ≥ 0: the same as push_speed; default 0.05
  bool residual_compliance;  ///< indentations, where models have it; default true
  double compliance;         ///< ≥ 0: ContactOptions::compliance; default 0
} limber_contact_options;
LIMBER_API limber_contact_options limber_default_contact_options(void);

/// Bodies meet each other from the coming step on, which they do not at first. May be called again, with other options:
/// what contacts remembered is forgotten then. @param options NULL: the defaults
LIMBER_API limber_result limber_world_set_contacts(limber_world* world, const limber_contact_options* options);

/// A contact before it acts. Body b is pushed against the normal, a along it.
typedef struct limber_contact {
  uint64_t id;  ///< the same in every step for the same features of the same bodies
  limber_body_id a, b;
  limber_vec3 position;  ///< world, m, less the origin of the step's search
  limber_vec3 normal;    ///< unit, world, out of b into a
  double gap;            ///< m, negative where the bodies overlap
} limber_contact;
/// Asked of every contact found, by the thread that takes the step: false leaves it out. It must not call functions of
/// the world. @param veto NULL: all act
LIMBER_API limber_result limber_world_set_contact_veto(limber_world* world,
                                                       bool (*veto)(void* context, const limber_contact* contact),
                                                       void* context);

typedef enum limber_contact_phase LIMBER_ENUM {
  LIMBER_CONTACT_BEGUN = 0,    ///< pressed now, and not before
  LIMBER_CONTACT_LASTING = 1,  ///< pressed now and before
  LIMBER_CONTACT_ENDED = 2,    ///< pressed before, and not now
} limber_contact_phase;
/// What pressed, or ceased to, in the last step.
typedef struct limber_contact_event {
  uint64_t id;
  limber_body_id a, b;  ///< {0, 0} for a body that was removed
  limber_contact_phase phase;
  limber_vec3 position;  ///< world, m
  limber_vec3 normal;    ///< unit, world, out of b into a
  limber_vec3 impulse;   ///< on a over the step, world, N·s
  double approach;       ///< of one that began: how fast its points came together, m/s
} limber_contact_event;
LIMBER_API limber_result limber_world_contact_events(const limber_world* world, limber_contact_event* events,
                                                     size_t capacity, size_t* count);

/// A pair of bodies that came together in the last step at limber_world_options.hit_speed or faster.
typedef struct limber_hit_event {
  limber_body_id a, b;
  uint64_t user_data_a, user_data_b;
  limber_vec3 position, normal;  ///< of the fastest contact: world, m; unit, out of b into a
  double speed;                  ///< at which they came together there, m/s
  limber_vec3 impulse;           ///< of all their contacts on a, over the step, world, N·s
} limber_hit_event;
LIMBER_API limber_result limber_world_hit_events(const limber_world* world, limber_hit_event* events, size_t capacity,
                                                 size_t* count);
/// Of all contacts of two bodies in the last step, on a: world, N·s.
LIMBER_API limber_result limber_world_contact_impulse(const limber_world* world, limber_body_id a, limber_body_id b,
                                                      limber_vec3* impulse);
/// Lets a body's surface run over it, as a conveyor's belt does. @param velocity m/s, body axes
LIMBER_API limber_result limber_world_set_surface_velocity(limber_world* world, limber_body_id id,
                                                           limber_vec3 velocity);
LIMBER_API limber_result limber_world_surface_velocity(const limber_world* world, limber_body_id id,
                                                       limber_vec3* velocity);

// Sensors: convex shapes that tell which bodies they overlap, and push none ---------------------------------------

LIMBER_API limber_result limber_world_add_sensor(limber_world* world, const limber_shape* shape, limber_transform pose,
                                                 limber_filter filter, limber_body_id* id);
LIMBER_API limber_filter limber_default_filter(void);
LIMBER_API limber_result limber_world_set_sensor_pose(limber_world* world, limber_body_id id, limber_transform pose);
/// A body that came into a sensor in the last step, or left it.
typedef struct limber_sensor_event {
  limber_body_id sensor, body;
  bool began;                                 ///< false: left, or was removed
  uint64_t user_data_sensor, user_data_body;  ///< theirs; 0 of a body that was removed
} limber_sensor_event;
LIMBER_API limber_result limber_world_sensor_events(const limber_world* world, limber_sensor_event* events,
                                                    size_t capacity, size_t* count);
/// Who is inside, as of the last step.
LIMBER_API limber_result limber_world_list_inside(const limber_world* world, limber_body_id sensor, limber_body_id* ids,
                                                  size_t capacity, size_t* count);

// Queries of bodies as they are now, moved and bent --------------------------------------------------------------

/// Which bodies may answer: those with a layer of the mask that `accepts`, where given, returns true for.
typedef struct limber_query_filter {
  uint32_t mask;  ///< default all
  bool (*accepts)(void* context, limber_body_id id);
  void* context;
} limber_query_filter;
LIMBER_API limber_query_filter limber_default_query_filter(void);

/// A place on a body that answers.
typedef struct limber_hit {
  limber_body_id body;
  bool has_point;           ///< false for static bodies: `at` is nothing then
  limber_surface_point at;  ///< as loads and handles take it
  limber_vec3 position;     ///< world, m
  limber_vec3 normal;       ///< unit, world, towards where the query came from; 0 where it begins within the body
  double fraction;          ///< of the way, in [0, 1]
  double distance;          ///< m
  uint64_t user_data;       ///< of the body
} limber_hit;
/// The first place that a ray from + f·way, 0 ≤ f ≤ 1, meets. @param way m, not zero @param filter NULL: all, here and
/// below @param found out: false where there is none; `hit` is not written then
LIMBER_API limber_result limber_world_cast_ray(const limber_world* world, limber_vec3 from, limber_vec3 way,
                                               const limber_query_filter* filter, bool* found, limber_hit* hit);
/// The first place on each body, by fraction.
LIMBER_API limber_result limber_world_cast_ray_all(const limber_world* world, limber_vec3 from, limber_vec3 way,
                                                   const limber_query_filter* filter, limber_hit* hits, size_t capacity,
                                                   size_t* count);
/// Where a sphere, capsule, box or hull first touches that is moved without turning.
LIMBER_API limber_result limber_world_cast_shape(const limber_world* world, const limber_shape* shape,
                                                 limber_transform pose, limber_vec3 way,
                                                 const limber_query_filter* filter, bool* found, limber_hit* hit);
/// Bodies that such a shape touches or lies in.
LIMBER_API limber_result limber_world_find_overlaps(const limber_world* world, const limber_shape* shape,
                                                    limber_transform pose, const limber_query_filter* filter,
                                                    limber_body_id* ids, size_t capacity, size_t* count);
/// The nearest place of any surface. @param max_distance m, > 0 and finite
LIMBER_API limber_result limber_world_nearest_point(const limber_world* world, limber_vec3 point, double max_distance,
                                                    const limber_query_filter* filter, bool* found, limber_hit* hit);

#ifdef __cplusplus
}
#endif
