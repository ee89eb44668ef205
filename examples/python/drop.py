"""drop: a hundred soft balls fall on a floor, as a GLB that any glTF viewer plays.

  run:   python3 drop.py drop.glb         limber-simulate is on PATH or in LIMBER_BIN
  see:   drop.glb in a viewer; a second number makes more or fewer balls
  next:  machine.py
"""
import pathlib
import sys

import limber

SPACING, SECONDS = 0.7, 2.0                                          # m, s
output = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "drop.glb").resolve()
count = int(sys.argv[2]) if len(sys.argv) > 2 else 100

asset = output.with_suffix(".ball.glb")
limber.soft_ball(0.3, cells=4, material=(3e5, 0.4, 1000.0), modes=12).write(asset)
places = [(i % 5 * SPACING, i // 5 % 5 * SPACING, 0.5 + i // 25 * SPACING) for i in range(count)]
limber.simulate({
    "step": 1 / 60, "duration": SECONDS, "assets": {"ball": str(asset)},
    "contact": {}, "statics": [{"name": "floor", "shape": {"half_space": {}}}],
    "bodies": [{"name": f"ball {i}", "asset": "ball", "position": place} for i, place in enumerate(places)],
}, record=output)
print(f"{count} balls fell into {output.name}, {output.stat().st_size / 1e6:.1f} MB")
