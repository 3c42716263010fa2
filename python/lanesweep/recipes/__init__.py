"""Recipes: functions of at most forty lines on lanesweep's tables, to be read and changed.

They need the extra: ``pip install 'lanesweep[recipes]'``.
"""

from importlib.util import find_spec

if find_spec("polars") is None:
    raise ImportError("polars is missing: pip install 'lanesweep[recipes]'", name="polars")

from ._justification import Justification, justification
from ._lanes import INJURY_CURVES, InjuryCurve, delta_v, failure_map, injury_risk, largest_gap, worst
from ._linear import Description, fit_description, found_emphasis, replayed
from ._logical_scenario import logical_scenario
from ._results import TOLERANCES, Comparison, compare_results
from ._risk import failure_ratio, risk
from ._uncertain import Uncertainty, uncertain
from ._variations import variations

__all__ = [
    "INJURY_CURVES",
    "TOLERANCES",
    "Comparison",
    "Description",
    "InjuryCurve",
    "Justification",
    "Uncertainty",
    "compare_results",
    "delta_v",
    "failure_map",
    "failure_ratio",
    "fit_description",
    "found_emphasis",
    "injury_risk",
    "justification",
    "largest_gap",
    "logical_scenario",
    "replayed",
    "risk",
    "uncertain",
    "variations",
    "worst",
]
