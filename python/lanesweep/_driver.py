"""Drivers written in Python."""

from __future__ import annotations

import abc
import re
import threading
from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from . import _core
from ._core import View
from ._identity import Unreadable, digest


class Driver(abc.ABC):
    """A driver of the ego vehicle, vectorised over lanes.

    Subclass it, implement `acceleration`, and give an instance wherever a driver model is expected: ``models=["FSM",
    MyDriver()]``. The engine steps the lanes; frame, criteria and order of a step are those of the built-in drivers. Lanes
    are in binary32 on the CPU.

    A driver is its code, its present values and what the code reads: change a value, and it is another driver in the next run. What
    a run changes belongs into what `start` returns.

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


#: The driver that the engine last got for a name and fingerprint.
_registered: dict[str, Driver] = {}
#: The last driver of each name, which stands for it where the name alone is given.
_named: dict[str, Driver] = {}
_lock = threading.Lock()


def fingerprint(driver: Driver) -> str:
    """Distinguish drivers of one name: by their code, their present values, and what the code reads."""
    try:
        return digest(driver, driver.name, driver.may_accelerate, driver.attention)
    except Unreadable as error:
        raise _core.UsageError(
            f"driver {name_of(driver)}: {error}\n  help: a driver is known by its code and its values: make this in `start`, "
            "or define `__getstate__`, which returns the values that the driver computes with"
        ) from error


def name_of(driver: Driver) -> str:
    return driver.name or type(driver).__name__


def register(driver: Driver, known_as: str | None = None) -> str:
    """Make a driver known to the engine as it is now; return its name and fingerprint, which must be `known_as` if given."""
    name, attention = name_of(driver), driver.attention
    if not isinstance(name, str) or not isinstance(attention, str):
        raise TypeError(f"driver {type(driver).__name__}: `name` and `attention` are texts, not {name!r} and {attention!r}")
    if not isinstance(driver.may_accelerate, (bool, np.bool_)):
        raise TypeError(f"driver {name}: `may_accelerate` is True or False, not {driver.may_accelerate!r}")
    identity = f"{name}@{fingerprint(driver)}"
    if known_as not in (None, identity):
        raise _core.InputError(
            f"driver {name} is not the one that was planned: its code, its values or what they read differ here\n  help: "
            "plan again; what a run changes belongs into what `start` returns"
        )
    with _lock:
        # Another object with these values is another driver: it may change later.
        if _registered.get(identity) is not driver:
            _core.register(name, identity.rpartition("@")[2], driver, bool(driver.may_accelerate), attention)
            _registered[identity] = driver
        _named[name.casefold()] = driver
    return identity


def refresh(words: Iterable[str]) -> None:
    """Make the drivers that words name by their names alone known as they are now."""
    names = set(re.split(r"[^\w.@-]+", ",".join(words).casefold()))
    for driver in [driver for name, driver in list(_named.items()) if name in names]:
        register(driver)


def models_of(models: Any) -> list[str | Driver]:
    """What an argument `models` names; empty for None, which means all."""
    if models is None:
        return []
    if isinstance(models, (str, Driver)):
        models = [models]
    wants = "give a name, a Driver, or a list of these"
    if isinstance(models, (type, bytes)) or not isinstance(models, Iterable):
        raise TypeError(f"`models` is {_shown(models)}; {wants}")
    found: list[str | Driver] = list(models)
    if not found:
        raise ValueError("`models` is empty; name at least one, or leave it out for all")
    for model in found:
        if not isinstance(model, (str, Driver)):
            raise TypeError(f"`models` holds {_shown(model)}; {wants}")
    return found


def names_of(models: Any) -> list[str]:
    """Names of models as the engine knows them; drivers are registered."""
    found = models_of(models)
    refresh(model for model in found if isinstance(model, str))
    names = [register(model) if isinstance(model, Driver) else model for model in found]
    shown = [name.partition("@")[0] for name in names]
    for at, name in enumerate(shown):
        if name in shown[:at] and names[at] not in names[:at]:
            raise _core.UsageError(f"two drivers are called {name}: give one of them another `name`")
    return names


def _shown(value: Any) -> str:
    """What stands in place of a model."""
    if isinstance(value, type) and issubclass(value, Driver):
        return f"the class {value.__name__}, not a driver of it: {value.__name__}(…)"
    return f"{value!r}"[:80]
