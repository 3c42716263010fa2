"""Tables with a row per vehicle whose cells are lists over time."""

from __future__ import annotations

import os
from collections.abc import Mapping

import polars as pl

from ..options import Path as File
from ._table import COLUMNS, bad, canonical, json_lists, number, read_table, unpacked

_SWIFTRAJ = {
    "vehicle_id": "vehicle_id",
    "frame_index": "frame",
    "frenet_s": "s_m",
    "frenet_d": "d_m",
    "frenet_s_speed": "forward_speed_mps",
    "frenet_d_speed": "leftward_speed_mps",
    "frenet_s_accel": "acceleration_mps2",
    "vehicle_length": "length_m",
    "vehicle_width": "width_m",
    "vehicle_class": "class",
    "lane_id": "lane",
}


def lists(path: File, columns: Mapping[str, str]) -> pl.DataFrame:
    """Read a table with a row per vehicle whose cells are lists over time: Parquet, or JSON with a list of vehicles.

    Parameters
    ----------
    path : path
        The file; JSON may also have one vehicle per line.
    columns : dict
        Our columns by theirs, such as ``{"track": "vehicle_id", "t": "time_s", "x": "x_m", "y": "y_m"}``. Units stay: multiply the
        columns of the result where they differ.

    Returns
    -------
    polars.DataFrame
        These columns, a row per item of the lists; what is no list is repeated.
    """
    if unknown := set(columns.values()) - set(COLUMNS):
        raise bad(path, f"`{min(unknown)}`", f"it is no column of tracks; there are {', '.join(COLUMNS)}", "give one of these")
    if os.fspath(path).endswith(".parquet"):
        return unpacked(path, read_table(path), columns)
    return json_lists(path, columns)


def swiftraj(path: File, frame_interval_s: float = 0.1) -> pl.DataFrame:
    """Read SWIFTraj (Parquet): positions, speeds and accelerations along the road, of the middle of the box.

    Source: https://www.swiftraj.com, https://arxiv.org/abs/2602.22563

    Parameters
    ----------
    path : path
        A row per vehicle, with lists.
    frame_interval_s : float
        Time between two frames.

    Returns
    -------
    polars.DataFrame
        ``vehicle_id, frame, time_s, s_m, d_m, forward_speed_mps, leftward_speed_mps, acceleration_mps2, length_m, width_m, class, lane``.
    """
    step_s, frame = number(path, "`frame_interval_s`", frame_interval_s, above=0), lists(path, _SWIFTRAJ)
    return canonical(path, frame.with_columns(time_s=pl.col("frame") * step_s))
