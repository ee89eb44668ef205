"""limber's programs, run as processes: they link GPL code, which this package does not.

They are looked for in the folder that the environment variable LIMBER_BIN names, then on PATH.
"""

from __future__ import annotations

import json
import os
import pathlib
import shutil
import subprocess
import tempfile
from typing import Any, Optional, Union

from ._asset import Asset, read_asset
from ._library import InputError, InvalidArgument

Path = Union[str, os.PathLike[str]]


def _arguments(options: dict[str, Any]) -> list[str]:
    """max_force=50 as --max-force 50, volume=True as --volume; a list once for each item."""
    out: list[str] = []
    for name, value in options.items():
        flag = "--" + name.replace("_", "-")
        for item in value if isinstance(value, (list, tuple)) else [value]:
            if item is True:
                out.append(flag)
            elif item is not None and item is not False:
                out += [flag, os.fspath(item) if isinstance(item, os.PathLike) else str(item)]
    return out


def run(program: str, *arguments: Path, **options: Any) -> str:
    """Runs one of limber's programs and returns what it prints. @raises InvalidArgument, InputError with its message"""
    path = shutil.which(program, path=os.environ.get("LIMBER_BIN")) or shutil.which(program)
    if path is None:
        raise InputError(f"{program} is not in LIMBER_BIN or on PATH: install limber's programs")
    done = subprocess.run([path, *(os.fspath(a) for a in arguments), *_arguments(options)], capture_output=True, text=True)
    if done.returncode != 0:
        raise (InvalidArgument if done.returncode == 2 else InputError)(done.stderr.strip())
    return done.stdout


def bake(mesh: Path, output: Optional[Path] = None, material: str = "rubber", modes: int = 32, **options: Any) -> Asset:
    """Finds the modes of a mesh by limber-precompute. `output`: the GLB to write; None: none is kept. Options are the program's:
    scale=0.1, max_force=50, volume=True, …"""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(output) if output is not None else pathlib.Path(folder) / "baked.glb"
        run("limber-precompute", mesh, output=path, material=material, modes=modes, **options)
        return read_asset(path)


def find_joints(mesh: Path, output: Optional[Path] = None, **options: Any) -> dict[str, Any]:
    """Finds the joints of an assembly by limber-joints: the content of its file (docs/formats/joints.md)."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(output) if output is not None else pathlib.Path(folder) / "found.joints.json"
        run("limber-joints", mesh, output=path, **options)
        found: dict[str, Any] = json.loads(path.read_text())
        return found


def simulate(scene: Union[Path, dict[str, Any]], **options: Any) -> str:
    """Plays a scene (docs/formats/scene.md), a file or its content, by limber-simulate: record="flight.glb", …
    Files that a dict names are sought from the current folder."""
    if not isinstance(scene, dict):
        return run("limber-simulate", scene, **options)
    with tempfile.NamedTemporaryFile("w", suffix=".json", dir=".") as file:
        json.dump(scene, file)
        file.flush()
        return run("limber-simulate", file.name, **options)


def view(source: Path, output: Path, **options: Any) -> pathlib.Path:
    """Writes a scene, an asset or an assembly as a page by limber-view (docs/page.md); returns its path."""
    run("limber-view", source, output=output, **options)
    return pathlib.Path(output)
