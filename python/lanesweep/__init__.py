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
from typing import TYPE_CHECKING

# Mesa's layer that chooses devices reports a missing XDG_RUNTIME_DIR on stderr, and reorders the devices, whose order is ours.
_os.environ.setdefault("NODEVICE_SELECT", "1")

from . import _core as _core, drivers as drivers, options as options  # noqa: E402
from ._core import (
    BusyError as BusyError,
    DeviceError as DeviceError,
    Frame as Frame,
    InputError as InputError,
    InternalError as InternalError,
    LanesweepError as LanesweepError,
    MissingFile as MissingFile,
    RunStopped as RunStopped,
    SystemRefusal as SystemRefusal,
    UsageError as UsageError,
    VerificationError as VerificationError,
    __version__ as __version__,
    profile as profile,
)
from ._driver import Driver as Driver, Vehicle as Vehicle, View as View
from ._result import Figure as Figure, Result as Result
from ._simulate import LimitState as LimitState, simulate as simulate
from ._verbs import *  # noqa: F403

if not TYPE_CHECKING:
    # Python's own `map` stays what it is after `from lanesweep import *`.
    __all__ = [name for name in globals() if not name.startswith("_") and name not in ("TYPE_CHECKING", "annotations", "map")]
