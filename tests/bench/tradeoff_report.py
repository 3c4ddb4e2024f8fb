"""Tables and plots of what tradeoff.py has measured.

A report holds `scenes`, by name: `runs`, a list of bakes by curve, `patches`, and `cycles`, the bakes of Cycles, or why
it was `refused`; `agreement`, by scene and method, the finest bake; and `growth` and `touching`, by method: `runs` and fitted exponents.
"""
import math

from tradeoff_plot import log_plot

DEFAULT = "adaptive, final gather"
CYCLES = "Cycles"
AGREEMENT, GROWTH, TOUCHING = "agreement", "growth", "touching"
DIAL = (0.1, 0.05, 0.02, 0.01)
MOST_PATCHES = 300  # of methods that link all pairs: of more they would need all memory
SHOWN = ("cornell-box", "living-room", "furnished-room")  # whose error against time tradeoff.md shows


def exponent(runs, quantity):
    """The slope of the regression line of its logarithm over that of the elements."""
    points = sorted({(math.log(run["elements"]), math.log(run[quantity])) for run in runs})
    x0 = sum(x for x, _ in points) / max(1, len(points))
    y0 = sum(y for _, y in points) / max(1, len(points))
    spread = sum((x - x0) ** 2 for x, _ in points)
    return sum((x - x0) * (y - y0) for x, y in points) / spread if spread else None


def factors_to(runs, error):
    """Form factors of the cheapest run whose measured error is at most this."""
    enough = [run["factors"] for run in runs if run["error"]["relative_rms"] <= error]
    return min(enough, default=None)


def seconds_to(runs, error):
    """Along the curve, between the runs on both sides of the error; None if it is beyond its range."""
    points = sorted((run["error"]["relative_rms"], run["seconds"]) for run in runs)
    for (low, slow), (high, quick) in zip(points, points[1:]):
        if 0 < low <= error <= high and low < high:
            return slow * (quick / slow) ** (math.log(error / low) / math.log(high / low))
    return None


def points_of(runs, quantity):
    return [(run[quantity], 100 * run["error"]["relative_rms"]) for run in runs]


def write_plots(report, out):
    for name, scene in report["scenes"].items():
        for quantity, label in (("seconds", "processor seconds"), ("links", "links"), ("rays", "rays"),
                                ("factors", "form factors"), ("peak_bytes", "peak memory in bytes")):
            curves = {curve: points_of(runs, quantity) for curve, runs in scene["runs"].items()}
            if quantity == "seconds" and "cycles" in scene:
                curves[CYCLES] = points_of(scene["cycles"], quantity)
            (out / f"{name}-{quantity}.svg").write_text(
                log_plot(f"{name}: measured error", label, "relative RMS error in %", curves))
    for key, title in ((GROWTH, "Links of the Cornell box"), (TOUCHING, "Links of two touching plates")):
        curves = {f"{name} ({one['exponent']:.2f})": [(run["elements"], run["links"]) for run in one["runs"]]
                  for name, one in report.get(key, {}).items() if one["exponent"] is not None}
        (out / f"{key}.svg").write_text(log_plot(f"{title}, with the exponent", "elements", "links", curves))
    curves = {name: points_of(one["runs"], "links") for name, one in report.get(TOUCHING, {}).items()}
    (out / "touching-error.svg").write_text(
        log_plot("Two touching plates: measured error", "links", "relative RMS error in %", curves))


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


def told(error):
    return f"{100 * error['relative_rms']:.2f} % ({100 * error['low']:.2f} to {100 * error['high']:.2f})"


def to_two_percent(quantity, values, form):
    said = [f"{curve} {form.format(value)}" if value else f"{curve} beyond its range here"
            for curve, value in values.items()]
    return f"\n{quantity} to 2 %: {', '.join(said)}.\n"


def scene_tables(name, scene):
    text = f"\n## {name}\n\n"
    if name in SHOWN:
        text += f"![Measured error against time in {name}]({name}-seconds.svg)\n\n"
    if scene["patches"] > MOST_PATCHES:
        text += f"`matrix` and `two-level` link all pairs of its {scene['patches']} patches: not run.\n\n"
    runs = scene["runs"]
    text += table(
        ["", "asked", "measured", "bias", "imbalance", "elements", "links", "form factors", "rays", "seconds",
         "memory"],
        [[curve, f"{100 * float(run['flags'][1]):g} %", told(run["error"]), f"{100 * run['error']['bias']:.2f} %",
          f"{100 * run['imbalance']:.2f} %", f"{run['elements']:,}", f"{run['links']:,}", f"{run['factors']:,}",
          f"{run['rays'] / 1e6:.1f} million", f"{run['seconds']:.1f}", f"{run['peak_bytes'] / 1e6:.0f} MB"]
         for curve, bakes in runs.items() for run in bakes])
    if scene.get("cycles"):
        first = scene["cycles"][0]
        text += (f"\nCycles of Blender {first['version']}, {first['texels']:,} texels in {first['charts']:,} charts, "
                 f"unwrapped in {first['unwrap_seconds']:.2f} s:\n\n" +
                 table(["samples", "measured", "bias", "seconds"],
                       [[f"{run['samples']:,}", told(run["error"]), f"{100 * run['error']['bias']:.2f} %",
                         f"{run['seconds']:.1f}"] for run in scene["cycles"]]))
        runs = {**runs, CYCLES: scene["cycles"]}
    if "refused" in scene:
        text += f"\nNot baked by Cycles: {scene['refused']}.\n"
    text += to_two_percent("Form factors", {curve: factors_to(bakes, 0.02) for curve, bakes in scene["runs"].items()},
                           "{:,}")
    return text + to_two_percent("Processor seconds", {curve: seconds_to(bakes, 0.02) for curve, bakes in runs.items()},
                                 "{:.2f}")


def agreement_table(report):
    """Whatever makes the solution, what is gathered from it is the same light."""
    by_scene = {name: finest for name, finest in report.get(AGREEMENT, {}).items() if finest}
    if not by_scene:
        return ""
    methods = list(reversed(max(by_scene.values(), key=len)))

    def cell(run):
        return f"{100 * run['error']['relative_rms']:.2f} % (of {100 * float(run['flags'][1]):g})" if run else "–"
    rows = [[name] + [cell(finest.get(method)) for method in methods] for name, finest in by_scene.items()]
    return ("\n## Every method at its finest\n\nThe measured error with the final gather, of what was asked for, the finest "
            f"within the time. Of scenes of at most {MOST_PATCHES} patches.\n\n" + table([""] + methods, rows))


def growth_tables(report):
    text = ""
    if GROWTH in report:
        text += ("\n## Links and memory against elements, the Cornell box\n\n"
                 "![Links against elements](growth.svg)\n\nExponents are fitted to the finer half of each range; "
                 "memory is that of elements and links.\n\n")
        text += table(
            ["", "exponent of links", "of memory", "bytes per element at last", "elements: links"],
            [[name, fitted(one["exponent"]), fitted(one["memory_exponent"]),
              f"{one['runs'][-1]['solve_bytes'] / one['runs'][-1]['elements']:,.0f}",
              ", ".join(f"{run['elements']:,}: {run['links']:,}" for run in one["runs"])]
             for name, one in report[GROWTH].items()])
    if TOUCHING in report:
        text += ("\n## Two plates that touch at a right angle\n\n![Links against elements](touching.svg)\n"
                 "![Measured error against links](touching-error.svg)\n\n"
                 "By form factor alone, as its threshold falls and the geometry stays, links grow about as the square "
                 "of the elements (Garmann: Hierarchical Radiosity – An Analysis of Computational Complexity, Dortmund "
                 "584/1995). At a fixed threshold and ever smaller areas they grow as the elements (Hanrahan, Salzman, "
                 "Aupperle 1991), but these gather at the edge, and the error stays. By energy fewer links are left "
                 "where little light passes.\n\n")
        text += table(
            ["", "exponent", "elements: links: measured error"],
            [[name, fitted(one["exponent"]),
              ", ".join(f"{run['elements']:,}: {run['links']:,}: {100 * run['error']['relative_rms']:.2f} %"
                        for run in one["runs"])] for name, one in report[TOUCHING].items()])
    return text


def fitted(value):
    return "–" if value is None else f"{value:.2f}"


def markdown(report):
    text = ("# The trade, measured\n\nBy `tests/bench/tradeoff.py`. Errors are relative RMS of the irradiance, with "
            "their 95 % interval, by `radbake check`; seconds are processor seconds of a bake.\n")
    if any(scene.get("cycles") for scene in report["scenes"].values()):
        text += ("\nCycles' seconds are of its bake alone: no start, no unwrap, no writing. Its map is compared as a "
                 "viewer interpolates it; no denoiser, no clamping, no light threshold.\n")
    text += dial(report)
    text += "".join(scene_tables(name, scene) for name, scene in report["scenes"].items())
    return text + agreement_table(report) + growth_tables(report)
