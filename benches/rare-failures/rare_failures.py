"""Rare failures with known probability, as functions that any library of reliability analysis can call.

>>> from rare_failures import cases
>>> case = cases()[0]
>>> case.limit(numpy.zeros((1, case.dimensions)))   # ≤ 0 fails; rows are independent standard normal numbers

A textbook case needs NumPy; a case on lanes needs the module lanesweep too. `probability` is the truth in the standard normal
space: of a case on lanes, the truth of the density times `valid_share`, because invalid points do not fail.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

FOLDER = Path(__file__).parent
Limit = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Case:
    """A limit state over independent standard normal numbers, and its probability of failure."""

    name: str
    dimensions: int
    limit: Limit
    probability: float
    #: One standard error of the probability, relative; 0 by quadrature.
    relative_error: float
    #: Fraction of the failures around the second of the kernels that carry most; None of a textbook problem.
    second_share: float | None


def _plane(x: np.ndarray) -> np.ndarray:
    return 4.753424308822899 - x.sum(axis=1) / math.sqrt(x.shape[1])


def _four_modes(x: np.ndarray) -> np.ndarray:
    return 4.5 - np.abs(x[:, :2]).max(axis=1)


def _four_branches(near: float, far: float) -> Limit:
    def limit(x: np.ndarray) -> np.ndarray:
        u, v = (x[:, 0] + x[:, 1]) / math.sqrt(2), (x[:, 0] - x[:, 1]) / math.sqrt(2)
        return np.minimum(near + 0.2 * v**2 - np.abs(u), far - np.abs(v))

    return limit


def _parabola(x: np.ndarray) -> np.ndarray:
    return 5.0 - x[:, 1] - 0.5 * (x[:, 0] - 0.1) ** 2


def _metaball(x: np.ndarray) -> np.ndarray:
    a = 4.0 * (x[:, 0] + 2.0) ** 2 / 9.0 + x[:, 1] ** 2 / 25.0
    b = (x[:, 0] - 2.5) ** 2 / 4.0 + (x[:, 1] - 0.5) ** 2 / 25.0
    return 30.0 / (a**2 + 1.0) + 20.0 / (b**2 + 1.0) - 5.0


def _needle(x: np.ndarray) -> np.ndarray:
    return np.hypot(x[:, 0] - 4.0, x[:, 1]) - 0.3


TEXTBOOK: dict[str, Limit] = {
    "plane": _plane,
    "four_modes": _four_modes,
    "four_branches_3": _four_branches(3.0, 3.5),
    "four_branches_5": _four_branches(5.0, 5.2),
    "parabola": _parabola,
    "metaball": _metaball,
    "needle": _needle,
}


def _on_lanes(row: dict[str, str]) -> tuple[int, Limit, float]:
    import lanesweep

    path = FOLDER / "densities" / row["density"]
    state: Any = lanesweep.LimitState(path, model=row["model"], criterion=row["criterion"], thw=float(row["thw_s"]))

    def limit(u: np.ndarray) -> np.ndarray:
        values = state(state.from_standard_normal(u))
        # Libraries take means of values; far from any failure is far enough.
        return np.minimum(values, 1e3)

    return len(state.parameters), limit, state.valid_share


def cases(name: str = "", *, textbook: bool = True, lanes: bool = True) -> list[Case]:
    """The cases whose name contains `name`."""
    found = []
    with (FOLDER / "cases.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            is_textbook = row["density"].startswith("standard normal")
            if name not in row["case"] or not (textbook if is_textbook else lanes):
                continue
            share = 1.0
            if is_textbook:
                dimensions, limit = int(row["density"].split()[-1]), TEXTBOOK[row["model"]]
            else:
                dimensions, limit, share = _on_lanes(row)
            second = float(row["second_share"]) if row["second_share"] else None
            probability = share * float(row["truth"])
            found.append(Case(row["case"], dimensions, limit, probability, float(row["relative_error"]), second))
    return found
