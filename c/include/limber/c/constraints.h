/// @file limber/c/constraints.h
/// Handles, joints and manipulation in the C interface. Rules of all calls: limber/limber.h.
#pragma once

#include "limber/c/world.h"

#ifdef __cplusplus
extern "C" {
#endif

// Handles: a point of a body is held, dragged or pulled -----------------------------------------------------------

typedef struct limber_handle_options {
  limber_vec3 direction[3];  ///< world, orthonormal, in which the point is held; the first `directions` count
  int directions;            ///< 0 to 3; default 0: all three axes
  double max_force;          ///< N along each direction, > 0; default infinite
  double stiffness;          ///< N/m, ≥ 0: pulls like a spring; default 0: the target is met exactly
  double damping;            ///< N·s/m, ≥ 0, only with a stiffness; default 0
} limber_handle_options;
LIMBER_API limber_handle_options limber_default_handle_options(void);

/// Takes hold of a point where it is now. @param options NULL: the defaults
LIMBER_API limber_result limber_world_add_handle(limber_world* world, limber_body_id id, limber_surface_point at,
                                                 const limber_handle_options* options, limber_handle_id* handle);
LIMBER_API limber_result limber_world_remove_handle(limber_world* world, limber_handle_id id);
LIMBER_API bool limber_world_contains_handle(const limber_world* world, limber_handle_id id);
LIMBER_API limber_result limber_world_list_handles(const limber_world* world, limber_handle_id* ids, size_t capacity,
                                                   size_t* count);
/// Where the point is wanted at the end of the coming step, world, m, and how the target goes on from there, m/s.
LIMBER_API limber_result limber_world_set_handle_target(limber_world* world, limber_handle_id id, limber_vec3 position,
                                                        limber_vec3 velocity);
/// What a handle does, as of the last step.
typedef struct limber_handle_state {
  limber_vec3 target, target_velocity;  ///< for the coming step, m, m/s
  limber_vec3 force;                    ///< mean, on the body, world, N
  double work;                          ///< done on the body in the step, J
  double error;                         ///< distance from the target along the held directions, m
} limber_handle_state;
LIMBER_API limber_result limber_world_handle_state(const limber_world* world, limber_handle_id id,
                                                   limber_handle_state* state);
LIMBER_API limber_result limber_world_set_handle_user_data(limber_world* world, limber_handle_id id, uint64_t data);
LIMBER_API limber_result limber_world_handle_user_data(const limber_world* world, limber_handle_id id, uint64_t* data);

// Joints ---------------------------------------------------------------------------------------------------------

/// What b may do relative to a, along and about the axes of the joint's frame.
typedef enum limber_joint_type LIMBER_ENUM {
  LIMBER_JOINT_BALL = 0,         ///< three rotations about the origin; coordinates: intrinsic x-y-z Euler angles
  LIMBER_JOINT_REVOLUTE = 1,     ///< rotation about x
  LIMBER_JOINT_CYLINDRICAL = 2,  ///< rotation about x, translation along x; with a pitch the two go together
  LIMBER_JOINT_PRISMATIC = 3,    ///< translation along x
  LIMBER_JOINT_PLANAR = 4,       ///< rotation about z, translations along x and y
  LIMBER_JOINT_FIXED = 5,        ///< none
} limber_joint_type;

/// low ≤ high; infinite ends are open.
typedef struct limber_interval {
  double low, high;
} limber_interval;

/// How a joint sits on a body that deforms: on a patch of its surface.
typedef struct limber_attachment {
  const limber_surface_point* patch;  ///< its points; default NULL: vertices around the joint's origin
  size_t patch_count;
  double radius;           ///< m, ≥ 0; without a patch: all vertices within it, or the nearest one. Default 0
  limber_surface surface;  ///< without a patch: of which surface; default LIMBER_SURFACE_COLLISION
} limber_attachment;

typedef struct limber_joint_options {
  limber_joint_type type;          ///< default fixed
  limber_transform frame;          ///< of the joint, in the world as the bodies stand; default the world's
  limber_interval rotation;        ///< revolute, cylindrical: about x; planar: about z; rad; default open
  limber_interval translation[2];  ///< prismatic, cylindrical: [0] along x; planar: along x and y; m; default open
  double cone;                     ///< ball: largest angle of b's x axis from a's, rad; default infinite
  limber_interval euler[3];        ///< ball, rad; default open
  double pitch;                    ///< cylindrical: advance along x per radian, m/rad; default 0: no screw
  limber_attachment on_a, on_b;
  bool collide_connected;  ///< whether a and b have contacts with each other; default false
} limber_joint_options;
LIMBER_API limber_joint_options limber_default_joint_options(void);

/// Joins two bodies as they stand: all the joint's coordinates are 0 now. @param a, b b moves relative to a; {0, 0} is
/// the world, for one of them
LIMBER_API limber_result limber_world_add_joint(limber_world* world, limber_body_id a, limber_body_id b,
                                                const limber_joint_options* options, limber_joint_id* joint);
LIMBER_API limber_result limber_world_remove_joint(limber_world* world, limber_joint_id id);
LIMBER_API bool limber_world_contains_joint(const limber_world* world, limber_joint_id id);
LIMBER_API limber_result limber_world_list_joints(const limber_world* world, limber_joint_id* ids, size_t capacity,
                                                  size_t* count);
/// Whether two bodies have no contacts with each other even where no joint keeps them from it; they have at first.
LIMBER_API limber_result limber_world_ignore_collision(limber_world* world, limber_body_id a, limber_body_id b,
                                                       bool ignore);

/// What acts along one coordinate; forces in N or N·m, velocities in m/s or rad/s. All are 0 by default.
typedef struct limber_actuation {
  double motor_velocity;
  double motor_max_force;  ///< ≥ 0; 0: no motor
  double drive_target;     ///< m or rad
  double drive_stiffness;  ///< N/m or N·m/rad, ≥ 0; 0: no drive
  double drive_damping;    ///< N·s/m or N·m·s/rad, ≥ 0; without a stiffness: a damper
  double friction;         ///< ≥ 0
} limber_actuation;
/// @param coordinate 0 to limber_joint_state.coordinates − 1
LIMBER_API limber_result limber_world_set_joint_actuation(limber_world* world, limber_joint_id id, int coordinate,
                                                          const limber_actuation* actuation);
/// What a joint does, as of the last step. The first `coordinates` numbers of each array count.
typedef struct limber_joint_state {
  int coordinates;
  double position[3];      ///< m or rad, with full turns
  double force[3];         ///< along each: limit, motor, drive and friction together, N or N·m
  limber_vec3 lock_force;  ///< of the locked translations on b, world, N
  double distance_error;   ///< of the locked freedoms, m
  double angle_error;      ///< rad
} limber_joint_state;
LIMBER_API limber_result limber_world_joint_state(const limber_world* world, limber_joint_id id,
                                                  limber_joint_state* state);
/// Lets a joint break: at the end of a step in which the force of its locked translations is larger it is removed.
/// @param newtons > 0; infinite, as it is at first: nothing breaks it
LIMBER_API limber_result limber_world_set_joint_strength(limber_world* world, limber_joint_id id, double newtons);
LIMBER_API limber_result limber_world_joint_strength(const limber_world* world, limber_joint_id id, double* newtons);
/// A joint that broke in the last step.
typedef struct limber_joint_break {
  limber_joint_id joint;  ///< is gone
  limber_body_id a, b;    ///< that it joined; {0, 0}: the world
  uint64_t user_data;     ///< the joint's
  limber_vec3 force;      ///< that broke it: limber_joint_state.lock_force
} limber_joint_break;
LIMBER_API limber_result limber_world_joint_breaks(const limber_world* world, limber_joint_break* breaks,
                                                   size_t capacity, size_t* count);
LIMBER_API limber_result limber_world_set_joint_user_data(limber_world* world, limber_joint_id id, uint64_t data);
LIMBER_API limber_result limber_world_joint_user_data(const limber_world* world, limber_joint_id id, uint64_t* data);

// Machines: assets whose bodies are joined ------------------------------------------------------------------------

/// A joint of an asset, whose bodies stand as in its input.
typedef struct limber_asset_joint {
  int32_t a, b;                  ///< numbers of its bodies; b moves relative to a. a is −1: the world
  limber_joint_options options;  ///< frame in the input's coordinates, m; attachments without patches
  int coordinates;
  limber_actuation actuation[3];  ///< of each coordinate
} limber_asset_joint;
LIMBER_API size_t limber_asset_joint_count(const limber_asset* asset);
/// @param joint below limber_asset_joint_count()
LIMBER_API limber_result limber_asset_get_joint(const limber_asset* asset, size_t joint, limber_asset_joint* data);

/// How a machine starts.
typedef struct limber_machine_placement {
  limber_transform pose;         ///< of the input's coordinates, in the world; default the world's own
  limber_vec3 velocity;          ///< of their origin, world, m/s; bodies move with it as one rigid thing; default 0
  limber_vec3 angular_velocity;  ///< world, rad/s; default 0
  bool tied;             ///< by its joints to the world; false: these are left out, and it is free. Default true
  limber_filter filter;  ///< of all its bodies; default all
} limber_machine_placement;
LIMBER_API limber_machine_placement limber_default_machine_placement(void);
/// Adds all bodies of an asset, its joints with what acts on them, and its pairs without contacts.
/// @param bodies out, limber_asset_body_count() @param joints out, limber_asset_joint_count(); {0, 0}: left out
LIMBER_API limber_result limber_world_add_machine(limber_world* world, const limber_asset* asset,
                                                  const limber_machine_placement* placement, limber_body_id* bodies,
                                                  limber_joint_id* joints);

/// What contacts, handles and joints took in the last step.
typedef struct limber_constraint_report {
  int islands, bodies, rows;
  int iterations;                                     ///< the most that an island needed
  int solved_islands, limit_islands, failed_islands;  ///< by how their steps ended; parts of steps count each
  double residual;                                    ///< limber/engine/world.h, ConstraintReport::residual
  bool solved;                                        ///< every row is within its tolerance
  double energy_removed;                              ///< J
} limber_constraint_report;
LIMBER_API limber_result limber_world_constraint_report(const limber_world* world, limber_constraint_report* report);

// Manipulation: points get an acceleration, a velocity or a place by forces of least norm -------------------------

typedef enum limber_manipulation_level LIMBER_ENUM {
  LIMBER_MANIPULATE_ACCELERATION = 0,      ///< m/s², by a force held over the coming step
  LIMBER_MANIPULATE_VELOCITY = 1,          ///< m/s now, by an impulse
  LIMBER_MANIPULATE_POSITION = 2,          ///< m at the coming step's end, by a force held over it
  LIMBER_MANIPULATE_POSITION_IMPULSE = 3,  ///< m at the coming step's end, by an impulse now
} limber_manipulation_level;
/// A point of a body, and a unit direction in the world.
typedef struct limber_point_direction {
  limber_body_id body;
  limber_surface_point at;
  limber_vec3 direction;
} limber_point_direction;
/// @param wishes, wanted `wish_count` each: along each direction m/s², m/s or the world coordinate, m
/// @param forces where forces may act, `force_count`; NULL and 0: along the wishes themselves
/// @param max_iterations ≥ 1, of places; 6 is enough
/// @param impulses out, one per force: N for accelerations, N·s else
/// @param residual out: the largest |wanted − reached|; NULL: not told
LIMBER_API limber_result limber_world_manipulate(limber_world* world, limber_manipulation_level level,
                                                 const limber_point_direction* wishes, const double* wanted,
                                                 size_t wish_count, const limber_point_direction* forces,
                                                 size_t force_count, int max_iterations, double* impulses,
                                                 double* residual);

#ifdef __cplusplus
}
#endif
