"""Runs in parts, for any executor: plan once, run the parts anywhere, join them. Tables, figures and estimates have the bytes of
the whole run; only what the record says of the host (seconds, backend) and of settings differs.

    plan = parts.plan(lanesweep.sample, "cut-in-2.json", samples=10**8, thw=1.2)
    done = [parts.run(plan, shard) for shard in range(plan.shards)]  # joblib, Dask, Ray, …
    result = parts.join(plan, done)
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ._core import InputError
from ._driver import Driver, models_of, register
from ._result import Result, temporary
from ._run import run as verb
from ._verbs import merge

__all__ = ["Plan", "join", "plan", "run"]

#: A part: names and contents of its files.
Part = dict[str, bytes]


@dataclass(frozen=True)
class Plan:
    """A run that is made once, and the number of its parts; it can be pickled.

    Attributes
    ----------
    verb : str
        ``"study"`` or ``"sample"``.
    content : bytes
        The plan file.
    shards : int
        Number of parts.
    drivers : tuple of (Driver, str)
        Drivers in Python that the plan names, and how.
    """

    verb: str
    content: bytes = field(repr=False)
    shards: int
    drivers: tuple[tuple[Driver, str], ...] = ()

    def _register(self) -> None:
        for driver, known_as in self.drivers:
            register(driver, known_as)


def plan(function: Callable[..., Result], *args: Any, shards: int = 8, **arguments: Any) -> Plan:
    """Plan a run of `lanesweep.study` or `lanesweep.sample`, with its arguments.

    Parameters
    ----------
    function : callable
        `lanesweep.study` or `lanesweep.sample`.
    shards : int
        Number of parts, of equal size.

    Returns
    -------
    Plan
    """
    if not callable(function):
        raise TypeError(f"`function` is {function!r:.80}; give lanesweep.study or lanesweep.sample itself")
    if function.__name__ not in ("study", "sample"):
        raise ValueError(f"{function.__name__} cannot be split; study and sample can")
    if not isinstance(shards, int) or shards < 1:
        raise TypeError(f"`shards` is {shards!r:.80}; give a whole number of at least 1")
    given = inspect.signature(function).bind(*args, **arguments).arguments
    # What can be iterated over once only is kept.
    models = models_of(given.get("models"))
    drivers = tuple((model, register(model)) for model in models if isinstance(model, Driver))
    with temporary() as folder:
        verb(function.__name__, {**given, "models": models or None, "plan_only": True, "out": folder})
        content = (Path(folder) / "plan.json").read_bytes()
    return Plan(function.__name__, content, shards, drivers)


def run(plan: Plan, shard: int, *, backend: str = "cpu", threads: int | None = None) -> Part:
    """Run a part of a plan, counted from 0.

    Returns
    -------
    dict of str to bytes
        The files of the part.
    """
    plan._register()
    with temporary() as folder:
        path = Path(folder) / "plan.json"
        path.write_bytes(plan.content)
        part = {"plan": path, "shard": f"{shard}/{plan.shards}", "out": folder, "backend": backend, "threads": threads}
        verb(plan.verb, part)
        return {part.name: part.read_bytes() for part in Path(folder).glob("part-*")}


def join(plan: Plan, parts: Iterable[Part], *, out: str | os.PathLike[str] | None = None) -> Result:
    """Join the parts of a run; missing, double and foreign parts are errors.

    Parameters
    ----------
    parts : iterable of dict
        What `run` returned, in any order.
    out : path, optional
        Folder of the result; without it the files go with the result.

    Returns
    -------
    Result
    """
    plan._register()
    keep = temporary() if out is None else None
    folder = Path(keep.name) / "run" if keep is not None else Path(out or "")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "plan.json").write_bytes(plan.content)
    names = {"plan.json"}
    for name, content in (file for part in parts for file in part.items()):
        if Path(name).name != name or not name.startswith("part-"):
            raise InputError(f"`{name}` is no file of a part")
        if name in names:
            raise InputError(f"{name} is there twice: give every part once")
        names.add(name)
        (folder / name).write_bytes(content)
    missing = [k for k in range(plan.shards) if not any(name.startswith(f"part-{k:05}-of-") for name in names)]
    if missing:
        raise InputError(f"{len(missing)} of {plan.shards} parts are missing: {str(missing)[1:-1]}\n  help: run(plan, {missing[0]}) makes one")
    result = merge(folder)
    for name in names:
        (folder / name).unlink(missing_ok=True)
    result._keep = keep
    return result
