"""pendulum: a bar on a hinge swings, then a motor turns it.

  run:   python3 pendulum.py
  see:   the time of a small swing beside that of theory, 2π √(I/(m g d)); then the bar's speed, which is the motor's
  next:  drop.py
"""
import math

import limber

HALF_LENGTH, G = 0.5, 9.80665                                        # m, m/s²

world = limber.World(step=1 / 240, contacts=False)
bar = world.add_rigid(limber.Shape.box((0.02, 0.02, HALF_LENGTH)), 2700.0, position=(0, 0, -HALF_LENGTH))
hinge = world.add_joint(None, bar, "revolute", position=(0, 0, 0))   # about x, at the bar's upper end
bar.set_velocity((0, 0.05, 0), (0.1, 0, 0))                          # m/s, rad/s: v = ω × r

crossings = []
before = 0.0
while len(crossings) < 3:
    world.step()
    now = hinge.coordinates[0]
    if before * now < 0:
        crossings.append(world.time - now / (now - before) / 240)
    before = now
inertia = (0.02**2 + HALF_LENGTH**2) / 3 + HALF_LENGTH**2            # about the hinge, per kg, m²
print(f"a swing takes {crossings[2] - crossings[0]:.4f} s, by theory {2 * math.pi * math.sqrt(inertia / (G * HALF_LENGTH)):.4f} s")

hinge.actuate(motor_velocity=2.0, motor_max_force=200.0)             # rad/s, N·m
world.step(240)
print(f"the motor turns it at {bar.angular_velocity[0]:.4f} rad/s")
