"""A linear description that is found for the outcomes: a decomposition whose weights CMA-ES tunes through `study(external=…)`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import polars as pl

from .. import _verbs
from ..options import Criterion
from ._shared import InputError, check_names, extra, quiet, table


Array = npt.NDArray[np.float64]
INSTANTS, KNOTS = 50, 4
#: Series and numbers of a category, by the columns of scenarios; `T` is the duration, s.
_LAYOUT: dict[str, tuple[list[str], list[str]]] = {
    "cut_in": (["target_y", "target_v"], ["ego_v0", "T"]),
    "cut_out": (["target_y", "target_v", "lead_v"], ["ego_v0", "D", "T"]),
    "lvd": (["target_v"], ["T"]),
}
_SIZES = ["id", "category", "side", "lane_width", "ego_length", "ego_width", "target_length", "target_width"]


class Description(NamedTuple):
    """A scenario as `size` numbers: z = (mean + Σ c_j·direction_j)/weights, with the series at 50 instants, then the numbers."""

    weights: Array
    mean: Array
    directions: Array


def fit_description(scenarios: Any, size: int, emphasis: npt.ArrayLike | None = None) -> Description:
    """Decompose scenarios of one category (singular values) with weights times exp(emphasis): 4 knots per series, one per number."""
    rows = table(scenarios, "category", "target_v", "fps")
    return _fit(vectors(rows), _category(rows), size, emphasis)


def replayed(description: Description, scenarios: Any) -> pl.DataFrame:
    """Return scenarios as the description keeps them: an S' for `study(external=…)`."""
    rows = table(scenarios, "category", "target_v", "fps")
    return of_vectors(_decoded(description, vectors(rows)), rows)


def found_emphasis(
    scenarios: Any, size: int, *, criterion: Criterion = "ttc", evaluations: int = 600, seed: int = 157
) -> tuple[Array, float]:
    """Search the emphasis with the largest F1, cross-validated, mean over the drivers for which S fails in ten scenarios.

    `scenarios` are kept ones of one category. CMA-ES proposes; a call of `study` scores a generation of twelve. The F1 of the best is too
    good for what was chosen: quote that of scenarios which the search has not seen.
    """
    with extra():
        import cma
    check_names([criterion], ["collision", "ttc", "btn"], "criterion")
    rows = table(scenarios, "category", "target_v", "fps")
    z, category = vectors(rows), _category(rows)
    series, numbers = _LAYOUT[category]
    folds = table(_verbs.study(scenarios=rows).table("folds"))
    fold = rows.join(folds, on="id", how="left", maintain_order="left")["fold"].to_numpy()
    start = [0.0] * (KNOTS * len(series) + len(numbers))
    search = cma.CMAEvolutionStrategy(start, 0.7, {"popsize": 12, "seed": seed, "bounds": [-8, 8], "verbose": -9})
    best: tuple[Array, float] = (np.array(start), 0.0)
    for _ in range(max(evaluations // 12, 1)):
        points = search.ask()
        decoded = np.empty((len(points), *z.shape))
        for at, point in enumerate(points):
            for one in np.unique(fold):
                is_own = fold == one
                decoded[at, is_own] = _decoded(_fit(z[~is_own], category, size, point), z[is_own])
        scores = _scores(rows, {f"p{at}": of_vectors(of, rows) for at, of in enumerate(decoded)}, criterion)
        search.tell(points, [1.0 - score for score in scores])
        if max(scores) > best[1]:
            best = (np.asarray(points[int(np.argmax(scores))]), max(scores))
    return best


def _fit(z: Array, category: str, size: int, emphasis: npt.ArrayLike | None) -> Description:
    series, numbers = _LAYOUT[category]
    parts = z[:, : -len(numbers)].reshape(len(z), len(series), INSTANTS)
    # Positions on one side have the distance from the middle of the lane as their unit, not their own spread.
    is_lateral = np.array([[name == "target_y"] for name in series])
    spread = np.sqrt(((parts - np.where(is_lateral, 0.0, parts.mean(axis=0))) ** 2).mean(axis=0)).mean(axis=1)
    # A number that is the same in all scenarios has no spread.
    spread, spreads = (np.maximum(of, 1e-9) for of in (spread, z[:, -len(numbers) :].std(axis=0)))
    weights = np.r_[np.repeat(1.0 / (INSTANTS * spread), INSTANTS), 1.0 / spreads]
    if emphasis is not None:
        theta = np.asarray(emphasis, dtype=np.float64)
        knots = theta[: -len(numbers)].reshape(len(series), KNOTS)
        at = np.linspace(0, KNOTS - 1, INSTANTS)
        weights *= np.exp(np.r_[np.concatenate([np.interp(at, range(KNOTS), of) for of in knots]), theta[-len(numbers) :]])
    mean = (z * weights).mean(axis=0)
    centred = z * weights - mean
    # Right singular vectors, the largest first.
    return Description(weights, mean, np.linalg.eigh(centred.T @ centred).eigenvectors[:, ::-1][:, :size].T)


def _decoded(description: Description, z: Array) -> Array:
    weights, mean, directions = description
    return np.asarray((mean + (z * weights - mean) @ directions.T @ directions) / weights)


def _category(rows: pl.DataFrame) -> str:
    found = rows["category"].unique().to_list()
    check_names(found, _LAYOUT, "category")
    if len(found) != 1:
        raise InputError(f"there are scenarios of {', '.join(map(str, found))}\n  help: give those of one category")
    return str(found[0])


def of_vectors(z: Array, scenarios: Any) -> pl.DataFrame:
    """Return the scenarios of `vectors` that were changed, with the sizes and sides of the scenarios: an S' for `study(external=…)`."""
    rows = table(scenarios, "category", "target_v", "fps")
    category = _category(rows)
    series, numbers = _LAYOUT[category]
    z, expected = np.asarray(z, dtype=np.float64), (rows.height, INSTANTS * len(series) + len(numbers))
    if z.shape != expected:
        raise InputError(f"the vectors have the shape {z.shape}; expected {expected}, as `vectors` makes them")
    found = {name: z[:, INSTANTS * at : INSTANTS * (at + 1)] for at, name in enumerate(series)}
    found |= {name: z[:, at - len(numbers)] for at, name in enumerate(numbers)}
    # A vehicle does not drive backwards, and a motion lasts.
    found = {name: of if name == "target_y" else np.maximum(of, 0.0) for name, of in found.items()}
    found["fps"] = (INSTANTS - 1) / np.maximum(found.pop("T"), 0.1)
    sizes = list(_SIZES)
    if category == "lvd":
        found |= {"target_y": np.zeros((len(z), INSTANTS)), "ego_v0": found["target_v"][:, 0]}
    if category == "cut_out":
        found["lead_y"] = np.zeros((len(z), INSTANTS))
        sizes += ["lead_length", "lead_width"]
    return rows.select(sizes).with_columns(pl.Series(name, of.tolist()) for name, of in found.items())


def _scores(rows: pl.DataFrame, described: Mapping[str, pl.DataFrame], criterion: Criterion) -> list[float]:
    """Mean F1 of every S' over the drivers for which S fails in ten scenarios."""
    # A bad proposal jumps sideways, and is scored all the same.
    with quiet():
        study = _verbs.study(scenarios=rows, external=described, accept_implausible=True, config={"study": {"folds": 1}})
    judged = table(study.table("results")).filter((pl.col("criterion") == criterion) & (pl.col("failing_scenarios") >= 10))
    if judged.is_empty():
        raise InputError(f"no driver fails in ten of these scenarios ({criterion})\n  help: give more scenarios, or another criterion")
    means = judged.group_by("variant").agg(pl.col("f1").fill_null(0.0).mean())
    by_name = dict(means.iter_rows())
    return [float(by_name[name]) for name in described]


def vectors(scenarios: Any) -> Array:
    """Return scenarios of one category as vectors, a row each: the series at 50 equidistant instants, then the numbers of the category."""
    rows = table(scenarios, "category", "target_v", "fps")
    series, numbers = _LAYOUT[_category(rows)]

    def sampled(values: list[float]) -> Array:
        return np.interp(np.linspace(0, len(values) - 1, INSTANTS), np.arange(len(values)), values)

    parts = [np.array([sampled(values) for values in rows[name].to_list()]) for name in series]
    duration = (rows["target_v"].list.len().to_numpy() - 1.0) / rows["fps"].to_numpy()
    return np.column_stack([*parts, *(duration if name == "T" else rows[name].to_numpy() for name in numbers)])
