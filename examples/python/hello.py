"""hello: ground, a box and a soft ball that fall, a step, a ray: examples/00_hello.cpp in Python.

  run:   python3 hello.py
  see:   the heights of a wooden crate and of a ball of jelly, ten times a second, to the last digit those of 00_hello
  next:  pendulum.py
"""
import limber

world = limber.World()                                               # 1/60 s a step; gravity is −z; bodies meet
world.add_static(limber.Shape.half_space())                          # ground: z ≤ 0
box = world.add_rigid(limber.Shape.box((0.5, 0.5, 0.5)), 700.0, position=(0, 0, 3), rotation=(0.3, 0.2, 0))  # kg/m³
jelly = (1e5, 0.4, 1000.0)                                           # Pa, Poisson's ratio, kg/m³
ball = world.add_body(limber.soft_ball(0.3, cells=6, material=jelly, modes=12), position=(3, 0, 1))

for step in range(181):
    if step % 6 == 0:
        print(f"{world.time:.1f} s: crate at {box.position[2]:.3f} m, ball at {ball.position[2]:.3f} m")
    world.step()
hit = world.cast_ray(ball.position + (0, 0, 1), (0, 0, -2))
if hit:
    print(f"a ray from above meets the {'ball' if hit.body == ball else 'ground'} at {hit.position[2]:.3f} m")
