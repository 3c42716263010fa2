"""lanesweep: scenario-based assessment of automated driving systems.

Recordings or tables of cases become lanes: a scenario, a parameterization, a headway and a driver model each. Speeds are in
m/s, lengths in m, times in s, accelerations in m/s².

>>> import lanesweep
>>> result = lanesweep.study(synth_recordings=2)  # without data: on generated recordings
>>> result.table("results").columns[:3]
['category', 'variant', 'model']
"""

from __future__ import annotations

import os as _os

# Mesa's layer that chooses devices reports a missing XDG_RUNTIME_DIR on stderr, and reorders the devices, whose order is ours.
_os.environ.setdefault("NODEVICE_SELECT", "1")

from . import _core, drivers, options  # noqa: E402
from ._core import (
    BusyError,
    DeviceError,
    Frame,
    InputError,
    InternalError,
    LanesweepError,
    MissingFile,
    RunStopped,
    SystemRefusal,
    UsageError,
    VerificationError,
    __version__,
    profile,
)
from ._driver import Driver, Vehicle, View
from ._result import Figure, Result
from ._simulate import LimitState, simulate
from ._verbs import *  # noqa: F403
from ._verbs import __all__ as _functions

__all__ = [
    "BusyError",
    "DeviceError",
    "Driver",
    "Figure",
    "Frame",
    "InputError",
    "InternalError",
    "LanesweepError",
    "LimitState",
    "MissingFile",
    "Result",
    "RunStopped",
    "SystemRefusal",
    "UsageError",
    "Vehicle",
    "VerificationError",
    "View",
    "__version__",
    "drivers",
    "options",
    "profile",
    "simulate",
    # Python's own `map` stays what it is after `from lanesweep import *`.
    *(name for name in _functions if name != "map"),
]
