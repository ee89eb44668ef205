// Four scenes by the C interface, and the hash of the state that each ends in. scenes.cpp and scenes.py are the same
// scenes in C++ and Python: what they print is the same.
#include <inttypes.h>
#include <limber/limber.h>
#include <stdio.h>
#include <stdlib.h>

static void check(limber_result result) {
  if (result == LIMBER_OK) return;
  fprintf(stderr, "scenes: %s\n", limber_last_error());
  exit(1);
}

static limber_world* make_world(limber_contact_solver solver, bool contacts) {
  limber_world* world;
  check(limber_world_create(NULL, &world));
  limber_contact_options options = limber_default_contact_options();
  options.solver = solver;
  options.find_contacts = contacts;
  check(limber_world_set_contacts(world, &options));
  return world;
}

static limber_body_id add_ground(limber_world* world) {
  limber_shape* ground;
  limber_body_id id;
  check(limber_shape_create_half_space((limber_vec3){0, 0, 1}, 0.0, &ground));
  check(limber_world_add_static(world, ground, NULL, &id));
  limber_shape_destroy(ground);
  return id;
}

static limber_body_id add_crate(limber_world* world, limber_vec3 at, limber_vec3 turn) {
  limber_shape* box;
  limber_body_id id;
  limber_placement start = limber_default_placement();
  start.pose = (limber_transform){limber_quat_from_rotation_vector(turn), at};
  check(limber_shape_create_box((limber_vec3){0.25, 0.25, 0.25}, &box));
  check(limber_world_add_rigid(world, box, 700.0, &start, &id));
  limber_shape_destroy(box);
  return id;
}

static limber_body_id add_jelly(limber_world* world, limber_vec3 at, limber_vec3 spin) {
  const limber_material jelly = {1e5, 0.4, 1000.0};
  const int32_t cells[3] = {3, 3, 6};
  limber_asset* bar;
  limber_body_id id;
  limber_placement start = limber_default_placement();
  start.pose.p = at;
  start.angular_velocity = spin;
  check(limber_asset_create_soft_box((limber_vec3){0.1, 0.1, 0.3}, cells, &jelly, 8, 0.02, &bar));
  check(limber_world_add_body(world, bar, 0, &start, &id));
  limber_asset_destroy(bar);
  return id;
}

static void end(const char* name, limber_world* world, int steps) {
  check(limber_world_step(world, steps));
  printf("%s %016" PRIx64 "\n", name, limber_world_state_hash(world));
  limber_world_destroy(world);
}

static void flight(void) {
  limber_world* world = make_world(LIMBER_CONTACT_GAME, false);
  const limber_body_id bar = add_jelly(world, (limber_vec3){0, 0, 2}, (limber_vec3){1, 2, 3});
  const limber_surface_point corner = {LIMBER_SURFACE_COLLISION, 5, {1, 0, 0}};
  check(limber_world_apply_impulse(world, bar, corner, (limber_vec3){0.5, 0.1, 2}, LIMBER_AXES_BODY, 0.004));
  end("flight", world, 600);
}

static void joints(void) {
  limber_world* world = make_world(LIMBER_CONTACT_EXACT, false);
  const limber_body_id a = add_crate(world, (limber_vec3){0, 0, 2}, (limber_vec3){0, 0, 0});
  const limber_body_id b = add_jelly(world, (limber_vec3){0, 0, 1.4}, (limber_vec3){0, 0, 0});
  limber_joint_id ball, hinge;
  limber_joint_options options = limber_default_joint_options();
  options.type = LIMBER_JOINT_BALL;
  options.frame.p = (limber_vec3){0.25, 0, 2};
  check(limber_world_add_joint(world, (limber_body_id){0, 0}, a, &options, &ball));
  options.type = LIMBER_JOINT_REVOLUTE;
  options.frame.p = (limber_vec3){0, 0, 1.7};
  options.rotation = (limber_interval){-0.5, 0.8};
  check(limber_world_add_joint(world, a, b, &options, &hinge));
  const limber_actuation motor = {.motor_velocity = 2.0, .motor_max_force = 5.0, .friction = 0.1};
  check(limber_world_set_joint_actuation(world, hinge, 0, &motor));
  end("joints", world, 120);
}

static void contact(const char* name, limber_contact_solver solver, int crates, int steps) {
  limber_world* world = make_world(solver, true);
  add_ground(world);
  for (int i = 0; i < crates; ++i)
    add_crate(world, (limber_vec3){0.02 * i, 0, 0.3 + 0.6 * i}, (limber_vec3){0.1, 0, 0.2 * i});
  add_jelly(world, (limber_vec3){0.1, 0, 0.6 + 0.6 * crates}, (limber_vec3){0.5, 0, 0});
  end(name, world, steps);
}

int main(void) {
  flight();
  joints();
  contact("contact_exact", LIMBER_CONTACT_EXACT, 2, 60);
  contact("contact_game", LIMBER_CONTACT_GAME, 6, 240);
  return 0;
}
