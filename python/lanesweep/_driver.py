"""Drivers of one's own: in Python, or compiled."""

from __future__ import annotations

import ctypes
import functools
import re
import threading
import types
from _ctypes import CFuncPtr
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._identity import Unreadable, digest

#: The signature of a compiled driver, as `numba.cfunc` takes it; see `Driver.compiled`.
SIGNATURE = f"void(int64, int64, int64, float64, {', '.join(['CPointer(float32)'] * 4)})"


class Vehicle:
    """Another vehicle as the drivers of all running lanes see it: an entry per lane.

    Attributes
    ----------
    present : ndarray of bool
        The vehicle is there for the ego; where it is not, the other entries have no meaning.
    attended : ndarray of bool
        It is there, and the attention rule lets the driver react to it.
    speed, gap, lateral_gap, lateral_speed, half_lengths : ndarray of float32
        m/s; m, bumper to bumper; m, negative where the vehicles overlap; m/s towards the ego; m.
    """

    def __init__(self, rows: npt.NDArray[np.float32]) -> None:
        present, attended, self.speed, self.gap, self.lateral_gap, self.lateral_speed, self.half_lengths = rows
        self.present: npt.NDArray[np.bool_] = present != 0
        self.attended: npt.NDArray[np.bool_] = attended != 0


class View:
    """All running lanes at one step: an entry per lane.

    Attributes
    ----------
    step : int
        Index of the step.
    time_s : float
        Time since the start, s.
    lane : ndarray of int64
        Position of each lane in its batch: the index of its entry in arrays of states. In no order.
    ego_speed, ego_acceleration : ndarray of float32
        m/s; m/s² over the last step, 0 at the start.
    other : Vehicle
        The principal vehicle: it cuts in, cuts out, or leads.
    ahead : Vehicle
        In a cut-out, the vehicle ahead of the one that cuts out; elsewhere it is not present.
    rows : ndarray of float32, shape (16, len(view))
        All of this: the rows that a compiled driver gets.
    """

    def __init__(self, step: int, time_s: float, lane: npt.NDArray[np.int64], rows: npt.NDArray[np.float32]) -> None:
        self.step, self.time_s, self.lane, self.rows = step, time_s, lane, rows
        self.ego_speed, self.ego_acceleration = rows[:2]

    @functools.cached_property
    def other(self) -> Vehicle:
        return Vehicle(self.rows[2:9])

    @functools.cached_property
    def ahead(self) -> Vehicle:
        return Vehicle(self.rows[9:])

    def __len__(self) -> int:
        return len(self.lane)


class Driver:
    """A driver of the ego vehicle, vectorised over lanes.

    Subclass it, implement `acceleration`, `compiled` or both, and give an instance wherever a driver model is expected:
    ``models=["FSM", MyDriver()]``. The engine steps the lanes; frame, criteria and order of a step are those of the
    built-in drivers. Lanes are in binary32 on the CPU.

    A driver is its code, its present values and what the code reads: change a value, and it is another driver in the next
    run. What a run changes belongs into what `start` returns.

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
    compiled : function or int, optional
        The driver as machine code, which is called in threads and without Python: a Python function, which numba compiles,
        a function of ctypes, or an address. In C::

            void compiled(int64_t lanes, int64_t stride, int64_t step, double dt_s,
                          const float *view, float *state, const float *parameters, float *acceleration);

        Row r of lane i is ``view[r * stride + i]``; `lanesweep.drivers` names the rows. `state` has `state_rows` such rows
        of the driver's own, 0 at the start. It writes `lanes` accelerations, m/s². Where `acceleration` is implemented too,
        both are compared once, over the first lanes; a difference of more than 0.001 in one lane of a hundred is an error.
        An address says nothing of its code: give such a driver a value that changes with it.
    parameters : array_like of float
        Numbers for `compiled`, in binary32.
    state_rows : int
        Rows of the state of `compiled`.

    Examples
    --------
    >>> class Coasting(lanesweep.Driver):
    ...     may_accelerate = False
    ...
    ...     def acceleration(self, view, state):
    ...         return np.where(view.other.attended, np.float32(-0.5), np.float32(0))
    >>> lanesweep.study(synth_recordings=1, models=["FSM", Coasting()], thw=1.2).status
    'ok'
    """

    name: str = ""
    may_accelerate: bool = True
    attention: str = "FSM"
    compiled: Any = None
    parameters: npt.ArrayLike = ()
    state_rows: int = 0

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
        raise NotImplementedError


def decided(driver: Driver, state: Any, step: int, time_s: float, lane: npt.NDArray[np.int64], rows: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Ask a driver; `rows` are one after the other, with a stride of their own."""
    count = len(lane)
    found = np.asarray(driver.acceleration(View(step, time_s, lane, rows.reshape(16, -1)[:, :count]), state), dtype=np.float32)
    if found.ndim > 1:
        shape = f"{found.ndim} dimensions and the shape {found.shape}"
        raise _core.UsageError(f"`acceleration` returned an array of {shape}; expected one number per lane: ({count},)")
    if found.ndim == 1 and len(found) != count:
        raise _core.UsageError(f"`acceleration` returned {len(found)} numbers for {count} lanes")
    return np.ascontiguousarray(np.broadcast_to(found, count))


_compiled: dict[str, Any] = {}


def _machine_code(driver: Driver) -> Any:
    """What `compiled` is: a function of Python (in the class, not bound), numba or ctypes, or an address."""
    return getattr(driver.compiled, "__func__", driver.compiled)


def _address(driver: Driver) -> int:
    found, of = _machine_code(driver), f"driver {name_of(driver)}: `compiled`"
    if isinstance(found, types.FunctionType):
        try:
            import numba
        except ImportError:
            help = "pip install numba, or give a C function"
            raise _core.UsageError(f"{of} is a function in Python, which numba compiles\n  help: {help}") from None
        key = digest(found)
        if key not in _compiled:
            try:
                _compiled[key] = numba.cfunc(SIGNATURE)(found)
            except Exception as error:
                raise _core.UsageError(f"{of} is not compiled by numba: {error}\n  help: its signature is {SIGNATURE}") from error
        found = _compiled[key]
    if isinstance(found, CFuncPtr):
        found = ctypes.cast(found, ctypes.c_void_p).value
    address = getattr(found, "address", found)
    if not isinstance(address, int) or isinstance(address, bool) or address <= 0:
        raise TypeError(f"{of} is {found!r:.80}; give a function of Python, numba or ctypes, or an address")
    return address


#: The driver that the engine last got for a name and fingerprint.
_registered: dict[str, Driver] = {}
#: The last driver of each name, which stands for it where the name alone is given.
_named: dict[str, Driver] = {}
_lock = threading.Lock()


def fingerprint(driver: Driver) -> str:
    """Distinguish drivers of one name: by their code, their present values, and what the code reads."""
    try:
        code = _machine_code(driver)
        # An address is another one in every process.
        code = None if isinstance(code, int) else getattr(code, "__wrapped__", code)
        return digest(driver, driver.name, driver.may_accelerate, driver.attention, code, driver.parameters, driver.state_rows)
    except Unreadable as error:
        raise _core.UsageError(
            f"driver {name_of(driver)}: {error}\n  help: a driver is known by its code and its values: make this in `start`, "
            "or define `__getstate__`, which returns the values that the driver computes with"
        ) from error


def name_of(driver: Driver) -> str:
    return driver.name or type(driver).__name__


def register(driver: Driver, known_as: str | None = None) -> str:
    """Make a driver known to the engine as it is now; return its name and fingerprint, which must be `known_as` if given."""
    name = name_of(driver)
    identity = f"{name}@{fingerprint(driver)}"
    if known_as not in (None, identity):
        raise _core.InputError(
            f"driver {name} is not the one that was planned: its code, its values or what they read differ here\n  help: "
            "plan again; what a run changes belongs into what `start` returns"
        )
    with _lock:
        # Another object with these values is another driver: it may change later.
        if _registered.get(identity) is not driver:
            compiled, in_python = None, type(driver).acceleration is not Driver.acceleration
            if driver.compiled is not None:
                numbers = np.asarray(driver.parameters, dtype=np.float32).ravel().tolist()
                compiled = _address(driver), numbers, int(driver.state_rows), in_python
            elif not in_python:
                raise TypeError(f"driver {name}: it has neither `acceleration` nor `compiled`")
            if not (isinstance(name, str) and isinstance(driver.attention, str) and isinstance(driver.may_accelerate, (bool, np.bool_))):
                raise TypeError(f"driver {name}: `name` and `attention` are texts, `may_accelerate` is True or False")
            _core.register(name, identity.rpartition("@")[2], driver, driver.may_accelerate, driver.attention, compiled)
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
    several: list[Any] = [models] if isinstance(models, (str, Driver, type, bytes)) or not isinstance(models, Iterable) else list(models)
    if not several:
        raise ValueError("`models` is empty; name at least one, or leave it out for all")
    for model in several:
        if not isinstance(model, (str, Driver)):
            is_class = isinstance(model, type) and issubclass(model, Driver)
            shown = f"the class {model.__name__}, not a driver of it: {model.__name__}(…)" if is_class else f"{model!r:.80}"
            verb = "is" if models is model else "holds"
            raise TypeError(f"`models` {verb} {shown}; give a name, a Driver, or a list of these")
    return several


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
