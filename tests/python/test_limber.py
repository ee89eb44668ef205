"""What the package does beside the C interface: errors, arrays, lifetimes, words for constants, programs."""
import gc
import json
import math
import os
import pathlib
import shutil
import subprocess
import sys

import numpy as np
import pytest

import limber

SOURCE = pathlib.Path(__file__).resolve().parents[2]
G = 9.80665


@pytest.fixture
def world():
    w = limber.World()
    w.add_static(limber.Shape.half_space())
    return w


def sphere_mass(radius, density):
    return density * 4 / 3 * math.pi * radius**3


def test_a_ball_falls_along_its_parabola_and_presses_with_its_weight(world):
    ball = world.add_rigid(limber.Shape.sphere(0.5), 1000.0, position=(0, 0, 2))
    world.step(30)
    assert ball.position[2] == pytest.approx(2 - 0.5 * G * 0.25, abs=1e-9)
    world.step(120)
    (event,) = world.contact_events
    assert event["phase"] == 1
    assert event["approach"] == 0.0
    assert abs(event["impulse"][2]) * 60 == pytest.approx(sphere_mass(0.5, 1000.0) * G, rel=1e-2)
    assert ball in (world.body_at(event["a"]["index"]), world.body_at(event["b"]["index"]))


def test_errors_are_exceptions_with_the_librarys_text(world):
    with pytest.raises(limber.InputError, match="no-such.glb"):
        limber.read_asset("/no-such.glb")
    with pytest.raises(ValueError, match="radius"):
        limber.Shape.sphere(-1.0)
    ball = world.add_rigid(limber.Shape.sphere(0.5))
    ball.remove()
    assert not ball.exists
    with pytest.raises(limber.InvalidArgument):
        ball.position
    with pytest.raises(limber.InvalidArgument, match="no colour"):
        world.add_rigid(limber.Shape.sphere(0.5), colour="red")
    with pytest.raises(limber.InvalidArgument, match="hinge"):
        world.add_joint(None, None, "hinge", (0, 0, 0))
    with pytest.raises(limber.InvalidArgument, match="shape"):
        limber.Shape.hull(np.zeros((4, 2)))


def test_arrays_of_an_asset_are_views_that_outlive_it():
    asset = limber.soft_ball(0.3, cells=4, modes=6)
    model = asset.models[0]
    vertices, frequencies = model.vertices, model.frequencies
    expected = vertices.copy()
    assert not vertices.flags.owndata and not vertices.flags.writeable
    assert model.vertices.__array_interface__["data"] == vertices.__array_interface__["data"]
    del asset, model
    gc.collect()
    limber.soft_ball(0.4, cells=4, modes=6)  # takes memory that was freed
    assert np.array_equal(vertices, expected)
    assert np.linalg.norm(vertices, axis=1).max() == pytest.approx(0.3, rel=1e-3)
    assert np.all(np.diff(frequencies) >= 0) and frequencies[0] > 1.0


def test_vertices_are_written_in_place_and_agree_with_morph_targets(world):
    ball = world.add_body(limber.soft_ball(0.3, cells=4, modes=6), position=(1, 2, 3), rotation=(0.1, 0.2, 0.3))
    ball.apply_impulse((5, 0, 5), at=limber.Point(0, surface="render"))
    world.step(3)
    out, normals = np.empty((len(ball.model.vertices), 3), np.float32), np.empty((len(ball.model.vertices), 3), np.float32)
    assert ball.vertices(out=out, normals=normals) is out
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0, abs=1e-5)
    weights = ball.weights()
    assert np.abs(weights).max() > 1e-3
    local = ball.model.vertices + sum(w * ball.model.morph_target(i) for i, w in enumerate(weights))
    w, x, y, z = ball.rotation
    turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])
    assert out == pytest.approx(local @ turn.T + ball.position, abs=1e-5)
    with pytest.raises(limber.InvalidArgument, match="float64"):
        ball.vertices(out=np.empty(out.shape))
    ball.remove()
    with pytest.raises(limber.InvalidArgument):
        ball.model.vertices


def test_a_saved_state_is_restored_to_the_bit(world):
    world.add_body(limber.soft_ball(0.3, cells=4, modes=6), position=(0, 0, 0.5))
    world.step(20)
    state = world.save()
    world.step(30)
    first = world.state_hash
    world.restore(state)
    assert world.step_count == 20
    world.step(30)
    assert world.state_hash == first
    with pytest.raises(limber.InvalidArgument):
        world.restore(state[: len(state) // 2])
    assert world.state_hash == first


def test_queries_answer_with_bodies(world):
    near = world.add_rigid(limber.Shape.sphere(0.5), position=(2, 0, 1))
    far = world.add_rigid(limber.Shape.sphere(0.5), position=(4, 0, 1))
    hit = world.cast_ray((0, 0, 1), (10, 0, 0))
    assert hit.body == near and hit.distance == pytest.approx(1.5, abs=1e-6) and hit.fraction == pytest.approx(0.15, abs=1e-6)
    assert hit.normal == pytest.approx((-1, 0, 0), abs=1e-6)
    assert world.cast_ray((0, 0, 1), (10, 0, 0), ignore=[near]).body == far
    assert world.cast_ray((0, 0, 1), (-10, 0, 0)) is None
    assert set(world.find_overlaps(limber.Shape.sphere(1.0), (3, 0, 1.2))) == {near, far}
    assert world.nearest_point((2, 0, 3), 2.0).position == pytest.approx((2, 0, 1.5), abs=1e-6)
    ball = world.cast_shape(limber.Shape.sphere(0.25), (0, 0, 1), (10, 0, 0))
    assert ball.body == near and ball.distance == pytest.approx(1.25, abs=1e-5)


def test_a_motor_turns_until_the_limit():
    world = limber.World(gravity=(0, 0, 0))
    wheel = world.add_rigid(limber.Shape.sphere(0.2))
    hinge = world.add_joint(None, wheel, "revolute", (0, 0, 0), rotation_limits=(-1, 1))
    hinge.actuate(motor_velocity=3.0, motor_max_force=1000.0)
    world.step(60)
    assert hinge.coordinates == pytest.approx([1.0], abs=1e-3)
    assert world.joints == [hinge]
    with pytest.raises(limber.InvalidArgument, match="speed"):
        hinge.actuate(speed=1.0)
    wheel.remove()
    assert not hinge.exists


def test_a_lift_carries_a_crate_that_cannot_turn(world):
    lift = world.add_kinematic(limber.Shape.box((1, 1, 0.1)), position=(0, 0, 1))
    crate = world.add_rigid(limber.Shape.box((0.2, 0.2, 0.2)), position=(0, 0, 1.3), lock_rotation=(True, True, True))
    for i in range(60):
        lift.lead((0, 0, 1 + 0.01 * (i + 1)), velocity=(0, 0, 0.6))
        world.step()
    assert lift.position[2] == pytest.approx(1.6, abs=1e-9)
    assert crate.position[2] == pytest.approx(1.9, abs=5e-3)
    assert np.array_equal(crate.rotation, (1, 0, 0, 0))


def test_a_joint_that_is_too_weak_breaks():
    world = limber.World()
    ball = world.add_rigid(limber.Shape.sphere(0.1), 1000.0, position=(0, 0, -1))
    joint = world.add_joint(None, ball, "ball", (0, 0, 0))
    assert joint.strength == math.inf
    world.step(10)
    assert world.broken_joints == []
    joint.strength = 0.9 * sphere_mass(0.1, 1000.0) * G
    world.step()
    assert world.broken_joints == [joint] and not joint.exists


def test_a_handle_drags_its_point(world):
    ball = world.add_body(limber.soft_ball(0.3, cells=4, modes=6), position=(0, 0, 2))
    start = ball.point_position(3)
    handle = ball.hold(3)
    for i in range(30):
        handle.move_to(start + (0.01 * (i + 1), 0, 0))
        world.step()
    assert ball.point_position(3) == pytest.approx(start + (0.3, 0, 0), abs=1e-6)
    handle.remove()
    assert world.handles == []


def test_a_veto_lets_a_body_through(world):
    ghost = world.add_rigid(limber.Shape.sphere(0.5), position=(0, 0, 0.6))
    solid = world.add_rigid(limber.Shape.sphere(0.5), position=(3, 0, 0.6))
    world.set_contact_veto(lambda a, b: ghost in (a, b))
    world.step(60)
    assert ghost.position[2] == pytest.approx(0.6 - 0.5 * G, abs=1e-6)
    assert solid.position[2] == pytest.approx(0.5, abs=2e-3)


def test_a_sensor_tells_who_is_inside(world):
    gate = world.add_sensor(limber.Shape.sphere(0.5), (0, 0, 1))
    ball = world.add_rigid(limber.Shape.sphere(0.1), position=(0, 0, 1), user_data=2**63)
    world.step()
    assert world.inside(gate) == [ball]
    assert ball.user_data == 2**63
    world.step(60)
    assert world.inside(gate) == []


def test_a_fall_is_told_as_a_hit():
    world = limber.World(hit_speed=4.0)
    ground = world.add_static(limber.Shape.half_space())
    ball = world.add_rigid(limber.Shape.sphere(0.1), 1000.0, position=(0, 0, 1.1))
    hits = []
    for _ in range(60):
        world.step()
        hits += [event.copy() for event in world.hit_events]
        if len(world.hit_events):
            assert np.linalg.norm(world.contact_impulse(ball, ground)) == pytest.approx(
                np.linalg.norm(world.hit_events[0]["impulse"]), rel=1e-9)
    (hit,) = hits
    assert hit["speed"] == pytest.approx(math.sqrt(2 * G), abs=2 * G / 60)
    assert {world.body_at(hit[side]["index"]) for side in ("a", "b")} == {ball, ground}


def test_a_belt_carries_a_table_of_five_parts(world):
    top, leg = limber.Shape.box((0.5, 0.5, 0.05)), limber.Shape.box((0.05, 0.05, 0.25))
    legs = [(leg, (x, y, 0.25)) for x in (-0.45, 0.45) for y in (-0.45, 0.45)]
    table = world.add_compound([(top, (0, 0, 0.55), (1, 0, 0, 0)), *legs], 500.0, position=(0, 0, 0.5))
    (ground,) = [body for body in world.bodies if body != table]
    ground.surface_velocity = (0, 0.5, 0)
    assert ground.surface_velocity.tolist() == [0, 0.5, 0]
    world.step(120)
    assert table.velocity == pytest.approx((0, 0.5, 0), abs=2e-3)
    hit = world.cast_ray((0, 0, 3), (0, 0, -4), ignore=[ground])
    assert hit is None or hit.body == table  # it is carried away
    hit = world.cast_ray(table.position + (0, 0, 3), (0, 0, -4))
    assert hit.body == table and hit.point is not None and hit.position[2] == pytest.approx(0.6, abs=2e-3)
    assert table.point_position(hit.point) == pytest.approx(hit.position, abs=1e-7)


def test_an_asset_is_written_and_read(tmp_path):
    asset = limber.soft_box((0.1, 0.1, 0.3), (2, 2, 4), "rubber", modes=5)
    asset.write(tmp_path / "bar.glb")
    bytes_read = limber.read_asset((tmp_path / "bar.glb").read_bytes())
    for again in (limber.read_asset(tmp_path / "bar.glb"), bytes_read):
        assert np.array_equal(again.models[0].eigenvalues, asset.models[0].eigenvalues)
        assert again.models[0].mass == asset.models[0].mass
    assert asset.models[0].mass == pytest.approx(limber.material("rubber")[2] * 0.2 * 0.2 * 0.6, rel=1e-9)


def test_every_public_name_has_a_docstring():
    for name in limber.__all__:
        thing = getattr(limber, name)
        if callable(thing):
            assert thing.__doc__, name


def example(name, *arguments):
    done = subprocess.run([sys.executable, SOURCE / "examples/python" / name, *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_pendulum_swings_by_theory():
    words = example("pendulum.py").split()
    measured, theory = float(words[3]), float(words[7])
    assert measured == pytest.approx(theory, rel=2e-3)
    assert float(words[-2]) == pytest.approx(2.0, abs=1e-3)


needs = lambda program: pytest.mark.skipif(
    shutil.which(program, path=os.environ.get("LIMBER_BIN", "")) is None, reason=f"{program} is not built")


@needs("limber-simulate")
def test_balls_fall_into_a_glb(tmp_path):
    assert "6 balls" in example("drop.py", tmp_path / "drop.glb", "6")
    assert (tmp_path / "drop.glb").read_bytes()[:4] == b"glTF"


@needs("limber-precompute")
def test_a_mesh_is_baked_by_the_program(tmp_path):
    mesh = tmp_path / "bar.mesh"
    mesh.write_bytes(subprocess.run([SOURCE / "scripts/make-bar", *"1 0.1 0.05 8 2 1".split()], stdout=subprocess.PIPE, check=True).stdout)
    model = limber.bake(mesh, material="steel", modes=4).models[0]
    assert model.modes == 4
    assert model.mass == pytest.approx(limber.material("steel")[2] * 1 * 0.1 * 0.05, rel=1e-6)
    with pytest.raises(limber.Error):
        limber.bake(tmp_path / "none.msh")


@needs("limber-precompute")
@needs("make_assembly")
def test_a_machine_is_baked_and_moves_by_its_joints(tmp_path, world):
    limber.run("make_assembly", "door", out=tmp_path / "door.obj")
    asset = limber.bake(tmp_path / "door.obj", auto_joints=True, rigid="*")
    assert len(asset.models) > 1
    number, hinge = next((i, joint) for i, joint in enumerate(asset.joints) if joint.type == "revolute")
    door = world.add_machine(asset, position=(0, 0, 1), layers=2, mask=2)
    assert len(door.bodies) == len(asset.models) and all(joint.exists for joint in door.joints)
    leaf = door.bodies[hinge.b]
    assert leaf.position == pytest.approx(asset.models[hinge.b].origin_in_input + (0, 0, 1), abs=1e-12)
    joint = door.joints[number]
    joint.actuate(motor_velocity=0.5, motor_max_force=1e4)
    world.step(30)
    low, high = hinge.rotation_limits
    assert low < joint.coordinates[0] < high
    assert joint.coordinates[0] == pytest.approx(0.25, abs=0.02)
    free = limber.World(gravity=(0, 0, 0)).add_machine(asset, tied=False, velocity=(1, 0, 0), angular_velocity=(0, 0, 1))
    assert free.bodies[0].angular_velocity[2] == pytest.approx(1.0)
    assert [j is None for j in free.joints] == [j.a is None for j in asset.joints]
    with pytest.raises(limber.InvalidArgument):
        world.add_machine(asset, layer=2)


@needs("limber-precompute")
@needs("make_assembly")
def test_the_drawn_door_opens():
    first, *_, last = example("machine.py").splitlines()
    assert first == "revolute joint: door on frame"
    assert float(last.split()[-2]) == pytest.approx(0.9, abs=0.02)  # 3 s at 0.3 rad/s


@needs("limber-joints")
def test_joints_are_found_by_the_program(tmp_path):
    limber.run("make_assembly", "door", out=tmp_path / "door.obj")
    known = json.loads((tmp_path / "door.joints.json").read_text())
    found = limber.find_joints(tmp_path / "door.obj", components="groups")
    assert sorted(joint["type"] for joint in found["joints"]) == sorted(joint["type"] for joint in known["joints"])


@needs("limber-view")
def test_an_asset_becomes_a_page(tmp_path):
    limber.soft_ball(0.3, 6, "jelly", 4, 0.02).write(tmp_path / "ball.glb")
    page = limber.view(tmp_path / "ball.glb", tmp_path / "ball.html")
    assert page == tmp_path / "ball.html" and '{"path":"/scene/asset.glb","packed":"' in page.read_text()
    with pytest.raises(limber.InputError, match="none.glb"):
        limber.view(tmp_path / "none.glb", page)
