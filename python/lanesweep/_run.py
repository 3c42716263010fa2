"""Runs verbs: keyword arguments become words of a command line."""

from __future__ import annotations

import functools
import importlib
import json
import keyword
import logging
import numbers
import os
import sys
import warnings
from collections.abc import Callable, KeysView, Mapping, Sequence, Set, ValuesView
from pathlib import Path
from typing import Any

from . import _core
from ._driver import names_of, refresh
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


def path_of(value: Any, name: str) -> str:
    """Write the path of an argument."""
    try:
        return str(os.fspath(value))
    except TypeError as error:
        raise TypeError(f"`{name}`: {error}") from None


def words_of(value: Any, name: str, *, is_list: bool) -> list[str]:
    """Write the value of an argument, or several values, as on the command line."""
    if hasattr(value, "tolist"):
        # Of NumPy and pandas. A text has the digits of its arithmetic: 0.6 of binary32, not 0.6000000238418579.
        value = [str(one) for one in value] if str(getattr(value, "dtype", "")) == "float32" else value.tolist()
    if isinstance(value, (Set, range, KeysView, ValuesView)):
        value = list(value)
    is_several = isinstance(value, (Mapping, Sequence)) and not isinstance(value, (str, bytes))
    several = list(value) if is_several else [value]
    if not several:
        raise ValueError(f"`{name}` is empty; give at least one value, or leave it out")
    for one in value.values() if isinstance(value, Mapping) else several:
        if not isinstance(one, (str, bool, numbers.Number, os.PathLike)):
            wants = "give a number, a text or a path" + (", or a list of these" if one is value else "")
            raise TypeError(f"`{name}` {'holds' if is_several else 'is'} {one!r:.80}; {wants}")
    if isinstance(value, Mapping):
        several = [f"{key}={word(one)}" for key, one in value.items()]
    words = [word(one) for one in several]
    return [",".join(words)] if is_list else words


@functools.lru_cache(maxsize=1)
def _definition() -> dict[str, list[dict[str, Any]]]:
    """The arguments of every verb."""
    return {str(verb["verb"]): verb["arguments"] for verb in json.loads(_core.definition())}


def name_of(verb: str, flag: str | None) -> str:
    """The name of an argument; that of a position is not known by its flag."""
    if flag is None:
        flag = next(str(one["id"]) for one in _definition()[verb] if one["flag"] is None)
        flag = ("folder" if verb in ("synth", "cluster merge") else "recordings") if flag == "dir" else flag
    name = flag.replace("-", "_")
    return name + "_" if keyword.iskeyword(name) else name


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

    refresh(map(word, words))
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
        if value is False and any(one["takes_value"] for one in _definition()[verb] if one["flag"] == flag):
            raise TypeError(f"`{name_of(verb, flag)}` is False; give a value, or leave it out")
        if value is None or value is False:
            continue
        if flag is None:
            positions += words_of(value, name_of(verb, flag), is_list=False)
        elif value is True:
            words.append(f"--{flag}")
        else:
            given = names_of(value) if flag == "models" else value
            words += [f"--{flag}={one}" for one in words_of(given, name_of(verb, flag), is_list=is_list)]
    keep = None
    if out is None and default_out is not None:
        keep = temporary()
        out = Path(keep.name) / default_out
    if out is not None:
        path = out
        words.append(f"--out={path_of(out, 'out')}")
    if positions:
        words += ["--", *positions]
    code, text, document, messages = _run(words)
    return Result(verb, code, text, document, messages, None if path is None else Path(os.fspath(path)), keep)
