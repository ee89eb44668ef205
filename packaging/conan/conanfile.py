"""Untested. The runtime for Conan 2, from the sources it lies in: conan create packaging/conan"""
from pathlib import Path

from conan import ConanFile
from conan.tools.cmake import CMake, CMakeDeps, CMakeToolchain, cmake_layout
from conan.tools.files import copy


class Limber(ConanFile):
    name = "limber"
    version = "0.1.0"
    license = "MIT"
    description = "Deformable, jointed objects for interactive software"
    settings = "os", "compiler", "build_type", "arch"

    def export_sources(self):
        root = Path(self.recipe_folder).parents[1]
        copy(self, "*", root, self.export_sources_folder, excludes=("build/*", "out/*", "*/node_modules/*", ".git/*"))

    def requirements(self):
        self.requires("eigen/3.4.0", transitive_headers=True)
        self.requires("highway/1.0.3")
        self.requires("nlohmann_json/3.11.2", visible=False)

    def layout(self):
        cmake_layout(self)

    def generate(self):
        toolchain = CMakeToolchain(self)
        for part in ("PRECOMPUTE", "TOOLS", "TESTS", "EXAMPLES", "PAPERS", "TBB", "ASSIMP"):
            toolchain.cache_variables[f"LIMBER_BUILD_{part}"] = False
        toolchain.generate()
        CMakeDeps(self).generate()

    def build(self):
        cmake = CMake(self)
        cmake.configure()
        cmake.build()

    def package(self):
        CMake(self).install()

    def package_info(self):  # limber's own package config, which names its targets
        self.cpp_info.set_property("cmake_find_mode", "none")
        self.cpp_info.builddirs = ["lib/cmake/limber"]
