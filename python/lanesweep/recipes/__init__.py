"""Recipes: what twenty lines compute from lanesweep's tables, short enough to be read and changed.

They need the extra: ``pip install 'lanesweep[recipes]'``.
"""

from ._results import TOLERANCES, Comparison, compare_results
from ._uncertain import Uncertainty, uncertain
from ._variations import variations

__all__ = ["TOLERANCES", "Comparison", "Uncertainty", "compare_results", "uncertain", "variations"]
