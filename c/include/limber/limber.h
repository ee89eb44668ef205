/// @file limber/limber.h
/// limber in C: soft and stiff bodies that fall, touch and hang on joints, moved in fixed steps. C11; C++ takes it too.
///
///   limber_world* world;
///   limber_world_create(NULL, &world);                              // 1/60 s a step, gravity along −z
///   limber_world_set_contacts(world, NULL);                         // bodies meet; without this they pass through
///   limber_asset* bunny;
///   if (limber_asset_read_file("bunny.glb", &bunny) != LIMBER_OK) puts(limber_last_error());
///   limber_body_id id;
///   limber_world_add_body(world, bunny, 0, NULL, &id);
///   limber_asset_destroy(bunny);                                    // the world holds what it needs
///   while (running) {
///     limber_world_advance(world, frame_seconds, NULL);             // 0, 1 or more fixed steps
///     limber_world_reconstruct(world, id, positions, normals, 1.0); // deformed vertices, if you draw them
///   }
///   limber_world_destroy(world);
///
/// *Units.* m, kg, s, N, N·s, J, rad. World axes are right-handed; z is up where gravity is not set otherwise. A body's
/// frame B has its origin at the centre of mass and the axes of its mesh or shape; `pose` is X_WB, which takes points
/// of B into the world. Amplitudes z of modes are in kg^½·m. C++ programs find derivations behind each function in the
/// header of its namesake, limber/engine/world.h.
///
/// *Errors.* A function that can fail returns a limber_result and writes its answers through its last pointers. After
/// anything but LIMBER_OK nothing has changed, answers are not written, and limber_last_error() tells why in a line.
/// No C++ exception leaves limber. A pointer that must not be NULL is checked, as every number and id is: they must be
/// finite, in the range told, and name something that is there. Pointers to options may be NULL: the defaults.
///
/// *Ownership.* What a `_create` or `_read` function gives belongs to the caller, until its `_destroy` function, which
/// takes NULL too. A world keeps what it needs of shapes and assets for itself: they may be destroyed once they are
/// added. Pointers into an object (`const limber_model*`, arrays of limber_model_data) are valid as long as it lives.
/// Arrays of the caller are read or written during the call alone, but for contexts of callbacks.
///
/// *Lists.* A function with `capacity` and `count` writes at most `capacity` items and sets `*count` to how many there
/// are: call it with capacity 0 and no array to learn the number.
///
/// *Threads.* A world and its queries are used by one thread at a time; different worlds by different threads at once.
/// Assets and shapes do not change: any number of threads may read them. limber_last_error() is the calling thread's.
/// There is no global state.
///
/// *Same bits.* The same calls give the same state to the bit as from C++: limber_world_state_hash().
///
/// *Versions.* Until 1.0 structs and functions may change with the second number of the version, and the library's
/// SONAME with them. Fill options by their default-makers, so that fields that are new have their defaults.
#pragma once

#include "limber/c/asset.h"
#include "limber/c/base.h"
#include "limber/c/constraints.h"
#include "limber/c/contact.h"
#include "limber/c/world.h"
