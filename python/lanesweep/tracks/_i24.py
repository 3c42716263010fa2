"""I-24 MOTION."""

from __future__ import annotations

import polars as pl

from ..options import Path as File
from ._table import bad, json_lists

_FOOT_M = 0.3048
_CLASSES = {"0": "sedan", "1": "midsize", "2": "van", "3": "pickup", "4": "semi", "5": "truck", "6": "motorcycle"}
_NAMES = {
    "_id": "vehicle_id",
    "timestamp": "time_s",
    "x_position": "s_m",
    "y_position": "d_m",
    "length": "length_m",
    "width": "width_m",
    "coarse_vehicle_class": "class",
    "direction": "direction",
}


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
    frame = json_lists(path, _NAMES)
    if not frame["direction"].is_in([1.0, -1.0]).fill_null(False).all():
        raise bad(path, "`direction`", "it is neither 1 nor -1", "check that this is I-24 MOTION")
    frame = frame.with_columns(pl.col("s_m", "d_m", "length_m", "width_m") * _FOOT_M, pl.col("class").str.strip_suffix(".0").replace(_CLASSES))
    return frame.with_columns(s_m=pl.col("s_m") + pl.col("direction") * pl.col("length_m") * 0.5)
