"""Cases around a case: inside, at and outside ranges, and on both sides of a boundary between two answers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import polars as pl

from ..options import Path
from ._shared import answers, case_of, extra, within


Points = npt.NDArray[np.float64]
#: Answers to points in units of the ranges, empty where a point is no case.
Answer = Callable[[Points], npt.NDArray[np.str_]]


def variations(
    case: Mapping[str, Any],
    ranges: Mapping[str, tuple[float, float]],
    *,
    inside: int = 64,
    edge: int = 16,
    outside: int = 16,
    boundary: int = 8,
    seed: int = 157,
    profile: Path = "un-r157",
) -> pl.DataFrame:
    """Vary columns of a case in their ranges, by a scrambled Sobol sequence. A row has an `id` and the computed `answer`.

    Cases of `edge` have one quantity at an end of its range, those of `outside` one beyond an end by up to a quarter of the range,
    the ends in turn. `boundary` is the maximum number of pairs with different answers, a thousandth of the ranges apart at most.
    Points that are no case, and repeated ends of a single range, have no row.
    """
    within(0, float("inf"), inside=inside, edge=edge, outside=outside, boundary=boundary)
    known = case_of(case, ranges)
    low, high = np.array(list(ranges.values()), dtype=np.float64).T

    def cases(places: Points) -> pl.DataFrame:
        values = (low + places * (high - low)).round(6)
        return pl.DataFrame({**known, **dict(zip(ranges, values.T, strict=True))})

    def answer(places: Points) -> npt.NDArray[np.str_]:
        return answers(cases(places), profile)["verdict"].fill_null("").to_numpy().astype(str)

    places = _places(len(ranges), inside, edge, outside, seed)
    pairs = _boundary(places[:inside], boundary, answer)
    names = [f"{of}-{k + 1}" for of, n in (("inside", inside), ("edge", edge), ("outside", outside)) for k in range(n)]
    names += [f"boundary-{k // 2 + 1}{'ab'[k % 2]}" for k in range(len(pairs))]
    places = np.vstack([places, pairs])
    found = cases(places).insert_column(0, pl.Series("id", names)).with_columns(answer=pl.Series(answer(places)))
    repeated = [f"edge-{k + 1}" for k in range(2, edge) if len(ranges) == 1]
    return found.filter(pl.col("answer") != "", ~pl.col("id").is_in(repeated))


def _places(size: int, inside: int, edge: int, outside: int, seed: int) -> Points:
    """Points inside the unit cube, then with one coordinate at an end, then with one beyond an end, the ends in turn."""
    with extra():
        from scipy.stats import qmc
    count = inside + edge + outside
    points = qmc.Sobol(size + 1, rng=seed).random_base2(max(count - 1, 0).bit_length())[:count]
    places, last = points[:, :size], points[inside:, size]
    row = np.arange(edge + outside)
    at = np.where(row < edge, row, row - edge)
    # From a tenth of the way, so that rounding does not lead back.
    beyond = np.where(row < edge, 0.0, 0.25 * (0.1 + 0.9 * last))
    places[inside + row, at % size] = np.where(at // size % 2 == 0, -beyond, 1.0 + beyond)
    return np.asarray(places)


def _boundary(points: Points, count: int, answer: Answer) -> Points:
    """Bisect between neighbours with different answers, the nearest first, each in one pair: both ends of every pair in turn."""
    if count == 0 or len(points) == 0:
        return points[:0]
    found = answer(points)
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    is_none = found == ""
    apart[(found[:, None] == found[None]) | is_none[:, None] | is_none[None]] = np.inf
    pairs: list[tuple[int, int]] = []
    while len(pairs) < count and np.isfinite(apart).any():
        one, other = divmod(int(apart.argmin()), len(points))
        apart[[one, other]], apart[:, [one, other]] = np.inf, np.inf
        pairs.append((one, other))
    at = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    ends = points[at]
    # A thousandth of the ranges. Without pairs there is nothing to bisect.
    for _ in range(10 if pairs else 0):
        middle = ends.mean(axis=1)
        is_same = answer(middle) == found[at[:, 0]]
        ends[is_same, 0], ends[~is_same, 1] = middle[is_same], middle[~is_same]
    return ends.reshape(-1, points.shape[1])
