"""The scenes of tests/c/scenes.c in Python."""
import limber

JELLY = (1e5, 0.4, 1000.0)


def add_crate(world, at, turn=(0, 0, 0)):
    return world.add_rigid(limber.Shape.box((0.25, 0.25, 0.25)), 700.0, position=at, rotation=turn)


def add_jelly(world, at, spin=(0, 0, 0)):
    bar = limber.soft_box((0.1, 0.1, 0.3), (3, 3, 6), JELLY, modes=8)
    return world.add_body(bar, position=at, angular_velocity=spin)


def end(name, world, steps):
    world.step(steps)
    print(f"{name} {world.state_hash:016x}")


def flight():
    world = limber.World(contacts=False)
    bar = add_jelly(world, (0, 0, 2), (1, 2, 3))
    bar.apply_impulse((0.5, 0.1, 2), at=5, axes="body", delay=0.004)
    end("flight", world, 600)


def joints():
    world = limber.World(contacts={"solver": "exact", "find_contacts": False})
    a, b = add_crate(world, (0, 0, 2)), add_jelly(world, (0, 0, 1.4))
    world.add_joint(None, a, "ball", position=(0.25, 0, 2))
    hinge = world.add_joint(a, b, "revolute", position=(0, 0, 1.7), rotation_limits=(-0.5, 0.8))
    hinge.actuate(motor_velocity=2.0, motor_max_force=5.0, friction=0.1)
    end("joints", world, 120)


def contact(name, solver, crates, steps):
    world = limber.World(contacts=solver)
    world.add_static(limber.Shape.half_space())
    for i in range(crates):
        add_crate(world, (0.02 * i, 0, 0.3 + 0.6 * i), (0.1, 0, 0.2 * i))
    add_jelly(world, (0.1, 0, 0.6 + 0.6 * crates), (0.5, 0, 0))
    end(name, world, steps)


flight()
joints()
contact("contact_exact", "exact", 2, 60)
contact("contact_game", "game", 6, 240)
