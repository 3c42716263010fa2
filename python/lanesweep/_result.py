"""Results of verbs: a folder of tables, figures and records."""

from __future__ import annotations

import functools
import html
import json
import os
import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from ._core import Frame

#: What the exit code of a result means; other codes are exceptions.
STATUS = {1: "not preventable", 4: "incomplete", 8: "undecided", 9: "no conflict", 10: "outside Annex 3"}


class Figure:
    """A figure in SVG; notebooks show it. It has a `path`, and its `numbers` as a table if it has any."""

    def __init__(self, path: Path, numbers: Frame | None = None, keep: Any = None) -> None:
        self.path = path
        self.numbers = numbers
        self._keep = keep

    @property
    def svg(self) -> str:
        return self.path.read_text(encoding="utf-8")

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the figure to a file: SVG, or what Matplotlib makes of the numbers, by the ending of the name."""
        target = Path(path)
        if target.suffix.lower() == ".svg":
            target.write_text(self.svg, encoding="utf-8")
        else:
            self.plot().savefig(target)
        return target

    def plot(self) -> Any:
        """Draw the numbers of the figure with Matplotlib, a panel each.

        Returns
        -------
        matplotlib.figure.Figure
            To change and to save as PNG or PDF.
        """
        import matplotlib.pyplot as plt

        if self.numbers is None:
            raise ValueError(f"{self.path.name} has no numbers beside it; `svg` is the figure")
        table = self.numbers.to_numpy()
        panels = list(dict.fromkeys(table["panel"]))
        columns = min(len(panels), 3)
        rows = -(-len(panels) // columns)
        figure, axes = plt.subplots(rows, columns, squeeze=False, figsize=(4 * columns + 2, 3.5 * rows + 1), layout="constrained")
        for axis in axes.flat[len(panels) :]:
            axis.remove()
        for panel, axis in zip(panels, axes.flat, strict=False):
            own = {key: values[table["panel"] == panel] for key, values in table.items()}
            names = list(dict.fromkeys(filter(None, own["row"])))
            for name in dict.fromkeys(own["series"]):
                of = {key: values[own["series"] == name] for key, values in own.items()}
                # Rows with a name have their place on the other axis.
                y = [-names.index(row) if np.isnan(value) else value for row, value in zip(of["row"], of["y"], strict=True)]
                ends = np.abs(np.array([of["x_low"], of["x_high"]]) - of["x"])
                bars = None if np.isnan(ends[0]).all() else np.nan_to_num(ends)
                axis.errorbar(of["x"], y, xerr=bars, fmt="o" if names else "o-", markersize=4, label=name)
            if names and np.isnan(own["y"][0]):
                axis.set_yticks([-at for at in range(len(names))], names)
            axis.set(title=panel, xlabel=own["x_quantity"][0], ylabel=own["y_quantity"][0])
        figure.legend(*axes.flat[0].get_legend_handles_labels(), loc="outside lower center", ncols=columns, fontsize="small")
        # What the figure says of itself, synthetic data first of all.
        said = [re.search(f"<{tag}>(.*?)</{tag}>", self.svg, re.DOTALL) for tag in ("title", "desc")]
        title, about = (html.unescape(found[1]) if found else "" for found in said)
        figure.suptitle("\n".join(filter(None, [title, about.split(". ")[0], "SYNTHETIC DATA" * ("SYNTHETIC" in about)])), fontsize="medium")
        return figure

    def _repr_svg_(self) -> str:
        return self.svg

    def __repr__(self) -> str:
        return f"Figure({self.path.name!r})"


class _Kept(type(Path())):  # type: ignore[misc]
    """A path whose temporary folder stays with it."""

    keep: Any = None


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
        self, verb: str, code: int, text: str, document: str, tables: list[tuple[str, Frame]], messages: list[str], path: Path | None, keep: Any
    ) -> None:
        self.verb = verb
        self.status = STATUS.get(code, str(code)) if code else "preventable" if verb == "check" else "ok"
        self.text = text or "\n".join(messages)
        self.messages = messages
        self.path = path
        self._keep = keep
        self._json = document
        self._tables = dict(tables)

    @property
    def folder(self) -> Path | None:
        return self.path if self.path is not None and self.path.is_dir() else None

    @functools.cached_property
    def document(self) -> dict[str, Any]:
        found = json.loads(self._json or "{}", object_hook=_with_infinity)
        return found if isinstance(found, dict) else {"rows": found}

    @property
    def densities(self) -> dict[str, Path]:
        """Density files of a fit, by category and parameterization: ``"cut-in-2"``."""
        if self.verb != "fit" or self.path is None:
            return {}
        found = self.path.rglob("*.json") if self.path.is_dir() else [self.path]
        kept = [_Kept(path) for path in sorted(found) if not path.name.startswith("lanesweep-")]
        for path in kept:
            path.keep = self._keep
        return {path.stem: path for path in kept}

    @property
    def tables(self) -> list[str]:
        """Names of the tables."""
        return list(self._tables)

    def table(self, name: str) -> Frame:
        """Return a table; its columns, types and units are the same whatever its values."""
        if name not in self._tables:
            raise KeyError(f"there is no table `{name}`; there are {', '.join(self.tables) or 'none'}")
        return self._tables[name]

    @property
    def figures(self) -> list[str]:
        """Names of the figures."""
        return sorted(self._figures())

    def figure(self, name: str) -> Figure:
        """Return a figure."""
        paths = self._figures()
        if name not in paths:
            raise KeyError(f"there is no figure `{name}`; there are {', '.join(self.figures)}")
        return Figure(paths[name], self._tables.get(name), self._keep)

    def _figures(self) -> dict[str, Path]:
        return {path.stem: path for path in self.folder.rglob("*.svg")} if self.folder is not None else {}

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


def _with_infinity(record: dict[str, Any]) -> dict[str, Any]:
    """Read infinite numbers, which JSON has not and the program writes as texts."""
    infinite = {"Infinity": float("inf"), "-Infinity": float("-inf")}
    return {key: infinite.get(value, value) if isinstance(value, str) else value for key, value in record.items()}


def temporary() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="lanesweep-", ignore_cleanup_errors=True)
