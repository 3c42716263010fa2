"""Types of arguments, and options that several functions share.

A list may be any sequence, a set, a range, or an array of NumPy or pandas.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from typing import Any, Literal, TypeAlias, TypedDict

import numpy as np
import numpy.typing as npt

from ._driver import Driver

__all__ = ["Case", "Data", "Plausibility", "Run", "Split", "Sweep"]

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


class Run(TypedDict, total=False):
    """Options of every function.

    Attributes
    ----------
    threads : int
        Threads, by default one per core. Results do not depend on it.
    config : path, list of paths, or mapping
        Configuration file, or keys of one with their values. Without it, the variable LANESWEEP_CONFIG names the file.
    """

    threads: Int
    config: Config


class Plausibility(TypedDict, total=False):
    """What is done with physically impossible input.

    Attributes
    ----------
    accept_implausible : bool
        Use physically impossible values (a speed of 108 m/s) with a warning, instead of leaving them out.
    """

    accept_implausible: bool


class Data(Plausibility, total=False):
    """Where scenarios come from; without data they are mined from generated recordings.

    Attributes
    ----------
    scenarios : path or table
        Scenario file (.jsonl, .parquet, .csv) or a table of pandas, Polars or pyarrow with its columns, instead of recordings.
    filter : bool
        Keep only scenarios of the file that pass the filters of mining; by default they are kept as given.
    preset : str or path
        Format of the recordings: ``"exid"``, ``"sumo-fcd"``, … or a TOML file; by default the names of the columns tell it.
    synth_recordings : int
        Number of generated recordings, by default 84.
    accept_implausible : bool
        Use physically impossible values with a warning.
    """

    scenarios: Path
    filter: bool
    preset: Path
    synth_recordings: Int


class Sweep(Run, total=False):
    """Options of functions that sweep lanes.

    Attributes
    ----------
    backend : {"auto", "cpu", "gpu"}
        ``"auto"``: a GPU if there is one.
    device : str or int
        Device, by part of its name, PCI bus id or index.
    profile : str or path
        Constants of drivers and criteria: ``"paper"`` (the default), ``"paper-fit"``, ``"jrc-2021"``, ``"un-r157"``, … or a TOML file.
    dt : float
        Time step, s; by default that of the profile.
    threads : int
        Threads, by default one per core.
    config : path, list of paths, or mapping
        Configuration file, or keys of one with their values.
    """

    backend: Literal["auto", "cpu", "gpu"]
    device: str | Int
    profile: Path
    dt: Float


class Split(Sweep, total=False):
    """Options of runs that can be split and resumed; those of `Sweep` too. See also `lanesweep.parts`.

    Attributes
    ----------
    shard : str
        ``"0/8"``: compute part 0 of 8 into `out`; `merge` joins the parts.
    plan : path
        Run a plan that `plan_only` wrote.
    plan_only : bool
        Write the plan, plan.json in `out`, and stop.
    """

    shard: str
    plan: Path
    plan_only: bool


class Case(Plausibility, Run, total=False):
    """A concrete case; those of `Run` and `accept_implausible` too. Speeds along the road are texts with their unit; other numbers are in m, s, m/s, m/s².

    Attributes
    ----------
    category : {"cut-in", "cut-out", "lvd"}
        Kind of scenario.
    ego_speed : str
        Initial speed of the ego: ``"60km/h"``.
    speed : str
        Initial speed of the other vehicle; by default that of the ego.
    gap, thw : float
        Initial gap, bumper to bumper, m; or the time headway, s.
    lateral_speed : float
        Cut-in and cut-out: lateral speed, m/s.
    lateral_distance : float
        Cut-in: lateral distance at the start, m; cut-out: at the end. By default the width of the lane.
    acceleration : float
        Acceleration of the other vehicle, m/s²; a leader deceleration needs one, otherwise it is 0 by default.
    end_speed : str
        Speed at which the acceleration ends; by default standstill, or never.
    ahead_speed : str
        Cut-out: speed of the vehicle ahead of the one that cuts out, by default 0.
    ahead_gap : float
        Cut-out: gap between the two, m.
    length, width : float
        Of every vehicle, m; by default those of the profile.
    ego_length, ego_width : float
        Of the ego, m.
    lane_width : float
        Width of the lanes, m; by default that of the scenario, else 3.5.
    """

    category: Category
    ego_speed: Speed
    speed: Speed
    gap: Number
    thw: Number
    lateral_speed: Number
    lateral_distance: Number
    acceleration: Number
    end_speed: Speed
    ahead_speed: Speed
    ahead_gap: Number
    length: Number
    width: Number
    ego_length: Number
    ego_width: Number
    lane_width: Number
