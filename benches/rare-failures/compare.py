"""The benchmark's cases by lanesweep, OpenTURNS and UQpy: errors, coverage and missed modes in one table.

    cargo bench --bench rare -- repeats 200 > ours.csv
    pip install numpy openturns UQpy            # UQpy needs NumPy 1; one that is not installed is left out, with a line
    python benches/rare-failures/compare.py ours.csv 50 20000 > table.csv

With a name in place of 50 it makes the table (.md) or the figure (.svg) of the book instead, from the rows of lanesweep alone; a file
crude.csv beside them has crude lanes of the cases.

The other libraries get so many calls of the limit state: a first run, which is not counted, tells how many samples per level that
takes. `lanesweep` has no such limit: its calls are those of its draws of the density too. Prints a row per case and method: calls and
error as medians over the repeats, the fraction of repeats with a relative error above one half, the mean over the truth, coverage of
the 95 % interval where the method has one, and the fraction of repeats that lack more than half of what the second kernel carries.
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
from typing import TYPE_CHECKING

# The table and the figure need neither NumPy nor the cases.
if TYPE_CHECKING:
    import numpy as np
    from rare_failures import Case, Limit


class Counted:
    """A limit state that counts its calls."""

    def __init__(self, limit: Limit) -> None:
        self.limit, self.calls = limit, 0

    def __call__(self, points: object) -> np.ndarray:
        import numpy as np

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
    import numpy as np
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


def show(case: Case, truth: float, method: str, calls: list[float], found: list[Estimate]) -> None:
    errors = [abs(p / truth - 1) for p, _, _ in found]
    held = [low <= truth <= high for _, low, high in found if not math.isnan(low)]
    # Half of less would not be told from the scatter of a good method.
    missed = None if (case.second_share or 0) < SECOND else 1 - case.second_share / 2
    print(
        case.name,
        f"{truth:.4e}",
        method,
        len(found),
        round(statistics.median(calls)),
        f"{statistics.median(errors):.4f}",
        f"{sum(e > 0.5 for e in errors) / len(errors):.3f}",
        f"{statistics.fmean(p for p, _, _ in found) / truth:.4f}",
        f"{sum(held) / len(held):.3f}" if held else "",
        "" if missed is None else f"{sum(p < missed * truth for p, _, _ in found) / len(found):.3f}",
        sep=",",
        flush=True,
    )


def others(case: Case, repeats: int, calls: int) -> None:
    for library in (openturns, uqpy):
        runs: dict[str, tuple[list[float], list[Estimate]]] = defaultdict(lambda: ([], []))
        levels: dict[str, int] = {}
        try:
            for seed in range(repeats + 1):
                counted = Counted(case.limit)
                for method, run in library(counted, case.dimensions, seed):
                    counted.calls = 0
                    try:
                        estimate = run(levels.get(method, FIRST))
                    except Exception as error:  # what a library cannot do counts as no estimate
                        print(f"{case.name}: {method}: {error}", file=sys.stderr)
                        estimate = (0.0, math.nan, math.nan)
                    if method not in levels:
                        levels[method] = max(FIRST * calls // max(counted.calls, 1), 100)
                        continue
                    runs[method][0].append(counted.calls)
                    runs[method][1].append(estimate)
        except ImportError as error:
            print(f"SKIPPED: {error}", file=sys.stderr)
        for method, (made, estimates) in runs.items():
            show(case, case.probability, method, made, estimates)


def figure(by_case: dict[str, list[dict[str, str]]]) -> str:
    """Estimates over the truth on a logarithmic axis: a dot per seed, dark where the 95 % interval does not hold the truth."""
    rows = [case for case in by_case]
    left, width, height, line = 215, 540, 34 + 16 * len(rows), 16

    def x(ratio: float) -> float:
        return left + (width - left - 62) * (math.log(min(max(ratio, 0.5), 2.0)) / math.log(4) + 0.5)

    style = "font-family:sans-serif;font-size:10px;fill:#222"
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img" style="{style}">']
    parts.append("<title>Estimates of rare failures over their truths, a dot per seed</title>")
    parts.append('<rect width="100%" height="100%" fill="#fff"/>')
    for ratio in (0.5, 0.7, 1.0, 1.4, 2.0):
        dashes = "" if ratio == 1.0 else ' stroke-dasharray="2 3"'
        parts.append(f'<line x1="{x(ratio):.1f}" x2="{x(ratio):.1f}" y1="4" y2="{height - 28}" stroke="#999"{dashes}/>')
        parts.append(f'<text x="{x(ratio):.1f}" y="{height - 16}" text-anchor="middle">{ratio:g}</text>')
    parts.append(f'<text x="{x(1.0):.1f}" y="{height - 3}" text-anchor="middle">estimate over truth</text>')
    parts.append(f'<text x="{width - 4}" y="{height - 16}" text-anchor="end">held</text>')
    for at, name in enumerate(rows):
        y = 12 + line * at
        lines = by_case[name]
        truth = float(lines[0]["truth"])
        parts.append(f'<text x="4" y="{y + 3}">{name}, {truth:.0e}</text>')
        held = 0
        for row in lines:
            is_held = float(row["low"]) <= truth <= float(row["high"])
            held += is_held
            look = 'fill="#4477aa" fill-opacity="0.35"' if is_held else 'fill="#aa3311"'
            parts.append(f'<circle cx="{x(float(row["probability"]) / truth):.1f}" cy="{y}" r="2.2" {look}/>')
        parts.append(f'<text x="{width - 4}" y="{y + 3}" text-anchor="end">{held} of {len(lines)}</text>')
    return "\n".join([*parts, "</svg>", ""])


def table(by_case: dict[str, list[dict[str, str]]], crude: dict[str, dict[str, str]]) -> str:
    """The table of the book, in Markdown."""
    heads = "case,truth,crude,kernels; second,held,median error,half-width,lanes,seconds,misses second,doubtful".split(",")
    rows = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    with (Path(__file__).parent / "cases.csv").open(encoding="utf-8") as file:
        cases_of_file = {row["case"]: row for row in csv.DictReader(file)}
    for name, lines in by_case.items():
        case, counted = cases_of_file[name], crude.get(name)
        truth, error, second = float(case["truth"]), float(case["relative_error"]), float(case["second_share"] or 0)
        estimates = [float(line["probability"]) for line in lines]
        ends = [(float(line["low"]), float(line["high"])) for line in lines]
        has_enough = counted is not None and float(counted["draws"]) >= 1e7
        widths = [(high - low) / 2 / p for p, (low, high) in zip(estimates, ends, strict=True)]
        cells = [
            name,
            f"{truth:.2e}" + (f" ± {100 * error:.1f} %" if error else ""),
            f"{float(counted['probability']):.2e} ± {100 / float(counted['failures']) ** 0.5:.1f} %" if has_enough else "–",
            f"{case['failing_kernels']}; {100 * second:.0f} %" if case["failing_kernels"] else "–",
            f"{sum(low <= truth <= high for low, high in ends)} of {len(lines)}",
            f"{100 * statistics.median(abs(p / truth - 1) for p in estimates):.1f} %",
            f"{100 * statistics.fmean(widths):.0f} %",
            f"{statistics.median(int(line['runs']) for line in lines):,.0f}",
            f"{statistics.median(float(line['seconds']) for line in lines):.1f}",
            "–" if second < SECOND else str(sum(p < truth * (1 - second / 2) for p in estimates)),
            str(sum(line["verdict"] != "sound" for line in lines)),
        ]
        rows.append("| " + " | ".join(cells) + " |")
    return "\n".join(rows) + "\n"


def main(ours: Path, what: str, calls: int) -> None:
    by_case: dict[str, list[dict[str, str]]] = defaultdict(list)
    with ours.open(encoding="utf-8") as file:
        for line in csv.DictReader(file):
            by_case[line["case"]].append(line)
    if what.endswith((".svg", ".md")):
        counted: dict[str, dict[str, str]] = {}
        if (ours.parent / "crude.csv").is_file():
            with (ours.parent / "crude.csv").open(encoding="utf-8") as file:
                for line in csv.DictReader(file):
                    known = counted.get(line["case"])
                    if known is None or float(known["draws"]) < float(line["draws"]):
                        counted[line["case"]] = line
        text = figure(by_case) if what.endswith(".svg") else table(by_case, counted)
        Path(what).write_text(text, encoding="utf-8")
        return
    from rare_failures import cases

    repeats = int(what)
    print("case,truth,method,repeats,calls,median_error,off_by_half,mean_over_truth,coverage,misses_second", flush=True)
    for case in cases():
        lines = by_case.get(case.name, [])
        if not lines:
            continue
        # Over the truncated density; the others' are in the standard normal space.
        found = [(float(line["probability"]), float(line["low"]), float(line["high"])) for line in lines]
        show(case, float(lines[0]["truth"]), "lanesweep", [float(line["runs"]) for line in lines], found)
        if repeats > 0:
            others(case, repeats, calls)


# Fraction of the second kernel from which on it is asked whether a method misses it.
SECOND = 0.2
# Samples per level of the first run.
FIRST = 1000


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]) if len(sys.argv) > 3 else 20_000)
