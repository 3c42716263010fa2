"""Where do rare failures lie? One panel per case: the points that collide, of crude samples, in the two parameters that
tell them best from the kernels, with the kernels.

    lanesweep sample DENSITY --models MODEL --thw T --samples N --config sample.failures_limit=2000 --failures FAILURES.csv
    python regions.py OUT.svg "TITLE=DENSITY,FAILURES.csv" ...

The nearest kernel of a point is that of the smallest distance in units of the kernels' own deviation. Needs matplotlib."""
import csv
import json
import math
import sys

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt

plt.rcParams.update({"svg.hashsalt": "lanesweep", "font.size": 8, "svg.fonttype": "none"})


def case(density, failures):
    model = json.load(open(density))
    names = [parameter["name"] for parameter in model["parameters"]]
    scale = [model["bandwidth"]["value"] * value for value in model["scale"]]
    kernels = model["kernels"]
    points = [[float(row[name]) for name in names] for row in csv.DictReader(open(failures)) if row["collision"] == "1"]
    nearest, away = set(), []
    for point in points:
        distance = lambda kernel: sum(((a - b) / s) ** 2 for a, b, s in zip(point, kernel, scale))
        best = min(range(len(kernels)), key=lambda at: distance(kernels[at]))
        nearest.add(best)
        away.append([(a - b) / s for a, b, s in zip(point, kernels[best], scale)])
    mean = [sum(row[at] for row in away) / len(away) for at in range(len(names))]
    x, y = sorted(range(len(names)), key=lambda at: -abs(mean[at]))[:2]
    far = [math.sqrt(sum(value * value for value in row)) for row in away]
    return names, kernels, points, nearest, (x, y), (min(far), max(far))


def main():
    cases = [argument.split("=", 1) for argument in sys.argv[2:]]
    figure, panels = plt.subplots(1, len(cases), figsize=(2.6 * len(cases), 3.0), layout="constrained")
    for panel, (title, files) in zip(panels, cases):
        names, kernels, points, nearest, (x, y), (low, high) = case(*files.split(","))
        of = lambda rows, at: [row[at] for row in rows]
        panel.plot(of(kernels, x), of(kernels, y), ".", color="#9a9a9a", ms=3, label="kernels")
        near = [kernels[at] for at in sorted(nearest)]
        panel.plot(of(near, x), of(near, y), "o", mfc="none", color="#0072b2", ms=5, label="kernels that fail")
        panel.plot(of(points, x), of(points, y), "x", color="#d55e00", ms=3, mew=0.7, label="collisions")
        words = f"{len(points)} collisions, {len(nearest)} of {len(kernels)} kernels\n{low:.1f} to {high:.1f} kernel deviations away"
        panel.set_title(f"{title}\n{words}", fontsize=7, loc="left")
        panel.set_xlabel(names[x])
        panel.set_ylabel(names[y])
        for side in ("top", "right"):
            panel.spines[side].set_visible(False)
    panels[0].legend(frameon=False, fontsize=7)
    figure.savefig(sys.argv[1], metadata={"Date": None})


main()
