"""Runs verbs: keyword arguments become values that the compiled module takes."""

from __future__ import annotations

import csv
import importlib.util
import logging
import numbers
import os
import re
import sys
import tempfile
import warnings
from collections.abc import Callable, Collection, KeysView, Mapping, Sequence, Set, ValuesView
from pathlib import Path
from typing import Any

import numpy as np

from . import _core
from ._driver import names_of, refresh
from ._result import Result, temporary

_log = logging.getLogger("lanesweep")


def on_message(level: str, line: str) -> None:
    """Pass a line of the program's log on to `logging`, under the name ``lanesweep``."""
    # Python has no level TRACE.
    _log.log(getattr(logging, level, logging.DEBUG), "%s", line)


def progress() -> tuple[Callable[[str, int, int | None], None] | None, Callable[[], None]]:
    """Return a callback that moves a bar, and one that closes it.

    The bar is that of `tqdm` if it is installed; in a terminal or notebook only.
    """
    if importlib.util.find_spec("tqdm") is None or not ((sys.stderr is not None and sys.stderr.isatty()) or "ipykernel" in sys.modules):
        return None, lambda: None
    with warnings.catch_warnings():
        # Without ipywidgets, tqdm draws its bar as text and warns about it.
        warnings.simplefilter("ignore")
        tqdm: Any = importlib.import_module("tqdm.auto").tqdm
    bar: Any = None

    def move(what: str, done: int, total: int | None) -> None:
        nonlocal bar
        if bar is None or bar.total != total:
            close()
            bar = tqdm(total=total, desc=what, leave=False)
        bar.update(done - bar.n)

    def close() -> None:
        nonlocal bar
        if bar is not None:
            bar.close()
        bar = None

    return move, close


def plain(value: Any, name: str) -> Any:
    """Return the value of an argument as a number, a text (of a path, too), or a list or dictionary of these."""
    if name in ("config", "panel", "set") and hasattr(value, "to_dict"):
        # A Series.
        value = value.to_dict()
    if not isinstance(value, Mapping):
        return _list_or_scalar(value, name)
    rows: dict[str, Any] = {}
    for key, one in _some(value, name).items():
        # Tables of a configuration: {"run": {"dt_s": 0.05}}.
        inner = {f"{key}.{of}": two for of, two in one.items()} if isinstance(one, Mapping) and name == "config" else {str(key): one}
        rows |= {of: _list_or_scalar(two, name) for of, two in inner.items()}
    return rows


def _some(values: Any, name: str) -> Any:
    if not len(values):
        raise ValueError(f"`{name}` is empty; give at least one value, or leave it out")
    return values


def _list_or_scalar(value: Any, name: str) -> Any:
    value = _of_array(value)
    if isinstance(value, (Sequence, Set, KeysView, ValuesView)) and not isinstance(value, (str, bytes, bytearray)):
        # A set has no order of its own.
        several = sorted(value, key=lambda one: (str(type(one)), one)) if isinstance(value, Set) else value
        return [_scalar(_of_array(one), name) for one in _some(several, name)]
    return _scalar(value, name)


def _of_array(value: Any) -> Any:
    """Values of NumPy and pandas as those of Python."""
    if not hasattr(value, "tolist"):
        return value
    array = np.asarray(value)
    is_short = array.dtype.kind == "f" and array.dtype.itemsize < 8
    if is_short or str(getattr(value, "dtype", "")).lower() in ("float32", "float[pyarrow]"):
        # The digits of its arithmetic: 0.6 of binary32, not 0.6000000238418579.
        return np.vectorize(float, otypes=[float])(array.astype(array.dtype if is_short else np.float32).astype(str)).tolist()
    return value.tolist()


def _scalar(value: Any, name: str) -> Any:
    if isinstance(value, (bool, str)):
        return value
    if isinstance(value, os.PathLike):
        return path_of(value, name)
    if isinstance(value, numbers.Integral):
        return int(value)
    if isinstance(value, numbers.Real):
        return float(value)
    if isinstance(value, numbers.Number):
        return str(value)
    if is_table(value):
        raise _core.UsageError(f"`{name}` is a table in memory\n  help: write it into a file first (Parquet, CSV), and give its path")
    raise TypeError(f"`{name}` has the value {value!r:.80}; give a number, a text, a path, or a list of these that holds no lists")


def path_of(value: Any, name: str) -> str:
    """Write the path of an argument."""
    try:
        return os.fsdecode(value)
    except TypeError as error:
        raise TypeError(f"`{name}`: {error}") from None


def is_table(value: Any) -> bool:
    """Whether an argument is a table in memory: of pandas, Polars, pyarrow, or with the Arrow interface."""
    return hasattr(value, "__arrow_c_stream__") or hasattr(value, "to_csv")


def table_file(table: Any, path: Path) -> str:
    """Write a table into a file: Parquet, or CSV of pandas without pyarrow."""
    file = f"{path}.parquet"
    if hasattr(table, "write_parquet"):
        table.write_parquet(file)
    elif hasattr(table, "to_csv") and importlib.util.find_spec("pyarrow") is None:
        file = f"{path}.csv"
        table.to_csv(file, index=False)
    else:
        arrow: Any = importlib.import_module("pyarrow")
        made = arrow.Table.from_pandas(table, preserve_index=False) if hasattr(table, "to_csv") else arrow.table(table)
        importlib.import_module("pyarrow.parquet").write_table(made, file)
    return file


def row_file(row: Any, path: Path) -> Path:
    """Write a row, a dictionary or a Series of pandas, into a table of its own."""
    given = {name: value for name, value in row.items() if value is not None and type(value).__name__ != "NAType" and value == value}
    with open(path, "w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([given.keys(), given.values()])
    return path


def _word(value: Any) -> str:
    """Return a value as a command line has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return ",".join(map(_word, value))
    return repr(value).removesuffix(".0") if isinstance(value, float) else str(value)


def words_of(value: Any) -> bool | list[str]:
    """Return the value of an argument as words of a command line."""
    if isinstance(value, dict):
        return [f"{name}={_word(one)}" for name, one in value.items()]
    return value if isinstance(value, bool) else [_word(one) for one in (value if isinstance(value, list) else [value])]


def _in_words(text: str) -> str:
    """Name the argument in place of the temporary file that holds its row or table."""
    folder = re.escape(os.path.join(tempfile.gettempdir(), "lanesweep-"))
    return re.sub(rf"{folder}\w+[/\\](scenarios|file|table)\.(csv, line 2\b|csv|parquet)", r"`\1`", text)


#: Names of results in a temporary folder, without the argument `out`.
_OUT = {"study": "study", "tracks": "tracks", "mine": "scenarios.jsonl", "fit": "densities", "sample": "sample", "map": "map"}


def run(function: str, arguments: Mapping[str, Any]) -> Result:
    """Run a verb by the name of its function."""
    given = dict(arguments)
    default_out, path = _OUT.get(function), given.get("folder")
    if function == "tracks":
        paths = given["paths"]
        are_several = isinstance(paths, Collection) and not isinstance(paths, str) and len(paths) > 1
        if paths is None or are_several:
            # Figures of several recordings could have the same names.
            default_out, path = None, None if are_several else given["convert"]
    if given.get("models") is not None:
        given["models"] = names_of(given["models"])
    keep = temporary()
    folder = Path(keep.name)
    for name in ("scenarios", "file", "table"):
        value: Any = given.get(name)
        value = value._asdict() if hasattr(value, "_asdict") else value  # a row of `itertuples`
        is_row = isinstance(value, Mapping) or getattr(value, "ndim", 2) == 1
        if is_row and name != "scenarios":
            given[name], given["row"] = row_file(value, folder / f"{name}.csv"), given.get("row") or 1
        elif is_table(value):
            given[name] = table_file(value, folder / name)
        elif isinstance(value, (tuple, list)):
            raise _core.UsageError(f"`{name}` is {value!r:.80}\n  help: give a file, a table, or a row with its names: a mapping")
    external = given.get("external")
    external = {"external": external} if is_table(external) else external
    if isinstance(external, Mapping):
        given["external"] = [table_file(one, folder / str(name)) if is_table(one) else one for name, one in external.items()]
    data = given.get("recordings")
    if function != "mine" and isinstance(data, (str, os.PathLike)) and path_of(data, "recordings").endswith(".jsonl"):
        raise _core.UsageError("`recordings`: this is a scenario file\n  help: give it as `scenarios`")
    values = {name.removesuffix("_"): plain(value, name) for name, value in given.items() if value is not None}
    if default_out is not None:
        values.setdefault("out", str(folder / default_out))
    path = values.get("out", path)
    messages: list[str] = []

    def on_line(level: str, line: str) -> None:
        line = _in_words(line)
        messages.append(line)
        on_message(level, line)

    move, close = progress()
    words = {name: words_of(value) for name, value in values.items()}
    refresh(word for several in words.values() if isinstance(several, list) for word in several)
    shown = ", ".join(f"{name}={value!r}" for name, value in values.items() if name != "out" and value is not False)
    call = os.fsencode(f"lanesweep.{function}({shown})").decode(errors="replace")
    try:
        code, text, document, frames = _core.run(function, call, words, move, on_line)
    except _core.LanesweepError as error:
        error.args, error.problem = (_in_words(str(error)),), _in_words(getattr(error, "problem", ""))
        raise
    finally:
        close()
    if code == 3:  # nothing that could be used, each with its message
        raise _core.InputError("\n".join(messages) or "there is nothing that can be read")
    return Result(function, code, _in_words(text), document, frames, messages, None if path is None else Path(path_of(path, "out")), keep)
