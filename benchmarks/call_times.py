#!/usr/bin/env python3
"""What a call costs from Python over the same call from C++: µs of CPU time, the least of many rounds, both sides by turns.

  scripts/build benchmark call_times limber_c && /usr/bin/python3 benchmarks/call_times.py build/benchmark
"""
import pathlib
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
WANTED, TURNS, ROUNDS, CALLS = 2.0, 10, 60, 50                       # µs a call over C++; of each side; of a turn; of a round


def least(call):
    """µs a call"""
    best = float("inf")
    for _ in range(ROUNDS):
        start = time.thread_time_ns()
        for _ in range(CALLS):
            call()
        best = min(best, time.thread_time_ns() - start)
    return best / 1e3 / CALLS


def python_times():
    import limber
    world = limber.World(gravity=(0, 0, 0))
    world.add_static(limber.Shape.half_space())
    ball = world.add_body(limber.soft_ball(0.3, 6, "jelly", 12, 0.02), position=(0, 0, 1))
    out = ball.vertices()
    calls = {
        "step": world.step,
        "position": lambda: ball.position,
        "amplitudes": lambda: ball.amplitudes,
        "energy": lambda: ball.energy,
        "point_position": lambda: ball.point_position(5),
        "set_velocity": lambda: ball.set_velocity((0, 0, 0), (0, 0, 0)),
        "apply_force": lambda: ball.apply_force((0, 0, 0), 5),
        "cast_ray": lambda: world.cast_ray((0, 0, 5), (0, 0, -9)),
        "vertices": lambda: ball.vertices(out=out),
    }
    return {name: least(call) for name, call in calls.items()}


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    build = pathlib.Path(sys.argv[1])
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, ROOT / "python/assemble.py", build / "c/liblimber.so", folder], check=True, stdout=subprocess.DEVNULL)
        sys.path.insert(0, folder)
        cpp, python = {}, {}
        for _ in range(TURNS):
            told = subprocess.run([build / "bin/call_times"], check=True, capture_output=True, text=True).stdout
            for times, new in ((cpp, {name: float(us) for name, us in map(str.split, told.splitlines())}), (python, python_times())):
                for name, us in new.items():
                    times[name] = min(us, times.get(name, us))
    print("| call | C++, µs | Python, µs | over C++ |\n|---|---|---|---|")
    for name in cpp:
        over = python[name] - cpp[name]
        print(f"| `{name}` | {cpp[name]:.2f} | {python[name]:.2f} | {over:.2f}{'' if over <= WANTED else ' *'} |")


if __name__ == "__main__":
    main()
