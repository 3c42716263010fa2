"""Drivers written in Python."""

from __future__ import annotations

import abc
import hashlib
import inspect
import textwrap
import threading
import uuid
from typing import Any, ClassVar

import numpy.typing as npt

from . import _core
from ._core import View


class Driver(abc.ABC):
    """A driver of the ego vehicle, vectorised over lanes.

    Subclass it, implement `acceleration`, and give an instance wherever a driver model is expected: ``models=["FSM",
    MyDriver()]``. The engine steps the lanes; frame, criteria and order of a step are those of the built-in drivers. Lanes
    are in binary32 on the CPU.

    Attributes
    ----------
    name : str
        Name in tables, files and lane keys; by default that of the class.
    may_accelerate : bool
        Whether an acceleration may be positive. Lanes then run to a contact or to the profile's time cap. Otherwise they also
        end once no further event is possible, which is much faster.
    attention : str
        Built-in model whose attention rule applies: `Vehicle.attended` says when its driver may react to a vehicle. FSM
        attends always.
    """

    name: str = ""
    may_accelerate: ClassVar[bool] = True
    attention: ClassVar[str] = "FSM"

    def start(self, lanes: int, dt_s: float) -> Any:
        """Start a batch of lanes.

        Parameters
        ----------
        lanes : int
            Number of lanes of the batch.
        dt_s : float
            Time step, s.

        Returns
        -------
        Any
            The state of the drivers, which every call of `acceleration` of this batch gets; for instance arrays with one
            entry per lane, indexed by ``view.lane``.
        """
        return None

    @abc.abstractmethod
    def acceleration(self, view: View, state: Any) -> npt.ArrayLike:
        """Decide for all running lanes at one step.

        Parameters
        ----------
        view : View
            What the drivers see.
        state : Any
            What `start` returned.

        Returns
        -------
        array_like of float, shape (len(view),)
            Acceleration until the next step, m/s²; at most 100 in magnitude. The speed stops at 0.
        """


_registered: dict[int, tuple[Driver, str]] = {}
_lock = threading.Lock()


def _fingerprint(driver: Driver) -> str:
    """Distinguish drivers of one name: by the code of the class and the values of the instance."""
    try:
        code = textwrap.dedent(inspect.getsource(type(driver)))
        values = repr(sorted(vars(driver).items()))
        if " at 0x" in values or "..." in values:
            raise ValueError("the values have no text")
    except (OSError, TypeError, ValueError):
        # Never taken for another: a run with this driver is not resumed by another process.
        return uuid.uuid4().hex[:16]
    return hashlib.sha256(f"{code}\n{values}".encode()).hexdigest()[:16]


def register(driver: Driver) -> str:
    """Make a driver known to the engine and return its name."""
    name = driver.name or type(driver).__name__
    with _lock:
        fingerprint = _fingerprint(driver)
        known = _registered.get(id(driver))
        if known is None or known[0] is not driver or known[1] != fingerprint:
            _core.register(name, fingerprint, driver, bool(driver.may_accelerate), driver.attention)
            _registered[id(driver)] = (driver, fingerprint)
        elif len(_registered) > 1:
            # The last registration of a name counts.
            _core.register(name, fingerprint, driver, bool(driver.may_accelerate), driver.attention)
    return name


def names_of(models: Any) -> list[str]:
    """Names of models; drivers are registered."""
    if models is None:
        return []
    if isinstance(models, (str, Driver)):
        models = [models]
    return [register(model) if isinstance(model, Driver) else str(model) for model in models]
