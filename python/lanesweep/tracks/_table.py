"""What the formats share: reading XML and JSON, and the columns of the table."""

from __future__ import annotations

import gzip
import json
import logging
import math
import os
import re
import xml.etree.ElementTree as ET
import zlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import IO, Any, cast

import polars as pl

from .._core import InputError
from ..options import Path as File

LOG = logging.getLogger("lanesweep")
#: Errors of a compressed file that ends early.
_BROKEN = (EOFError, zlib.error, gzip.BadGzipFile)
#: The columns in their order, with their types.
COLUMNS: dict[str, Any] = dict.fromkeys(
    "vehicle_id frame time_s x_m y_m s_m d_m heading_deg speed_mps vx_mps vy_mps forward_speed_mps leftward_speed_mps "
    "acceleration_mps2 ax_mps2 ay_mps2 length_m width_m class lane direction".split(),
    pl.Float64,
)
COLUMNS |= {"vehicle_id": pl.String, "frame": pl.Int64, "class": pl.String, "lane": pl.String}


def bad(path: File, place: str, problem: str, help: str) -> InputError:
    """Return the error of a file."""
    return InputError(f"{os.fspath(path)}: {place}: {problem}\n  help: {help}")


def number(path: File, place: str, text: str | float | None, *, above: float = -math.inf) -> float:
    """Return the finite number that a text is."""
    try:
        value = float(text if text is not None else "")
    except ValueError:
        value = math.nan
    if not above < value < math.inf:
        raise bad(path, place, f"{text!r} is not a number" + f" above {above}" * math.isfinite(above), "correct the value")
    return value


def warn_left_out(path: File, names: Iterable[Any], what: str) -> None:
    """Name what of a file is not in the table."""
    several = sorted(set(map(str, names)))
    if several:
        more = ", …" if len(several) > 5 else ""
        LOG.warning("%s: %d %s left out: %s%s", os.fspath(path), len(several), what, ", ".join(several[:5]), more)


def opened(path: File) -> IO[bytes]:
    """Open a file, through gzip if its name ends in ``.gz``."""
    return cast(IO[bytes], gzip.open(path)) if os.fspath(path).endswith(".gz") else Path(path).open("rb")


def read_table(path: File) -> pl.DataFrame:
    """Read Parquet, or delimited texts with a header."""
    try:
        if os.fspath(path).endswith(".parquet"):
            return pl.read_parquet(Path(path))
        with opened(path) as file:
            text = file.read()
        return pl.read_csv(text, separator=";" if b";" in text[: text.find(b"\n")] else ",", infer_schema=False)
    except (pl.exceptions.PolarsError, *_BROKEN) as error:
        raise bad(path, "the file", f"no table, or truncated ({error})", "export the file again") from None


def elements(path: File, *tags: str) -> Iterator[ET.Element]:
    """Elements of an XML file at their ends, with what is inside; the root comes last and has lost its children."""
    around: list[ET.Element] = []
    with opened(path) as file:
        try:
            for event, element in ET.iterparse(file, ("start", "end")):
                if event == "start":
                    around.append(element)
                    continue
                around.pop()
                if element.tag in tags:
                    yield element
                if len(around) == 1:
                    del around[0][:]
        except (ET.ParseError, *_BROKEN) as error:
            place = f"inside `{around[-1].tag}`" if around else "at its beginning"
            raise bad(path, place, f"not well-formed XML, or truncated ({error})", "export the file again") from None


def _objects(path: File, key: str) -> list[dict[str, Any]]:
    """Objects of a JSON list, of the list under a key, or one object per line; numbers stay texts, ids of MongoDB become texts."""
    plain: dict[str, Any] = {"parse_float": str, "parse_int": str, "parse_constant": str}
    decoder = json.JSONDecoder(**plain, object_hook=lambda found: found.get("$oid", found))
    found: list[dict[str, Any]] = []
    try:
        with opened(path) as file:
            text = file.read().decode("utf-8-sig").strip()
        at = 0
        while at < len(text):
            document, at = decoder.raw_decode(text, at)
            at = re.compile(r"\s*").match(text, at).end()  # type: ignore[union-attr]
            of_key = document.get(key, document) if isinstance(document, dict) else document
            found += of_key if isinstance(of_key, list) else [of_key]
    except (ValueError, *_BROKEN) as error:
        raise bad(path, "not JSON, or truncated", str(error), "export the file again") from None
    for number, vehicle in enumerate(found, 1):
        if not isinstance(vehicle, dict):
            raise bad(path, f"vehicle {number} of the list", f"{vehicle!r:.40} is not an object", "give a list of vehicles")
    return found


def json_lists(path: File, columns: Mapping[str, str], key: str = "") -> pl.DataFrame:
    """A row per item of the lists of vehicles in JSON, which are in a list under a key, or one per line; `columns` as in `unpacked`."""
    vehicles = _objects(path, key)
    frame, there = {}, dict.fromkeys(key for vehicle in vehicles for key in vehicle)
    for theirs in [of for of in columns if of in there or not vehicles]:
        cells = [vehicle.get(theirs) for vehicle in vehicles]
        packed = any(isinstance(cell, list) for cell in cells)
        for number, cell in enumerate(cells, 1):
            if packed != isinstance(cell, list):
                raise bad(path, f"vehicle {number} of the list", f"`{theirs}` is {cell!r:.40}", "give every vehicle the same keys")
        frame[theirs] = pl.Series(theirs, cells, dtype=pl.List(pl.String) if packed else pl.String, strict=False)
    return unpacked(path, pl.DataFrame(frame), columns, there)


def unpacked(path: File, vehicles: pl.DataFrame, columns: Mapping[str, str], there: Iterable[str] = ()) -> pl.DataFrame:
    """A row per item of the lists of the vehicles; `columns` has our names by theirs, which are among those that are `there`."""
    for theirs in columns:
        if theirs not in vehicles.columns:
            problem = f"not there; the file has {', '.join(there or vehicles.columns)}"
            raise bad(path, f"column `{theirs}`", problem, "check that it has this format")
    frame = vehicles.select(pl.col(theirs).alias(ours) for theirs, ours in columns.items())
    frame = frame.with_columns(pl.col(name).arr.to_list() for name, dtype in frame.schema.items() if isinstance(dtype, pl.Array))
    packed = [name for name, dtype in frame.schema.items() if isinstance(dtype, pl.List)]
    for name in packed[1:]:
        differs = frame[name].list.len().ne_missing(frame[packed[0]].list.len())
        if differs.any():
            problem = f"the lists of `{packed[0]}` and `{name}` differ in length"
            raise bad(path, f"vehicle {differs.to_list().index(True) + 1} of the list", problem, "give lists of equal length")
    if packed:
        frame = frame.filter(pl.col(packed[0]).list.len() > 0).explode(packed)
    return canonical(path, frame)


def canonical(path: File, frame: pl.DataFrame) -> pl.DataFrame:
    """The columns in their order and with their types, NaN as no value; what else is no finite number, or no size, is an error."""
    frame = frame.with_columns(pl.col(pl.Float32, pl.Float64).fill_nan(None))
    types = {name: kind for name, kind in COLUMNS.items() if name in frame.columns}
    table = frame.select(pl.col(name).cast(kind, strict=False) for name, kind in types.items())
    for name, kind in types.items():
        is_size, found = name in ("length_m", "width_m"), table[name]
        is_good = found.is_finite() & (found > (0.0 if is_size else -math.inf)) if kind == pl.Float64 else found.is_not_null()
        wrong = frame.filter(~is_good.fill_null(False) & frame[name].is_not_null())
        if len(wrong):
            place = ", ".join(f"{of} {wrong[of][0]}" for of in ("vehicle_id", "frame", "time_s") if of in wrong.columns)
            raise bad(path, place, f"`{name}` is {wrong[name][0]!r}; expected a {'size' if is_size else 'number'}", "correct the value")
    if table.is_empty():
        raise bad(path, "the file", "there is no vehicle", "check that it has this format")
    return table
