"""Builds liblimber.so by CMake and puts the package together (python/assemble.py). The environment variable LIMBER_LIBRARY names
one that is built already."""
import os
import pathlib
import subprocess
import sys

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py
from wheel.bdist_wheel import bdist_wheel

ROOT = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(ROOT / "python"))
from assemble import assemble  # noqa: E402

RUNTIME_ALONE = [f"-DLIMBER_BUILD_{part}=OFF"
                 for part in ("PRECOMPUTE", "TOOLS", "TESTS", "EXAMPLES", "PAPERS", "TBB", "ASSIMP")]


def build_library():
    folder = ROOT / "build/python"
    subprocess.run(["cmake", "-S", ROOT, "-B", folder, "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_UNITY_BUILD=ON", *RUNTIME_ALONE],
                   check=True)
    subprocess.run(["cmake", "--build", folder, "--target", "limber_c", "--parallel"], check=True)
    return folder / "c/liblimber.so"


class BuildPackage(build_py):
    def run(self):
        super().run()
        assemble(os.environ.get("LIMBER_LIBRARY") or build_library(), self.build_lib)


class ForAnyPython3(bdist_wheel):
    """The library is of one platform; cffi opens it from any Python 3."""

    def get_tag(self):
        return "py3", "none", super().get_tag()[2]


class OfOnePlatform(Distribution):
    def has_ext_modules(self):
        return True


setup(packages=["limber"], package_dir={"limber": "python/limber"}, package_data={"limber": ["py.typed"]},
      distclass=OfOnePlatform, cmdclass={"build_py": BuildPackage, "bdist_wheel": ForAnyPython3})
