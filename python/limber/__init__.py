"""limber: soft and stiff bodies that fall, touch and hang on joints.

    import limber

    world = limber.World()                                             # 1/60 s a step, gravity along −z
    world.add_static(limber.Shape.half_space())                        # ground
    ball = world.add_body(limber.soft_ball(0.3), position=(0, 0, 2))
    world.step(120)
    print(ball.position, ball.vertices().shape)

Units are m, kg, s, N, rad. Arrays are numpy's; those of assets are views of the library's memory.
"""

from ._asset import Asset, AssetJoint, Model, Shape, material, read_asset, soft_ball, soft_box
from ._library import ComputationError, Error, InputError, InvalidArgument, ffi as _ffi, lib as _lib
from ._programs import bake, find_joints, run, simulate, view
from ._world import CONTACT_EVENT, HIT_EVENT, Body, Energy, Handle, Hit, Joint, Machine, Point, World

__version__: str = _ffi.string(_lib.limber_version()).decode()
__all__ = [
    "Asset", "AssetJoint", "Body", "CONTACT_EVENT", "ComputationError", "Energy", "Error", "HIT_EVENT", "Handle", "Hit", "InputError", "InvalidArgument",
    "Joint", "Machine", "Model", "Point", "Shape", "World", "bake", "find_joints", "material", "read_asset", "run", "simulate", "soft_ball",
    "soft_box", "view",
]
