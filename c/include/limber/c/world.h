/// @file limber/c/world.h
/// Worlds and bodies in the C interface: time, loads, state, snapshots, drawing. Rules of all calls: limber/limber.h.
#pragma once

#include "limber/c/asset.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct limber_world limber_world;

/// Threads that a caller lends. parallel_for(context, …) calls loop(of, begin, end) for disjoint ranges that cover
/// [0, count), each of at most `grain` indices, on any threads and in any order, and returns when all are done. `loop`
/// throws nothing. State is the same to the bit whatever they are.
typedef struct limber_jobs {
  void* context;    ///< outlives the world
  int concurrency;  ///< how many ranges may run at once, ≥ 1; 0: none are lent, everything in the calling thread
  void (*parallel_for)(void* context, size_t count, size_t grain, void (*loop)(void* of, size_t begin, size_t end),
                       void* of);
} limber_jobs;

typedef struct limber_world_options {
  double step;                ///< s, > 0; default 1/60
  int substeps;               ///< ≥ 1: each step is taken as so many equal ones, contacts found anew; default 1
  limber_vec3 gravity;        ///< m/s², world; default (0, 0, −9.80665)
  int max_steps_per_advance;  ///< ≥ 1: time beyond is dropped, so that a slow frame cannot snowball; default 8
  bool sleep;                 ///< whether islands at rest are left alone; default false
  double sleep_time;          ///< s, ≥ 0, at rest until an island sleeps; default 0.5
  double sleep_speed;         ///< m/s, ≥ 0: at rest is slower than this; default 1e-3
  bool half_precision;        ///< keeps drawn surfaces' shapes in half precision too; default false
  double hit_speed;           ///< m/s, ≥ 0: limber_world_hit_events() tells of pairs at least as fast; default 1
  limber_jobs jobs;           ///< default none
} limber_world_options;
LIMBER_API limber_world_options limber_default_world_options(void);

/// @param options NULL: the defaults @param world out: to be destroyed by limber_world_destroy()
LIMBER_API limber_result limber_world_create(const limber_world_options* options, limber_world** world);
LIMBER_API void limber_world_destroy(limber_world* world);
/// The options, with the step and gravity as they are now.
LIMBER_API limber_result limber_world_get_options(const limber_world* world, limber_world_options* options);

// Bodies ---------------------------------------------------------------------------------------------------------

/// How a body's frame moves, beside what acts on it. All but gravity's share is for bodies without fixed nodes, and
/// for game contact alone.
typedef struct limber_frame_settings {
  double gravity_scale;      ///< the body's gravity is this times the world's; default 1
  double linear_damping;     ///< c of v̇ = … − c v, 1/s, ≥ 0; default 0
  double angular_damping;    ///< the same of rotation; default 0
  bool lock_translation[3];  ///< axes of the world along which the body does not move; default none
  bool lock_rotation[3];     ///< and about which it does not turn
} limber_frame_settings;
LIMBER_API limber_frame_settings limber_default_frame_settings(void);

/// How a body starts.
typedef struct limber_placement {
  limber_transform pose;         ///< X_WB; default the world's origin
  limber_vec3 velocity;          ///< of the body's origin, world, m/s; default 0
  limber_vec3 angular_velocity;  ///< world, rad/s; default 0
  limber_filter filter;          ///< whom it meets; default all
  double friction;            ///< μ ≥ 0, of two bodies √(μ_a μ_b); below 0, the default: limber_contact_options'
  double restitution;         ///< e, 0 to 1, of rigid bodies, of two the larger; default 0
  const limber_shape* shape;  ///< what others meet in place of a modal body's surface; default NULL: the surface
  uint64_t user_data;         ///< the caller's own; default 0
  limber_frame_settings frame;  ///< gravity's share, damping, locked axes; default none
  bool modal_skin;              ///< bends by its model's modal skin where it has one; default true
  /// Whether a free body's turning and its modes feel each other's inertia; for flight alone, of a model with a volume
  /// block and no modal skin in use: limber/dynamics/inertial_coupling.h. Default false
  bool inertial_coupling;
} limber_placement;
LIMBER_API limber_placement limber_default_placement(void);

/// A body of an asset, which bends by its modes. @param placement NULL: the defaults, here and below
LIMBER_API limber_result limber_world_add_body(limber_world* world, const limber_asset* asset, size_t body,
                                               const limber_placement* placement, limber_body_id* id);
/// A rigid body of even density, kg/m³, > 0. The pose places its centre of mass; placement->shape is NULL.
LIMBER_API limber_result limber_world_add_rigid(limber_world* world, const limber_shape* shape, double density,
                                                const limber_placement* placement, limber_body_id* id);
/// A rigid body with mass properties of the caller's own.
LIMBER_API limber_result limber_world_add_rigid_with_mass(limber_world* world, const limber_shape* shape,
                                                          const limber_mass_properties* mass,
                                                          const limber_placement* placement, limber_body_id* id);
/// A compound of shapes that bound solids, of even density: a table, a hammer. Others meet its parts; events and
/// queries know the whole. The pose places its centre of mass (limber_parts_mass_properties()).
LIMBER_API limber_result limber_world_add_compound(limber_world* world, const limber_shape_part* parts, size_t count,
                                                   double density, const limber_placement* placement,
                                                   limber_body_id* id);
LIMBER_API limber_result limber_world_add_compound_with_mass(limber_world* world, const limber_shape_part* parts,
                                                             size_t count, const limber_mass_properties* mass,
                                                             const limber_placement* placement, limber_body_id* id);
/// A rigid shape that goes where limber_world_set_kinematic_frame() leads it, whatever it meets: a lift, a hand. Until
/// then it goes on at the velocities it is placed with. The pose places the shape's own origin.
LIMBER_API limber_result limber_world_add_kinematic(limber_world* world, const limber_shape* shape,
                                                    const limber_placement* placement, limber_body_id* id);
/// The same of a compound. The pose places the frame that its parts are told in.
LIMBER_API limber_result limber_world_add_kinematic_compound(limber_world* world, const limber_shape_part* parts,
                                                             size_t count, const limber_placement* placement,
                                                             limber_body_id* id);
/// A shape that never moves: the ground. Of the placement its pose, filter and friction are read. Only
/// limber_world_contains_body(), _remove_body() and user data take its id.
LIMBER_API limber_result limber_world_add_static(limber_world* world, const limber_shape* shape,
                                                 const limber_placement* placement, limber_body_id* id);
/// Removes a body, and with it its handles and joints.
LIMBER_API limber_result limber_world_remove_body(limber_world* world, limber_body_id id);
LIMBER_API bool limber_world_contains_body(const limber_world* world, limber_body_id id);
/// All bodies, static ones and sensors too.
LIMBER_API size_t limber_world_body_count(const limber_world* world);
LIMBER_API limber_result limber_world_list_bodies(const limber_world* world, limber_body_id* ids, size_t capacity,
                                                  size_t* count);
/// The body at an index, as of one that a caller has kept; {0, 0}: there is none.
LIMBER_API limber_body_id limber_world_body_at(const limber_world* world, uint32_t index);
LIMBER_API limber_result limber_world_set_body_user_data(limber_world* world, limber_body_id id, uint64_t data);
LIMBER_API limber_result limber_world_body_user_data(const limber_world* world, limber_body_id id, uint64_t* data);
/// @param model out: lives until the body is removed
LIMBER_API limber_result limber_world_body_model(const limber_world* world, limber_body_id id,
                                                 const limber_model** model);

/// How a body comes to move.
typedef enum limber_body_type LIMBER_ENUM {
  LIMBER_BODY_STATIC = 0,     ///< not at all: static bodies and sensors
  LIMBER_BODY_KINEMATIC = 1,  ///< as limber_world_set_kinematic_frame() says
  LIMBER_BODY_DYNAMIC = 2,    ///< by what acts on it
} limber_body_type;
LIMBER_API limber_result limber_world_body_type(const limber_world* world, limber_body_id id, limber_body_type* type);
LIMBER_API limber_result limber_world_is_asleep(const limber_world* world, limber_body_id id, bool* asleep);
/// Wakes a body and all that sleeps with it.
LIMBER_API limber_result limber_world_wake(limber_world* world, limber_body_id id);

// Time -----------------------------------------------------------------------------------------------------------

/// Takes `steps` fixed steps, ≥ 0.
LIMBER_API limber_result limber_world_step(limber_world* world, int steps);
/// Adds seconds, ≥ 0, to an accumulator and takes as many fixed steps as fit. @param steps out: how many; NULL: not
/// told
LIMBER_API limber_result limber_world_advance(limber_world* world, double seconds, int* steps);
/// Changes the length of the steps to come, s, > 0; before the loads of the coming step are given.
LIMBER_API limber_result limber_world_set_step(limber_world* world, double seconds);
/// From the coming step on, m/s², world. Wakes all bodies.
LIMBER_API limber_result limber_world_set_gravity(limber_world* world, limber_vec3 gravity);
// Of one body, from the coming step on: limber_frame_settings. They wake it.
LIMBER_API limber_result limber_world_set_gravity_scale(limber_world* world, limber_body_id id, double scale);
LIMBER_API limber_result limber_world_set_damping(limber_world* world, limber_body_id id, double linear,
                                                  double angular);
/// Velocities along axes that are locked are lost at once.
LIMBER_API limber_result limber_world_set_locks(limber_world* world, limber_body_id id, const bool translation[3],
                                                const bool rotation[3]);
LIMBER_API limber_result limber_world_frame_settings(const limber_world* world, limber_body_id id,
                                                     limber_frame_settings* settings);
// Of a world that is NULL these are 0.
/// Fraction of a step left in the accumulator, in [0, 1): how far to draw between the last two states.
LIMBER_API double limber_world_interpolation_factor(const limber_world* world);
LIMBER_API double limber_world_time(const limber_world* world);  ///< s: the lengths of all steps taken
LIMBER_API uint64_t limber_world_step_count(const limber_world* world);
LIMBER_API double limber_world_dropped_seconds(const limber_world* world);  ///< given up by max_steps_per_advance

// Loads ----------------------------------------------------------------------------------------------------------

typedef enum limber_axes LIMBER_ENUM {
  LIMBER_AXES_WORLD = 0,
  LIMBER_AXES_BODY = 1,
} limber_axes;

/// N, at the deformed point, held over the coming step; several add up.
LIMBER_API limber_result limber_world_apply_force(limber_world* world, limber_body_id id, limber_surface_point at,
                                                  limber_vec3 force, limber_axes axes);
/// N·s, at the deformed point: velocities change at the start of the coming step. @param delay s into the step at which
/// the modes get it, in [0, step)
LIMBER_API limber_result limber_world_apply_impulse(limber_world* world, limber_body_id id, limber_surface_point at,
                                                    limber_vec3 impulse, limber_axes axes, double delay);

/// Motion of what carries a body with fixed nodes, at the end of the coming step; world.
typedef struct limber_kinematic_frame {
  limber_transform pose;
  limber_vec3 velocity, acceleration;                  ///< of the body's origin, m/s, m/s²
  limber_vec3 angular_velocity, angular_acceleration;  ///< rad/s, rad/s²
} limber_kinematic_frame;
/// @return LIMBER_INVALID_ARGUMENT for a free body
LIMBER_API limber_result limber_world_set_kinematic_frame(limber_world* world, limber_body_id id,
                                                          const limber_kinematic_frame* target);

// State ----------------------------------------------------------------------------------------------------------

typedef struct limber_body_state {
  limber_transform pose;         ///< X_WB
  limber_vec3 velocity;          ///< of the body's origin, world, m/s
  limber_vec3 angular_velocity;  ///< world, rad/s
  const double* amplitude;       ///< z, kg^½·m, `modes` numbers; until the world changes
  const double* rate;            ///< ż, kg^½·m/s
  int32_t modes;
} limber_body_state;
LIMBER_API limber_result limber_world_body_state(const limber_world* world, limber_body_id id,
                                                 limber_body_state* state);
// What is set is the state before the last step too: nothing is drawn between.
LIMBER_API limber_result limber_world_set_pose(limber_world* world, limber_body_id id, limber_transform pose);
LIMBER_API limber_result limber_world_set_velocity(limber_world* world, limber_body_id id, limber_vec3 velocity,
                                                   limber_vec3 angular_velocity);
/// @param amplitudes, rates `modes` numbers each, kg^½·m and kg^½·m/s; modes is the model's
LIMBER_API limber_result limber_world_set_amplitudes(limber_world* world, limber_body_id id, const double* amplitudes,
                                                     const double* rates, int32_t modes);
/// Displacements (m) and velocities (m/s) of all nodes of the tetrahedral mesh, body frame, 3 a node.
/// @param numbers in each array: 3 times the nodes @return LIMBER_INVALID_ARGUMENT without limber_model_data.has_volume
LIMBER_API limber_result limber_world_set_node_displacements(limber_world* world, limber_body_id id,
                                                             const double* displacements, const double* velocities,
                                                             size_t numbers);

/// J.
typedef struct limber_energy {
  double kinetic_rigid;  ///< translation and rotation of the frame
  double potential;      ///< −m g·x of the centre of mass; 0 at the world's origin
  double kinetic_modal;  ///< ½ Σ ż²
  double elastic;        ///< ½ Σ λ z², and what contacts store
} limber_energy;
LIMBER_API limber_result limber_world_energy(const limber_world* world, limber_body_id id, limber_energy* energy);
LIMBER_API limber_result limber_world_linear_momentum(const limber_world* world, limber_body_id id,
                                                      limber_vec3* momentum);  ///< world, kg·m/s
/// Of the rigid part, about the body's origin, world, kg·m²/s.
LIMBER_API limber_result limber_world_angular_momentum(const limber_world* world, limber_body_id id,
                                                       limber_vec3* momentum);
/// World position of a surface point, m, and its velocity, m/s; deformed by the modes.
LIMBER_API limber_result limber_world_point_position(const limber_world* world, limber_body_id id,
                                                     limber_surface_point at, limber_vec3* position);
LIMBER_API limber_result limber_world_point_velocity(const limber_world* world, limber_body_id id,
                                                     limber_surface_point at, limber_vec3* velocity);
/// The displacement of a surface point beyond the modes, where contacts indent it, world, m.
LIMBER_API limber_result limber_world_point_indentation(const limber_world* world, limber_body_id id,
                                                        limber_surface_point at, limber_vec3* displacement);

/// Hash of all that the next step depends on: two worlds with the same calls behind them have the same. 0 for NULL.
LIMBER_API uint64_t limber_world_state_hash(const limber_world* world);

// Rollback -------------------------------------------------------------------------------------------------------

/// Bytes of a saved state. They are for worlds with the same bodies, in the same version of limber and on machines of
/// the same byte order: keep them in memory or send them to another player, but do not store them for later versions.
typedef struct limber_snapshot limber_snapshot;
LIMBER_API limber_result limber_snapshot_create(limber_snapshot** snapshot);
LIMBER_API void limber_snapshot_destroy(limber_snapshot* snapshot);
/// @param size out, bytes; NULL: not told. @return NULL for one that nothing was saved in
LIMBER_API const void* limber_snapshot_bytes(const limber_snapshot* snapshot, size_t* size);
/// Replaces what the snapshot holds. A world that is restored goes on as it did then, bit for bit, with the same calls.
/// Allocates nothing where the snapshot has held a world like this.
LIMBER_API limber_result limber_world_save_state(const limber_world* world, limber_snapshot* snapshot);
/// Bodies, handles and joints added since are removed; handles and joints removed since are there again.
/// @return LIMBER_INVALID_ARGUMENT for bytes that are damaged or of another version, or a body that was removed since
LIMBER_API limber_result limber_world_restore_state(limber_world* world, const void* bytes, size_t size);

// Drawing --------------------------------------------------------------------------------------------------------

/// Where the vertices of one body go: 3 floats per vertex of the render surface.
typedef struct limber_draw_target {
  limber_body_id id;
  float* positions;  ///< world less `origin`, m
  float* normals;    ///< unit, world; NULL: not wanted
  double tolerance;  ///< m, ≥ 0: modes that together move no vertex by more are not drawn
} limber_draw_target;
/// Deformed render surfaces, of many bodies at once, which is faster than one by one.
/// @param interpolation in [0, 1] between the last two states; 1: the newest
/// @param origin world: a point near the camera, where that is far from the world's origin
LIMBER_API limber_result limber_world_reconstruct_all(const limber_world* world, const limber_draw_target* targets,
                                                      size_t count, double interpolation, limber_vec3 origin);
/// The same of one body, in world coordinates. @param normals NULL: not wanted
LIMBER_API limber_result limber_world_reconstruct(const limber_world* world, limber_body_id id, float* positions,
                                                  float* normals, double interpolation);
/// Poses of many bodies between the last two states. @param poses out, `count` of them
LIMBER_API limber_result limber_world_interpolated_poses(const limber_world* world, const limber_body_id* ids,
                                                         size_t count, double interpolation, limber_transform* poses);
/// For a caller that deforms on its GPU: z, kg^½·m. @param amplitudes out, k numbers
LIMBER_API limber_result limber_world_interpolated_amplitudes(const limber_world* world, limber_body_id id,
                                                              double interpolation, float* amplitudes);
/// Weights of the morph targets of limber_model_morph_target() and of the asset's GLB. @param weights out, k numbers
LIMBER_API limber_result limber_world_interpolated_weights(const limber_world* world, limber_body_id id,
                                                           double interpolation, float* weights);
/// Whether the body bends by its model's modal skin: morph targets do not show all of its motion then.
LIMBER_API limber_result limber_world_has_modal_skin(const limber_world* world, limber_body_id id, bool* has);

// Times ----------------------------------------------------------------------------------------------------------

/// Parts of a step, and drawing: limber/core/stage_times.h tells what each counts.
enum { LIMBER_STAGES = 9 };
/// What the stages took since limber_world_set_stage_times(world, true).
typedef struct limber_stage_times {
  double seconds[LIMBER_STAGES];  ///< wall clock
  int64_t units[LIMBER_STAGES];
} limber_stage_times;
/// Switches clocks on, from 0, or off, as they are at first.
LIMBER_API limber_result limber_world_set_stage_times(limber_world* world, bool on);
LIMBER_API limber_result limber_world_get_stage_times(const limber_world* world, limber_stage_times* times);
/// "bookkeeping", "look_ahead", "broad_phase", "narrow_phase", "rows", "advance", "solve", "commit", "reconstruct";
/// NULL beyond.
LIMBER_API const char* limber_stage_name(int stage);

#ifdef __cplusplus
}
#endif
