"""A case whose inputs have errors: how often each answer is, and which input matters most."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import polars as pl

from ..options import Path
from ._shared import InputError, answers, case_of, extra, within


class Uncertainty(NamedTuple):
    """What `uncertain` finds.

    Attributes
    ----------
    answers : DataFrame
        Number and share of the draws with each answer, of those that are a case, with an interval (Clopper and Pearson).
    drivers : DataFrame
        Per driver, the draws in which it avoids the collision, of those in which an ego that never reacts collides.
    indices : DataFrame
        Per input, the first-order index, the fraction of the answer's variance that its error alone explains, ± `half_width` (95 %).
    draws : DataFrame
        Every draw with its answer; null where the numbers are no case.
    """

    answers: pl.DataFrame
    drivers: pl.DataFrame
    indices: pl.DataFrame
    draws: pl.DataFrame


def uncertain(
    case: Mapping[str, Any],
    errors: Mapping[str, Any],
    *,
    draws: int = 20_000,
    seed: int = 157,
    profile: Path = "un-r157",
) -> Uncertainty:
    """Draw the errors of a case's columns, independent of one another, and count the computed answers.

    An error is a standard deviation, of a normal distribution, or any distribution of `scipy.stats`: ``uniform(-0.5, 1.0)``. The shares
    are of the model: they do not say whether your sensors have these errors.
    """
    with extra():
        from scipy import stats
    within(1, float("inf"), draws=draws)
    case = case_of(case, errors)
    generator = np.random.default_rng(seed)
    known = {name: stats.norm(scale=error) if np.isscalar(error) else error for name, error in errors.items()}
    if absent := [name for name in known if name not in case]:
        raise InputError(f"{', '.join(absent)}: the case has no such column; it has {', '.join(case)}")
    if texts := [name for name in known if isinstance(case[name], str)]:
        raise InputError(f"{', '.join(texts)}: what has an error is a number; write the unit into the name: ego_speed_kmh")
    drawn = {name: case[name] + error.rvs(draws, random_state=generator) for name, error in known.items()}
    cases = pl.DataFrame({**case, **drawn})
    found = answers(cases, profile)
    judged = found.drop_nulls("verdict")
    conflicts = judged.filter(pl.col("verdict").is_in(["preventable", "not preventable"]))
    counts = judged["verdict"].value_counts(sort=True)
    drivers: list[str] = [name for name in ("Reg157", "CCHDM", "RSS", "FSM") if name in found.columns]
    avoiding = [conflicts.filter(pl.col(name) != "COLLIDES").height for name in drivers]
    own = answers(pl.DataFrame(case), profile)["verdict"][0]
    inputs = cases.select(list(drawn)).with_columns(is_own=found["verdict"] == own).drop_nulls()
    return Uncertainty(
        _shares("answer", counts["verdict"].to_list(), counts["count"].to_list(), judged.height),
        _shares("driver", drivers, avoiding, conflicts.height),
        _indices(inputs, seed),
        cases.with_columns(answer=found["verdict"]),
    )


def _shares(what: str, names: list[str], counts: list[int], of: int) -> pl.DataFrame:
    with extra():
        from statsmodels.stats.proportion import proportion_confint
    if not of:
        names, counts, of = [], [], 1
    low, high = proportion_confint(np.array(counts), of, method="beta")
    share = np.array(counts) / of
    return pl.DataFrame({what: names, "draws": counts, "of": of, "share": share, "low": low, "high": high})


def _indices(inputs: pl.DataFrame, seed: int) -> pl.DataFrame:
    """First-order indices of "the answer is that of the case without errors": its variance between bins of the draws.

    There are a hundred bins, or fewer of ten draws each. The index is the correlation ratio, corrected for the number of bins (Kelley's
    epsilon squared); its interval comes from 200 bootstrap samples.
    """
    names, is_own = inputs.columns[:-1], inputs["is_own"].to_numpy().astype(np.float64)
    count = len(is_own)
    if min(is_own.sum(), count - is_own.sum()) < 30:
        # Too few draws have another answer, or this one.
        return pl.DataFrame({"input": names, "index": None, "half_width": None})
    parts = min(100, count // 10)
    bins = {name: np.argsort(np.argsort(inputs[name].to_numpy())) * parts // count for name in names}

    def index(name: str, chosen: npt.NDArray[np.int64]) -> float:
        own, of = is_own[chosen], bins[name][chosen]
        sizes, hits = np.bincount(of, minlength=parts), np.bincount(of, own, minlength=parts)
        within = (hits - hits**2 / np.maximum(sizes, 1)).sum() / (count - parts)
        return float(1.0 - within / own.var(ddof=1))

    generator = np.random.default_rng(seed)
    again = [generator.integers(count, size=count) for _ in range(200)]
    spread = [1.96 * np.std([index(name, chosen) for chosen in again], ddof=1) for name in names]
    every = np.arange(count)
    return pl.DataFrame({"input": names, "index": [index(name, every) for name in names], "half_width": spread})
