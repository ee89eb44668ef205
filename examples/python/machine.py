"""machine: the joints of a drawn door are found in its triangles, and a motor opens it.

  run:   python3 machine.py            limber-precompute is on PATH or in LIMBER_BIN
  see:   parts and joints of the door, then how far its motor has turned it, each second
  next:  error_vs_time.py
"""
import pathlib
import tempfile

import limber

with tempfile.TemporaryDirectory() as folder:
    drawing = pathlib.Path(folder) / "door.obj"
    limber.run("make_assembly", "door", out=drawing)                 # any OBJ, glTF or STL of an assembly will do
    door = limber.bake(drawing, auto_joints=True, rigid="*")
for joint in door.joints:
    a = "the world" if joint.a is None else door.models[joint.a].name
    print(f"{joint.type} joint: {door.models[joint.b].name} on {a}")

world = limber.World()
placed = world.add_machine(door)
hinge = next(j for j, told in zip(placed.joints, door.joints) if told.type == "revolute" and j is not None)
hinge.actuate(motor_velocity=0.3, motor_max_force=100.0)             # rad/s, N·m
for second in range(4):
    print(f"{world.time:.0f} s: turned by {hinge.coordinates[0]:.3f} rad")
    world.step(60)
