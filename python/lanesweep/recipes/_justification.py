"""What a parameterization keeps: F1, hidden failures and S'/S of one driver and criterion, with a user's own limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import polars as pl

from ..options import Criterion
from . import _clusters
from ._shared import InputError, check_names, table, within


class Justification(NamedTuple):
    """What `justification` finds.

    Attributes
    ----------
    scores : DataFrame
        Recall, precision, F1 and S'/S with intervals over scenarios; `within` says whether the whole interval keeps to your limits:
        yes, no (it lies outside as a whole), or undecided.
    hidden : DataFrame
        The failures of S that S' does not have, with the outcomes of both lanes, those with the fastest contact of S first.
    """

    scores: pl.DataFrame
    hidden: pl.DataFrame


def justification(
    lanes: Any,
    parameterization: str,
    *,
    model: str,
    criterion: Criterion = "collision",
    limits: Mapping[str, tuple[float, float]] | None = None,
    level: float = 0.95,
) -> Justification:
    """Score a parameterization for a driver and a criterion, from the rows of `study(rows=…)`.

    Of a decomposition the variant `KEY-cv` is scored, whose basis has not seen the scenarios. `limits` are yours, by the
    quantity: ``{"recall": (0.9, 1.0), "S'/S": (0.8, 1.25)}``. No standard sets them.
    """
    within(0.5, 0.9999, level=level)
    rows = table(lanes, "id", "variant", "headway", "model", criterion).filter(model=model)
    known = rows["variant"].cast(pl.String)
    variant = f"{parameterization}-cv" if (known == f"{parameterization}-cv").any() else parameterization
    recorded, replayed = rows.filter(known == "S"), rows.filter(known == variant)
    both = recorded.join(replayed, on=["id", "headway"], suffix="_parameterized", validate="1:1", nulls_equal=True)
    if both.is_empty():
        raise InputError(f"the rows have no parameterization {variant} of {model}")
    one, other = pl.col(criterion), pl.col(f"{criterion}_parameterized")
    sums = {"tp": (one & other).sum(), "fn": (one & ~other).sum(), "fp": (~one & other).sum(), "runs": pl.len()}
    counts = both.group_by("id", maintain_order=True).agg(**sums)
    tp, fn, fp, runs = (counts[name].cast(pl.Int64).to_numpy() for name in sums)
    scores = _scores(tp, fn, fp, runs, level)
    check_names(limits or (), scores, "quantity")
    inside = {name: _within(scores[name], ends) for name, ends in (limits or {}).items()}
    rows_of = [(name, variant, *value, inside.get(name)) for name, value in scores.items()]
    schema = {"quantity": pl.String, "variant": pl.String, "value": pl.Float64, "low": pl.Float64, "high": pl.Float64, "within": pl.String}
    hidden = both.filter(one & ~other).sort("impact_speed_mps", "min_ttc_s", descending=[True, False], nulls_last=True)
    return Justification(pl.DataFrame(rows_of, schema, orient="row").fill_nan(None), hidden)


def _scores(
    tp: _clusters.Counts, fn: _clusters.Counts, fp: _clusters.Counts, runs: _clusters.Counts, level: float
) -> dict[str, _clusters.Estimate]:
    """Recall, precision and F1 (2J/(1 + J) with the rate of agreement J), without an interval where fewer than ten scenarios fail."""

    def share(missed: _clusters.Counts, failing: _clusters.Counts) -> _clusters.Estimate:
        value, low, high = _clusters.rate(tp, tp + missed, level)
        return (value, low, high) if (failing > 0).sum() >= _clusters.ENOUGH else (value, np.nan, np.nan)

    agreement = share(fn + fp, tp + fn)
    value, low, high = (2 * of / (1 + of) for of in agreement)
    ratio = _clusters.ratio(tp + fp, tp + fn, runs, level)
    return {"recall": share(fn, tp + fn), "precision": share(fp, tp + fp), "F1": (value, low, high), "S'/S": ratio}


def _within(estimate: _clusters.Estimate, limits: tuple[float, float]) -> str:
    _, low, high = estimate
    if low >= limits[0] and high <= limits[1]:
        return "yes"
    return "no" if high < limits[0] or low > limits[1] else "undecided"
