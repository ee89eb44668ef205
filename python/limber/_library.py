"""The shared library behind the package, its errors, and memory of its objects as numpy arrays."""

from __future__ import annotations

import functools
import pathlib
from typing import Any, Optional, Sequence

import numpy as np

from ._interface import ffi

lib: Any = ffi.dlopen(str(pathlib.Path(__file__).with_name("liblimber.so")))


class Error(Exception):
    """What limber raises; its text is the library's line."""


class InvalidArgument(Error, ValueError):
    """An argument is outside its documented range, not finite, or names nothing."""


class InputError(Error):
    """A file cannot be read, or holds something wrong."""


class ComputationError(Error):
    """The input was well formed, but no right answer can be computed."""


_errors = {lib.LIMBER_INVALID_ARGUMENT: InvalidArgument, lib.LIMBER_INPUT_ERROR: InputError,
           lib.LIMBER_COMPUTATION_ERROR: ComputationError, lib.LIMBER_OUT_OF_MEMORY: MemoryError}


def check(result: int) -> None:
    """Raises what a call that failed tells."""
    if result:
        raise _errors.get(result, Error)(ffi.string(lib.limber_last_error()).decode())


def answer(kind: str, function: Any, *arguments: Any) -> Any:
    """Calls a function whose last argument is where its answer goes, and returns the pointer to it."""
    out = ffi.new(kind + "*")
    check(function(*arguments, out))
    return out


class Answer:
    """Where the same question is answered again and again, of a world, which one thread at a time uses. `members`: paths of
    vectors in the struct, which `copy` makes arrays of: (3,), or (4,) of a quaternion."""

    def __init__(self, kind: str, **members: Sequence[str]) -> None:
        self.pointer = ffi.new(kind + "*")
        self.memory = ffi.buffer(self.pointer)
        self.copy = {name: np.frombuffer(self.memory, np.float64, 4 if path[-1] == "q" else 3, ffi.offsetof(kind, *path)).copy
                     for name, path in members.items()}


def create(kind: str, function: Any, *arguments: Any) -> Any:
    """Calls a function that makes an object, which is destroyed with what holds the pointer."""
    pointer = answer(kind + "*", function, *arguments)[0]
    return ffi.gc(pointer, getattr(lib, kind + "_destroy"))


def _keep(owner: object, _: object) -> None:
    pass


def view(pointer: Any, count: int, dtype: Any, owner: Optional[object]) -> np.ndarray:
    """Memory of an object as a read-only array, without a copy; it keeps `owner` alive. A copy, where None owns it."""
    dtype = np.dtype(dtype)
    if count == 0:
        return np.empty(0, dtype)
    if owner is None:
        return np.frombuffer(ffi.buffer(pointer, count * dtype.itemsize), dtype).copy()
    kept = ffi.gc(pointer, functools.partial(_keep, owner))
    array = np.frombuffer(ffi.buffer(kept, count * dtype.itemsize), dtype)
    array.flags.writeable = False
    return array


def vector(v: Sequence[float]) -> tuple[float, float, float]:
    """Three numbers, as limber_vec3 takes them."""
    x, y, z = v
    return x, y, z


def array3(v: Any) -> np.ndarray:
    """A limber_vec3 as an array of its own."""
    return np.array((v.x, v.y, v.z))


def numbers(s: Any) -> Any:
    """Members of a struct."""
    return tuple(getattr(s, name) for name, _ in ffi.typeof(s).fields)


def transform(position: Sequence[float], rotation: Sequence[float]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """A pose, as limber_transform takes it. `rotation`: a quaternion (w, x, y, z), or three numbers: a rotation vector, rad."""
    numbers = tuple(float(r) for r in rotation)
    if len(numbers) == 3:
        q = lib.limber_quat_from_rotation_vector(numbers)
        numbers = (q.w, q.x, q.y, q.z)
    if len(numbers) != 4:
        raise InvalidArgument(f"a rotation has {len(numbers)} numbers, expected 4 of a quaternion or 3 of a rotation vector")
    return numbers, vector(position)


def chosen(options: Any, given: dict[str, Any], what: str) -> Any:
    """Sets members of an options struct by their names."""
    for name, value in given.items():
        if not hasattr(options, name):
            known = ", ".join(member for member, _ in ffi.typeof(options).item.fields)
            raise InvalidArgument(f"{what} has no {name}, expected one of: {known}")
        setattr(options, name, value)
    return options


@functools.cache
def word(prefix: str, text: str) -> int:
    """The constant of an enumeration that a word names, such as "revolute"."""
    try:
        return int(getattr(lib, prefix + text.upper()))
    except AttributeError:
        raise InvalidArgument(f'"{text}" is none of the words of {prefix}…') from None
