"""Assets, models and shapes."""

from __future__ import annotations

import functools
import os
from typing import Any, Callable, NamedTuple, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike

from ._library import InvalidArgument, answer, array3, check, create, ffi, lib, numbers, vector, view

Material = Union[str, tuple[float, float, float]]


def material(name: str) -> tuple[float, float, float]:
    """Young's modulus (Pa), Poisson's ratio and density (kg/m³) of a preset such as "steel" or "rubber"."""
    m = answer("limber_material", lib.limber_material_preset, name.encode())
    return m.youngs_modulus, m.poisson_ratio, m.density


def _numbers(m: Material) -> Any:
    return ffi.new("limber_material*", material(m) if isinstance(m, str) else tuple(float(x) for x in m))


class Model:
    """One body of an asset, or of a world, with its numbers. Does not change. Arrays of an asset's are read-only views of its
    memory, which they keep alive; those of a world's body are copies, and it tells nothing once its body is removed."""

    def __init__(self, find: Callable[[], Any], owner: Optional[object]) -> None:
        self._find, self._owner = find, owner

    @property
    def _data(self) -> Any:
        return answer("limber_model_data", lib.limber_model_get_data, self._find())

    @property
    def name(self) -> str:
        return ffi.string(self._data.name).decode()

    @property
    def mass(self) -> float:
        """kg"""
        return self._data.mass

    @property
    def volume(self) -> float:
        """m³"""
        return self._data.volume

    @property
    def center_of_mass(self) -> np.ndarray:
        """(3,), body frame, m"""
        return array3(self._data.center_of_mass)

    @property
    def origin_in_input(self) -> np.ndarray:
        """(3,): the body's origin in the coordinates of its mesh or shape, m"""
        return array3(self._data.origin_in_input)

    @property
    def inertia(self) -> np.ndarray:
        """(3, 3), about the body's origin, body axes, kg·m²"""
        return np.array(list(self._data.inertia)).reshape(3, 3)

    @property
    def modes(self) -> int:
        """k"""
        return self._data.modes

    @property
    def eigenvalues(self) -> np.ndarray:
        """(k,): λ = (2πf)², rad²/s²; a view"""
        return view(self._data.eigenvalue, self.modes, np.float64, self._owner)

    @property
    def frequencies(self) -> np.ndarray:
        """(k,): f, Hz"""
        return np.sqrt(self.eigenvalues) / (2 * np.pi)

    @property
    def decays(self) -> np.ndarray:
        """(k,): ξ, 1/s: a mode's amplitude falls as exp(−ξt); a view"""
        return view(self._data.decay, self.modes, np.float64, self._owner)

    @property
    def vertices(self) -> np.ndarray:
        """(V, 3) float32: the drawn surface at rest, body frame, m; a view"""
        return self._vertices(self._data.render)

    @property
    def triangles(self) -> np.ndarray:
        """(T, 3) int32: vertices, counter-clockwise seen from outside; a view"""
        return self._triangles(self._data.render)

    @property
    def collision_vertices(self) -> np.ndarray:
        """(V, 3) float32: the surface that touches, at rest, body frame, m; a view"""
        return self._vertices(self._data.collision)

    @property
    def collision_triangles(self) -> np.ndarray:
        """(T, 3) int32; a view"""
        return self._triangles(self._data.collision)

    def morph_target(self, mode: int) -> np.ndarray:
        """(V, 3) float32: displacements of the drawn vertices per unit weight of a mode, m (`Body.weights`)."""
        out = np.empty((self._data.render.vertices, 3), np.float32)
        check(lib.limber_model_morph_target(self._find(), mode, ffi.from_buffer("float[]", out)))
        return out

    def _vertices(self, surface: Any) -> np.ndarray:
        return view(surface.rest, 3 * surface.vertices, np.float32, self._owner).reshape(-1, 3)

    def _triangles(self, surface: Any) -> np.ndarray:
        return view(surface.corner, 3 * surface.triangles, np.int32, self._owner).reshape(-1, 3)


class AssetJoint(NamedTuple):
    """A joint between bodies of an asset, whose bodies stand as in its input."""

    a: Optional[int]
    """number of a body of `Asset.models`; None: the world"""
    b: int
    """moves relative to a"""
    type: str
    """"ball", "revolute", "cylindrical", "prismatic", "planar" or "fixed": `World.add_joint`"""
    position: np.ndarray
    """(3,): of its frame, in the input's coordinates, m"""
    rotation: np.ndarray
    """(4,): unit quaternion (w, x, y, z) of its frame"""
    rotation_limits: tuple[float, float]
    """rad; infinite ends are open"""
    translation_limits: list[tuple[float, float]]
    """two, m"""
    cone: float
    """rad"""
    euler: list[tuple[float, float]]
    """three, rad"""
    pitch: float
    """m/rad"""
    patch_radius: float
    """m"""
    collide_connected: bool


JOINT_TYPES = {value: text.removeprefix("LIMBER_JOINT_").lower() for value, text in ffi.typeof("limber_joint_type").elements.items()}


class Asset:
    """One or more bodies that were baked together: `read_asset`, `bake`, `soft_ball`, `soft_box`. Does not change."""

    def __init__(self, pointer: Any) -> None:
        self._pointer = pointer

    @property
    def models(self) -> list[Model]:
        """Its bodies, in the order of `World.add_body`."""
        return [Model(functools.partial(self._model, i), self._pointer)
                for i in range(lib.limber_asset_body_count(self._pointer))]

    @property
    def joints(self) -> list[AssetJoint]:
        """What joins its bodies, as `World.add_machine` does."""
        return [self._joint(answer("limber_asset_joint", lib.limber_asset_get_joint, self._pointer, i))
                for i in range(lib.limber_asset_joint_count(self._pointer))]

    @staticmethod
    def _joint(joint: Any) -> AssetJoint:
        o = joint.options
        limits = lambda intervals: [numbers(i) for i in intervals]
        return AssetJoint(None if joint.a < 0 else joint.a, joint.b, JOINT_TYPES[o.type], array3(o.frame.p), np.array(numbers(o.frame.q)),
                          numbers(o.rotation), limits(o.translation), o.cone, limits(o.euler), o.pitch, o.on_a.radius, o.collide_connected)

    def _model(self, i: int) -> Any:
        return answer("const limber_model*", lib.limber_asset_model, self._pointer, i)[0]

    def write(self, path: Union[str, os.PathLike[str]]) -> None:
        """Writes the GLB that `read_asset` reads and glTF viewers show. @raises InputError (disk)"""
        check(lib.limber_asset_write_file(self._pointer, os.fspath(path).encode()))


def read_asset(source: Union[str, bytes, os.PathLike[str]]) -> Asset:
    """Reads a GLB of limber-precompute from a path, or from its bytes. @raises InputError"""
    if isinstance(source, bytes):
        return Asset(create("limber_asset", lib.limber_asset_read_memory, source, len(source), ffi.NULL))
    return Asset(create("limber_asset", lib.limber_asset_read_file, os.fspath(source).encode()))


def soft_ball(radius: float, cells: int = 6, material: Material = "jelly", modes: int = 12,
              damping_ratio: float = 0.02) -> Asset:
    """A free ball that bends, without a file. `radius`: m. `cells`: across, ≥ 2. `material`: a preset's name, or
    (Young's modulus, Pa; Poisson's ratio; density, kg/m³)."""
    return Asset(create("limber_asset", lib.limber_asset_create_soft_ball, radius, cells, _numbers(material), modes,
                        damping_ratio))


def soft_box(half_extents: Sequence[float], cells: Sequence[int] = (3, 3, 3), material: Material = "jelly",
             modes: int = 12, damping_ratio: float = 0.02) -> Asset:
    """A free box that bends, about its middle. `half_extents`: m. `cells`: along each axis, ≥ 1."""
    return Asset(create("limber_asset", lib.limber_asset_create_soft_box, vector(half_extents), list(cells),
                        _numbers(material), modes, damping_ratio))


class Shape:
    """A rigid shape, in the frame of the body that wears it; lengths in m. Does not change."""

    def __init__(self, pointer: Any) -> None:
        self._pointer = pointer

    @staticmethod
    def half_space(normal: Sequence[float] = (0, 0, 1), offset: float = 0.0) -> Shape:
        """All points with normal · x ≤ offset are solid. `normal`: unit."""
        return Shape(create("limber_shape", lib.limber_shape_create_half_space, vector(normal), offset))

    @staticmethod
    def sphere(radius: float) -> Shape:
        return Shape(create("limber_shape", lib.limber_shape_create_sphere, radius))

    @staticmethod
    def capsule(radius: float, half_length: float) -> Shape:
        """Within `radius` of the segment from (0, 0, −half_length) to (0, 0, half_length)."""
        return Shape(create("limber_shape", lib.limber_shape_create_capsule, radius, half_length))

    @staticmethod
    def box(half_extents: Sequence[float]) -> Shape:
        return Shape(create("limber_shape", lib.limber_shape_create_box, vector(half_extents)))

    @staticmethod
    def cylinder(radius: float, half_length: float, sides: int = 32) -> Shape:
        """A prism about the z axis whose corners lie on the cylinder."""
        return Shape(create("limber_shape", lib.limber_shape_create_cylinder, radius, half_length, sides))

    @staticmethod
    def hull(points: ArrayLike) -> Shape:
        """The convex hull of points, (N, 3), four at least, not in one plane."""
        p = _rows(points, np.float64, "points")
        return Shape(create("limber_shape", lib.limber_shape_create_hull, ffi.from_buffer("double[]", p), len(p)))

    @staticmethod
    def mesh(vertices: ArrayLike, triangles: ArrayLike) -> Shape:
        """A surface that does not deform: vertices (V, 3), triangles (T, 3), counter-clockwise seen from outside."""
        v, t = _rows(vertices, np.float64, "vertices"), _rows(triangles, np.int32, "triangles")
        return Shape(create("limber_shape", lib.limber_shape_create_mesh, ffi.from_buffer("double[]", v), len(v),
                            ffi.from_buffer("int32_t[]", t), len(t)))

    @staticmethod
    def height_field(heights: ArrayLike, spacing: Sequence[float] = (1.0, 1.0)) -> Shape:
        """Heights (rows, columns) over a grid in the xy plane, solid below: heights[j, i] at (i·spacing[0], j·spacing[1])."""
        h = np.ascontiguousarray(heights, np.float32)
        if h.ndim != 2:
            raise InvalidArgument(f"heights has shape {h.shape}, expected (rows, columns)")
        return Shape(create("limber_shape", lib.limber_shape_create_height_field, h.shape[1], h.shape[0],
                            float(spacing[0]), float(spacing[1]), ffi.from_buffer("float[]", h)))


def _rows(numbers: ArrayLike, dtype: Any, name: str) -> np.ndarray:
    rows = np.ascontiguousarray(numbers, dtype)
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise InvalidArgument(f"{name} has shape {rows.shape}, expected (n, 3)")
    return rows
