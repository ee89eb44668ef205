/// @file limber/c/base.h
/// Results, vectors and poses of the C interface: limber/limber.h.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#if defined(__GNUC__)
#define LIMBER_API __attribute__((visibility("default")))
#else
#define LIMBER_API
#endif

// In C an enumeration takes any int, which limber checks. In C++ it does so only where its type is told.
#ifdef __cplusplus
#define LIMBER_ENUM : int
#else
#define LIMBER_ENUM
#endif

#ifdef __cplusplus
extern "C" {
#endif

/// How a call ended.
typedef enum limber_result LIMBER_ENUM {
  LIMBER_OK = 0,
  LIMBER_INVALID_ARGUMENT = 1,   ///< an argument is NULL, out of its range, not finite, or names nothing
  LIMBER_INPUT_ERROR = 2,        ///< a file cannot be read, or holds something wrong
  LIMBER_COMPUTATION_ERROR = 3,  ///< well formed, but no right answer can be computed
  LIMBER_OUT_OF_MEMORY = 4,
  LIMBER_INTERNAL_ERROR = 5,  ///< limber's own slip: please report it
} limber_result;

/// Why the last call of this thread that failed did so: one line of UTF-8 text, at most 1023 bytes; empty before the
/// first. Valid until the thread's next failure.
LIMBER_API const char* limber_last_error(void);

/// The library's version, such as "0.1.0".
LIMBER_API const char* limber_version(void);

typedef struct limber_vec3 {
  double x, y, z;
} limber_vec3;

/// A rotation, of length 1 to 1e-6. {1, 0, 0, 0}: none.
typedef struct limber_quat {
  double w, x, y, z;
} limber_quat;

/// A pose X_AB: a point p of frame B is at q p q* + p_AB in frame A.
typedef struct limber_transform {
  limber_quat q;
  limber_vec3 p;  ///< m
} limber_transform;

/// The rotation by |r| rad about r, right hand; none at 0.
LIMBER_API limber_quat limber_quat_from_rotation_vector(limber_vec3 r);
/// No rotation, no translation.
LIMBER_API limber_transform limber_identity(void);

/// Names a body of one world. Stays invalid for good once its body is removed. Generation 0: no body.
typedef struct limber_body_id {
  uint32_t index, generation;
} limber_body_id;

/// Names a handle of one world, like limber_body_id; removed by itself or with its body.
typedef struct limber_handle_id {
  uint32_t index, generation;
} limber_handle_id;

/// Names a joint of one world, like limber_handle_id.
typedef struct limber_joint_id {
  uint32_t index, generation;
} limber_joint_id;

typedef enum limber_surface LIMBER_ENUM {
  LIMBER_SURFACE_RENDER = 0,     ///< what is drawn
  LIMBER_SURFACE_COLLISION = 1,  ///< what touches
} limber_surface;

/// A point of a body's surface. A vertex v is any triangle that has it, weight 1 at its corner.
typedef struct limber_surface_point {
  limber_surface surface;
  int32_t triangle;
  double weight[3];  ///< barycentric, sums to 1
} limber_surface_point;

/// A bodies' layers and whom it meets: two bodies do only if each one's layers share a bit with the other's mask.
typedef struct limber_filter {
  uint32_t layers;  ///< default 1
  uint32_t mask;    ///< default all
  bool self;        ///< also where the body touches itself: modal bodies with a volume block. Default false
} limber_filter;

#ifdef __cplusplus
}
#endif
