#!/usr/bin/env python3
"""How a bake grows with its scene: growth.py RADBAKE [TRIANGLES …] (default: 10000 30000 100000).

Makes a furnished room of each size (scenes/make_room.py), bakes it to 5 %, and prints what it took: seconds of
processor time of the whole bake without its check, seconds on the wall by phase, memory, links, elements, rays, the
output's vertices, and the measured error. Last the exponents with which these grow, fitted by least squares to their
logarithms, and how many bytes a triangle takes. Of one process at a time, on all processors.
"""

import json
import math
import pathlib
import resource
import subprocess
import sys
import tempfile

MAKE_ROOM = pathlib.Path(__file__).resolve().parents[2] / "scenes" / "make_room.py"
ERROR = 0.05
PROBES = 1024
PHASES = ("import", "solve", "energy", "gather", "export")


def bake(radbake, scene, folder, probes):
    """The statistics, and the processor seconds of the process."""
    statistics = folder / "statistics.json"
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([radbake, "bake", scene, "-o", folder / "baked.glb", "--statistics", statistics, "--error", str(ERROR),
                    "--check", str(probes)], check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return json.loads(statistics.read_text()), seconds


def measure(radbake, triangles, folder):
    scene = folder / "room.glb"
    subprocess.run([sys.executable, "-B", MAKE_ROOM, str(triangles), scene], check=True, stdout=subprocess.DEVNULL)
    checked, _ = bake(radbake, scene, folder, PROBES)
    statistics, seconds = bake(radbake, scene, folder, 0)
    last = statistics["iterations"][-1]
    row = {"triangles": statistics["scene"]["triangles"], "processor s": seconds}
    row.update({f"{phase} s": statistics["time"][phase] for phase in PHASES})
    row.update({"MiB": statistics["memory"]["peak_bytes"] / 2**20, "links": last["links"], "elements": last["elements"],
                "rays": statistics["rays"]["count"], "vertices": statistics["output"]["vertices"]})
    return row, checked["error"]


def exponent(xs, ys):
    """The slope of the least-squares line through the logarithms."""
    points = [(math.log(x), math.log(y)) for x, y in zip(xs, ys) if y > 0]
    mean_x, mean_y = (sum(axis) / len(points) for axis in zip(*points))
    return sum((x - mean_x) * (y - mean_y) for x, y in points) / sum((x - mean_x) ** 2 for x, _ in points)


def main():
    if len(sys.argv) < 2 or not all(size.isdigit() for size in sys.argv[2:]):
        sys.exit(__doc__)
    sizes = [int(size) for size in sys.argv[2:]] or [10_000, 30_000, 100_000]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for size in sizes:
            row, error = measure(sys.argv[1], size, pathlib.Path(folder))
            rows.append(row)
            measured = error["measured"]
            print("  ".join(f"{name} {value:.4g}" if isinstance(value, float) else f"{name} {value:,}"
                            for name, value in row.items()))
            print(f"    asked 5 %, estimated {100 * error['estimated']:.2f} %, measured "
                  f"{100 * measured['relative_rms']:.2f} % ({100 * measured['low']:.2f} to {100 * measured['high']:.2f}), "
                  f"bias {100 * measured['bias']:+.2f} %", flush=True)
    if len(rows) > 1:
        triangles = [row["triangles"] for row in rows]
        print("exponents: " + "  ".join(f"{name} {exponent(triangles, [row[name] for row in rows]):.2f}"
                                        for name in list(rows[0])[1:]))
    print("bytes a triangle: " + "  ".join(f"{row['MiB'] * 2**20 / row['triangles']:,.0f}" for row in rows))


if __name__ == "__main__":
    main()
