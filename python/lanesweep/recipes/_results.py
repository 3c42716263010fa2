"""Results of another simulator beside a driver's lanes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import polars as pl

from .. import _verbs
from .._simulate import simulate
from ..options import Path as PathLike
from ._shared import InputError, check_names, extra, table


#: Quantities of `compare_results`, a cause before its effects, with the differences that count as none: half of a time step of
#: 0.1 s, 0.1 m and 0.2 m/s.
TOLERANCES = {
    "reaction_s": 0.05,
    "braking_s": 0.05,
    "min_gap_m": 0.1,
    "min_ttc_s": 0.05,
    "contact_s": 0.05,
    "impact_speed_mps": 0.2,
}


class Comparison(NamedTuple):
    """What `compare_results` finds.

    Attributes
    ----------
    cases : DataFrame
        A row per result: the difference of every quantity, theirs minus ours, and `first`, the first quantity that differs.
    causes : DataFrame
        A row per quantity that is the first one in some cases: their number, and median, minimum and maximum of its difference
        in these cases. The quantity with the most cases leads.
    agreement : tuple of float
        Fraction of the results with the same answer to whether the vehicles touch, with its interval (95 %, Clopper and Pearson).
    missing : int
        Number of the cases without a result, or whose result has no `collision`.
    ignored : list of str
        Columns of the results that were not compared.
    """

    cases: pl.DataFrame
    causes: pl.DataFrame
    agreement: tuple[float, float, float]
    missing: int
    ignored: list[str]


def compare_results(
    cases: Any,
    theirs: Any,
    *,
    model: str = "CCHDM",
    profile: PathLike = "un-r157",
    tolerances: Mapping[str, float] = TOLERANCES,
) -> Comparison:
    """Compare another simulator's results with a driver's lanes: the first quantity that differs, in the cases that differ.

    `cases` is a table of cases with an `id`, `theirs` one with `id`, `collision` and, where known, quantities of `TOLERANCES`. A field
    without a value is unknown. Infinite is a value: a time that never comes, a gap that never closes. A quantity that `tolerances` leaves
    out is not compared.
    """
    with extra():
        from statsmodels.stats.proportion import proportion_confint
    check_names(tolerances, TOLERANCES, "quantity to compare")
    given, own = table(theirs, "id", "collision"), table(cases, "id")
    results = _as_values(given)
    both = results.join(_lanes(own, results.columns, model, profile), on="id", suffix="_ours", validate="1:1")
    if both.height < results.height:
        raise InputError(f"{results.height - both.height} results have the id of no case")
    most = {name: by for name, by in tolerances.items() if name in results.columns} | {"collision": 0.0}
    pairs = {name: (pl.col(name), pl.col(f"{name}_ours")) for name in most}
    # Infinite minus infinite is no difference.
    minus = {name: pl.when(one == other).then(0.0).otherwise(one - other) for name, (one, other) in pairs.items()}
    compared = both.select("id", **minus)
    # What equals a tolerance is not beyond it, whatever its last bits.
    beyond = [pl.when(pl.col(name).abs().round(4) > by).then(pl.lit(name)) for name, by in most.items()]
    compared = compared.with_columns(first=pl.coalesce(beyond))
    found = compared.unpivot(index="first", on=list(most), variable_name="quantity").filter(pl.col("first") == pl.col("quantity"))
    value = pl.col("value")
    causes = found.group_by("quantity", maintain_order=True).agg(cases=pl.len(), median=value.median(), min=value.min(), max=value.max())
    causes = causes.sort("cases", descending=True, maintain_order=True)
    agreeing, judged = compared.filter(collision=0.0).height, compared["collision"].count()
    low, high = proportion_confint(agreeing, judged, method="beta")
    ignored = [name for name in given.columns if name not in ("id", *most)]
    return Comparison(compared, causes, (agreeing / judged, low, high), own.height - judged, ignored)


def _lanes(cases: pl.DataFrame, columns: list[str], model: str, profile: PathLike) -> pl.DataFrame:
    """The driver's outcomes. An event that does not happen has an infinite time."""
    found = table(simulate(cases, models=model, profile=profile))
    if "braking_s" in columns:
        rows: Any = cases.drop("answer", strict=False).iter_rows(named=True)
        traces = (_verbs.trace(table=row, models=model, profile=profile).document for row in rows)
        braking = [next((step["t_s"] for step in of["steps"] if "braking" in (step["mark"] or "")), None) for of in traces]
        found = found.with_columns(braking_s=pl.Series(braking, dtype=pl.Float64))
    times = [name for name in ("reaction_s", "braking_s", "contact_s") if name in found.columns]
    return _as_values(found.with_columns(pl.col(*times).fill_null(float("inf"))))


def _as_values(rows: pl.DataFrame) -> pl.DataFrame:
    """Numbers, and texts as ids. Vehicles that touch have no gap left, and others never touch."""
    known = [name for name in TOLERANCES if name in rows.columns]
    if not rows["id"].is_unique().all():
        raise InputError(f"the id {rows.filter(pl.col('id').is_duplicated())['id'][0]} occurs twice")
    if not rows["collision"].count():
        raise InputError("`collision` has no value in any row\n  help: say whether the vehicles touch")
    found = rows.select(pl.col("id").cast(pl.String), pl.col("collision", *known).cast(pl.Float64))
    if "min_gap_m" in known:
        found = found.with_columns(pl.col("min_gap_m").clip(lower_bound=0.0))
    if "contact_s" in known:
        never = pl.when(pl.col("collision") == 0).then(float("inf")).otherwise(pl.col("contact_s"))
        found = found.with_columns(contact_s=never)
    return found
