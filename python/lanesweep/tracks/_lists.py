"""Formats with a row per vehicle whose cells are lists over time."""

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
_AUTOMATUM = {
    "UUID": "vehicle_id",
    "time": "time_s",
    "x_vec": "x_m",
    "y_vec": "y_m",
    "psi_vec": "heading_deg",
    "vx_vec": "vx_mps",
    "vy_vec": "vy_mps",
    "ax_vec": "ax_mps2",
    "ay_vec": "ay_mps2",
    "length": "length_m",
    "width": "width_m",
    "type": "class",
    "lane_id_vec": "lane",
}
_FOOT_M = 0.3048
_CLASSES = {"0": "sedan", "1": "midsize", "2": "van", "3": "pickup", "4": "semi", "5": "truck", "6": "motorcycle"}
_I24 = {
    "_id": "vehicle_id",
    "timestamp": "time_s",
    "x_position": "s_m",
    "y_position": "d_m",
    "length": "length_m",
    "width": "width_m",
    "coarse_vehicle_class": "class",
    "direction": "direction",
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


def automatum(path: File) -> pl.DataFrame:
    """Read Automatum DATA (``dynamicWorld.json``): the centre of gravity, taken for the middle of the box.

    Source: https://openautomatumdronedata.readthedocs.io

    Parameters
    ----------
    path : path
        JSON with a list ``objects`` whose values are lists over time.

    Returns
    -------
    polars.DataFrame
        ``vehicle_id, time_s, x_m, y_m, heading_deg, vx_mps, vy_mps, ax_mps2, ay_mps2, length_m, width_m, class, lane``.
    """
    return json_lists(path, _AUTOMATUM, "objects").with_columns(pl.col("heading_deg").degrees())


def i24(path: File) -> pl.DataFrame:
    """Read I-24 MOTION (JSON): feet along and across the road, of the middle of the rear bumper, without speeds.

    Name the table ``….i24.parquet``, or give ``preset="i24"``: positions are smoothed over 1 s, and lanes are bands of 12 ft.
    Source: https://github.com/I24-MOTION/I24M_documentation

    Parameters
    ----------
    path : path
        A list of vehicles whose values are lists over time.

    Returns
    -------
    polars.DataFrame
        ``vehicle_id, time_s, s_m, d_m, length_m, width_m, class, direction``, of the middle of the box.
    """
    frame = json_lists(path, _I24)
    if not frame["direction"].is_in([1.0, -1.0]).fill_null(False).all():
        raise bad(path, "`direction`", "it is neither 1 nor -1", "check that this is I-24 MOTION")
    frame = frame.with_columns(pl.col("s_m", "d_m", "length_m", "width_m") * _FOOT_M, pl.col("class").str.strip_suffix(".0").replace(_CLASSES))
    return frame.with_columns(s_m=pl.col("s_m") + pl.col("direction") * pl.col("length_m") * 0.5)
