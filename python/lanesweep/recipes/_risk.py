"""Risk by parameterization: failure rates of several densities, and ratios of rates."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from .. import _verbs
from .._result import Result
from ..options import Path
from . import _clusters
from ._shared import extra, table

if TYPE_CHECKING:
    import polars as pl


def risk(densities: Result | Mapping[str, Path], **options: Any) -> pl.DataFrame:
    """Sample every density of a fit, or densities by their names, and return the estimates of all with the name of the density.

    `options` are those of `sample`. `replayed_ratio` is S'/S, the error of the parameterization itself; `sampled_ratio` is the rate of
    the density over that of the recorded scenarios, P/S. Both have intervals over scenarios (`…_low`, `…_high`).
    """
    with extra():
        import polars as pl
    named = densities.densities if isinstance(densities, Result) else densities
    estimates = [
        table(_verbs.sample(density, **options).table("estimates")).insert_column(0, pl.lit(name).alias("name"))
        for name, density in named.items()
    ]
    return pl.concat(estimates, how="diagonal_relaxed")


def failure_ratio(one: Any, other: Any, *, criterion: str = "collision", by: str = "sample", level: float = 0.95) -> pl.DataFrame:
    """Divide the failure rates of two drivers or profiles on the same cases, with an interval over samples, per headway and of all.

    Both are rows of `sample(rows=…)` with the same seed, or parts of them: ``rows.filter(model="FSM")``. Of `study` rows give
    ``by="id"``.
    """
    with extra():
        import polars as pl
    first, second = (table(rows) for rows in (one, other))
    if any(rows["model"].n_unique() > 1 for rows in (first, second) if "model" in rows.columns):
        raise ValueError("a side has several drivers: filter its rows by model")
    both = first.join(second, on=[by, "headway"], suffix="_other", validate="1:1", nulls_equal=True)
    if both.is_empty() or both.height < max(first.height, second.height):
        raise ValueError("the two have other cases: give one driver each, of one seed")
    found = []
    for name, part in [("all", both), *((str(key[0]), of) for key, of in both.group_by("headway", maintain_order=True))]:
        sums = part.group_by(by, maintain_order=True).agg(pl.col(criterion, f"{criterion}_other").cast(pl.Int64).sum(), runs=pl.len())
        above, below, runs = (sums[of].cast(pl.Int64).to_numpy() for of in (criterion, f"{criterion}_other", "runs"))
        found.append((name, *_clusters.ratio(above, below, runs, level)))
    return pl.DataFrame(found, schema=["headway", "ratio", "low", "high"], orient="row", schema_overrides={"headway": pl.String})
