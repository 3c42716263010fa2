"""Measures the Python module beside the command line and its peers: `python benches/python/measure.py WHAT`.

WHAT is one of: first (install to first figure; needs a wheel: first WHEEL), cases (a million cases), driver (Reg157 in NumPy on
the default study; drivers of all kinds), openturns, uqpy (subset simulation on one problem), ray (parts on two and four workers). Prints CSV.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import lanesweep
import numpy as np


def row(*cells: object) -> None:
    print(",".join(str(cell) for cell in cells), flush=True)


def program(*words: object) -> float:
    start = time.perf_counter()
    subprocess.run([sys.executable, "-m", "lanesweep", "-q", *map(str, words)], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


def first(wheel: str) -> None:
    code = "import lanesweep; lanesweep.study(synth_recordings=12, backend='cpu').figure('radar-cut-in').svg"
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        made = time.perf_counter()
        subprocess.run([f"{folder}/bin/pip", "install", "-q", wheel], check=True)
        installed = time.perf_counter()
        subprocess.run([f"{folder}/bin/python", "-c", code], check=True, cwd=folder)
        done = time.perf_counter()
        imports = []
        for _ in range(5):
            begin = time.perf_counter()
            subprocess.run([f"{folder}/bin/python", "-c", "import lanesweep"], check=True, cwd=folder)
            middle = time.perf_counter()
            subprocess.run([f"{folder}/bin/python", "-c", "pass"], check=True, cwd=folder)
            imports.append(middle - begin - (time.perf_counter() - middle))
    row("step", "seconds")
    row("environment", round(made - start, 2))
    row("install, with NumPy", round(installed - made, 2))
    row("first figure", round(done - installed, 2))
    row("import, median of 5", round(sorted(imports)[2], 3))
    row("wheel bytes", Path(wheel).stat().st_size)


def cases(count: int = 10**6) -> None:
    """A million concrete cut-ins: in memory, and as a Parquet table through the command line."""
    import pandas as pd

    rng = np.random.default_rng(1)
    table = pd.DataFrame({
        "category": "cut-in",
        "ego_speed_mps": rng.uniform(15, 40, count),
        "speed_mps": rng.uniform(10, 35, count),
        "gap": rng.uniform(2, 80, count),
        "lateral_speed": rng.uniform(0.3, 2.5, count),
        "duration": 8.0,
    })  # fmt: skip
    row("way", "cases", "seconds")
    for _ in range(3):
        start = time.perf_counter()
        frame = lanesweep.simulate(table, models="FSM", backend="cpu")
        row("simulate(DataFrame)", count, round(time.perf_counter() - start, 2))
        start = time.perf_counter()
        frame.to_polars()
        row("frame.to_polars()", count, round(time.perf_counter() - start, 4))
    part = table.iloc[: count // 40]  # with series, as scenarios have them
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cases.parquet"
        part.to_parquet(path)
        words = ["study", "--scenarios", path, "--thw=observed", "--models=FSM", "--backend=cpu", f"--out={folder}/out"]
        row("study --scenarios --rows", len(part), round(program(*words, f"--rows={folder}/lanes.parquet"), 2))


def driver() -> None:
    """Reg157 in NumPy on the default study: verdicts, and lane-steps per second."""
    from lanesweep.drivers import Reg157

    with tempfile.TemporaryDirectory() as folder:
        results, seconds = {}, {}
        for name, model in [("built-in", "Reg157"), ("NumPy", Reg157())]:
            start = time.perf_counter()
            result = lanesweep.study(models=[model], backend="cpu", out=f"{folder}/{name}", rows=f"{folder}/{name}.parquet")
            seconds[name] = time.perf_counter() - start
            results[name] = result
        import polars as pl

        ours, theirs = (pl.read_parquet(f"{folder}/{name}.parquet") for name in ("NumPy", "built-in"))
        same = [column for column in ours.columns if column not in ("model", "robust", "reaction_s")]
        differing = (ours.select(same).rows() != theirs.select(same).rows()) and sum(
            a != b for a, b in zip(ours.select(same).rows(), theirs.select(same).rows(), strict=True)
        )
        steps = int(((theirs["end_s"] / 0.04).round() + 1).sum())
    row("driver", "lanes", "lane-steps", "seconds of study with rows", "differing lanes")
    row("built-in", len(theirs), steps, round(seconds["built-in"], 2), 0)
    row("NumPy", len(ours), steps, round(seconds["NumPy"], 2), int(differing))

    # The steps alone.
    count = 200_000
    rng = np.random.default_rng(1)
    table = {
        "ego_speed_mps": rng.uniform(15, 40, count),
        "speed_mps": rng.uniform(10, 35, count),
        "gap": rng.uniform(2, 80, count),
        "lateral_speed": rng.uniform(0.3, 2.5, count),
    }
    sys.path.insert(0, str(Path(__file__).parents[2] / "python" / "examples"))
    from compiled_driver import FastIDM, policy
    from lanesweep.drivers import IDM

    in_numpy = policy()
    in_numpy.compiled = None
    drivers = {
        "built-in FSM": "FSM", "built-in Reg157": "Reg157", "Reg157 in NumPy": Reg157(), "IDM in NumPy": IDM(), "IDM compiled": FastIDM(),
        "network in NumPy": in_numpy, "network compiled": policy(),
    }  # fmt: skip
    row("driver", "lanes", "lane-steps", "CPU seconds", "million lane-steps per CPU second")
    few = {name: values[:1000] for name, values in table.items()}
    for name, model in drivers.items():
        lanesweep.simulate(few, category="cut-in", models=[model], backend="cpu")
        start = time.process_time()
        frame = lanesweep.simulate(table, category="cut-in", models=[model], backend="cpu")
        elapsed = time.process_time() - start
        steps = int(np.round(frame["end_s"] / 0.04 + 1).sum())
        row(name, count, steps, round(elapsed, 2), round(steps / elapsed / 1e6, 2))
    loop = idm_loop()
    columns = [values for values in table.values()]
    loop(*(values[:10] for values in columns))
    start = time.process_time()
    steps = loop(*columns)[0]
    elapsed = time.process_time() - start
    row("IDM in a loop by numba", count, steps, round(elapsed, 2), round(steps / elapsed / 1e6, 2))


def idm_loop() -> Any:
    """The IDM in cut-ins without an engine: lane after lane, with smallest gap and TTC."""
    import numba

    @numba.njit(error_model="numpy")
    def loop(v0s, us, gaps, ws):  # type: ignore[no-untyped-def]
        steps, collisions, nearest, soonest = 0, 0, np.empty(len(us)), np.empty(len(us))
        slowing = 0.5 / np.sqrt(1.0 * 2.0)
        for k in range(len(us)):
            v, u, gap, y, w, v0 = v0s[k], us[k], gaps[k], 3.5, ws[k], v0s[k]
            nearest[k], soonest[k] = np.inf, np.inf
            for _ in range(3000):
                steps += 1
                ahead, beside = gap > -4.3, y >= 1.9
                if not beside and ahead:
                    nearest[k] = min(nearest[k], gap)
                    if v > u:
                        soonest[k] = min(soonest[k], gap / (v - u))
                if not beside and abs(gap + 2.15) < 2.15:
                    collisions += 1
                    break
                free = 1 - (v / max(v0, 0.1)) ** 4
                interaction = 0.0
                if ahead and not beside:
                    interaction = ((2.0 + max(0.0, v * 1.5 + v * (v - u) * slowing)) / max(gap, 0.1)) ** 2
                v = max(v + min(max(free - interaction, -8.0), 1.0) * 0.04, 0.0)
                gap += (u - v) * 0.04
                y = max(y - w * 0.04, 0.0)
        return steps, collisions, nearest, soonest

    return loop


def problem() -> tuple[lanesweep.LimitState, Path, tempfile.TemporaryDirectory[str]]:
    keep = tempfile.TemporaryDirectory()
    lanesweep.fit(categories="cut-in", parameterizations=2, out=keep.name)
    path = Path(keep.name) / "cut-in-2.json"
    return lanesweep.LimitState(path, model="FSM", criterion="collision", thw=1.2), path, keep


def ours(path: Path) -> None:
    row("method", "seed", "estimate", "low", "high", "lanes", "seconds")
    truth = lanesweep.sample(path, models="FSM", criterion="collision", thw=1.2, samples=2 * 10**6, backend="cpu")
    one = truth.table("estimates").to_polars().row(0, named=True)
    row("lanesweep crude, the truth", "", one["probability"], one["draws_low"], one["draws_high"], one["runs"], "")
    for seed in range(3):
        start = time.perf_counter()
        found = lanesweep.sample(path, models="FSM", criterion="collision", thw=1.2, estimator="is", seed=seed, backend="cpu")
        one = found.table("estimates").to_polars().row(0, named=True)
        seconds = round(time.perf_counter() - start, 2)
        row("lanesweep importance sampling", seed, one["probability"], one["draws_low"], one["draws_high"], one["runs"], seconds)


class StandardNormal:
    """The problem in independent standard normal numbers, as other libraries need it; estimates are divided by `share`."""

    def __init__(self, limit_state: lanesweep.LimitState) -> None:
        self.limit_state, self.dimensions, self.share = limit_state, len(limit_state.parameters), limit_state.valid_share
        self.calls = 0

    def __call__(self, u: object) -> np.ndarray:
        points = self.limit_state.from_standard_normal(np.atleast_2d(np.asarray(u, dtype=float)))
        self.calls += len(points)
        # The value of an invalid point is infinite; OpenTURNS averages values.
        return np.minimum(self.limit_state(points), 1e3)


def openturns() -> None:
    import openturns as ot

    limit_state, path, _keep = problem()
    ours(path)
    g = StandardNormal(limit_state)
    function = ot.PythonFunction(g.dimensions, 1, func_sample=lambda sample: g(sample)[:, np.newaxis])
    event = ot.ThresholdEvent(
        ot.CompositeRandomVector(function, ot.RandomVector(ot.Normal(g.dimensions))), ot.LessOrEqual(), 0.0
    )
    for seed in range(3):
        ot.RandomGenerator.SetSeed(seed)
        g.calls = 0
        start = time.perf_counter()
        algorithm = ot.SubsetSampling(event)
        algorithm.setMaximumOuterSampling(40)
        algorithm.setBlockSize(100)
        algorithm.run()
        result = algorithm.getResult()
        half = result.getConfidenceLength(0.95) / 2
        p = result.getProbabilityEstimate()
        seconds = round(time.perf_counter() - start, 2)
        row("OpenTURNS SubsetSampling", seed, p / g.share, (p - half) / g.share, (p + half) / g.share, g.calls, seconds)


UQPY: StandardNormal


def uqpy() -> None:
    """UQpy 4.2 needs NumPy 1: run it in an environment of its own."""
    global UQPY
    from UQpy.distributions import JointIndependent, Normal
    from UQpy.reliability import SubsetSimulation
    from UQpy.run_model import PythonModel, RunModel
    from UQpy.sampling import ModifiedMetropolisHastings

    limit_state, _, _keep = problem()
    UQPY = StandardNormal(limit_state)
    row("method", "seed", "estimate", "low", "high", "lanes", "seconds")
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "limit.py").write_text("import __main__\n\ndef g(u):\n    return float(__main__.UQPY(u)[0])\n")
        os.chdir(folder)
        sys.path.insert(0, folder)
        for seed in range(3):
            UQPY.calls = 0
            start = time.perf_counter()
            d = UQPY.dimensions
            target = JointIndependent([Normal() for _ in range(d)])
            first = np.random.default_rng(seed).standard_normal((2000, d))
            chains = ModifiedMetropolisHastings(dimension=d, log_pdf_target=target.log_pdf, n_chains=200, random_state=seed)
            model = RunModel(model=PythonModel(model_script="limit.py", model_object_name="g"))
            found = SubsetSimulation(model, chains, samples_init=first, nsamples_per_subset=2000, max_level=10)
            p, cov = found.failure_probability / UQPY.share, found.independent_chains_CoV
            seconds = round(time.perf_counter() - start, 2)
            row("UQpy SubsetSimulation", seed, p, p * (1 - 1.96 * cov), p * (1 + 1.96 * cov), UQPY.calls, seconds)
        os.chdir("/")


def ray() -> None:
    import ray as cluster
    from lanesweep import ray as on_ray

    _, path, _keep = problem()
    row("workers", "samples", "seconds")
    samples = 4 * 10**6
    start = time.perf_counter()
    whole = lanesweep.sample(path, models="FSM", criterion="collision", thw=1.2, samples=samples, threads=1, backend="cpu")
    row("none, one thread", samples, round(time.perf_counter() - start, 2))
    for workers in (1, 2, 4):
        cluster.init(num_cpus=workers, include_dashboard=False, _node_ip_address="127.0.0.1", log_to_driver=False)
        on_ray.sample(path, models="FSM", thw=1.2, samples=1000, shards=workers)  # starts the workers
        start = time.perf_counter()
        joined = on_ray.sample(path, models="FSM", criterion="collision", thw=1.2, samples=samples, shards=8)
        row(workers, samples, round(time.perf_counter() - start, 2))
        same = (Path(joined) / "estimates.csv").read_bytes() == (Path(whole) / "estimates.csv").read_bytes()
        assert same, "other bytes"
        cluster.shutdown()


if __name__ == "__main__":
    what, *arguments = sys.argv[1:]
    {"first": first, "cases": cases, "driver": driver, "openturns": openturns, "uqpy": uqpy, "ray": ray}[what](*arguments)
