"""Tables of lanes: where drivers fail, the worst lanes, how severe contacts are; and what no case covers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
import polars as pl

from ..options import Criterion
from ._shared import InputError, UsageError, check_names, extra, table, within


def failure_map(rows: Any, x: str, y: str, *, criterion: Criterion = "collision", bins: int = 20) -> pl.DataFrame:
    """Count lanes and failures over two parameters, per driver: a row per cell with lanes; its range is from `…_low` to `…_high`.

    `rows` are those of `sample(rows=…)`. The cells divide the range of the rows; lanes without a finite `x` and `y` are in none.
    """
    within(1, 10_000, bins=bins)
    lanes = table(rows, "model", criterion, x, y).cast({x: pl.Float64, y: pl.Float64}).filter(pl.col(x).is_finite() & pl.col(y).is_finite())
    if lanes.is_empty():
        raise InputError(f"no row has a finite {x} and {y}")

    def place(name: str) -> tuple[pl.Expr, pl.Expr]:
        values = lanes[name].to_numpy()
        low, width = float(values.min()), float(values.max() - values.min()) / bins or 1.0
        # The largest value is in the last cell.
        cell = ((pl.col(name) - low) / width).floor().clip(0, bins - 1)
        return (low + width * cell).alias(f"{name}_low"), (low + width * (cell + 1)).alias(f"{name}_high")

    cells = lanes.select("model", pl.col(criterion).cast(pl.Int64).alias("failures"), *place(x), *place(y))
    names = [name for name in cells.columns if name != "failures"]
    found = cells.group_by(names).agg(lanes=pl.len(), failures=pl.sum("failures"))
    return found.with_columns(share=pl.col("failures") / pl.col("lanes")).sort(names)


def worst(rows: Any, count: int = 20, *, criterion: Criterion = "collision") -> pl.DataFrame:
    """Return the worst lanes of each driver: fastest contacts, then smallest TTC; smallest TTC or largest BTN, then fastest contacts.

    `rows` are those of `sample(failures=…)`, `sample(rows=…)` or `simulate`.
    """
    near, slow = pl.col("min_ttc_s"), -pl.col("impact_closing_speed_mps").abs()
    # The smallest is the worst.
    order = {"collision": [slow, near], "ttc": [near, slow], "btn": [-pl.col("max_btn"), slow]}
    within(1, float("inf"), count=count)
    check_names([criterion], order, "criterion")
    lanes = table(rows, "model", "min_ttc_s", "impact_closing_speed_mps", may_be_empty=True)
    lanes = lanes.sort("model", *order[criterion], nulls_last=True, maintain_order=True)
    return lanes.group_by("model", maintain_order=True).head(count)


class InjuryCurve(NamedTuple):
    """A published curve of the risk of an injury over the change of speed, with its source.

    Attributes
    ----------
    source : str
        Publication, injury and occupants.
    valid_to_mps : float
        Largest change of speed that the source covers, m/s.
    logistic : tuple of float, optional
        a and b of 1/(1 + exp(a - b ΔV)), ΔV in mph; without it the risk is (ΔV/valid_to_mps)⁴.
    """

    source: str
    valid_to_mps: float
    logistic: tuple[float, float] | None = None


Curve = Literal["nhtsa-2022-frontal-mais3", "nhtsa-2022-frontal-fatal", "joksch-1993-fatal"]
_MPH = 0.44704
_NHTSA = "occupants of cars in frontal crashes, United States, 2010 to 2015; Wang, NHTSA DOT HS 813 219, 2022, table A-6"
#: Curves of `injury_risk`.
INJURY_CURVES = {
    "nhtsa-2022-frontal-mais3": InjuryCurve(f"MAIS3+ of {_NHTSA}", 60 * _MPH, (6.9774, 0.1620)),
    "nhtsa-2022-frontal-fatal": InjuryCurve(f"death of {_NHTSA}", 60 * _MPH, (9.0422, 0.1571)),
    "joksch-1993-fatal": InjuryCurve(
        "death of drivers of cars in crashes of two vehicles, United States, 1980 to 1986; Joksch, Velocity change and fatality risk "
        "in a crash: a rule of thumb, Accident Analysis and Prevention 25(1), 1993",
        71 * _MPH,
    ),
}


def delta_v(
    rows: Any, *, ego_kg: float = 1500.0, other_kg: float = 1500.0, restitution: float = 0.0, dt_s: float = 0.04
) -> pl.DataFrame:
    """Add the changes of speed in every contact, `delta_v_ego_mps` and `delta_v_other_mps`, by conservation of momentum.

    ΔV = (1 + e)·m_other/(m_own + m_other)·closing speed, of a central contact in line: null for a contact from the side, for one of
    vehicles that overlapped along the road by more than a time step's way before, and for one in which they move apart. `rows` are those
    of `simulate` or `sample`; `dt_s` is the time step of their profile: 0.1 of `jrc-2021`.
    """
    within(1, 1e6, ego_kg=ego_kg, other_kg=other_kg)
    lanes = table(rows, "impact_closing_speed_mps", "contact_type", "min_gap_m", may_be_empty=True)
    closing = pl.col("impact_closing_speed_mps").cast(pl.Float64)
    of_all = (1.0 + restitution) * closing / (ego_kg + other_kg)
    # The box of a vehicle that comes from the side is beside the ego before it touches.
    from_behind = pl.col("min_gap_m") >= -closing * dt_s - 0.05
    central = pl.when((pl.col("contact_type") == 2) & (closing > 0) & from_behind)
    both = {"delta_v_ego_mps": other_kg * of_all, "delta_v_other_mps": ego_kg * of_all}
    return lanes.with_columns(**{name: central.then(of) for name, of in both.items()})


def injury_risk(delta_v_mps: npt.ArrayLike, curve: Curve = "nhtsa-2022-frontal-mais3") -> npt.NDArray[np.float64]:
    """Return the risk of an injury at changes of speed of a car, by a curve of `INJURY_CURVES`; NaN beyond its data."""
    check_names([curve], INJURY_CURVES, "curve")
    of = INJURY_CURVES[curve]
    change = np.asarray(delta_v_mps, dtype=np.float64)
    a, b = of.logistic or (0.0, 0.0)
    risk = 1.0 / (1.0 + np.exp(a - b * change / _MPH)) if of.logistic else (change / of.valid_to_mps) ** 4
    return np.where(change <= of.valid_to_mps, risk, np.nan)


def largest_gap(points: Any, ranges: Mapping[str, tuple[float, float]] | None = None, *, draws: Any = None) -> pl.DataFrame:
    """Return per quantity the largest interval of its range without a point, whatever the other quantities are.

    `ranges` are by default those of the points. With `draws` of a density (`LimitState.draw`), `exposure` is the fraction of them inside,
    with its interval (Clopper and Pearson). Of equally large intervals it is the one with the most draws, or the lowest.
    """
    with extra():
        import polars.selectors as select
        from statsmodels.stats.proportion import proportion_confint
    cases = table(points, *(ranges or ()))
    likely = None if draws is None else table(draws, *(ranges or ()))
    found = []
    for name in ranges or cases.select(select.numeric()).columns:
        values = cases[name].drop_nulls().to_numpy().astype(np.float64)
        low, high = ranges[name] if ranges else (values.min(), values.max())
        ends = np.sort(np.r_[low, values[(values > low) & (values < high)], high])
        if low >= high and ranges:
            raise UsageError(f"`ranges`: {name} goes from {low} to {high}; give the smaller end first")
        widths = np.diff(ends)
        counts = np.zeros(len(widths)) if likely is None else np.histogram(likely[name].drop_nulls(), ends)[0]
        at = np.where(widths >= widths.max() * (1 - 1e-9), counts, -1).argmax()
        row = {"quantity": name, "from": ends[at], "to": ends[at + 1], "fraction": widths[at] / (high - low)}
        if likely is not None:
            inside = likely.filter((pl.col(name) > ends[at]) & (pl.col(name) < ends[at + 1])).height
            interval = proportion_confint(inside, likely.height, method="beta")
            row |= {"exposure": inside / likely.height, "low": interval[0], "high": interval[1]}
        found.append(row)
    return pl.DataFrame(found).sort("fraction", descending=True)
