"""Rates whose runs depend on one another in clusters: the headways of a scenario, the lanes of a sample. Formulas: chapter *Estimators*."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ._shared import extra

Counts = npt.NDArray[np.int64]
#: Estimate, lower and upper end of its interval; NaN where there is none.
Estimate = tuple[float, float, float]
#: Clusters with a failure that a paired ratio needs on each side.
ENOUGH = 10


def _effective(counts: Counts) -> float:
    """The equivalent number of equal counts (Kish)."""
    squares = float((counts.astype(np.float64) ** 2).sum())
    return float(counts.sum()) ** 2 / squares if squares else 0.0


def rate(hits: Counts, runs: Counts, level: float = 0.95) -> Estimate:
    """The rate of hits with Wilson's interval for the effective number of runs (Korn and Graubard 1998); an entry per cluster."""
    with extra():
        from scipy.stats import norm, t
        from statsmodels.stats.proportion import proportion_confint
    hits, runs = hits[runs > 0], runs[runs > 0]
    if not len(runs):
        return np.nan, np.nan, np.nan
    of, count, q = hits.sum() / runs.sum(), len(runs), 0.5 + level / 2
    few = max(_effective(runs), 1.0)
    if hits.sum() == 0:
        return 0.0, 0.0, 1.0 - (1.0 - level) ** (1.0 / int(few))
    squares = (((hits - of * runs) / runs.sum()) ** 2).sum()
    variance = count / (count - 1) * squares if count > 1 else of * (1.0 - of)
    freedom = max(min(_effective(hits), _effective(runs - hits)) - 1.0, 1.0)
    factor = norm.ppf(q) / t.ppf(q, freedom)
    effective = np.clip(of * (1.0 - of) / variance * factor**2, few, max(runs.sum(), few)) if variance > 0 else few
    low, high = proportion_confint(of * effective, effective, 1.0 - level, method="wilson")
    return float(of), float(low), float(high)


def ratio(above: Counts, below: Counts, runs: Counts, level: float = 0.95) -> Estimate:
    """The ratio of two rates over the same clusters, on the logarithm; the quotient of both intervals with few failing clusters."""
    with extra():
        from scipy.stats import t
    failing = min((above > 0).sum(), (below > 0).sum())
    if failing < ENOUGH:
        (one, one_low, one_high), (other, other_low, other_high) = rate(above, runs, level), rate(below, runs, level)
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(np.divide(one, other)), float(one_low / other_high), float(np.divide(one_high, other_low))
    # The influences of a cluster on both logarithms.
    influences = above / above.sum() - below / below.sum()
    sigma = np.sqrt(len(runs) / (len(runs) - 1) * (influences**2).sum())
    value, factor = above.sum() / below.sum(), np.exp(t.ppf(0.5 + level / 2, failing - 1) * sigma)
    return float(value), float(value / factor), float(value * factor)
