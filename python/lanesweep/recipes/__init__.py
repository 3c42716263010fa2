"""Recipes: functions of at most forty lines on lanesweep's tables, to be read and changed.

They need the extra: ``pip install 'lanesweep[recipes]'``.
"""

from importlib.util import find_spec

if find_spec("polars") is None:
    raise ImportError("polars is missing: pip install 'lanesweep[recipes]'", name="polars")

from ._justification import Justification as Justification, justification as justification
from ._lanes import (
    INJURY_CURVES as INJURY_CURVES,
    InjuryCurve as InjuryCurve,
    delta_v as delta_v,
    failure_map as failure_map,
    injury_risk as injury_risk,
    largest_gap as largest_gap,
    worst as worst,
)
from ._linear import (
    Description as Description,
    fit_description as fit_description,
    found_emphasis as found_emphasis,
    of_vectors as of_vectors,
    replayed as replayed,
    vectors as vectors,
)
from ._logical_scenario import logical_scenario as logical_scenario
from ._results import TOLERANCES as TOLERANCES, Comparison as Comparison, compare_results as compare_results
from ._risk import failure_ratio as failure_ratio, risk as risk
from ._uncertain import Uncertainty as Uncertainty, uncertain as uncertain
from ._variations import variations as variations
