"""Results of verbs: a folder of tables, figures and records."""

from __future__ import annotations

import csv
import html
import json
import os
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np

from ._core import Frame, frame_of_columns, frame_of_records

#: What the exit code of a result means; other codes are exceptions.
STATUS = {
    1: "not preventable",
    4: "incomplete",
    8: "undecided",
    9: "no conflict",
    10: "outside Annex 3",
}

#: The word of a function whose result answers a question.
_ANSWERS = {"check": "preventable"}

#: Columns whose values are names, even where all of them look like numbers.
_NAMES = {"id", "scenario", "variant", "headway", "category", "model", "criterion", "lane", "claim"}


class Figure:
    """A figure in SVG; notebooks show it."""

    def __init__(self, path: Path, keep: Any = None) -> None:
        self.path = path
        self._keep = keep

    @property
    def svg(self) -> str:
        return self.path.read_text(encoding="utf-8")

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the figure to a file."""
        target = Path(path)
        target.write_text(self.svg, encoding="utf-8")
        return target

    def plot(self) -> Any:
        """Draw the numbers of the figure with Matplotlib, a panel each.

        Returns
        -------
        matplotlib.figure.Figure
            To change and to save as PNG or PDF.
        """
        import matplotlib.pyplot as plt

        numbers = self.path.parent.parent / "tables" / f"{self.path.stem}.csv"
        if not numbers.is_file():
            raise ValueError(f"{self.path.name} has no numbers beside it; `svg` is the figure")
        header, *rows = _rows(numbers)
        records = [dict(zip(header, row, strict=True)) for row in rows]
        panels = list(dict.fromkeys(record["panel"] for record in records))
        columns = min(len(panels), 3)
        figure, axes = plt.subplots(
            -(-len(panels) // columns), columns, squeeze=False, figsize=(4 * columns + 2, 3.5 * -(-len(panels) // columns)), layout="constrained"
        )
        for axis in axes.flat[len(panels) :]:
            axis.remove()
        for panel, axis in zip(panels, axes.flat, strict=False):
            own = [record for record in records if record["panel"] == panel]
            names = list(dict.fromkeys(record["row"] for record in own if record["row"]))
            for name in dict.fromkeys(record["series"] for record in own):
                series = [record for record in own if record["series"] == name]
                # Rows with a name have their place on the other axis.
                x = [float(record["x"]) for record in series]
                y = [float(record["y"] or -names.index(record["row"])) for record in series]
                axis.errorbar(x, y, _bars(series, "y", y), _bars(series, "x", x), fmt="o" if names else "o-", markersize=4, label=name)
            if names and not own[0]["y"]:
                axis.set_yticks([-at for at in range(len(names))], names)
            axis.set(title=panel, xlabel=own[0]["x_quantity"], ylabel=own[0]["y_quantity"])
        axes.flat[0].legend(fontsize="small")
        # What the figure says of itself, synthetic data first of all.
        said = [re.search(f"<{tag}>(.*?)</{tag}>", self.svg, re.DOTALL) for tag in ("title", "desc")]
        title, about = (html.unescape(found[1]) if found else "" for found in said)
        figure.suptitle("\n".join(filter(None, [title, about.split(". ")[0], "SYNTHETIC DATA" * ("SYNTHETIC" in about)])), fontsize="medium")
        return figure

    def _repr_svg_(self) -> str:
        return self.svg

    def __repr__(self) -> str:
        return f"Figure({self.path.name!r})"


def _bars(rows: list[dict[str, str]], axis: str, at: list[float]) -> Any:
    """Distances to the ends of intervals, as Matplotlib takes them; none without any."""
    if not any(row[f"{axis}_low"] for row in rows):
        return None
    ends = [[float(row[f"{axis}_{end}"] or value) for row, value in zip(rows, at, strict=True)] for end in ("low", "high")]
    return np.abs(np.array(ends) - np.array(at))


class Result:
    """What a verb leaves: status, text, a document, and a folder with tables, figures and a page.

    A result without `out` lives in a temporary folder, which goes with the object; `save` keeps a copy. Where a function
    takes a file or folder, a result can be given: it stands for its own.

    Attributes
    ----------
    status : str
        The answer of `check` (``"preventable"``, …); else ``"ok"``; ``"incomplete"`` if parts of the input were left out.
    text : str
        The result for people, as the command line prints it; `print` shows it.
    document : dict
        What ``--format json`` prints: the record of the run, or its numbers.
    messages : list of str
        Lines of the log: what was found, and what was left out.
    path, folder : Path or None
        File or folder of the result; the folder of its files.
    """

    def __init__(
        self, verb: str, code: int, text: str, document: str, messages: list[str], path: Path | None, keep: Any
    ) -> None:
        self.verb = verb
        self.status = _ANSWERS.get(verb, "ok") if code == 0 else STATUS.get(code, str(code))
        self.text = text or "\n".join(messages)
        self.messages = messages
        self.path = path
        self._keep = keep
        self._json = document
        self._document: dict[str, Any] | None = None

    @property
    def folder(self) -> Path | None:
        return self.path if self.path is not None and self.path.is_dir() else None

    @property
    def document(self) -> dict[str, Any]:
        if self._document is None:
            found = json.loads(self._json or "{}", object_hook=_with_infinity)
            self._document = found if isinstance(found, dict) else {"rows": found}
        return self._document

    @property
    def densities(self) -> dict[str, Path]:
        """Density files of a fit, by category and parameterization: ``"cut-in-2"``."""
        if self.verb != "fit" or self.path is None:
            return {}
        found = self._files("*.json") if self.path.is_dir() else iter([self.path])
        return {path.stem: path for path in sorted(found) if not path.name.startswith("lanesweep-")}

    @property
    def tables(self) -> list[str]:
        """Names of the tables: of the document, and of the folder's CSV files."""
        in_document = [key for key, value in self.document.items() if _is_table(value)]
        in_folder = sorted(path.stem for path in self._files("*.csv"))
        return in_document + [name for name in in_folder if name not in in_document]

    def table(self, name: str) -> Frame:
        """Return a table as a frame."""
        value = self.document.get(name)
        path = next((path for path in self._files("*.csv") if path.stem == name), None)
        has_file = path is not None
        # Types are those of the document, unless its rows hold more than values.
        if _is_table(value) and not (has_file and any(isinstance(one, dict) for row in value for one in row.values())):
            header, *rows = _rows(path) if path is not None and has_file else [[]]
            # What the file says of the data as a whole: that they are synthetic.
            said = {name: rows[0][at] for at, name in enumerate(header) if name == "data" and rows and name not in value[0]}
            return frame_of_records(_json([row | said for row in value]), header)
        if path is None or not has_file:
            raise KeyError(f"there is no table `{name}`; there are {', '.join(self.tables)}")
        return _read_csv(path)

    @property
    def figures(self) -> list[str]:
        """Names of the figures."""
        return sorted(path.stem for path in self._files("*.svg"))

    def figure(self, name: str) -> Figure:
        """Return a figure."""
        path = next((path for path in self._files("*.svg") if path.stem == name), None)
        if path is None:
            raise KeyError(f"there is no figure `{name}`; there are {', '.join(self.figures)}")
        return Figure(path, self._keep)

    def save(self, folder: str | os.PathLike[str]) -> Path:
        """Copy the files into a new folder."""
        import shutil

        if self.path is None:
            raise ValueError(f"{self.verb} leaves no files")
        target = Path(folder)
        if self.path.is_dir():
            shutil.copytree(self.path, target)
        else:
            shutil.copy2(self.path, target)
        return target

    def _files(self, pattern: str) -> Iterator[Path]:
        return self.folder.rglob(pattern) if self.folder is not None else iter(())

    def __fspath__(self) -> str:
        if self.path is None:
            raise TypeError(f"the result of {self.verb} has no file")
        if self.densities:
            # Where a fit is given, a density is expected.
            if len(self.densities) > 1:
                names = ", ".join(self.densities)
                raise TypeError(f"the fit has several densities: give one of them, as result.densities[name]: {names}")
            return str(next(iter(self.densities.values())))
        return str(self.path)

    def __repr__(self) -> str:
        at = f", {str(self.path)!r}" if self.path is not None else ""
        return f"<lanesweep {self.verb}: {self.status}{at}>"

    def __str__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        page = self.path / "report.html" if self.path is not None else None
        if page is not None and page.is_file():
            source = html.escape(page.read_text(encoding="utf-8"), quote=True)
            return f'<iframe srcdoc="{source}" style="width:100%;height:40em;border:0" sandbox="allow-scripts"></iframe>'
        return f"<pre>{html.escape(self.text)}</pre>"


def _is_table(value: Any) -> TypeGuard[list[dict[str, Any]]]:
    return isinstance(value, list) and bool(value) and all(isinstance(row, dict) for row in value)


def _with_infinity(record: dict[str, Any]) -> dict[str, Any]:
    """Read infinite numbers, which JSON has not and the program writes as texts."""
    infinite = {"Infinity": float("inf"), "-Infinity": float("-inf")}
    return {key: infinite.get(value, value) if isinstance(value, str) else value for key, value in record.items()}


def _json(records: list[dict[str, Any]]) -> str:
    """Write records as the program does."""
    infinite = {float("inf"): "Infinity", float("-inf"): "-Infinity"}

    def finite(value: Any) -> Any:
        return infinite.get(value, value) if isinstance(value, float) else value

    return json.dumps([{key: finite(value) for key, value in record.items()} for record in records])


def _rows(path: str | os.PathLike[str]) -> list[list[str]]:
    """Header and rows of a CSV file."""
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.reader(file))


def _typed(values: list[str]) -> list[Any]:
    """Read a column of texts as whole numbers or numbers, if all of them are. Empty or NaN is no value."""
    for read in (int, float):
        try:
            return [None if value in ("", "NaN") else read(value) for value in values]
        except ValueError:
            continue
    return [value or None for value in values]


def _read_csv(path: str | os.PathLike[str]) -> Frame:
    """Read a CSV table that lanesweep wrote."""
    header, *rows = _rows(path)
    columns = {}
    for at, name in enumerate(header):
        texts = [row[at] for row in rows]
        # Our files protect texts that a spreadsheet would take for a formula.
        texts = [text[1:] if text[:1] == "'" and text[1:2] in "'=+-@\t\r" else text for text in texts]
        columns[name] = [text or None for text in texts] if name in _NAMES else _typed(texts)
    records = [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]
    if not records:
        return frame_of_columns({name: [] if name in _NAMES else np.empty(0) for name in header})
    return frame_of_records(_json(records), header)


def temporary() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="lanesweep-", ignore_cleanup_errors=True)
