#!/usr/bin/env python3
"""Puts the package together: its Python files, the shared library, and what cffi knows of it from the C header.

  assemble.py LIBLIMBER.SO FOLDER    makes FOLDER/limber
"""
import pathlib
import re
import shutil
import sys

import cffi

HERE = pathlib.Path(__file__).resolve().parent
HEADERS = HERE.parent / "c/include/limber/c"


def declarations():
    """The C header without what only a preprocessor reads."""
    text = "".join((HEADERS / f"{name}.h").read_text() for name in ("base", "asset", "world", "constraints", "contact"))
    text = re.sub(r"#ifdef __cplusplus.*?#endif", "", text, flags=re.S)
    text = re.sub(r"//.*", "", text)
    return re.sub(r"^#.*$", "", text, flags=re.M).replace("LIMBER_API ", "").replace("LIMBER_ENUM ", "")


def assemble(library, folder):
    package = pathlib.Path(folder) / "limber"
    package.mkdir(parents=True, exist_ok=True)
    for file in (*(HERE / "limber").glob("*.py"), HERE / "limber/py.typed"):
        shutil.copy(file, package)
    shutil.copy(library, package / "liblimber.so")
    ffi = cffi.FFI()
    ffi.cdef(declarations())
    ffi.set_source("limber._interface", None)
    ffi.emit_python_code(str(package / "_interface.py"))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    assemble(sys.argv[1], sys.argv[2])
