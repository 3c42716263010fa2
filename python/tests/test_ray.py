"""Runs in parts on Ray. Ray ends a process whose cluster breaks, without a word, so `.ci/python` gives this file its own."""

from __future__ import annotations

import os
import signal
import threading
import time
from pathlib import Path

import lanesweep
import pytest
from lanesweep import parts

ray = pytest.importorskip("ray")
from lanesweep import ray as on_ray  # noqa: E402
from test_parts import FILES, contents  # noqa: E402


@pytest.fixture(scope="module", autouse=True)
def cluster():
    # By default Ray reserves a third of the machine's memory.
    small = {"num_cpus": 2, "object_store_memory": 128 << 20}
    ray.init(**small, include_dashboard=False, _node_ip_address="127.0.0.1", log_to_driver=False)
    yield
    ray.shutdown()


def test_a_run_on_ray_whose_worker_is_killed_has_the_bytes_of_the_whole(density) -> None:
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

    thread = threading.Thread(target=kill)
    thread.start()
    result = on_ray.sample(density, **options, shards=8)
    thread.join()
    assert killed or not Path("/proc").is_dir()
    assert contents(result, FILES) == contents(whole, FILES)


def test_a_limit_state_on_ray_is_the_limit_state(density, caplog) -> None:
    here = lanesweep.LimitState(density, model="FSM", criterion="ttc", thw=0.6)
    there = on_ray.limit_state(str(density), model="FSM", criterion="ttc", thw=0.6, workers=2)
    points = here.draw(301)
    assert (there(points) == here(points)).all()
    # Its workers hold both cores: a run says why it waits.
    threading.Timer(2, there.close).start()
    with caplog.at_level("WARNING", logger="lanesweep"):
        on_ray.sample(density, samples=200, thw=1.2, shards=2)
    assert "keeps its cores until it is closed" in caplog.text
    with pytest.raises(ValueError, match="closed"):
        there(points)
    with pytest.raises(TypeError, match="dictionary|options of `run`"):
        on_ray.sample(density, samples=200, thw=1.2, shards=2, cluster=4)


def test_an_exception_of_a_task_reaches_the_caller(density) -> None:
    plan = parts.plan(lanesweep.sample, density, samples=200, thw=1.2, shards=2)
    broken = parts.Plan(plan.verb, plan.content[:-50], plan.shards)
    with pytest.raises(Exception, match="plan"):
        on_ray.run(broken)
