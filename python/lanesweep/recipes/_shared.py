"""What recipes share: the libraries of the extra, tables, answers of many cases."""

from __future__ import annotations

import difflib
import logging
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import polars as pl
import polars.selectors as select

from .. import _verbs
from .._core import InputError as InputError, UsageError as UsageError
from ..options import Path as PathLike


@contextmanager
def extra() -> Iterator[None]:
    """Name the extra where one of its libraries is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise ImportError(f"{error.name} is missing: pip install 'lanesweep[recipes]'", name=error.name) from error


@contextmanager
def quiet() -> Iterator[None]:
    """Log nothing."""
    log = logging.getLogger("lanesweep")
    level = log.level
    log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        log.setLevel(level)


def check_names(names: Iterable[str], known: Iterable[str], what: str) -> None:
    """Refuse names that are none of the known ones; the error has the nearest of these."""
    for name in names:
        if name not in (all_known := [*known]):
            help = "".join(f"\n  help: did you mean `{near}`?" for near in difflib.get_close_matches(str(name), all_known, 1))
            raise UsageError(f"there is no {what} `{name}`; there are {', '.join(all_known)}{help}")


def within(low: float, high: float, **given: float) -> None:
    """Refuse arguments out of range."""
    for name, value in given.items():
        if not low <= value <= high:
            raise UsageError(f"`{name}` is {value}; expected {low} to {high}")


def table(rows: Any, *needs: str, may_be_empty: bool = False) -> pl.DataFrame:
    """Return a table of lanesweep, pandas, Polars or pyarrow, columns by their names, or a file (.csv, .jsonl, .parquet).

    It has the columns `needs`. NaN is no value. Verdicts, which are 0 and 1 in CSV, become true and false; nested fields and infinite
    numbers, which are texts in JSON, are those of Parquet.
    """
    if isinstance(rows, (str, os.PathLike)):
        path = Path(rows)
        readers: dict[str, Any] = {".csv": pl.read_csv, ".jsonl": pl.read_ndjson, ".parquet": pl.read_parquet}
        check_names([path.suffix], readers, f"reader of {path}:")
        rows = readers[path.suffix](path, **({} if path.suffix == ".parquet" else {"infer_schema_length": None}))
    found = pl.DataFrame(dict(rows) if isinstance(rows, Mapping) else rows, strict=False).unnest(select.struct(), separator="_")
    check_names(needs, found.columns, "column")
    if found.is_empty() and not may_be_empty:
        raise InputError("the table has no rows\n  help: give at least one")
    infinite = [of.name for of in found.select(select.string()) if of.str.contains("^-?Infinity$").any()]
    found = found.cast(dict.fromkeys(infinite, pl.Float64))
    verdicts = select.by_name("collision", "ttc", "btn", require_all=False) & select.integer()
    return found.with_columns(select.float().fill_nan(None), verdicts.cast(pl.Boolean))


def case_of(case: Mapping[str, Any], varied: Mapping[str, Any]) -> dict[str, Any]:
    """Return a case without its id and answer; its names, and those of what varies, must be quantities of a case."""
    given = {name: value for name, value in case.items() if name not in ("id", "answer")}
    check_names((re.sub("_(kmh|mps2?|m|s)$", "", name) for name in [*given, *varied]), _verbs.Case.__annotations__, "quantity of a case")
    if not varied:
        raise UsageError("nothing varies\n  help: give at least one quantity")
    return given


def answers(cases: pl.DataFrame, profile: PathLike) -> pl.DataFrame:
    """Return the computed answer of every case, a column `verdict` and one per driver; no values where a row is no case."""
    try:
        # A draw that is no case is counted, not reported.
        with quiet():
            found = table(_verbs.check(cases, nominal=True, profiles=profile).table("cases"))
    except InputError:
        # No row is a case: say what is wrong with the first one.
        _verbs.check(cases, row=1, profiles=profile)
        raise
    every = pl.DataFrame({"row": range(1, len(cases) + 1)}, schema={"row": pl.Int64})
    return every.join(found, on="row", how="left", maintain_order="left").drop("row")
