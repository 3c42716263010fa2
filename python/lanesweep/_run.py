"""Runs verbs: keyword arguments become words of a command line."""

from __future__ import annotations

import importlib
import logging
import os
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from . import _core
from ._driver import names_of
from ._result import Result, temporary

_log = logging.getLogger("lanesweep")
_LEVELS = {"ERROR": logging.ERROR, "WARN": logging.WARNING, "INFO": logging.INFO, "DEBUG": logging.DEBUG, "TRACE": logging.DEBUG}


def on_message(level: str, line: str) -> None:
    """Pass a line of the program's log on to `logging`, under the name ``lanesweep``."""
    _log.log(_LEVELS.get(level, logging.INFO), "%s", line)


def progress() -> tuple[Callable[[str, int, int], None] | None, Callable[[], None]]:
    """Return a callback that moves a bar, and one that closes it.

    The bar is that of `tqdm` if it is installed; in a terminal or notebook only.
    """
    try:
        with warnings.catch_warnings():
            # Without ipywidgets, tqdm draws its bar as text and warns about it.
            warnings.simplefilter("ignore")
            tqdm: Any = importlib.import_module("tqdm.auto").tqdm
    except ImportError:
        return None, lambda: None
    if not (sys.stderr is not None and sys.stderr.isatty()) and "ipykernel" not in sys.modules:
        return None, lambda: None
    bar: Any = None

    def move(what: str, done: int, total: int) -> None:
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


def word(value: Any) -> str:
    """Write a value as on the command line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, os.PathLike):
        return str(os.fspath(value))
    return str(value)


def words_of(value: Any, *, is_list: bool) -> list[str]:
    """Write a value, or several, as on the command line."""
    if hasattr(value, "tolist"):
        value = value.tolist()  # of NumPy
    if isinstance(value, dict):
        value = [f"{name}={word(one)}" for name, one in value.items()]
    several = [word(value)] if isinstance(value, (str, os.PathLike)) or not isinstance(value, Sequence) else [*map(word, value)]
    return [",".join(several)] if is_list else several


def command(words: Sequence[Any]) -> tuple[int, str]:
    """Run a command line inside this process: the words after ``lanesweep``.

    Returns
    -------
    tuple of int and str
        Exit code, and what the program prints. An error is an exception.
    """
    code, text, _, _ = _run(words)
    return code, text


def _run(words: Sequence[Any]) -> tuple[int, str, str, list[str]]:
    """Run a command line; return exit code, text, document, and the lines of the log."""
    move, close = progress()
    messages: list[str] = []

    def keep(level: str, line: str) -> None:
        messages.append(line)
        on_message(level, line)

    try:
        return *_core.run([word(one) for one in words], move, keep), messages
    finally:
        close()


def run(
    verb: str,
    arguments: list[tuple[str | None, Any, bool]],
    *,
    out: Any = None,
    default_out: str | None = None,
    path: Any = None,
) -> Result:
    """Run a verb with arguments: flag (None for a position), value, whether it is a comma-separated list.

    The files of the result are in `out`, in a temporary `default_out`, or in `path`, which is an argument.
    """
    words: list[str] = verb.split()
    positions: list[str] = []
    for flag, value, is_list in arguments:
        value = value.item() if hasattr(value, "item") and getattr(value, "ndim", None) == 0 else value
        if value is None or value is False or (isinstance(value, (list, tuple)) and not value):
            continue
        if flag is None:
            positions += words_of(value, is_list=False)
        elif value is True:
            words.append(f"--{flag}")
        else:
            given = names_of(value) if flag == "models" else value
            words += [f"--{flag}={one}" for one in words_of(given, is_list=is_list)]
    keep = None
    if out is None and default_out is not None:
        keep = temporary()
        out = Path(keep.name) / default_out
    if out is not None:
        path = out
        words.append(f"--out={os.fspath(out)}")
    if positions:
        words += ["--", *positions]
    code, text, document, messages = _run(words)
    return Result(verb, code, text, document, messages, None if path is None else Path(os.fspath(path)), keep)
