"""Runs on a Ray cluster: a task per part. Needs the package `ray`; call ``ray.init`` first."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from typing import Any

import numpy as np
import numpy.typing as npt
import ray

from . import _verbs, parts
from ._result import Result
from ._simulate import LimitState

__all__ = ["limit_state", "run", "sample", "study"]

_LOG = logging.getLogger("lanesweep")


def run(
    plan: parts.Plan,
    *,
    out: str | os.PathLike[str] | None = None,
    backend: str = "cpu",
    num_cpus: int = 1,
    max_retries: int = 3,
    **options: Any,
) -> Result:
    """Run a plan on the cluster, a task per part.

    A task whose worker or node is lost runs again elsewhere, at most `max_retries` times; the result has the bytes of the
    undisturbed run. An exception of a task ends the run.

    Parameters
    ----------
    plan : Plan
        From `lanesweep.parts.plan`.
    out : path, optional
        Folder of the result; without it the files go with the result.
    backend : str
        ``"cpu"``; or ``"gpu"`` with ``num_gpus=1`` for the tasks.
    num_cpus : int
        Cores, and threads, of a task.
    max_retries : int
        Retries after the loss of a worker.
    **options
        Further options of `ray.remote`, such as `num_gpus` or `scheduling_strategy`.

    Returns
    -------
    Result
    """
    free: Callable[[], dict[str, float]] = ray.available_resources
    if free().get("CPU", 0) < num_cpus:
        _LOG.warning(
            "fewer than %s cores of the cluster are free: parts wait for them (a limit_state keeps its cores until it is closed)", num_cpus
        )
    task: Any = ray.remote(num_cpus=num_cpus, max_retries=max_retries, **options)(parts.run)
    shared = ray.put(plan)
    pending = [task.remote(shared, shard, backend=backend, threads=max(1, int(num_cpus))) for shard in range(plan.shards)]

    def finished() -> Iterator[parts.Part]:
        left = pending
        while left:
            done, left = ray.wait(left)
            yield from ray.get(done)

    try:
        return parts.join(plan, finished(), out=out)
    except BaseException:
        for reference in pending:
            ray.cancel(reference, force=True)
        raise


def _planned(function: Callable[..., Result]) -> Callable[..., Result]:
    def planned(*args: Any, shards: int = 8, out: Any = None, cluster: dict[str, Any] | None = None, **arguments: Any) -> Result:
        if not isinstance(cluster, (Mapping, type(None))):
            raise TypeError(f"`cluster` is {cluster!r:.80}; give options of `run`, such as {{'num_cpus': 2}}")
        plan = parts.plan(function, *args, shards=shards, **arguments)
        return run(plan, out=out, **(cluster or {}))

    planned.__doc__ = f"""Plan `lanesweep.{function.__name__}` here and run its parts on the cluster.

    Takes the arguments of `lanesweep.{function.__name__}`, and:

    Parameters
    ----------
    shards : int
        Number of parts.
    out : path, optional
        Folder of the result.
    cluster : dict, optional
        Options of `run`: `backend`, `num_cpus`, `max_retries`, those of `ray.remote`.
    """
    planned.__name__ = function.__name__
    return planned


sample = _planned(_verbs.sample)
study = _planned(_verbs.study)


class _Evaluator:
    """A limit state in a worker: opened once, called per batch."""

    def __init__(self, arguments: tuple[Any, ...], options: dict[str, Any]) -> None:
        self.limit_state = LimitState(*arguments, **options)

    def values(self, points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return self.limit_state(points)


class limit_state(AbstractContextManager["limit_state"]):
    """A `LimitState` in several workers: every call is one batch of tasks, so that an adaptive estimator makes one
    batch per round. A lost worker is started again. The workers keep their cores until `close`, or the end of a ``with`` block.

    Parameters
    ----------
    *arguments, **options
        Those of `LimitState`; the density file must be readable in the workers.
    workers : int
        Number of workers.
    num_cpus : int
        Cores of a worker.
    """

    def __init__(self, *arguments: Any, workers: int = 2, num_cpus: int = 1, **options: Any) -> None:
        actor: Any = ray.remote(num_cpus=num_cpus, max_restarts=-1, max_task_retries=3)(_Evaluator)
        self._actors = [actor.remote(arguments, options) for _ in range(workers)]

    def __call__(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return the n values of an array of shape (n, d)."""
        if not self._actors:
            raise ValueError("the limit state is closed")
        batches = np.array_split(np.ascontiguousarray(points, dtype=np.float64), len(self._actors))
        pairs = zip(self._actors, batches, strict=True)
        return np.concatenate(ray.get([actor.values.remote(batch) for actor, batch in pairs if len(batch)]))

    def close(self) -> None:
        """End the workers and free their cores."""
        actors, self._actors = self._actors, []
        for actor in actors:
            ray.kill(actor)

    def __exit__(self, *error: object) -> None:
        self.close()
