"""Track formats as one table: a row per vehicle and time, in the columns that `lanesweep` reads.

    from lanesweep.tracks import sumo
    sumo("fcd.xml", "demo.rou.xml").write_parquet("fcd.parquet")  # then lanesweep.study("fcd.parquet"), or `lanesweep mine fcd.parquet`

The functions return a Polars data frame with those of these columns that the format has, in this order: ``vehicle_id`` (text),
``frame`` (whole), ``time_s``; ``x_m``, ``y_m`` in a plane (y to the left of x), or ``s_m``, ``d_m`` along the road and to the left of its
line, of the middle of the box; ``heading_deg`` (from +x towards y), ``speed_mps``, ``vx_mps``, ``vy_mps``, ``forward_speed_mps``,
``leftward_speed_mps``, ``acceleration_mps2`` (forward), ``ax_mps2``, ``ay_mps2``, ``length_m``, ``width_m``, ``class`` (of lorries, it
begins with ``truck``, ``bus`` or the like), ``lane`` (its name), ``direction`` (1 along the road, -1 against it). Several recordings in
one table need a column ``recording``. The log, ``lanesweep``, names what is left out.

Texts may be compressed with gzip (``.gz``). A missing file raises `FileNotFoundError`; one that cannot be used raises
`lanesweep.InputError`, a `ValueError`, that names file and element. They need the extra: ``pip install 'lanesweep[tracks]'``.
"""

from __future__ import annotations

import sys
from importlib.util import find_spec
from types import ModuleType
from typing import Any

from .. import _verbs
from .._result import Result

if find_spec("polars") is None:
    raise ImportError("polars is missing: pip install 'lanesweep[tracks]'", name="polars")

from ._commonroad import commonroad
from ._lists import automatum, i24, lists, swiftraj
from ._sumo import sumo

__all__ = ["automatum", "commonroad", "i24", "lists", "sumo", "swiftraj"]


class _Verb(ModuleType):
    """The module `lanesweep.tracks` takes the place of the function of that name, and is called as it."""

    def __call__(self, *args: Any, **arguments: Any) -> Result:
        return _verbs.tracks(*args, **arguments)


sys.modules[__name__].__class__ = _Verb
