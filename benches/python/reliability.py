"""Rare failures on textbook problems: OpenTURNS and UQpy beside lanesweep, at equal numbers of calls of the limit state.

    cargo bench --bench rare -- textbook 200 > textbook.csv
    pip install "numpy<2" openturns UQpy        # UQpy needs NumPy 1; one that is not installed is left out, with a line
    python benches/python/reliability.py textbook.csv 50 > peers.csv

Every method gets as many calls as lanesweep's median on that problem: a first run, which is not counted, tells how many
samples per level that takes. What it really made is in the table. Prints a row per problem and method: calls and error as medians over the repeats, the fraction of
repeats with a relative error above one half, the mean over the truth, coverage of the 95 % interval where the method has
one.
"""

from __future__ import annotations

import csv
import math
import os
import statistics
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

Array = np.ndarray
Limit = Callable[[Array], Array]


def plane(x: Array) -> Array:
    return 4.753424308822899 - x.sum(axis=1) / math.sqrt(x.shape[1])


def four_modes(x: Array) -> Array:
    return 4.5 - np.abs(x[:, :2]).max(axis=1)


def four_branches(near: float, far: float) -> Limit:
    def limit(x: Array) -> Array:
        u, v = (x[:, 0] + x[:, 1]) / math.sqrt(2), (x[:, 0] - x[:, 1]) / math.sqrt(2)
        return np.minimum(near + 0.2 * v**2 - np.abs(u), far - np.abs(v))

    return limit


def parabola(x: Array) -> Array:
    return 5.0 - x[:, 1] - 0.5 * (x[:, 0] - 0.1) ** 2


def metaball(x: Array) -> Array:
    a = 4.0 * (x[:, 0] + 2.0) ** 2 / 9.0 + x[:, 1] ** 2 / 25.0
    b = (x[:, 0] - 2.5) ** 2 / 4.0 + (x[:, 1] - 0.5) ** 2 / 25.0
    return 30.0 / (a**2 + 1.0) + 20.0 / (b**2 + 1.0) - 5.0


def needle(x: Array) -> Array:
    return np.hypot(x[:, 0] - 4.0, x[:, 1]) - 0.3


def problem(name: str) -> tuple[int, Limit]:
    if " d=" in name:
        return int(name.split("=")[1]), plane if name.startswith("plane") else four_modes
    if name.startswith("four branches"):
        near, far = map(float, name.split()[2:])
        return 2, four_branches(near, far)
    return 2, {"parabola": parabola, "metaball": metaball, "needle": needle}[name]


class Counted:
    """A limit state that counts its calls."""

    def __init__(self, limit: Limit) -> None:
        self.limit, self.calls = limit, 0

    def __call__(self, points: object) -> Array:
        points = np.atleast_2d(np.asarray(points, dtype=float))
        self.calls += len(points)
        return self.limit(points)


# Probability, ends of the 95 % interval (NaN without one).
Estimate = tuple[float, float, float]


# Samples per level → estimate.
Run = Callable[[int], Estimate]


def openturns(limit: Counted, dimensions: int, seed: int) -> Iterator[tuple[str, Run]]:
    import openturns as ot

    ot.Log.Show(ot.Log.NONE)
    ot.RandomGenerator.SetSeed(seed)

    def evaluated(sample: object) -> list[list[float]]:
        return limit(sample)[:, np.newaxis].tolist()

    function = ot.PythonFunction(dimensions, 1, func_sample=evaluated)
    vector = ot.CompositeRandomVector(function, ot.RandomVector(ot.Normal(dimensions)))
    event = ot.ThresholdEvent(vector, ot.LessOrEqual(), 0.0)

    def of(result: object) -> Estimate:
        p = result.getProbabilityEstimate()
        half = result.getConfidenceLength(0.95) / 2
        return p, p - half, p + half

    def by_levels(make: Callable[[], object]) -> Run:
        def run(level: int) -> Estimate:
            algorithm = make()
            algorithm.setMaximumOuterSampling(level)
            algorithm.setBlockSize(1)
            algorithm.run()
            return of(algorithm.getResult())

        return run

    def directional(level: int) -> Estimate:
        algorithm = ot.AdaptiveDirectionalStratification(event, ot.RiskyAndFast(), ot.RandomDirection())
        algorithm.setMaximumOuterSampling(max(level, 100))
        algorithm.run()
        return of(algorithm.getResult())

    yield "OpenTURNS subset simulation", by_levels(lambda: ot.SubsetSampling(event))
    yield "OpenTURNS non-parametric adaptive IS", by_levels(lambda: ot.NAIS(event, 0.1))
    yield "OpenTURNS cross-entropy", by_levels(lambda: ot.StandardSpaceCrossEntropyImportanceSampling(event, 0.1))
    if dimensions <= 5:
        yield "OpenTURNS adaptive directional stratification", directional


# The limit state of the running method: UQpy calls a function of a script by its name.
CURRENT: Counted


def uqpy(limit: Counted, dimensions: int, seed: int) -> Iterator[tuple[str, Run]]:
    from UQpy.distributions import JointIndependent, Normal
    from UQpy.reliability import SubsetSimulation
    from UQpy.run_model import PythonModel, RunModel
    from UQpy.sampling import ModifiedMetropolisHastings

    def subset(level: int) -> Estimate:
        global CURRENT
        CURRENT = limit
        level = max(10 * (level // 10), 100)  # whole chains
        target = JointIndependent([Normal() for _ in range(dimensions)])
        first = np.random.default_rng(seed).standard_normal((level, dimensions))
        chains = ModifiedMetropolisHastings(
            dimension=dimensions, log_pdf_target=target.log_pdf, n_chains=level // 10, random_state=seed
        )
        model = RunModel(model=PythonModel(model_script="limit.py", model_object_name="g"))
        run = SubsetSimulation(model, chains, samples_init=first, nsamples_per_subset=level, max_level=12)
        p, cov = float(run.failure_probability), float(run.independent_chains_CoV)
        return p, p * (1 - 1.96 * cov), p * (1 + 1.96 * cov)

    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "limit.py").write_text("import __main__\n\ndef g(u):\n    return float(__main__.CURRENT(u)[0])\n")
        before = Path.cwd()
        os.chdir(folder)
        sys.path.insert(0, folder)
        yield "UQpy subset simulation", subset
        os.chdir(before)


def main(textbook: Path, repeats: int) -> None:
    ours: dict[str, list[dict[str, str]]] = defaultdict(list)
    with textbook.open() as file:
        for line in csv.DictReader(file):
            ours[line["case"]].append(line)
    print("problem,truth,method,repeats,calls,median_error,off_by_half,mean_over_truth,coverage", flush=True)

    def show(name: str, truth: float, method: str, calls: list[float], found: list[Estimate]) -> None:
        errors = [abs(p / truth - 1) for p, _, _ in found]
        held = [low <= truth <= high for _, low, high in found if not math.isnan(low)]
        print(
            name,
            f"{truth:.4e}",
            method,
            len(found),
            round(statistics.median(calls)),
            f"{statistics.median(errors):.4f}",
            f"{sum(e > 0.5 for e in errors) / len(errors):.3f}",
            f"{statistics.fmean(p for p, _, _ in found) / truth:.4f}",
            f"{sum(held) / len(held):.3f}" if held else "",
            sep=",",
            flush=True,
        )

    for name, lines in ours.items():
        truth = float(lines[0]["truth"])
        found = [(float(line["probability"]), float(line["low"]), float(line["high"])) for line in lines]
        show(name, truth, "lanesweep", [float(line["runs"]) for line in lines], found)
        calls = int(statistics.median(float(line["runs"]) for line in lines))
        dimensions, limit = problem(name)
        for library in (openturns, uqpy):
            runs: dict[str, tuple[list[float], list[Estimate]]] = defaultdict(lambda: ([], []))
            levels: dict[str, int] = {}
            try:
                for seed in range(repeats + 1):
                    counted = Counted(limit)
                    for method, run in library(counted, dimensions, seed):
                        counted.calls = 0
                        try:
                            estimate = run(levels.get(method, FIRST))
                        except Exception as error:  # what a library cannot do counts as no estimate
                            print(f"{name}: {method}: {error}", file=sys.stderr)
                            estimate = (0.0, math.nan, math.nan)
                        if method not in levels:
                            levels[method] = max(FIRST * calls // max(counted.calls, 1), 100)
                            continue
                        runs[method][0].append(counted.calls)
                        runs[method][1].append(estimate)
            except ImportError as error:
                print(f"SKIPPED: {error}", file=sys.stderr)
            for method, (made, estimates) in runs.items():
                show(name, truth, method, made, estimates)


# Samples per level of the first run.
FIRST = 1000


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 50)
