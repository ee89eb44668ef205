"""error_vs_time: how far from finite elements of all nodes, and how quick: the picture of docs/error-vs-time.md by matplotlib.

  run:   python3 error_vs_time.py error.svg [SCENE…]    limber-benchmark is on PATH or in LIMBER_BIN; all scenes take minutes
  see:   a row per setting, and the picture: a field per scene, a line per step length, a dot per number of modes
"""
import csv
import pathlib
import sys
import tempfile

import limber

output = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "error.svg")
scenes = sys.argv[2:] or ["poke", "drag", "spin", "lamp", "strip"]

with tempfile.TemporaryDirectory() as folder:
    table = pathlib.Path(folder) / "error.csv"
    limber.run("limber-benchmark", "error", scene=",".join(scenes), modes="2,10,40", steps_per_second="60,240", substeps=0, csv=table)
    with table.open() as file:
        rows = list(csv.DictReader(file))
fields: dict[str, dict[str, list[tuple[float, float]]]] = {scene: {} for scene in scenes}
for row in rows:
    time, error = float(row["frame_us"]), float(row["error"])        # µs for 1/60 s of the scene
    fields[row["scene"]].setdefault(row["line"], []).append((time, error))
    print(f"{row['scene']}, {row['line']}, {row['modes']} modes: {100 * error:.2g} % off, {time:.3g} µs a frame")

try:
    from matplotlib import pyplot
except ModuleNotFoundError:
    print(f"{output} is not drawn: matplotlib is missing (apt install python3-matplotlib)")
    sys.exit()
figure, axes = pyplot.subplots(1, len(scenes), figsize=(4 * len(scenes), 4), squeeze=False)
for axis, (scene, lines) in zip(axes[0], fields.items()):
    for line, dots in lines.items():
        axis.loglog(*zip(*sorted(dots)), marker="o", label=line)
    axis.set(title=scene, xlabel="µs for 1/60 s", ylabel="error, of the largest way")
    axis.grid(True, which="both", alpha=0.3)
    axis.legend(fontsize="small")
figure.tight_layout()
figure.savefig(output)
