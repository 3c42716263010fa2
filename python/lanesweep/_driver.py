"""Drivers written in Python."""

from __future__ import annotations

import abc
import hashlib
import inspect
import pickle
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


#: Drivers by what the engine knows them by: name and fingerprint.
_registered: dict[str, Driver] = {}
#: Fingerprints of drivers that have none of their own: never taken for another's.
_unknown: dict[int, tuple[Driver, str]] = {}
_lock = threading.Lock()


def fingerprint(driver: Driver) -> str:
    """Distinguish drivers of one name: by the code of their classes, and by their values."""
    digest = hashlib.sha256()
    try:
        for kind in type(driver).__mro__:
            if kind in (Driver, object) or kind.__module__ == "abc":
                continue
            digest.update(textwrap.dedent(inspect.getsource(kind)).encode())
            for name, value in sorted(vars(kind).items()):
                if name.startswith("__") or name in ("_abc_impl",):
                    continue
                function = getattr(value, "__func__", value)
                if inspect.isfunction(function):
                    cells = [name for name in function.__code__.co_freevars if name != "__class__"]
                    if cells or function.__defaults__ or function.__kwdefaults__:
                        # Its source does not say what it computes.
                        raise ValueError("a function holds values")
                else:
                    digest.update(pickle.dumps((name, value)))
        digest.update(pickle.dumps(sorted(vars(driver).items())))
    except Exception:
        # No source, or values that cannot be pickled: a run with this driver is not resumed by another process.
        with _lock:
            return _unknown.setdefault(id(driver), (driver, uuid.uuid4().hex[:16]))[1]
    return digest.hexdigest()[:16]


def register(driver: Driver, known_as: str | None = None) -> str:
    """Make a driver known to the engine; return its name and fingerprint, which is another process's if given."""
    name = driver.name or type(driver).__name__
    identity = known_as or f"{name}@{fingerprint(driver)}"
    with _lock:
        if identity not in _registered:
            _core.register(name, identity.rpartition("@")[2], driver, bool(driver.may_accelerate), driver.attention)
            _registered[identity] = driver
    return identity


def names_of(models: Any) -> list[str]:
    """Names of models as the engine knows them; drivers are registered."""
    if models is None:
        return []
    if isinstance(models, (str, Driver)):
        models = [models]
    names = [register(model) if isinstance(model, Driver) else str(model) for model in models]
    shown = [name.partition("@")[0] for name in names]
    for at, name in enumerate(shown):
        if name in shown[:at] and names[at] not in names[:at]:
            raise _core.UsageError(f"two drivers are called {name}: give one of them another `name`")
    return names
