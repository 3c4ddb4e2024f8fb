#!/usr/bin/env python3
"""What each method gives for its cost: measured error against time, links and rays, links against elements, memory.

    tradeoff.py --radbake build/release/bin/radbake --out build/tradeoff [--publish tests/bench]
    tradeoff.py … --parts cornell-box,growth --keep

Runs `radbake bake` for every method and basis over its accuracy range on each scene, without the final gather and, for
the default, with it, and `radbake check` on every result. Where there is a `blender`, Cycles bakes the scene too
(cycles.py). Three more parts are `agreement`, every method with the final gather at its finest, `growth`, links against
elements in the Cornell box, and `touching`, two plates that touch at a right angle.
Writes tradeoff.json (all that was measured), tradeoff.md (tables) and SVGs into --out, anew after each part; --publish
copies tradeoff.md and the plots that it shows. A range ends where a bake takes longer than --longest. Times are
processor seconds of the bake, without the check. Needs nothing but Python 3.
"""
import argparse
import base64
import json
import math
import os
import pathlib
import resource
import shutil
import signal
import struct
import subprocess
import sys

from tradeoff_report import (AGREEMENT, CYCLES, DEFAULT, GROWTH, MOST_PATCHES, SHOWN, TOUCHING, exponent, markdown,
                             write_plots)

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
CURVES[DEFAULT] = ["--method", "adaptive"]
ERRORS = (0.2, 0.1, 0.05, 0.03, 0.02, 0.014, 0.01)
FINEST = (0.02, 0.01)
SAMPLES = (4, 16, 64, 256, 1024)
TEXELS = 65536
# Methods that link all pairs of patches at least.
FLAT = ("matrix", "two-level")
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
    "furnished-room": (None, []),  # made in --out
}
FURNISHED = 10_000  # triangles


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


class Refused(Exception):
    """Cycles has no such scene; says why."""


class Bench:
    def __init__(self, radbake, blender, out, probes, longest):
        self.radbake, self.blender, self.out, self.probes, self.longest = radbake, blender, out, probes, longest
        self.baked = out / "baked.glb"

    def timed(self, command, beside=0):
        """The processor seconds of a command; None if it took twice the limit and what it does beside the bake."""
        before = resource.getrusage(resource.RUSAGE_CHILDREN)

        def limit():
            resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(2 * self.longest + beside), resource.RLIM_INFINITY))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        done = subprocess.run(command, preexec_fn=limit, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        if done.returncode == -signal.SIGXCPU:
            return None
        if done.returncode:
            raise subprocess.CalledProcessError(done.returncode, command, stderr=done.stderr)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    def check(self, path, scene_flags):
        command = [self.radbake, "check", path, self.baked, "--probes", str(self.probes), "--json", *scene_flags]
        return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)

    def bake(self, scene, flags, checked=True):
        """One bake: what it cost, and its measured error; None if it took twice the limit."""
        path, scene_flags = scene
        statistics = self.out / "statistics.json"
        seconds = self.timed([self.radbake, "bake", path, "-o", self.baked, "--statistics", statistics, "--check", "0",
                              "--progress", "none", *scene_flags, *flags])
        if seconds is None:
            return None
        told = json.loads(statistics.read_text())
        last, memory = told["iterations"][-1], told["memory"]
        run = {
            "flags": flags, "seconds": seconds, "elements": last["elements"], "links": last["links"],
            "factors": last["factors"], "applications": sum(i["sweeps"] for i in told["iterations"]),
            "rays": told["rays"]["count"], "vertices": told["output"]["vertices"],
            "imbalance": told["energy"]["imbalance"], "peak_bytes": memory["peak_bytes"],
            "solve_bytes": memory["bytes_per_element"] * last["elements"] + memory["bytes_per_link"] * last["links"],
            "patches": told["scene"]["patches"], "stopped_by": told["stopped_by"],
        }
        if checked:
            run["error"] = self.check(path, scene_flags)
        return run

    def cycles(self, scene, samples):
        """The same of Cycles' bake; its seconds are of the bake alone, without unwrapping and writing."""
        path, scene_flags = scene
        environment = json.loads(scene_flags[1]) if scene_flags else [0, 0, 0]
        try:
            seconds = self.timed([
                self.blender, "--background", "--factory-startup", "--python-exit-code", "1",
                "--python", ROOT / "tests" / "bench" / "cycles.py", "--", path, self.baked, "--samples", str(samples),
                "--texels", str(TEXELS), "--threads", str(os.cpu_count()),
                "--environment", ",".join(map(str, environment))], beside=60)
        except subprocess.CalledProcessError as error:
            said = [line for line in error.stderr.splitlines() if line.startswith("cycles: ")]
            if said:
                raise Refused(said[-1].removeprefix("cycles: ")) from None
            raise
        if seconds is None:
            return None
        return {**json.loads(self.baked.with_suffix(".json").read_text()), "error": self.check(path, scene_flags)}

    def sweep(self, settings, bake):
        """Bakes by one setting after the other, until one takes too long."""
        runs = []
        for setting in settings:
            run = bake(setting)
            if run is None:
                break
            runs.append(run)
            print("   ", *(setting if isinstance(setting, list) else [setting]), f"{run['seconds']:.1f} s",
                  f"{run['links']} links" if "links" in run else "",
                  f"{100 * run['error']['relative_rms']:.2f} %" if "error" in run else "", flush=True)
            if run["seconds"] > self.longest:
                break
        return runs

    def trade(self, name, curves):
        scene = SCENES[name]
        if name == "furnished-room":
            scene = self.out / "furnished-room.glb", []
            subprocess.run([sys.executable, OURS / "make_room.py", str(FURNISHED), scene[0]], check=True)
        runs = {}
        patches = 0
        # The quick ones first: it says how many patches there are.
        for curve, flags in reversed(CURVES.items()):
            if curve not in curves or curve in FLAT and patches > MOST_PATCHES:
                continue
            print(f"  {name}, {curve}", flush=True)
            settings = [["--error", str(error), *flags] for error in ERRORS]
            runs[curve] = self.sweep(settings, lambda flags: self.bake(scene, flags))
            patches = max([patches] + [run["patches"] for run in runs[curve]])
        found = {"runs": runs, "patches": patches}
        if self.blender and CYCLES in curves:
            print(f"  {name}, {CYCLES}", flush=True)
            try:
                found["cycles"] = self.sweep(SAMPLES, lambda samples: self.cycles(scene, samples))
            except Refused as reason:
                found["refused"] = str(reason)
        return found

    def agreement(self, name):
        """Of each method, gathered anew, the finest bake within the limit; of none where some would link too much."""
        finest = {}
        for method, flags in reversed(SOLUTIONS.items()):
            print(f"  {name}, {method}, gathered", flush=True)
            settings = [["--error", str(error), *flags, "--final-gather", "on"] for error in FINEST]
            runs = self.sweep(settings, lambda flags: self.bake(SCENES[name], flags))
            if runs and runs[-1]["patches"] <= MOST_PATCHES:
                finest[method] = runs[-1]
            elif not finest:
                return {}
        return finest

    def growth(self, scene, settings_by_name, checked=False):
        """Links and bytes against elements, with the exponents fitted to the finer half of the settings."""
        growth = {}
        for name, settings in settings_by_name.items():
            print(f"  links of {name}", flush=True)
            runs = self.sweep(settings, lambda flags: self.bake(scene, flags, checked))
            finer = runs[max(0, len(runs) // 2 - 1):]
            growth[name] = {"runs": runs, "exponent": exponent(finer, "links"),
                            "memory_exponent": exponent(finer, "solve_bytes")}
        return growth


def growth_settings():
    """As the papers refine: smaller leaves at one threshold; and for `adaptive` less energy a link too."""
    areas = [2e-2, 8e-3, 4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 6e-5, 1.6e-5]

    def flags(method, *more):
        return ["--method", method, "--basis", "constant", "--error", "0.5", *more]
    return {
        "matrix": [flags("matrix", "--oracle.a_min", str(a)) for a in areas],
        "two-level": [flags("two-level", "--oracle.a_min", str(a / 10)) for a in areas],
        "hierarchical, F_max = 0.1": [flags("hierarchical", "--oracle.f_max", "0.1", "--oracle.a_min", str(a))
                                      for a in areas],
        "adaptive, W_min = 1e-5": [flags("adaptive", "--oracle.w_min", "1e-5", "--oracle.a_min", str(a))
                                   for a in areas],
        "adaptive, W_min falling": [flags("adaptive", "--oracle.a_min", "1e-7", "--oracle.w_min", str(w))
                                    for w in (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.2e-4, 6e-5, 3e-5, 1.5e-5)],
    }


def touching_settings():
    """The form-factor oracle as both its thresholds fall, and as the smallest area alone does; and the energy oracle
    without a smallest area.

    At a distance r a link's elements have the size h = r·√(π·F_max), but not below √A_min. Over two plates that touch
    this makes 1/√(F_max·A_min) elements and 1/√(F_max³·A_min) links: at a fixed A_min, of a coarser sweep, links grow
    as the third power of the elements, and at a fixed F_max as the first. Neither is what Garmann looks at, who lets
    the threshold fall and keeps the geometry; with A_min in proportion it is the second.
    """
    def flags(method, *more):
        return ["--method", method, "--error", "0.5", "--final-gather", "off", *more]

    def energy(basis):
        return [flags("adaptive", "--basis", basis, "--oracle.a_min", "1e-7", "--oracle.w_min", str(w))
                for w in (1.6e-2, 4e-3, 1e-3, 2.5e-4, 6.4e-5, 1.6e-5, 4e-6, 1e-6)]
    return {
        "form factor": [flags("hierarchical", "--oracle.f_max", str(f), "--oracle.a_min", str(f / 16))
                        for f in (0.1, 0.05, 0.025, 0.0125, 0.00625, 0.003125, 0.0015625)],
        "form factor, A_min alone": [flags("hierarchical", "--oracle.f_max", "0.1", "--oracle.a_min", str(a))
                                     for a in (1e-3, 2.5e-4, 6.3e-5, 1.6e-5, 4e-6, 1e-6)],
        "energy": energy("constant"),
        "energy, linear": energy("linear"),
    }


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--radbake", required=True)
    arguments.add_argument("--out", required=True, type=pathlib.Path)
    arguments.add_argument("--publish", type=pathlib.Path, help="folder for tradeoff.md and the plots that it shows")
    arguments.add_argument("--blender", default=shutil.which("blender"), help="its program (default: that of the path)")
    arguments.add_argument("--parts", help=f"scenes, {GROWTH}, {TOUCHING}, with commas; all by default")
    arguments.add_argument("--keep", action="store_true", help="the other parts that --out already has")
    arguments.add_argument("--curves", help="of the scenes, with semicolons; all by default")
    arguments.add_argument("--probes", type=int, default=1024)
    arguments.add_argument("--longest", type=float, default=120, help="processor seconds of a bake that end a range")
    given = arguments.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    there = [*SCENES, AGREEMENT, GROWTH, TOUCHING]
    parts = given.parts.split(",") if given.parts else there
    if set(parts) - set(there):
        sys.exit(f"tradeoff: no part {', '.join(sorted(set(parts) - set(there)))}; there are {', '.join(there)}")
    curves = given.curves.split(";") if given.curves else [*CURVES, CYCLES]
    if set(curves) - {*CURVES, CYCLES}:
        sys.exit(f"tradeoff: the curves are {'; '.join([*CURVES, CYCLES])}")
    bench = Bench(given.radbake, given.blender, given.out, given.probes, given.longest)
    stored = given.out / "tradeoff.json"
    report = json.loads(stored.read_text()) if given.keep and stored.exists() else {"scenes": {}}
    report["cores"] = os.cpu_count()
    for part in parts:
        if part == AGREEMENT:
            report[part] = {}
            for name in (name for name, (path, _) in SCENES.items() if path and path.exists()):
                report[part][name] = bench.agreement(name)
                stored.write_text(json.dumps(report, indent=1))
        elif part == GROWTH:
            report[part] = bench.growth(SCENES["cornell-box"], growth_settings())
        elif part == TOUCHING:
            plates = given.out / "touching-plates.gltf"
            plates.write_text(json.dumps(touching_plates()))
            report[part] = bench.growth((plates, []), touching_settings(), checked=True)
        elif SCENES[part][0] is None or SCENES[part][0].exists():
            report["scenes"][part] = bench.trade(part, curves)
        stored.write_text(json.dumps(report, indent=1))
        (given.out / "tradeoff.md").write_text(markdown(report))
        write_plots(report, given.out)
    for left in ("baked.glb", "baked.json", "statistics.json"):
        (given.out / left).unlink(missing_ok=True)
    if given.publish:
        for name in ("tradeoff.md", *(f"{scene}-seconds.svg" for scene in SHOWN if scene in report["scenes"]),
                     f"{GROWTH}.svg", f"{TOUCHING}.svg", "touching-error.svg"):
            shutil.copy(given.out / name, given.publish)
    print(f"{given.out}/tradeoff.md")


if __name__ == "__main__":
    main()
