// hello: ground, a box and a soft ball that fall, a step, a ray: examples/00_hello.cpp in C.
//   run:   hello
//   see:   the heights of a wooden crate and of a ball of jelly, ten times a second, to the last digit those of 00_hello
//   next:  docs/c-and-python.md
#include <limber/limber.h>
#include <stdio.h>
#include <stdlib.h>

static void check(limber_result result) {
  if (result == LIMBER_OK) return;
  fprintf(stderr, "hello: %s\n", limber_last_error());
  exit(1);
}

static limber_vec3 place(const limber_world* world, limber_body_id body) {
  limber_body_state state;
  check(limber_world_body_state(world, body, &state));
  return state.pose.p;
}

int main(void) {
  limber_world* world;
  check(limber_world_create(NULL, &world));       // 1/60 s a step; gravity is −z
  check(limber_world_set_contacts(world, NULL));  // bodies meet

  limber_body_id ground, box, ball;
  limber_shape *half_space, *crate;
  check(limber_shape_create_half_space((limber_vec3){0, 0, 1}, 0.0, &half_space));  // z ≤ 0
  check(limber_world_add_static(world, half_space, NULL, &ground));

  limber_placement start = limber_default_placement();
  check(limber_shape_create_box((limber_vec3){0.5, 0.5, 0.5}, &crate));  // half extents, m
  start.pose = (limber_transform){limber_quat_from_rotation_vector((limber_vec3){0.3, 0.2, 0}), {0, 0, 3}};
  check(limber_world_add_rigid(world, crate, 700.0, &start, &box));  // kg/m³

  limber_asset* wobbly;
  const limber_material jelly = {1e5, 0.4, 1000.0};
  check(limber_asset_create_soft_ball(0.3, 6, &jelly, 12, 0.02, &wobbly));  // radius, cells across, modes, damping
  start.pose = (limber_transform){{1, 0, 0, 0}, {3, 0, 1}};
  check(limber_world_add_body(world, wobbly, 0, &start, &ball));

  limber_shape_destroy(half_space);  // the world holds what it needs
  limber_shape_destroy(crate);
  limber_asset_destroy(wobbly);

  for (int step = 0; step <= 180; ++step) {
    if (step % 6 == 0)
      printf("%.1f s: crate at %.3f m, ball at %.3f m\n", limber_world_time(world), place(world, box).z,
             place(world, ball).z);
    check(limber_world_step(world, 1));
  }
  bool found;
  limber_hit hit;
  limber_vec3 above = place(world, ball);
  above.z += 1.0;
  check(limber_world_cast_ray(world, above, (limber_vec3){0, 0, -2}, NULL, &found, &hit));
  if (found)
    printf("a ray from above meets the %s at %.3f m\n", hit.body.index == ball.index ? "ball" : "ground",
           hit.position.z);
  limber_world_destroy(world);
  return 0;
}
