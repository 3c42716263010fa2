"""Types of arguments, and lists of what exists: `PROFILES`, `MODELS`, `PARAMETERIZATIONS`, and `KEYS` of ``config``.

A list may be any sequence, a set, a range, or an array of NumPy or pandas.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from . import _core
from ._driver import Driver

_LISTS = _core.lists()
#: Names of the built-in profiles, for `profile` and `profiles`.
PROFILES: list[str] = _LISTS["profiles"]
#: Names of the built-in driver models, for `models`.
MODELS: list[str] = _LISTS["models"]
#: Parameterizations, by the names of their density files (``"cut-in-2"``), with the features that they keep.
PARAMETERIZATIONS: dict[str, str] = _LISTS["parameterizations"]
#: Keys of ``config`` with their meanings.
KEYS: dict[str, str] = _LISTS["keys"]

#: A result stands for its file or folder.
Path: TypeAlias = "str | os.PathLike[str]"
Paths: TypeAlias = "Path | Collection[Path]"
Int: TypeAlias = "int | np.integer[Any]"
Float: TypeAlias = "float | np.floating[Any] | np.integer[Any]"
#: A number, or a text of one with its unit.
Number: TypeAlias = "Float | str"
Category: TypeAlias = Literal["cut-in", "cut-out", "lvd"]
Categories: TypeAlias = "Category | Collection[Category] | npt.NDArray[Any]"
Criterion: TypeAlias = Literal["collision", "ttc", "btn"]
Models: TypeAlias = "str | Driver | Collection[str | Driver] | npt.NDArray[Any]"
#: Seconds; ``"paper"``, ``"r157"``, ``"observed"``.
Headways: TypeAlias = "str | Float | Collection[str | Float] | npt.NDArray[Any]"
#: Keys of parameterizations.
Keys: TypeAlias = "str | Int | Collection[str | Int] | npt.NDArray[Any]"
#: A speed with its unit: ``"60km/h"``, ``"16.7m/s"``; or 0.
Speed: TypeAlias = "str | Literal[0]"
#: A file, or keys with their values: ``{"mining.leader_max_thw_s": 2.5}``.
Config: TypeAlias = "Path | Collection[Path] | Mapping[str, Any]"
#: Names with their values: ``{"ego_speed_kmh": 108}``.
Values: TypeAlias = "str | Collection[str] | Mapping[str, Any]"
#: A table of pandas, Polars or pyarrow.
Table: TypeAlias = Any
