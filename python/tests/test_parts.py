"""Runs in parts."""

from __future__ import annotations

from pathlib import Path

import lanesweep
import numpy as np
import pytest
from lanesweep import parts

FILES = ["estimates.csv", "tables/convergence.csv"]


def contents(result: lanesweep.Result, names: list[str]) -> dict[str, bytes]:
    return {name: (Path(result) / name).read_bytes() for name in names}


def test_parts_in_any_order_have_the_bytes_of_the_whole(density, scenarios) -> None:
    whole = lanesweep.sample(density, samples=2000, thw=1.2, backend="cpu")
    plan = parts.plan(lanesweep.sample, density, samples=2000, thw=1.2, shards=3)
    joined = parts.join(plan, [parts.run(plan, shard) for shard in (2, 0, 1)])
    assert contents(joined, FILES) == contents(whole, FILES)
    whole = lanesweep.study(scenarios=scenarios, models=["FSM", lanesweep.drivers.IDM()], thw=1.2)
    plan = parts.plan(lanesweep.study, scenarios=scenarios, models=["FSM", lanesweep.drivers.IDM()], thw=1.2, shards=2)
    joined = parts.join(plan, [parts.run(plan, 1), parts.run(plan, 0)])
    assert contents(joined, ["results.csv"]) == contents(whole, ["results.csv"])


class OfAnArray(lanesweep.Driver):
    """A driver whose values have no short text."""

    may_accelerate = False

    def __init__(self) -> None:
        self.values = np.arange(2000.0)
        self.lock = None

    def acceleration(self, view, state):
        return np.full(len(view), -self.values[3])


def test_parts_with_a_driver_run_in_other_processes(density) -> None:
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    driver = OfAnArray()
    plan = parts.plan(lanesweep.sample, density, samples=600, thw=1.2, shards=2, models=[driver])
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        done = list(pool.map(parts.run, [plan, plan], range(2)))
    whole = lanesweep.sample(density, samples=600, thw=1.2, models=[driver])
    assert contents(parts.join(plan, done), FILES) == contents(whole, FILES)


def test_a_run_is_not_resumed_with_another_driver_of_its_name(density, tmp_path) -> None:
    def made(value: float) -> lanesweep.Driver:
        class Constant(lanesweep.Driver):
            may_accelerate = False

            def acceleration(self, view, state):
                return np.full(len(view), value)

        return Constant()

    options = {"samples": 300_000, "thw": 1.2}
    with pytest.raises(lanesweep.RunStopped):
        lanesweep.sample(density, **options, models=[made(-1.0)], config={"run": {"stop_after_s": 0.3}}, out=tmp_path / "out")
    ours = lanesweep.sample(density, **{**options, "samples": 20_000}, models=[made(-8.0)], out=tmp_path / "out")
    fresh = lanesweep.sample(density, **{**options, "samples": 20_000}, models=[made(-8.0)])
    assert contents(ours, ["estimates.csv"]) == contents(fresh, ["estimates.csv"])
    with pytest.raises(lanesweep.UsageError, match="two drivers are called Constant"):
        lanesweep.sample(density, samples=10, thw=1.2, models=[made(-1.0), made(-2.0)])


def test_missing_parts_and_verbs_that_cannot_be_split_are_errors(density) -> None:
    plan = parts.plan(lanesweep.sample, density, samples=2000, thw=1.2, shards=3)
    with pytest.raises(lanesweep.InputError, match="missing"):
        parts.join(plan, [parts.run(plan, 0)])
    with pytest.raises(lanesweep.InputError, match="twice"):
        parts.join(plan, [parts.run(plan, 0)] * 2)
    with pytest.raises(ValueError, match="cannot be split"):
        parts.plan(lanesweep.check)
    with pytest.raises(lanesweep.UsageError):
        parts.run(plan, 3)


def test_a_missing_part_is_named_and_wrong_arguments_are_refused(density) -> None:
    plan = parts.plan(lanesweep.sample, density, samples=600, thw=1.2, shards=3)
    with pytest.raises(lanesweep.InputError, match=r"1 of 3 parts are missing: 1\n  help: run\(plan, 1\)"):
        parts.join(plan, [parts.run(plan, 0), parts.run(plan, 2)])
    with pytest.raises(TypeError, match="lanesweep.sample itself"):
        parts.plan("sample", density)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="whole number"):
        parts.plan(lanesweep.sample, density, shards=2.0)  # type: ignore[arg-type]
