"""Worlds, and the bodies, handles and joints in them."""

from __future__ import annotations

import functools
import struct
from typing import Any, Callable, Iterable, NamedTuple, Optional, Sequence, Union

import numpy as np

from ._asset import Asset, Model, Shape
from ._library import Answer, InvalidArgument, answer, array3, check, chosen, create, ffi, lib, transform, vector, word


def _record(ctype: Any) -> Any:
    """The numpy type of a C one, as the header has it: structs by member, vectors as three numbers."""
    if ctype is ffi.typeof("limber_vec3"):
        return np.dtype((np.float64, 3))
    if ctype.kind == "struct":
        members = ctype.fields
        return np.dtype({"names": [name for name, _ in members], "formats": [_record(m.type) for _, m in members],
                         "offsets": [m.offset for _, m in members], "itemsize": ffi.sizeof(ctype)})
    scalars = {"double": np.float64, "uint64_t": np.uint64, "uint32_t": np.uint32}
    return np.dtype(np.int32 if ctype.kind == "enum" else scalars[ctype.cname])


CONTACT_EVENT = _record(ffi.typeof("limber_contact_event"))
"""A contact that pressed, or ceased to, in the last step, as limber_contact_event has it. phase: 0 begun, 1 lasting, 2 ended.
position: world, m; normal: out of b into a; impulse: on a over the step, world, N·s. World.body_at(event["a"]["index"]) is the body."""


HIT_EVENT = _record(ffi.typeof("limber_hit_event"))
"""A pair of bodies that came together fast in the last step, as limber_hit_event has it: a, b, user_data_a, user_data_b; position and
normal of the fastest contact; speed, m/s; impulse of all their contacts on a, N·s."""


ALL_LAYERS = 0xFFFFFFFF


class Point(NamedTuple):
    """A point of a body's surface: a triangle and barycentric weights, which sum to 1."""

    triangle: int
    weights: Sequence[float] = (1.0, 0.0, 0.0)
    surface: str = "collision"
    """or "render" """


class Energy(NamedTuple):
    """J"""

    kinetic_rigid: float
    potential: float
    kinetic_modal: float
    elastic: float


class Hit(NamedTuple):
    """A place on a body that answers a query."""

    body: Body
    point: Optional[Point]
    """as loads and handles take it; None for static bodies"""
    position: np.ndarray
    """(3,), world, m"""
    normal: np.ndarray
    """(3,), unit, world, towards where the query came from"""
    fraction: float
    """of the way, in [0, 1]"""
    distance: float
    """m"""


_SURFACES = {lib.LIMBER_SURFACE_COLLISION: "collision", lib.LIMBER_SURFACE_RENDER: "render"}


def _point(at: Union[int, Point]) -> tuple[int, int, Sequence[float]]:
    p = at if isinstance(at, Point) else Point(int(at))
    return word("LIMBER_SURFACE_", p.surface), p.triangle, list(p.weights)


_EVERY_BODY = ffi.NULL, None
"""What World._filter gives where nobody is left out"""

_HIT = struct.Struct("@2I?0dIi3d48x2d")
"""limber_hit without position, normal and user_data"""

_make = tuple.__new__
"""Of a NamedTuple from all its members: half the time of its own constructor"""


def _key(id: Any) -> tuple[int, int]:
    """An id of its own, in whose place C takes the pair: `id` may be in a list's memory."""
    return id.index, id.generation


class _Named:
    """Something that an id names in a world."""

    _kind = ""

    def __init__(self, world: World, id: tuple[int, int]) -> None:
        self._world = world
        self._id = id

    def __eq__(self, other: object) -> bool:
        return (isinstance(other, _Named) and type(other) is type(self) and other._world is self._world
                and other._id == self._id)

    def __hash__(self) -> int:
        return hash((self._kind, self._id))

    def __repr__(self) -> str:
        return f"<limber.{type(self).__name__} {self.index} of {self._world!r}>"

    @property
    def index(self) -> int:
        """Number in the world, which one that comes later may get again."""
        return self._id[0]

    @property
    def exists(self) -> bool:
        """False once it has been removed."""
        return bool(getattr(lib, f"limber_world_contains_{self._kind}")(self._world._pointer, self._id))

    def remove(self) -> None:
        """Takes it out of the world; of a body its handles and joints too."""
        check(getattr(lib, f"limber_world_remove_{self._kind}")(self._world._pointer, self._id))

    @property
    def user_data(self) -> int:
        """A number of the caller's own, of 64 bits; part of a saved state."""
        read = getattr(lib, f"limber_world_{self._kind}_user_data")
        return answer("uint64_t", read, self._world._pointer, self._id)[0]

    @user_data.setter
    def user_data(self, data: int) -> None:
        check(getattr(lib, f"limber_world_set_{self._kind}_user_data")(self._world._pointer, self._id, data))


class Body(_Named):
    """A body of a world; of static bodies and sensors only what every id has."""

    _kind = "body"

    def _state(self) -> Answer:
        state = self._world._body_state
        check(lib.limber_world_body_state(self._world._pointer, self._id, state.pointer))
        return state

    @property
    def position(self) -> np.ndarray:
        """(3,): the body's origin, its centre of mass, world, m"""
        return self._state().copy["position"]()

    @property
    def rotation(self) -> np.ndarray:
        """(4,): unit quaternion (w, x, y, z) from body to world axes"""
        return self._state().copy["rotation"]()

    @property
    def velocity(self) -> np.ndarray:
        """(3,): of the body's origin, world, m/s"""
        return self._state().copy["velocity"]()

    @property
    def angular_velocity(self) -> np.ndarray:
        """(3,), world, rad/s"""
        return self._state().copy["angular_velocity"]()

    @property
    def amplitudes(self) -> np.ndarray:
        """(k,): z of the modes, kg^½·m; a copy"""
        s = self._state().pointer
        return np.frombuffer(ffi.buffer(s.amplitude, 8 * s.modes), np.float64).copy() if s.modes else np.empty(0)

    @property
    def rates(self) -> np.ndarray:
        """(k,): ż, kg^½·m/s; a copy"""
        s = self._state().pointer
        return np.frombuffer(ffi.buffer(s.rate, 8 * s.modes), np.float64).copy() if s.modes else np.empty(0)

    def set_pose(self, position: Sequence[float], rotation: Sequence[float] = (1, 0, 0, 0)) -> None:
        """World, m. `rotation`: a quaternion (w, x, y, z) or a rotation vector, rad."""
        check(lib.limber_world_set_pose(self._world._pointer, self._id, transform(position, rotation)))

    def set_velocity(self, velocity: Sequence[float], angular_velocity: Sequence[float] = (0, 0, 0)) -> None:
        """World, m/s and rad/s."""
        check(lib.limber_world_set_velocity(self._world._pointer, self._id, vector(velocity), vector(angular_velocity)))

    def set_amplitudes(self, amplitudes: Sequence[float], rates: Sequence[float]) -> None:
        """(k,) each, kg^½·m and kg^½·m/s."""
        if len(amplitudes) != len(rates):
            raise InvalidArgument(f"{len(amplitudes)} amplitudes and {len(rates)} rates, expected as many")
        check(lib.limber_world_set_amplitudes(self._world._pointer, self._id, list(amplitudes), list(rates),
                                              len(amplitudes)))

    def lead(self, position: Sequence[float], rotation: Sequence[float] = (1, 0, 0, 0), velocity: Sequence[float] = (0, 0, 0),
             angular_velocity: Sequence[float] = (0, 0, 0)) -> None:
        """Where a kinematic body, or what carries a body with fixed nodes, is at the end of the coming step, and how it moves
        there; world, m, m/s, rad/s."""
        frame = ffi.new("limber_kinematic_frame*")
        frame.pose = transform(position, rotation)
        frame.velocity, frame.angular_velocity = vector(velocity), vector(angular_velocity)
        check(lib.limber_world_set_kinematic_frame(self._world._pointer, self._id, frame))

    def set_gravity_scale(self, scale: float) -> None:
        """The body's gravity is this times the world's."""
        check(lib.limber_world_set_gravity_scale(self._world._pointer, self._id, scale))

    def set_damping(self, linear: float, angular: float) -> None:
        """c of v̇ = … − c v and of rotation, 1/s."""
        check(lib.limber_world_set_damping(self._world._pointer, self._id, linear, angular))

    def set_locks(self, translation: Sequence[bool] = (False, False, False),
                  rotation: Sequence[bool] = (False, False, False)) -> None:
        """Axes of the world along which the body does not move and about which it does not turn."""
        check(lib.limber_world_set_locks(self._world._pointer, self._id, list(translation), list(rotation)))

    @property
    def surface_velocity(self) -> np.ndarray:
        """(3,): how the surface runs over the body, as a conveyor's belt does, body axes, m/s"""
        return self._world._ask(lib.limber_world_surface_velocity, self._id)

    @surface_velocity.setter
    def surface_velocity(self, velocity: Sequence[float]) -> None:
        check(lib.limber_world_set_surface_velocity(self._world._pointer, self._id, vector(velocity)))

    @property
    def energy(self) -> Energy:
        e = answer("limber_energy", lib.limber_world_energy, self._world._pointer, self._id)
        return Energy(e.kinetic_rigid, e.potential, e.kinetic_modal, e.elastic)

    @property
    def model(self) -> Model:
        return Model(self._find_model, None)

    def _find_model(self) -> Any:
        return answer("const limber_model*", lib.limber_world_body_model, self._world._pointer, self._id)[0]

    @property
    def asleep(self) -> bool:
        return bool(answer("bool", lib.limber_world_is_asleep, self._world._pointer, self._id)[0])

    def wake(self) -> None:
        """Wakes it and all that sleeps with it."""
        check(lib.limber_world_wake(self._world._pointer, self._id))

    def apply_force(self, force: Sequence[float], at: Union[int, Point], axes: str = "world") -> None:
        """N, at the deformed point, held over the coming step. `axes`: "world" or "body"."""
        check(lib.limber_world_apply_force(self._world._pointer, self._id, _point(at), vector(force),
                                           word("LIMBER_AXES_", axes)))

    def apply_impulse(self, impulse: Sequence[float], at: Union[int, Point], axes: str = "world",
                      delay: float = 0.0) -> None:
        """N·s, at the deformed point, now. `delay`: s into the coming step at which the modes get it."""
        check(lib.limber_world_apply_impulse(self._world._pointer, self._id, _point(at), vector(impulse),
                                             word("LIMBER_AXES_", axes), delay))

    def point_position(self, at: Union[int, Point]) -> np.ndarray:
        """(3,): a surface point, deformed, world, m"""
        return self._world._ask(lib.limber_world_point_position, self._id, _point(at))

    def point_velocity(self, at: Union[int, Point]) -> np.ndarray:
        """(3,): of a surface point, deformation included, world, m/s"""
        return self._world._ask(lib.limber_world_point_velocity, self._id, _point(at))

    def hold(self, at: Union[int, Point], **options: Any) -> Handle:
        """Takes hold of a point where it is now. Options: max_force (N), stiffness (N/m), damping (N·s/m)."""
        o = ffi.new("limber_handle_options*", lib.limber_default_handle_options())
        chosen(o, options, "a handle")
        return Handle(self._world, _key(answer("limber_handle_id", lib.limber_world_add_handle, self._world._pointer,
                                          self._id, _point(at), o)[0]))

    def vertices(self, out: Optional[np.ndarray] = None, normals: Optional[np.ndarray] = None,
                 interpolation: float = 1.0) -> np.ndarray:
        """(V, 3) float32: the drawn surface, deformed, world, m. `out`, `normals`: arrays of that shape that are written in
        place; without `out` a new one. `interpolation`: in [0, 1] between the last two states."""
        if out is None:
            out = np.empty((self._drawn_vertices, 3), np.float32)
        check(lib.limber_world_reconstruct(self._world._pointer, self._id, self._numbers(out),
                                           ffi.NULL if normals is None else self._numbers(normals), interpolation))
        return out

    def weights(self, interpolation: float = 1.0) -> np.ndarray:
        """(k,) float32: weights of the morph targets (`Model.morph_target`), for a caller that deforms on its GPU."""
        out = np.empty(self.model.modes, np.float32)
        check(lib.limber_world_interpolated_weights(self._world._pointer, self._id, interpolation,
                                                    ffi.from_buffer("float[]", out)))
        return out

    @functools.cached_property
    def _drawn_vertices(self) -> int:
        return self.model._data.render.vertices

    def _numbers(self, array: np.ndarray) -> Any:
        expected = (self._drawn_vertices, 3)
        if array.shape != expected or array.dtype != np.float32 or not array.flags.c_contiguous:
            raise InvalidArgument(f"an array of {array.dtype} and shape {array.shape}, expected float32 and {expected}")
        return ffi.from_buffer("float[]", array, require_writable=True)


class Handle(_Named):
    """A point of a body that is held, dragged or pulled: `Body.hold`."""

    _kind = "handle"

    def move_to(self, position: Sequence[float], velocity: Sequence[float] = (0, 0, 0)) -> None:
        """Where the point is wanted at the end of the coming step, world, m, and how it goes on from there, m/s."""
        check(lib.limber_world_set_handle_target(self._world._pointer, self._id, vector(position), vector(velocity)))

    def _state(self) -> Any:
        return answer("limber_handle_state", lib.limber_world_handle_state, self._world._pointer, self._id)

    @property
    def force(self) -> np.ndarray:
        """(3,): mean on the body over the last step, world, N"""
        return array3(self._state().force)

    @property
    def work(self) -> float:
        """done on the body in the last step, J"""
        return self._state().work

    @property
    def error(self) -> float:
        """distance from the target along the held directions, m"""
        return self._state().error


class Joint(_Named):
    """A joint between two bodies: `World.add_joint`."""

    _kind = "joint"

    def _state(self) -> Any:
        return answer("limber_joint_state", lib.limber_world_joint_state, self._world._pointer, self._id)

    @property
    def coordinates(self) -> np.ndarray:
        """(0 to 3,): rad or m, angles with their full turns; 0 where the joint was made"""
        s = self._state()
        return np.array(list(s.position)[: s.coordinates])

    @property
    def forces(self) -> np.ndarray:
        """(0 to 3,): along each coordinate, limit, motor, drive and friction together, N or N·m"""
        s = self._state()
        return np.array(list(s.force)[: s.coordinates])

    @property
    def lock_force(self) -> np.ndarray:
        """(3,): of the locked translations on b, world, N"""
        return array3(self._state().lock_force)

    @property
    def strength(self) -> float:
        """N: at the end of a step in which `lock_force` is larger the joint is removed; infinite at first. `World.broken_joints`"""
        return answer("double", lib.limber_world_joint_strength, self._world._pointer, self._id)[0]

    @strength.setter
    def strength(self, newtons: float) -> None:
        check(lib.limber_world_set_joint_strength(self._world._pointer, self._id, newtons))

    def actuate(self, coordinate: int = 0, **actuation: float) -> None:
        """What acts along a coordinate from now on, in place of what did: motor_velocity, motor_max_force, drive_target,
        drive_stiffness, drive_damping, friction; those not given are 0."""
        a = ffi.new("limber_actuation*")
        chosen(a, actuation, "an actuation")
        check(lib.limber_world_set_joint_actuation(self._world._pointer, self._id, coordinate, a))


class Machine(NamedTuple):
    """An asset's bodies and joints in a world: `World.add_machine`."""

    bodies: list[Body]
    """per model of the asset"""
    joints: list[Optional[Joint]]
    """per joint of the asset; None for those to the world where it is not tied"""


class World:
    """Bodies in a space, moved in fixed steps.

    `step`: s. `gravity`: (3,), m/s². `contacts`: whether bodies meet; "exact" for contact to Coulomb's law in place of game
    contact, or a dict of options of limber_contact_options, such as {"substeps": 16, "friction": 0.3}. Other options are those
    of limber_world_options: substeps, max_steps_per_advance, sleep, sleep_time, sleep_speed, half_precision, hit_speed.

    A world is used by one thread at a time. The same calls give the same state to the bit, from C++ and C too.
    """

    def __init__(self, step: float = 1.0 / 60.0, gravity: Sequence[float] = (0.0, 0.0, -9.80665),
                 contacts: Union[bool, str, dict[str, Any]] = True, **options: Any) -> None:
        o = ffi.new("limber_world_options*", lib.limber_default_world_options())
        chosen(o, dict(options, step=step, gravity=vector(gravity)), "a world")
        self._pointer = create("limber_world", lib.limber_world_create, o)
        self._veto: Any = None
        self._vector = Answer("limber_vec3", vector=["x"])
        self._body_state = Answer("limber_body_state", position=["pose", "p"], rotation=["pose", "q"], velocity=["velocity"],
                                  angular_velocity=["angular_velocity"])
        self._found = Answer("bool")
        self._hit = Answer("limber_hit", position=["position"], normal=["normal"])
        if contacts is not False:
            self.set_contacts(contacts)

    def _ask(self, function: Any, *arguments: Any) -> np.ndarray:
        check(function(self._pointer, *arguments, self._vector.pointer))
        return self._vector.copy["vector"]()

    def __repr__(self) -> str:
        return f"<limber.World of {lib.limber_world_body_count(self._pointer)} bodies at {self.time:g} s>"

    def set_contacts(self, contacts: Union[bool, str, dict[str, Any]]) -> None:
        """As `contacts` of the constructor; what contacts remember is forgotten."""
        o = ffi.new("limber_contact_options*", lib.limber_default_contact_options())
        given = dict(contacts) if isinstance(contacts, dict) else {}
        if isinstance(contacts, bool):
            given["find_contacts"] = contacts
        elif isinstance(contacts, str):
            given["solver"] = contacts
        if isinstance(given.get("solver"), str):
            given["solver"] = word("LIMBER_CONTACT_", given["solver"])
        check(lib.limber_world_set_contacts(self._pointer, chosen(o, given, "contact")))

    # Bodies

    def add_body(self, asset: Asset, body: int = 0, **placement: Any) -> Body:
        """A body of an asset, which bends by its modes.

        Placement, here and below: position (3,), m; rotation, a quaternion (w, x, y, z) or a rotation vector, rad; velocity,
        m/s; angular_velocity, rad/s; friction, μ ≥ 0; restitution, e from 0 to 1; layers and mask, bits: whom it meets; shape, which others meet in place
        of the surface; modal_skin, False to bend by modes alone; inertial_coupling, True
        for flight in which turning and modes feel each other; gravity_scale; linear_damping and angular_damping, 1/s;
        lock_translation and lock_rotation, three bools for axes of the world; user_data.
        """
        return self._add(lib.limber_world_add_body, (asset._pointer, body), placement)

    def add_rigid(self, shape: Shape, density: float = 1000.0, **placement: Any) -> Body:
        """A rigid body of even density, kg/m³, placed by its centre of mass."""
        return self._add(lib.limber_world_add_rigid, (shape._pointer, density), placement)

    def add_compound(self, parts: Sequence[tuple[Any, ...]], density: float = 1000.0, **placement: Any) -> Body:
        """A rigid body of several shapes, of even density, kg/m³, placed by its centre of mass. `parts`: (shape, position) or (shape,
        position, rotation), in a frame of the compound's own."""
        array = ffi.new("limber_shape_part[]", [(shape._pointer, transform(position, turned[0] if turned else (1, 0, 0, 0)))
                                                for shape, position, *turned in parts])
        return self._add(lib.limber_world_add_compound, (array, len(parts), density), placement)

    def add_kinematic(self, shape: Shape, **placement: Any) -> Body:
        """A rigid shape that goes where `Body.lead` leads it, whatever it meets: a lift, a hand."""
        return self._add(lib.limber_world_add_kinematic, (shape._pointer,), placement)

    def add_static(self, shape: Shape, **placement: Any) -> Body:
        """A shape that never moves: the ground."""
        return self._add(lib.limber_world_add_static, (shape._pointer,), placement)

    def add_sensor(self, shape: Shape, position: Sequence[float] = (0, 0, 0), rotation: Sequence[float] = (1, 0, 0, 0)) -> Body:
        """A convex shape that tells which bodies it overlaps (`inside`), and pushes none."""
        return Body(self, _key(answer("limber_body_id", lib.limber_world_add_sensor, self._pointer, shape._pointer,
                                 transform(position, rotation), lib.limber_default_filter())[0]))

    def _add(self, function: Any, what: tuple[Any, ...], placement: dict[str, Any]) -> Body:
        given = dict(placement)
        p = ffi.new("limber_placement*", lib.limber_default_placement())
        p.pose = transform(given.pop("position", (0, 0, 0)), given.pop("rotation", (1, 0, 0, 0)))
        shape = given.pop("shape", None)
        if shape is not None:
            p.shape = shape._pointer
        for name in ("layers", "mask"):
            if name in given:
                setattr(p.filter, name, given.pop(name))
        for name in ("gravity_scale", "linear_damping", "angular_damping", "lock_translation", "lock_rotation"):
            if name in given:
                setattr(p.frame, name, given.pop(name))
        for name in ("velocity", "angular_velocity"):
            if name in given:
                given[name] = vector(given[name])
        chosen(p, given, "a placement")
        return Body(self, _key(answer("limber_body_id", function, self._pointer, *what, p)[0]))

    @property
    def bodies(self) -> list[Body]:
        """All there are, static ones and sensors too."""
        return [Body(self, _key(id)) for id in self._list("limber_body_id", lib.limber_world_list_bodies)]

    @property
    def joints(self) -> list[Joint]:
        return [Joint(self, _key(id)) for id in self._list("limber_joint_id", lib.limber_world_list_joints)]

    @property
    def handles(self) -> list[Handle]:
        return [Handle(self, _key(id)) for id in self._list("limber_handle_id", lib.limber_world_list_handles)]

    def body_at(self, index: int) -> Optional[Body]:
        """The body of an index, as an event has it; None: it has been removed."""
        id = lib.limber_world_body_at(self._pointer, index)
        return Body(self, _key(id)) if id.generation else None

    def poses(self, bodies: Sequence[Body], interpolation: float = 1.0) -> np.ndarray:
        """(n, 7): quaternions (w, x, y, z) and positions (m) of bodies between the last two states, in one call."""
        out = np.empty((len(bodies), 7))
        ids = ffi.new("limber_body_id[]", [body._id for body in bodies])
        check(lib.limber_world_interpolated_poses(self._pointer, ids, len(bodies), interpolation,
                                                  ffi.cast("limber_transform*", ffi.from_buffer(out))))
        return out

    def inside(self, sensor: Body) -> list[Body]:
        """Bodies in a sensor, as of the last step."""
        return [Body(self, _key(id)) for id in self._list("limber_body_id", lib.limber_world_list_inside, sensor._id)]

    def _list(self, kind: str, function: Any, *arguments: Any) -> Any:
        count = answer("size_t", function, self._pointer, *arguments, ffi.NULL, 0)
        items = ffi.new(kind + "[]", count[0])
        check(function(self._pointer, *arguments, items, count[0], count))
        return items

    # Joints

    def add_joint(self, a: Optional[Body], b: Optional[Body], type: str, position: Sequence[float],
                  rotation: Sequence[float] = (1, 0, 0, 0), **options: Any) -> Joint:
        """Joins two bodies as they stand; b moves relative to a, None is the world.

        `type`: "ball", "revolute" (about x), "cylindrical" (about and along x), "prismatic" (along x), "planar" (x, y, about z)
        or "fixed". `position`, `rotation`: the joint's frame in the world, m. Options: limits rotation_limits (low, high), rad;
        translation_limits, one or two (low, high), m; cone, rad; euler, three (low, high), rad; pitch, m/rad;
        patch_radius, m: of the surface that it sits on; collide_connected.
        """
        given = dict(options)
        o = ffi.new("limber_joint_options*", lib.limber_default_joint_options())
        o.type = word("LIMBER_JOINT_", type)
        o.frame = transform(position, rotation)
        if "rotation_limits" in given:
            o.rotation = tuple(given.pop("rotation_limits"))
        if "patch_radius" in given:
            o.on_a.radius = o.on_b.radius = given.pop("patch_radius")
        for i, limits in enumerate(given.pop("translation_limits", ())):
            o.translation[i] = tuple(limits)
        for i, limits in enumerate(given.pop("euler", ())):
            o.euler[i] = tuple(limits)
        chosen(o, given, "a joint")
        world = ffi.new("limber_body_id*")[0]
        return Joint(self, _key(answer("limber_joint_id", lib.limber_world_add_joint, self._pointer,
                                  world if a is None else a._id, world if b is None else b._id, o)[0]))

    def add_machine(self, asset: Asset, position: Sequence[float] = (0, 0, 0), rotation: Sequence[float] = (1, 0, 0, 0),
                    velocity: Sequence[float] = (0, 0, 0), angular_velocity: Sequence[float] = (0, 0, 0), tied: bool = True,
                    **filter: int) -> Machine:
        """All bodies of an asset, as they stand to each other in its input, and its joints with what acts on them.

        `position`, `rotation`: of the input's coordinates in the world. `velocity`, m/s, and `angular_velocity`, rad/s: of the
        whole, at their origin. `tied`: by its joints to the world; False: it is free. `layers` and `mask`: bits, whom its
        bodies meet.
        """
        p = ffi.new("limber_machine_placement*", lib.limber_default_machine_placement())
        p.pose, p.tied = transform(position, rotation), tied
        p.velocity, p.angular_velocity = vector(velocity), vector(angular_velocity)
        chosen(ffi.addressof(p, "filter"), filter, "a machine")
        bodies = ffi.new("limber_body_id[]", lib.limber_asset_body_count(asset._pointer))
        joints = ffi.new("limber_joint_id[]", lib.limber_asset_joint_count(asset._pointer))
        check(lib.limber_world_add_machine(self._pointer, asset._pointer, p, bodies, joints))
        return Machine([Body(self, _key(id)) for id in bodies], [Joint(self, _key(id)) if id.generation else None for id in joints])

    @property
    def broken_joints(self) -> list[Joint]:
        """Joints that broke in the last step; they exist no more."""
        return [Joint(self, _key(event.joint)) for event in self._list("limber_joint_break", lib.limber_world_joint_breaks)]

    def ignore_collision(self, a: Body, b: Body, ignore: bool = True) -> None:
        """Whether two bodies have no contacts with each other."""
        check(lib.limber_world_ignore_collision(self._pointer, a._id, b._id, ignore))

    # Time

    def step(self, steps: int = 1) -> None:
        """Takes fixed steps."""
        result = lib.limber_world_step(self._pointer, steps)
        if result:
            check(result)

    def advance(self, seconds: float) -> int:
        """Adds seconds of a frame to an accumulator and takes as many steps as fit; returns how many."""
        return answer("int", lib.limber_world_advance, self._pointer, seconds)[0]

    @property
    def time(self) -> float:
        """s: the lengths of all steps taken"""
        return lib.limber_world_time(self._pointer)

    @property
    def step_count(self) -> int:
        return lib.limber_world_step_count(self._pointer)

    @property
    def interpolation_factor(self) -> float:
        """in [0, 1): how far to draw between the last two states"""
        return lib.limber_world_interpolation_factor(self._pointer)

    def set_step(self, seconds: float) -> None:
        """Length of the steps to come, s."""
        check(lib.limber_world_set_step(self._pointer, seconds))

    def set_gravity(self, gravity: Sequence[float]) -> None:
        """(3,), m/s², from the coming step on."""
        check(lib.limber_world_set_gravity(self._pointer, vector(gravity)))

    # Contacts

    @property
    def contact_events(self) -> np.ndarray:
        """Contacts that pressed, or ceased to, in the last step: an array of CONTACT_EVENT."""
        return self._events("limber_contact_event", lib.limber_world_contact_events, CONTACT_EVENT)

    def _events(self, kind: str, function: Any, record: np.dtype) -> np.ndarray:
        events = self._list(kind, function)
        return np.frombuffer(ffi.buffer(events), record) if len(events) else np.empty(0, record)

    @property
    def hit_events(self) -> np.ndarray:
        """Pairs that came together in the last step at `hit_speed` (m/s, an option of the world) or faster: an array of HIT_EVENT."""
        return self._events("limber_hit_event", lib.limber_world_hit_events, HIT_EVENT)

    def contact_impulse(self, a: Body, b: Body) -> np.ndarray:
        """(3,): of all contacts of two bodies in the last step, on a, world, N·s"""
        return self._ask(lib.limber_world_contact_impulse, a._id, b._id)

    def set_contact_veto(self, veto: Optional[Callable[[Optional[Body], Optional[Body]], bool]]) -> None:
        """Asked of every contact found between two bodies, before it acts: True leaves it out. It must not change the world,
        and what it raises is printed and lets the contact act. None: all act."""
        if veto is None:
            check(lib.limber_world_set_contact_veto(self._pointer, ffi.NULL, ffi.NULL))
            self._veto = None
            return

        leaves_out = veto

        def acts(_: Any, contact: Any) -> bool:
            return not leaves_out(self.body_at(contact.a.index), self.body_at(contact.b.index))

        callback = ffi.callback("bool(void*, const limber_contact*)", acts, error=True)
        check(lib.limber_world_set_contact_veto(self._pointer, callback, ffi.NULL))
        self._veto = callback

    # Queries

    def cast_ray(self, origin: Sequence[float], way: Sequence[float], mask: int = ALL_LAYERS,
                 ignore: Iterable[Body] = ()) -> Optional[Hit]:
        """The first place that a ray from `origin` along `way` (m, as long as the ray) meets. `mask`: layers that may answer."""
        filter, _accepts = self._filter(mask, ignore) if ignore or mask != ALL_LAYERS else _EVERY_BODY
        return self._first(lib.limber_world_cast_ray(self._pointer, vector(origin), vector(way), filter, self._found.pointer, self._hit.pointer))

    def cast_shape(self, shape: Shape, position: Sequence[float], way: Sequence[float],
                   rotation: Sequence[float] = (1, 0, 0, 0), mask: int = ALL_LAYERS,
                   ignore: Iterable[Body] = ()) -> Optional[Hit]:
        """Where a sphere, capsule, box or hull first touches that is moved along `way` without turning."""
        filter, _accepts = self._filter(mask, ignore)
        return self._first(lib.limber_world_cast_shape(self._pointer, shape._pointer, transform(position, rotation), vector(way), filter,
                                                       self._found.pointer, self._hit.pointer))

    def nearest_point(self, point: Sequence[float], max_distance: float, mask: int = ALL_LAYERS,
                      ignore: Iterable[Body] = ()) -> Optional[Hit]:
        """The nearest place of any surface, no farther than `max_distance`, m."""
        filter, _accepts = self._filter(mask, ignore)
        return self._first(lib.limber_world_nearest_point(self._pointer, vector(point), max_distance, filter, self._found.pointer, self._hit.pointer))

    def find_overlaps(self, shape: Shape, position: Sequence[float], rotation: Sequence[float] = (1, 0, 0, 0),
                      mask: int = ALL_LAYERS, ignore: Iterable[Body] = ()) -> list[Body]:
        """Bodies that a sphere, capsule, box or hull touches or lies in."""
        filter, _accepts = self._filter(mask, ignore)
        return [Body(self, _key(id)) for id in self._list("limber_body_id", lib.limber_world_find_overlaps, shape._pointer,
                                                    transform(position, rotation), filter)]

    def _filter(self, mask: int, ignore: Iterable[Body]) -> tuple[Any, Any]:
        if not ignore and mask == ALL_LAYERS:
            return _EVERY_BODY
        ignored = {body.index for body in ignore}
        filter = ffi.new("limber_query_filter*", lib.limber_default_query_filter())
        filter.mask = mask
        if not ignored:
            return filter, None
        accepts = ffi.callback("bool(void*, limber_body_id)", lambda _, id: id.index not in ignored)
        filter.accepts = accepts
        return filter, accepts  # the second is kept as long as the first is used

    def _first(self, result: int) -> Optional[Hit]:
        """What a query that ended with `result` has found."""
        if result:
            check(result)
        if not self._found.pointer[0]:
            return None
        hit = self._hit
        index, generation, has_point, surface, triangle, a, b, c, fraction, distance = _HIT.unpack_from(hit.memory)
        point = _make(Point, (triangle, (a, b, c), _SURFACES[surface])) if has_point else None
        return _make(Hit, (Body(self, (index, generation)), point, hit.copy["position"](), hit.copy["normal"](), fraction, distance))

    # Rollback

    def save(self) -> bytes:
        """All that coming steps depend on, for `restore` of worlds with the same bodies in the same version of limber."""
        snapshot = create("limber_snapshot", lib.limber_snapshot_create)
        check(lib.limber_world_save_state(self._pointer, snapshot))
        size = ffi.new("size_t*")
        pointer = lib.limber_snapshot_bytes(snapshot, size)
        return ffi.buffer(pointer, size[0])[:]

    def restore(self, state: bytes) -> None:
        """Goes back to a saved state, bit for bit; bodies added since are removed."""
        check(lib.limber_world_restore_state(self._pointer, ffi.from_buffer(state), len(state)))

    @property
    def state_hash(self) -> int:
        """Of all that the next step depends on: equal for worlds with the same calls behind them."""
        return lib.limber_world_state_hash(self._pointer)
