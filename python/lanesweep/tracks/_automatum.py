"""Automatum DATA."""

from __future__ import annotations

import math

import polars as pl

from ..options import Path as File
from ._table import json_lists

_NAMES = {
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
    return json_lists(path, _NAMES, "objects").with_columns(pl.col("heading_deg") * (180.0 / math.pi))
