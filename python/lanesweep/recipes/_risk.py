"""Risk by parameterization: failure rates of several densities, and ratios of rates."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import polars as pl

from .. import _verbs
from .._result import Result
from ..options import Criterion
from ..options import Path as PathLike
from . import _clusters
from ._shared import InputError, UsageError, table, within


def risk(densities: PathLike | Mapping[str, PathLike], **options: Any) -> pl.DataFrame:
    """Sample every density of a fit, or densities by their names, and return the estimates of all with the name of the density.

    `options` are those of `sample`; of several densities, each has `rows`, `failures` and `out` with its name: ``rows-cut-in-2.parquet``.
    `replayed_ratio` is S'/S, the error of the parameterization itself; `sampled_ratio` is the rate of the density over that of the
    recorded scenarios, P/S. Both have intervals over scenarios (`…_low`, `…_high`).
    """
    of_fit = densities.densities if isinstance(densities, Result) else densities
    named = of_fit if isinstance(of_fit, Mapping) else {Path(of_fit).stem: of_fit}
    if not named:
        raise UsageError("`densities` has none\n  help: give a fit, a density file, or several by their names")
    files = {key: Path(options[key]) for key in ("rows", "failures", "out") if options.get(key) is not None and len(named) > 1}
    estimates = []
    for name, density in named.items():
        own = options | {key: of.with_stem(f"{of.stem}-{name}") for key, of in files.items()}
        estimates.append(table(_verbs.sample(density, **own).table("estimates")).insert_column(0, pl.lit(name).alias("name")))
    return pl.concat(estimates, how="diagonal_relaxed")


def failure_ratio(one: Any, other: Any, *, criterion: Criterion = "collision", by: str = "sample", level: float = 0.95) -> pl.DataFrame:
    """Divide the failure rates of two drivers or profiles on the same cases, with an interval over samples, per headway and of all.

    Both are rows of `sample(rows=…)` of one density with the same seed, or parts of them: ``rows.filter(model="FSM")``. Of `study` rows give
    ``by="id"``.
    """
    within(0.5, 0.9999, level=level)
    first, second = (table(rows, by, "headway", criterion) for rows in (one, other))
    if any(rows.select(by, "headway").is_duplicated().any() for rows in (first, second)):
        raise InputError(f"a side has several lanes of one {by} and headway\n  help: filter its rows by model, and by variant")
    # The weight and the parameters of a sample, in the precision of its lanes.
    drawn = first.columns[[*first.columns, "weight"].index("weight") :]
    known: Any = dict.fromkeys((name for name in drawn if name in second.columns), pl.Float32)
    both = first.cast(known).join(second.cast(known), on=[by, "headway", *known], suffix="_other", validate="1:1", nulls_equal=True)
    if both.height < max(first.height, second.height) or len(known) < len(drawn):
        raise InputError("the two have other cases\n  help: give one driver each, of one density and seed")
    found = []
    for name, part in [("all", both), *((str(key[0]), of) for key, of in both.group_by("headway", maintain_order=True))]:
        sums = part.group_by(by, maintain_order=True).agg(pl.col(criterion, f"{criterion}_other").cast(pl.Int64).sum(), runs=pl.len())
        above, below, runs = (sums[of].cast(pl.Int64).to_numpy() for of in (criterion, f"{criterion}_other", "runs"))
        found.append((name, *_clusters.ratio(above, below, runs, level)))
    return pl.DataFrame(found, schema=["headway", "ratio", "low", "high"], orient="row", schema_overrides={"headway": pl.String})
