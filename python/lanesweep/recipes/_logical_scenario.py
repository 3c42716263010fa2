"""Logical scenarios of ASAM OpenSCENARIO XML (`ParameterValueDistribution`, revisions 1.1 to 1.3) as tables of cases."""

from __future__ import annotations

import functools
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import polars as pl

from ..options import Path
from ._shared import InputError, extra


def logical_scenario(file: Path, *, draws: int | None = None, seed: int | None = None) -> pl.DataFrame:
    """Return the cases of a file: every combination of listed values, or draws of random ones.

    Columns have the names and units of the file. `draws` and `seed` are by default its `numberOfTestRuns` and `randomSeed`.
    Distributions are truncated to their ranges. Expressions and parameter references are refused.
    """
    root = ElementTree.parse(file).getroot()
    listed, random = root.find("*/Deterministic"), root.find("*/Stochastic")
    if listed is not None and random is None:
        return functools.reduce(lambda one, other: one.join(other, how="cross"), map(_values, listed))
    if random is None or listed is not None:
        raise InputError(f"{file}: expected a ParameterValueDistribution with either Deterministic or Stochastic values")
    # A seed is a double. The hash of a whole one is itself.
    own = abs(hash(float(random.get("randomSeed", 0.0))))
    generator = np.random.default_rng(own if seed is None else seed)
    count = int(float(random.attrib["numberOfTestRuns"])) if draws is None else draws
    return pl.DataFrame({one.attrib["parameterName"]: _draws(one[0], count, generator) for one in random})


def _values(distribution: Element) -> pl.DataFrame:
    """The values of one parameter, or the sets of several."""
    if distribution.tag == "DeterministicMultiParameterDistribution":
        sets = [{one.attrib["parameterRef"]: _value(one) for one in each} for each in distribution.iter("ParameterValueSet")]
        return pl.DataFrame(sets, infer_schema_length=None)
    values = [_value(one) for one in distribution.iter("Element")]
    if (steps := distribution.find("DistributionRange")) is not None:
        (low, high), step = _range(steps), float(steps.attrib["stepWidth"])
        # The last value is the end of the range if the steps reach it, rounding aside.
        values = [round(low + k * step, 9) for k in range(int((high - low) / step + 1e-9) + 1)]
    return pl.DataFrame({distribution.attrib["parameterName"]: values})


def _value(one: Element) -> float | str:
    """A number, or the text of another value."""
    text = one.attrib["value"]
    if text.startswith("$"):
        raise InputError(f"{text}: references and expressions are not evaluated")
    try:
        return float(text)
    except ValueError:
        return text


def _range(one: Element) -> tuple[float, float]:
    found = one.find("Range")
    low, high = (-np.inf, np.inf) if found is None else (float(found.attrib["lowerLimit"]), float(found.attrib["upperLimit"]))
    if not low <= high:
        raise InputError(f"{one.tag}: its range goes from {low} to {high}")
    return low, high


def _draws(distribution: Element, count: int, generator: np.random.Generator) -> Any:
    """Draws of a distribution within its range, by its quantiles."""
    with extra():
        from scipy import stats
    kind, u = distribution.tag, generator.random(count)
    if kind in ("ProbabilityDistributionSet", "Histogram"):
        weights = np.array([float(one.attrib["weight"]) for one in distribution])
        at = generator.choice(len(weights), count, p=weights / weights.sum())
        if kind == "ProbabilityDistributionSet":
            return np.array([_value(one) for one in distribution])[at]
        ends = np.array([_range(bin) for bin in distribution])[at]
        return ends[:, 0] + u * (ends[:, 1] - ends[:, 0])
    low, high = _range(distribution)
    if kind == "UniformDistribution":
        return low + u * (high - low)
    mean = float(distribution.get("expectedValue", np.nan))
    if kind == "NormalDistribution":
        of = stats.norm(mean, float(distribution.attrib["variance"]) ** 0.5)
    elif kind == "PoissonDistribution":
        of, low = stats.poisson(mean), np.ceil(low) - 1
    else:
        # The moments of a LogNormalDistribution may be those of the value or of its logarithm.
        raise InputError(f"{kind} has no meaning here: draw it yourself, with NumPy")
    # In the tail that has the range, whose probabilities have all their digits.
    share, value = (of.sf, of.isf) if low > mean else (of.cdf, of.ppf)
    found = value(share(low) + u * (share(high) - share(low)))
    if not np.isfinite(found).all():
        raise InputError(f"{kind}: nothing can be drawn from {low} to {high} with {distribution.attrib}")
    return found
