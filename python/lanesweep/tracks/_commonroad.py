"""CommonRoad."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import polars as pl

from ..options import Path as File
from ._table import bad, canonical, elements, number, warn_left_out

_STATE = {
    "frame": "time/exact",
    "x_m": "position/point/x",
    "y_m": "position/point/y",
    "heading_deg": "orientation/exact",
    "speed_mps": "velocity/exact",
    "acceleration_mps2": "acceleration/exact",
}
_FACTS = {"class": "type", "length_m": "shape/rectangle/length", "width_m": "shape/rectangle/width"}
#: Types of obstacles that are no motor vehicles, and of standing ones that are.
_OTHERS = ("pedestrian", "bicycle", "train")
_STANDING = ("parkedVehicle", "car", "truck", "bus", "taxi", "motorcycle", "priorityVehicle")


def commonroad(path: File) -> pl.DataFrame:
    """Read a CommonRoad scene (XML, 2020a or newer): obstacles, each in the lanelet that it is in.

    Vehicles that stand (``staticObstacle``) are there at every time. Pedestrians, bicycles, trains and other obstacles are left out.
    Source: https://gitlab.lrz.de/tum-cps/commonroad-scenarios, the document *XML_commonRoad*

    Parameters
    ----------
    path : path
        The scene.

    Returns
    -------
    polars.DataFrame
        ``vehicle_id, frame, time_s, x_m, y_m, heading_deg, speed_mps, acceleration_mps2, length_m, width_m, class, lane``.

    Raises
    ------
    InputError
        An older version; a state without exact time and position.
    """
    root: dict[str, str] = {}
    rows: list[tuple[str | None, ...]] = []
    standing: list[tuple[str | None, ...]] = []
    lanelets: dict[str, npt.NDArray[np.float64]] = {}
    left_out: list[str] = []
    for one in elements(path, "lanelet", "dynamicObstacle", "staticObstacle", "commonRoad"):
        name, kind, is_static = one.get("id", ""), one.findtext("type", ""), one.tag == "staticObstacle"
        if one.tag == "commonRoad":
            root = one.attrib
        elif one.tag == "lanelet":
            left, right = (one.findall(f"{side}Bound/point") for side in ("left", "right"))
            points = [[number(path, f"lanelet {name}", point.findtext(axis)) for axis in "xy"] for point in [*left, *right[::-1]]]
            lanelets[name] = np.array(points).reshape(-1, 2)
        elif kind in _OTHERS or (is_static and kind not in _STANDING):
            left_out.append(f"{name} ({kind})")
        else:
            for state in (state for state in one.iter() if state.tag in ("initialState", "state")):
                row = (*map(state.findtext, _STATE.values()), *map(one.findtext, _FACTS.values()), name)
                if None in row[:3]:
                    raise bad(path, f"obstacle {name}", "a state has no exact time and position", "give a recorded scene")
                (standing if is_static else rows).append(row)
    if root.get("commonRoadVersion", "") < "2020":
        help = "give CommonRoad 2020a or newer; CommonRoad's own tools convert older files"
        raise bad(path, "the root", f"CommonRoad {root.get('commonRoadVersion')}", help)
    warn_left_out(path, left_out, "obstacles that are no motor vehicles")
    times = dict.fromkeys(row[0] for row in rows)
    rows += [(time, *row[1:]) for row in standing for time in times]
    frame = canonical(path, pl.DataFrame(rows, dict.fromkeys([*_STATE, *_FACTS, "vehicle_id"], pl.String), orient="row"))
    step_s = number(path, "`timeStepSize` of the root", root.get("timeStepSize"), above=0)
    warn_left_out(path, frame.filter(pl.col("length_m").is_null())["vehicle_id"], "sizes, of other shapes than rectangles,")
    lane = _lanes(frame["x_m"].to_numpy()[:, None], frame["y_m"].to_numpy()[:, None], lanelets)
    return canonical(path, frame.with_columns(pl.col("heading_deg").degrees(), time_s=pl.col("frame") * step_s, lane=pl.Series(lane, dtype=pl.String)))


def _lanes(x: npt.NDArray[np.float64], y: npt.NDArray[np.float64], lanelets: dict[str, npt.NDArray[np.float64]]) -> list[str | None]:
    """Names of the polygons that points, as columns, are in: a ray to +x crosses their edges an odd number of times."""
    lane: list[str | None] = [None] * len(x)
    for name, points in lanelets.items():
        (ax, ay), (bx, by) = points.T, np.roll(points, -1, axis=0).T
        with np.errstate(divide="ignore", invalid="ignore"):
            crosses = ((ay > y) != (by > y)) & (x < ax + (y - ay) / (by - ay) * (bx - ax))
        for at in np.flatnonzero(crosses.sum(axis=1) % 2):
            lane[at] = name
    return lane
