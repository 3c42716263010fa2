"""What recipes share: the libraries of the extra, tables, answers of many cases."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import _verbs
from .._core import InputError
from .._result import temporary
from ..options import Path as PathLike

if TYPE_CHECKING:
    import polars as pl


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


def table(rows: Any) -> pl.DataFrame:
    """Return a table of lanesweep, pandas, Polars or pyarrow, columns by their names, or a file (.csv, .jsonl, .parquet).

    NaN is no value. Verdicts, which are 0 and 1 in CSV, become true and false.
    """
    with extra():
        import polars as pl
        import polars.selectors as select
    if isinstance(rows, (str, os.PathLike)):
        path = Path(rows)
        if path.suffix == ".csv":
            rows = pl.read_csv(path, infer_schema_length=None)
        else:
            rows = pl.read_parquet(path) if path.suffix == ".parquet" else pl.read_ndjson(path, infer_schema_length=None)
    found = pl.DataFrame(dict(rows) if isinstance(rows, Mapping) else rows, strict=False)
    verdicts = select.by_name("collision", "ttc", "btn", require_all=False) & select.integer()
    return found.with_columns(select.float().fill_nan(None), verdicts.cast(pl.Boolean))


def answers(cases: pl.DataFrame, profile: PathLike) -> pl.DataFrame:
    """Return the computed answer of every case, a column `verdict` and one per driver; no values where a row is no case."""
    with extra():
        import polars as pl
    keep = temporary()
    file, found = Path(keep.name) / "cases.parquet", Path(keep.name) / "answers.parquet"
    cases.write_parquet(file)
    try:
        # A draw that is no case is counted, not reported.
        with quiet():
            _verbs.check(file, nominal=True, profiles=profile, rows=found)
    except InputError:
        # No row is a case: say what is wrong with the first one.
        _verbs.check(file, row=1, profiles=profile)
        raise
    every = pl.DataFrame({"row": range(1, len(cases) + 1)}, schema={"row": pl.Int64})
    return every.join(pl.read_parquet(found), on="row", how="left", maintain_order="left").drop("row")
