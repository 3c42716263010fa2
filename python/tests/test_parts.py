"""Runs in parts, alone and on Ray."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import lanesweep
import numpy as np
import pytest
from lanesweep import parts

FILES = ["estimates.csv", "worst.csv", "convergence.csv", "convergence.svg"]


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
    assert contents(joined, ["f1.csv", "failures.csv"]) == contents(whole, ["f1.csv", "failures.csv"])


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
        lanesweep.sample(density, **options, models=[made(-1.0)], stop_after=0.3, out=tmp_path / "out")
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


@pytest.fixture(scope="module")
def cluster():
    ray = pytest.importorskip("ray")
    ray.init(num_cpus=2, include_dashboard=False, _node_ip_address="127.0.0.1", log_to_driver=False)
    yield ray
    ray.shutdown()


def test_a_run_on_ray_whose_worker_is_killed_has_the_bytes_of_the_whole(cluster, density) -> None:
    from lanesweep import ray as on_ray

    options = {"samples": 400_000, "thw": 1.2, "models": "FSM"}
    whole = lanesweep.sample(density, **options, backend="cpu")
    killed: list[int] = []

    def kill() -> None:
        """Ends a worker that runs a part."""
        for _ in range(200):
            for path in Path("/proc").glob("[0-9]*/cmdline"):
                try:
                    name = path.read_bytes()
                except OSError:
                    continue
                if name.startswith(b"ray::run"):
                    killed.append(int(path.parent.name))
                    os.kill(killed[0], signal.SIGKILL)
                    return
            time.sleep(0.02)

    import threading

    thread = threading.Thread(target=kill)
    thread.start()
    result = on_ray.sample(density, **options, shards=8)
    thread.join()
    assert killed or not Path("/proc").is_dir()
    assert contents(result, FILES) == contents(whole, FILES)


def test_a_limit_state_on_ray_is_the_limit_state(cluster, density) -> None:
    from lanesweep import ray as on_ray

    here = lanesweep.LimitState(density, model="FSM", criterion="ttc", thw=0.6)
    there = on_ray.limit_state(str(density), model="FSM", criterion="ttc", thw=0.6, workers=2)
    points = here.draw(301)
    assert (there(points) == here(points)).all()


def test_an_exception_of_a_task_reaches_the_caller(cluster, density) -> None:
    from lanesweep import ray as on_ray

    plan = parts.plan(lanesweep.sample, density, samples=200, thw=1.2, shards=2)
    broken = parts.Plan(plan.verb, plan.content[:-50], plan.shards)
    with pytest.raises(Exception, match="plan"):
        on_ray.run(broken)
