"""SUMO: floating car data and the types of vehicles."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterable, Iterator

import polars as pl

from ..options import Path as File
from ._table import LOG, bad, canonical, elements, number, read_table, warn_left_out

#: Names of SUMO's attributes, with ours. Angles become headings later.
_NAMES = {
    "time": "time_s",
    "id": "vehicle_id",
    "x": "x_m",
    "y": "y_m",
    "angle": "heading_deg",
    "type": "class",
    "speed": "speed_mps",
    "lane": "lane",
}
_NEEDED = list(_NAMES.values())[:6]
_CARS = ("passenger", "private", "taxi", "hov", "evehicle", "authority", "army", "vip", "ignoring", "custom1", "custom2")
#: Length and width in metres of classes: https://sumo.dlr.de/docs/Vehicle_Type_Parameter_Defaults.html
_SIZES = {
    **dict.fromkeys(_CARS, (5.0, 1.8)),
    "motorcycle": (2.2, 0.9),
    "moped": (2.1, 0.8),
    "emergency": (6.5, 2.16),
    "delivery": (6.5, 2.16),
    "truck": (7.1, 2.4),
    "trailer": (16.5, 2.55),
    "bus": (12.0, 2.5),
    "coach": (14.0, 2.6),
}
#: How classes, or names of types without one, begin: those of lorries, and of what is no motor vehicle on a road.
_TRUCKS = ("truck", "trailer", "bus", "coach", "delivery", "lorry", "lkw", "sattel")
_OTHERS = (
    *("pedestrian", "wheelchair", "bicycle", "scooter", "tram", "rail", "subway", "cable_car", "ship", "aircraft", "drone", "container"),
    *("default_pedtype", "default_biketype", "default_railtype", "default_containertype"),
)
#: Length and width in metres, 0 if unknown, and class.
_Type = tuple[float, float, str]
_KNOWN: dict[str, _Type] = {"DEFAULT_VEHTYPE": (5.0, 1.8, "passenger"), "DEFAULT_TAXITYPE": (5.0, 1.8, "taxi")}


def sumo(fcd: File, types: File | Iterable[File] = ()) -> pl.DataFrame:
    """Read floating car data of SUMO (``--fcd-output``): XML, CSV (also of ``xml2csv``) or Parquet.

    SUMO gives the middle of the front bumper and the angle clockwise from north, but no sizes: these, and the class, come
    from the ``vType`` elements. A ``vType`` without `length` or `width` has that which SUMO documents for its `vClass`.
    Persons, containers, bicycles and trains are left out, and what is never in a lane.
    Source: https://sumo.dlr.de/docs/Simulation/Output/FCDOutput.html

    Parameters
    ----------
    fcd : path
        ``.xml``, ``.csv``, either with ``.gz``, or ``.parquet``.
    types : path or several
        Files with ``vType`` elements: ``.rou.xml``, ``.add.xml``.

    Returns
    -------
    polars.DataFrame
        ``vehicle_id, time_s, x_m, y_m, heading_deg, speed_mps, length_m, width_m, class, lane``.

    Raises
    ------
    InputError
        A type without size that no file defines, or that has two sizes; a vehicle without position, angle or type.
    """
    frame, known = canonical(fcd, _samples(fcd)), _KNOWN | _types(types)
    kinds = {name: known.get(name, known.get(name.split("@")[0], (0.0, 0.0, name))) for name in frame["class"].unique()}
    is_ours = ~pl.col("class").is_in([name for name, (*_, kind) in kinds.items() if kind.lower().startswith(_OTHERS)])
    if frame["lane"].is_not_null().any():
        is_ours &= pl.col("lane").is_not_null().any().over("vehicle_id")
    warn_left_out(fcd, frame.filter(~is_ours)["vehicle_id"], "persons, trains, or in no lane")
    frame = frame.filter(is_ours)
    unknown = sorted(name for name in frame["class"].unique() if 0.0 in kinds[name])
    if unknown:
        place = f"vehicle {frame.filter(pl.col('class') == unknown[0])['vehicle_id'][0]}"
        problem = f"no vType gives a size of its type `{unknown[0]}`" + (f" (and {len(unknown) - 1} more types)" if unknown[1:] else "")
        raise bad(fcd, place, problem, "give the files that define it: sumo(FCD, [FILE.rou.xml, FILE.add.xml])")
    length, width = (pl.col("class").replace_strict({name: of[at] for name, of in kinds.items()}) for at in (0, 1))
    kind = {name: "truck" if of[2].lower().startswith(_TRUCKS) else of[2] for name, of in kinds.items()}
    angle = pl.col("heading_deg").radians()
    frame = frame.with_columns(
        x_m=pl.col("x_m") - length / 2.0 * angle.sin(),
        y_m=pl.col("y_m") - length / 2.0 * angle.cos(),
        heading_deg=90.0 - pl.col("heading_deg"),
        length_m=length,
        width_m=width,
    )
    _warn_of_instant_lane_changes(fcd, frame)
    return canonical(fcd, frame.with_columns(pl.col("class").replace_strict(kind)))


def _warn_of_instant_lane_changes(fcd: File, frame: pl.DataFrame) -> None:
    """Name vehicles that are in another lane one step later, more than 2.5 m aside: no lateral speed describes this."""
    angle, x, y, time = (pl.col(name) for name in ("heading_deg", "x_m", "y_m", "time_s"))
    aside = (angle.radians().cos() * y.diff() - angle.radians().sin() * x.diff()).over("vehicle_id").abs()
    is_step = (time.diff().over("vehicle_id") <= 1.0) & (aside > 2.5)
    names = frame.filter(is_step & (pl.col("lane") != pl.col("lane").shift()).over("vehicle_id"))["vehicle_id"]
    if len(names):
        help = "simulate with --lanechange.duration, or with the sublane model"
        LOG.warning("%s: %d lane changes take one step, such as that of %s: %s", os.fspath(fcd), len(names), names[0], help)


def _types(files: File | Iterable[File]) -> dict[str, _Type]:
    """Types by name."""
    known: dict[str, _Type] = {}
    for file in [files] if isinstance(files, (str, os.PathLike)) else files:
        for one in elements(file, "vType"):
            name = one.get("id", "")
            usual = zip(("length", "width"), _SIZES.get(one.get("vClass", "passenger"), (0.0, 0.0)), strict=True)
            length, width = (number(file, f"vType `{name}`", one.get(key, size)) for key, size in usual)
            found = (length, width, one.get("vClass", name))
            if known.setdefault(name, found)[:2] != found[:2]:
                raise bad(file, f"vType `{name}`", "it has another size before", "give the files of this simulation only")
    return known


def _samples(fcd: File) -> pl.DataFrame:
    """Vehicles and times, in our columns; classes are names of types, headings are SUMO's angles."""
    if os.fspath(fcd).removesuffix(".gz").endswith(".xml"):
        frame = pl.DataFrame(_vehicles(fcd), dict.fromkeys(_NAMES, pl.String), orient="row")
    else:
        frame = read_table(fcd)
        for tag in ("person", "container"):
            warn_left_out(fcd, frame[f"{tag}_id"].drop_nulls() if f"{tag}_id" in frame.columns else (), f"elements `{tag}`")
        frame = frame.rename(lambda column: column.removeprefix("timestep_").removeprefix("vehicle_"))
    frame = frame.select((pl.col(of) if of in frame.columns else pl.lit(None, pl.String)).alias(ours) for of, ours in _NAMES.items())
    # Tables have a row for a step without vehicles.
    frame = frame.filter(pl.any_horizontal(pl.col("vehicle_id", "x_m", "y_m").is_not_null()))
    if frame["time_s"].dtype == pl.String:
        frame = frame.with_columns(time_s=_seconds(pl.col("time_s")))
    help = "write floating car data, with these attributes: sumo --fcd-output FILE"
    if frame.is_empty():
        raise bad(fcd, "the file", "no step has a vehicle", help)
    for column in _NEEDED:
        without = frame.filter(pl.col(column).is_null())
        if len(without):
            raise bad(fcd, f"vehicle {without['vehicle_id'][0]}, time {without['time_s'][0]}", f"there is no `{column}`", help)
    return frame


def _seconds(text: pl.Expr) -> pl.Expr:
    """Seconds of ``12.5``, or of ``0:08:15:30.25`` with days, hours and minutes."""
    parts = text.str.split(":").cast(pl.List(pl.Float64), strict=False).list
    days, hours, minutes = (parts.get(at, null_on_oob=True).fill_null(0.0) for at in (-4, -3, -2))
    return 86_400.0 * days + (3600.0 * hours + 60.0 * minutes + parts.get(-1))


def _vehicles(fcd: File) -> Iterator[tuple[str | None, ...]]:
    """Attributes of the vehicles, step by step."""
    left_out: dict[str, set[str]] = defaultdict(set)
    attributes = list(_NAMES)[1:]
    for step in elements(fcd, "timestep"):
        time = step.get("time")
        for one in step:
            if one.tag == "vehicle":
                yield (time, *map(one.get, attributes))
            else:
                left_out[one.tag].add(one.get("id", ""))
    for tag, names in left_out.items():
        warn_left_out(fcd, names, f"elements `{tag}`")
