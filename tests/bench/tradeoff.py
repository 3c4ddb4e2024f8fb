#!/usr/bin/env python3
"""What each method gives for its cost: measured error against time, links and rays, links against elements, memory.

    tradeoff.py --radbake build/release/bin/radbake --out build/tradeoff [--scenes cornell-box,two-rooms]

Runs `radbake bake` for every method and basis over its accuracy range on each scene, without the final gather and, for
the default, with it, and `radbake check` on every result.
Writes tradeoff.json (all that was measured), tradeoff.md (tables) and one SVG a scene and quantity into --out. A
method's range ends where a bake takes longer than --longest seconds. Times are processor seconds of the bake, without
the check. Needs nothing but Python 3.
"""
import argparse
import base64
import json
import math
import os
import pathlib
import resource
import shutil
import struct
import subprocess
import sys
import time

from tradeoff_plot import log_plot

ROOT = pathlib.Path(__file__).resolve().parents[2]
OURS = ROOT / "scenes"
SHARED = ROOT / ".." / "shared" / "scenes"
# The solution of each method as it is, and the default: the best of them gathered anew for the output.
SOLUTIONS = {
    "matrix": ["--method", "matrix"],
    "two-level": ["--method", "two-level"],
    "hierarchical": ["--method", "hierarchical"],
    "adaptive": ["--method", "adaptive", "--basis", "constant"],
    "adaptive, linear": ["--method", "adaptive", "--basis", "linear"],
    "adaptive, quadratic": ["--method", "adaptive", "--basis", "quadratic"],
}
CURVES = {name: [*flags, "--final-gather", "off"] for name, flags in SOLUTIONS.items()}
DEFAULT = "adaptive, final gather"
CURVES[DEFAULT] = ["--method", "adaptive"]
ERRORS = (0.2, 0.1, 0.05, 0.03, 0.02, 0.014, 0.01)
DIAL = (0.1, 0.05, 0.02, 0.01)
# Methods that link all pairs of patches at least: of more patches than this they would need all memory.
FLAT, MOST_PATCHES = ("matrix", "two-level"), 300
SCENES = {
    "cornell-box": (OURS / "cornell-box.glb", []),
    "two-rooms": (OURS / "two-rooms.glb", []),
    "furnace-box": (OURS / "furnace-box.glb", []),
    "furnace-sphere": (OURS / "furnace-sphere.glb", []),
    "plates-parallel": (OURS / "plates-parallel.glb", []),
    "plates-perpendicular": (OURS / "plates-perpendicular.glb", []),
    "plates-occluded": (OURS / "plates-occluded.glb", []),
    "tube": (OURS / "tube.glb", []),
    "three-lights": (OURS / "three-lights.glb", []),
    "window-room": (OURS / "window-room.glb", ["--environment.radiance", "[1000, 1000, 1000]"]),
    "cornell-box-bevy": (SHARED / "cornell-box-bevy.glb", []),
    "living-room": (SHARED / "living-room.glb", ["--environment.radiance", "[1, 1, 1]"]),
    "spheres-room": (SHARED / "spheres-room.glb", []),
}


def touching_plates():
    """Two unit squares that share an edge at a right angle; both glow a little and reflect half (Garmann 1995)."""
    corners = [(0, 0, 0), (0, 0, 1), (1, 0, 1), (1, 0, 0), (0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)]
    triangles = [0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7]
    points = struct.pack("<24f", *(x for corner in corners for x in corner))
    data = points + struct.pack("<12H", *triangles)
    return {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0},
                       "emissiveFactor": [1, 1, 1]}],
        "buffers": [{"byteLength": len(data),
                     "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}],
        "bufferViews": [{"buffer": 0, "byteLength": len(points)},
                        {"buffer": 0, "byteOffset": len(points), "byteLength": len(data) - len(points)}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3",
                       "min": [0, 0, 0], "max": [1, 1, 1]},
                      {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}]}


class Bench:
    def __init__(self, radbake, out, probes, longest):
        self.radbake, self.out, self.probes, self.longest = radbake, out, probes, longest

    def bake(self, scene, flags, checked=True):
        """One bake: what it cost, and its measured error; None if it took longer than twice the limit."""
        path, scene_flags = scene
        baked, statistics = self.out / "baked.glb", self.out / "statistics.json"
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        start = time.monotonic()
        command = [self.radbake, "bake", path, "-o", baked, "--statistics", statistics, "--check", "0",
                   "--progress", "none", *scene_flags, *flags]
        try:
            subprocess.run(command, check=True, timeout=2 * self.longest,
                           stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        except subprocess.TimeoutExpired:
            return None
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        told = json.loads(statistics.read_text())
        last = told["iterations"][-1]
        run = {
            "flags": flags, "wall_seconds": time.monotonic() - start,
            "seconds": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
            "solve_seconds": told["time"]["solve"], "elements": last["elements"], "links": last["links"],
            "factors": last["factors"], "applications": sum(i["sweeps"] for i in told["iterations"]),
            "rays": told["rays"]["count"], "vertices": told["output"]["vertices"],
            "imbalance": told["energy"]["imbalance"], "peak_bytes": told["memory"]["peak_bytes"],
            "patches": told["scene"]["patches"], "stopped_by": told["stopped_by"],
        }
        if checked:
            run["error"] = json.loads(subprocess.run(
                [self.radbake, "check", path, baked, "--probes", str(self.probes), "--json", *scene_flags],
                check=True, capture_output=True, text=True).stdout)
        return run

    def sweep(self, scene, settings, checked=True):
        """Bakes by one setting after the other, until one takes too long."""
        runs = []
        for flags in settings:
            run = self.bake(scene, flags, checked)
            if run is None:
                break
            runs.append(run)
            print("   ", *flags, f"{run['seconds']:.1f} s", f"{run['links']} links",
                  f"{100 * run['error']['relative_rms']:.2f} %" if checked else "", flush=True)
            if run["wall_seconds"] > self.longest:
                break
        return runs

    def trade(self, name, curves):
        runs = {}
        patches = 0
        # The quick ones first: it says how many patches there are.
        for curve, flags in reversed(CURVES.items()):
            if curve not in curves or curve in FLAT and patches > MOST_PATCHES:
                continue
            print(f"  {name}, {curve}", flush=True)
            settings = [["--error", str(error), *flags] for error in ERRORS]
            runs[curve] = self.sweep(SCENES[name], settings)
            patches = max([patches] + [run["patches"] for run in runs[curve]])
        return {"runs": runs, "patches": patches}

    def growth(self, scene, settings_by_name):
        """Links against elements, with the exponent fitted to the finer half of the settings."""
        growth = {}
        for name, settings in settings_by_name.items():
            print(f"  links of {name}", flush=True)
            runs = self.sweep(scene, settings, checked=False)
            growth[name] = {"runs": runs, "exponent": exponent(runs[len(runs) // 2 - 1:])}
        return growth


def exponent(runs):
    """The slope of the regression line of ln links over ln elements."""
    points = [(math.log(run["elements"]), math.log(run["links"])) for run in runs]
    points = sorted(set(points))
    if len(points) < 2:
        return None
    x0 = sum(x for x, _ in points) / len(points)
    y0 = sum(y for _, y in points) / len(points)
    return sum((x - x0) * (y - y0) for x, y in points) / sum((x - x0) ** 2 for x, _ in points)


def growth_settings():
    """As the papers refine: smaller leaves for all but `adaptive`, less energy a link for that."""
    areas = [2e-2, 8e-3, 4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 6e-5, 1.6e-5]

    def flags(method, *more):
        return ["--method", method, "--basis", "constant", "--error", "0.5", *more]
    return {
        "matrix": [flags("matrix", "--oracle.a_min", str(a)) for a in areas],
        "two-level": [flags("two-level", "--oracle.a_min", str(a / 10)) for a in areas],
        "hierarchical, F_max = 0.1": [flags("hierarchical", "--oracle.f_max", "0.1", "--oracle.a_min", str(a))
                                      for a in areas],
        "adaptive": [flags("adaptive", "--oracle.a_min", "1e-7", "--oracle.w_min", str(w))
                     for w in (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.2e-4, 6e-5, 3e-5, 1.5e-5)],
    }


def touching_settings():
    """The form-factor oracle alone, no smallest area in its way; and the energy oracle."""
    return {
        "form factor": [["--method", "hierarchical", "--error", "0.5", "--oracle.a_min", "1e-5",
                         "--oracle.f_max", str(f)] for f in (0.2, 0.1, 0.05, 0.025, 0.0125, 0.00625)],
        "energy": [["--method", "adaptive", "--basis", "constant", "--error", "0.5", "--oracle.a_min", "1e-5",
                    "--oracle.w_min", str(w)]
                   for w in (1.6e-2, 4e-3, 1e-3, 2.5e-4, 6.4e-5, 1.6e-5, 4e-6)],
    }


def factors_to(runs, error):
    """Form factors of the cheapest run whose measured error is at most this."""
    enough = [run["factors"] for run in runs if run["error"]["relative_rms"] <= error]
    return min(enough, default=None)


def write_plots(report, out):
    for name, scene in report["scenes"].items():
        for quantity, label in (("seconds", "processor seconds"), ("links", "links"), ("rays", "rays"),
                                ("factors", "form factors"), ("peak_bytes", "peak memory in bytes")):
            curves = {curve: [(run[quantity], 100 * run["error"]["relative_rms"]) for run in runs]
                      for curve, runs in scene["runs"].items()}
            (out / f"{name}-{quantity}.svg").write_text(
                log_plot(f"{name}: measured error", label, "relative RMS error in %", curves))
    for key, title in (("growth", "Links of the Cornell box"), ("touching", "Links of two touching plates")):
        curves = {f"{name} ({one['exponent']:.2f})": [(run["elements"], run["links"]) for run in one["runs"]]
                  for name, one in report[key].items() if one["exponent"] is not None}
        (out / f"{key}.svg").write_text(log_plot(f"{title}, with the exponent", "elements", "links", curves))


def table(header, rows):
    lines = ["| " + " | ".join(header) + " |", "|" + " --- |" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


def dial(report):
    """What was asked for, and what came out, by default; of errors that a second check would also find."""
    rows, ratios = [], []
    for name, scene in report["scenes"].items():
        measured = {float(run["flags"][1]): run["error"]["relative_rms"] for run in scene["runs"].get(DEFAULT, [])}
        measured = {error: measured[error] for error in DIAL if error in measured}
        ratios += [found / error for error, found in measured.items()]
        rows.append([name] + [f"{100 * measured[error]:.2f} %" if error in measured else "–" for error in DIAL])
    if not ratios:
        return ""
    share = sum(ratio <= 1 for ratio in ratios) / len(ratios)
    used = sum(ratio >= 1 / 3 for ratio in ratios) / len(ratios)
    return ("\n## The dial: asked and measured\n\n" +
            table([""] + [f"{100 * error:g} %" for error in DIAL], rows) +
            f"\nAt most what was asked in {100 * share:.0f} % of {len(ratios)} cases, at worst {max(ratios):.2f} times "
            f"it; above a third of it in {100 * used:.0f} %.\n")


def markdown(report):
    text = f"# The trade, measured\n\n{report['blender']}.\n" + dial(report)
    for name, scene in report["scenes"].items():
        text += f"\n## {name}\n\n"
        if scene["patches"] > MOST_PATCHES:
            text += f"`matrix` and `two-level` link all pairs of its {scene['patches']} patches: not run.\n\n"
        rows = []
        for curve, runs in scene["runs"].items():
            for run in runs:
                error = run["error"]
                rows.append([curve, f"{100 * float(run['flags'][1]):g} %",
                             f"{100 * error['relative_rms']:.2f} % ({100 * error['low']:.2f} to "
                             f"{100 * error['high']:.2f})", f"{100 * error['bias']:.2f} %",
                             f"{100 * run['imbalance']:.2f} %", f"{run['elements']:,}", f"{run['links']:,}",
                             f"{run['factors']:,}", f"{run['rays'] / 1e6:.1f} million", f"{run['seconds']:.1f}",
                             f"{run['peak_bytes'] / 1e6:.0f} MB"])
        text += table(["", "asked", "measured", "bias", "imbalance", "elements", "links", "form factors",
                       "rays", "seconds", "memory"], rows)
        needed = {curve: factors_to(runs, 0.02) for curve, runs in scene["runs"].items()}
        text += "\nForm factors to 2 %: " + ", ".join(
            f"{curve} {count:,}" if count else f"{curve} more than its range here"
            for curve, count in needed.items()) + ".\n"
    for key, title in (("growth", "Links against elements, the Cornell box"),
                       ("touching", "Two plates that touch at a right angle (Garmann 1995)")):
        text += f"\n## {title}\n\n"
        text += table(["", "exponent", "elements: links"],
                      [[name, "–" if one["exponent"] is None else f"{one['exponent']:.2f}",
                        ", ".join(f"{run['elements']:,}: {run['links']:,}" for run in one["runs"])]
                       for name, one in report[key].items()])
    return text


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--radbake", required=True)
    arguments.add_argument("--out", required=True, type=pathlib.Path)
    arguments.add_argument("--scenes", help="names, with commas; all by default")
    arguments.add_argument("--curves", help="names, with semicolons; all by default")
    arguments.add_argument("--probes", type=int, default=1024)
    arguments.add_argument("--longest", type=float, default=60, help="wall seconds of a bake that end a range")
    given = arguments.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    names = given.scenes.split(",") if given.scenes else list(SCENES)
    unknown = set(names) - set(SCENES)
    if unknown:
        sys.exit(f"tradeoff: no scene {', '.join(sorted(unknown))}; there are {', '.join(SCENES)}")
    curves = given.curves.split(";") if given.curves else list(CURVES)
    if set(curves) - set(CURVES):
        sys.exit(f"tradeoff: the curves are {'; '.join(CURVES)}")
    bench = Bench(given.radbake, given.out, given.probes, given.longest)
    plates = given.out / "touching-plates.gltf"
    plates.write_text(json.dumps(touching_plates()))
    report = {
        "cores": os.cpu_count(),
        "blender": "Cycles is not among the curves: no `blender` on this machine" if not shutil.which("blender")
                   else "Cycles is not among the curves: this driver does not run `blender`",
        "growth": bench.growth(SCENES["cornell-box"], growth_settings()) if not given.curves else {},
        "touching": bench.growth((plates, []), touching_settings()) if not given.curves else {},
        "scenes": {name: bench.trade(name, curves) for name in names if SCENES[name][0].exists()},
    }
    (given.out / "tradeoff.json").write_text(json.dumps(report, indent=1))
    (given.out / "tradeoff.md").write_text(markdown(report))
    write_plots(report, given.out)
    for left in ("baked.glb", "statistics.json"):
        (given.out / left).unlink(missing_ok=True)
    print(f"{given.out}/tradeoff.md")


if __name__ == "__main__":
    main()
