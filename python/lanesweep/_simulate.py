"""Tables of concrete cases, and limit states."""

from __future__ import annotations

import functools
import importlib.util
import json
import os
import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, SupportsFloat

import numpy as np
import numpy.typing as npt

from . import _core
from ._core import Frame
from ._driver import Driver, name_of, names_of, register
from ._run import on_message, path_of, plain, words_of

if TYPE_CHECKING:
    from .options import Criterion, Headways, Models, Path


def _column(name: str, values: Any) -> Any:
    """Values of a column: numbers, in which NaN stands for a value that is not given, or texts."""
    if np.ma.isMaskedArray(values):
        values = np.ma.filled(np.ma.asarray(values, dtype=np.float64), np.nan)
    array = np.asarray(values)
    if array.ndim > 1:
        raise _core.InputError(f"column `{name}` has the shape {array.shape}: give one value per case, or one for all")
    if array.dtype.kind in "biuf":
        return array.astype(np.float64)
    items = [None if type(value).__name__ == "NAType" else value for value in array.reshape(-1).tolist()]
    if array.dtype.kind in "cmM" or any(getattr(value, "ndim", 0) or not isinstance(value, (str, SupportsFloat, type(None))) for value in items):
        raise _core.InputError(f"column `{name}` holds {array.dtype}; expected numbers, or texts such as 60km/h")
    items = [value if value == value else None for value in items]
    if any(isinstance(value, str) for value in items):
        # A number beside texts may need no unit.
        return np.array([value if value is None else str(value) for value in items], dtype=object).reshape(array.shape)
    return np.array([np.nan if value is None else float(value) for value in items]).reshape(array.shape)


def _frame_of(columns: Mapping[str, Any]) -> Frame:
    """Make a table of columns; a scalar holds for all rows."""
    arrays = {str(name): _column(str(name), values) for name, values in columns.items()}
    lengths = {array.size for array in arrays.values() if array.ndim == 1} or {1}
    if len(lengths) > 1:
        raise _core.InputError(f"the columns differ in length ({sorted(lengths)}): give one value per case, or one for all")
    full = {name: np.broadcast_to(array, (*lengths,)) for name, array in arrays.items()}
    return _core.frame_of_columns(
        {name: array.tolist() if array.dtype == object else np.ascontiguousarray(array) for name, array in full.items()}
    )


def simulate(
    cases: Any,
    *,
    category: str | None = None,
    models: Models | None = None,
    thw: Headways | None = None,
    profile: Path = "paper",
    dt: float | None = None,
    backend: str = "auto",
    device: str | int | None = None,
    reference: bool = False,
    accept_implausible: bool = False,
) -> Frame:
    """Run concrete cases against driver models.

    Parameters
    ----------
    cases : table
        One case per row: a DataFrame of pandas or Polars, a pyarrow table, anything with the Arrow interface, or a mapping
        of columns. Columns: `category` (cut-in, cut-out, lvd), `ego_speed_kmh` or `ego_speed_mps`, `speed_kmh`, `gap` or
        `thw`, `lateral_speed`, `lateral_distance`, `acceleration`, `end_speed_kmh`, `ahead_speed_kmh`, `ahead_gap`, `length`,
        `width`, `ego_length`, `ego_width`, `lane_width`, `duration`. They mean what the arguments of `trace` mean; a null is a value that is not given. A speed along
        the road has its unit in the column's name or in the value (``"60km/h"``); a bare number other than 0 is refused.
        Other quantities are in m, s, m/s and m/s², and may say so (`gap_m`). A column `id` may name the cases, each by its own. The
        result repeats it in every row of its case, like any other column (`site`, `weather`) and the index of pandas.
    category : str, optional
        Kind of all cases, in place of the column.
    models : str, Driver or list of these, optional
        Driver models; by default the four that are built in.
    thw : float, str or list of these, optional
        Initial time headways, s, which every case starts from (or gaps: ``"30m"``); without it each row has its own.
    profile : str or path
        Name or file of a profile.
    dt : float, optional
        Time step, s; by default the profile's.
    backend, device : str
        ``"auto"``, ``"cpu"`` or ``"gpu"``, and the name of a device. Results do not depend on them.
    reference : bool
        Run in binary64, as `check` and `trace` do, on the CPU and several times slower.
    accept_implausible : bool
        Use physically impossible values with a warning.

    Returns
    -------
    Frame
        A row per case, headway and model, the last varying fastest: verdicts, minima and maxima, times in s, speeds in m/s. Lanes
        are in binary32, as in a study. Where `robust` is false, binary64 (`check`, `trace`, ``reference=True``) gives another
        verdict: the case is within rounding of a limit. Of a driver of your own it is null.

    Raises
    ------
    InputError
        With row (from 0) and column of a wrong value.

    Examples
    --------
    >>> cases = {"ego_speed_kmh": 60, "speed_kmh": 40, "gap_m": [5.0, 15.0], "lateral_speed_mps": 1.0}
    >>> lanesweep.simulate(cases, category="cut-in", models="FSM")["collision"]
    array([ True, False])
    """
    if isinstance(cases, (str, os.PathLike)) or (isinstance(cases, Mapping) and not cases):
        raise _core.InputError(f"`cases` is {cases!r:.80}\n  help: give a table of cases; `check` and `trace` read files")
    if isinstance(cases, Mapping):
        cases = _frame_of(cases)
    elif type(cases).__module__.startswith("pandas") and hasattr(cases, "reset_index"):
        # Rows are counted from 0. An index that counts them as well is no column.
        index = cases.index
        counts = type(index).__name__ == "RangeIndex" and index.name is None and index.start == 0 and index.step == 1
        cases = cases.reset_index(drop=counts)
        if not hasattr(cases, "__arrow_c_stream__") or importlib.util.find_spec("pyarrow") is None:
            # pandas hands out Arrow data from 2.2 on, if pyarrow is installed.
            cases = _frame_of({name: cases[name].to_numpy() for name in cases.columns})
    elif type(cases).__module__.startswith("polars") and hasattr(cases, "schema"):
        # Columns of the type Null, which cannot be handed over and say nothing.
        cases = cases.select([name for name, kind in cases.schema.items() if str(kind) != "Null"])
    given: dict[str, Any] = {"category": category, "dt": dt, "reference": reference, "accept_implausible": accept_implausible}
    headways: Any = [] if thw is None else plain(thw, "thw")
    given |= {"models": names_of(models), "thw": words_of(headways if isinstance(headways, (list, dict)) else [headways])}
    try:
        frame, notes = _core.simulate(cases, given | _where(profile, backend, device), on_message)
    except (TypeError, ValueError) as error:
        # Of pyarrow, where a column holds values of several types.
        if not type(error).__module__.startswith("pyarrow"):
            raise
        raise _core.InputError(f"the table cannot be handed over: {error}\n  help: give every column values of one type") from None
    for note in notes:
        warnings.warn(note, stacklevel=2)
    return frame


def _where(profile: Path, backend: str, device: str | int | None) -> dict[str, Any]:
    """Arguments of the engine."""
    return {"profile": path_of(profile, "profile"), "backend": backend, "device": None if device is None else str(device)}


class LimitState(_core.LimitState):
    """A density with one driver model and criterion, as a function of points: at most 0 where the criterion fails.

    `LimitState(density, ...)(points)` takes an array of shape (n, d), or a data frame with these columns, and returns n values,
    so that libraries of reliability analysis (OpenTURNS, UQpy, SciPy) can call it. Outside the valid region, where the density
    is 0, the value is infinite. Elsewhere values are continuous at the limit wherever that is possible: TTC minus its
    threshold, threshold minus BTN; for collisions the smallest TTC, or minus the closing speed of the contact.

    Parameters
    ----------
    density : path or Result
        Density file of `fit`.
    model : str or Driver
        Driver model.
    criterion : str
        ``"collision"``, ``"ttc"`` or ``"btn"``.
    thw : float or str, optional
        Initial headway, s; without it the density must draw it.
    profile, backend, device : str
        As in `simulate`.

    Attributes
    ----------
    parameters : list of str
        Names of the columns of points, with units.
    points : list of list of float
        The recorded scenarios, and `kernel_deviations` of the kernels around them: together they are the density.
        `log_density(points)` evaluates it within its valid region (`is_valid(points)`).
    valid_share : float
        Fraction of the density before its truncation that lies in the valid region.

    Examples
    --------
    >>> fitted = lanesweep.fit(synth_recordings=4, categories="cut-in", parameterizations=2)
    >>> limit_state = lanesweep.LimitState(fitted, model="FSM", criterion="ttc", thw=0.6)
    >>> limit_state(limit_state.draw(1000, rng=1)).shape
    (1000,)
    """

    def __new__(
        cls,
        density: Path,
        *,
        model: str | Driver = "FSM",
        criterion: Criterion = "collision",
        thw: float | str | None = None,
        profile: Path = "paper",
        backend: str = "cpu",
        device: str | int | None = None,
    ) -> LimitState:
        if not isinstance(model, (str, Driver)):
            raise TypeError(f"`model` is {model!r:.80}; give one model: a name or a Driver")
        (known_as,) = names_of(model)
        given = {"density": path_of(density, "density"), "criterion": criterion, "thw": None if thw is None else str(thw)}
        made = super().__new__(cls, given | {"model": known_as} | _where(profile, backend, device))
        assert isinstance(made, cls)
        made._arguments = given | {"model": model, "profile": profile, "backend": backend, "device": device}
        made._known_as = known_as
        made._keep = density
        return made

    _arguments: dict[str, Any]
    _known_as: str
    _keep: Any  # a copy reads the file again

    def __reduce__(self) -> tuple[Any, ...]:
        return functools.partial(LimitState, **self._arguments), ()

    def __call__(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        array = self._array(points)
        self._check_driver()
        return super().__call__(array) if len(array) else np.empty(0)

    def from_standard_normal(self, u: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Map independent standard normal numbers, shape (n, d), to points of the density before its truncation.

        The map is Rosenblatt's, smooth and increasing in each parameter, so that subset simulation, importance sampling and
        FORM of other libraries can work in the standard normal space. Invalid points do not fail (the value is infinite), so
        the probability of failure of the density is that in the standard normal space divided by `valid_share`.
        """
        return super().from_standard_normal(self._array(u))

    def is_valid(self, points: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        return super().is_valid(self._array(points))

    def log_density(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        return super().log_density(self._array(points))

    def _check_driver(self) -> None:
        """Refuse a driver that has changed since: the values of one limit state are those of one driver."""
        model = self._arguments["model"]
        if isinstance(model, Driver) and register(model) != self._known_as:
            raise _core.UsageError(f"driver {name_of(model)} has changed since this limit state was made: make another one")

    def _array(self, points: Any) -> npt.NDArray[np.float64]:
        """Points as an array; columns of a data frame by their names."""
        if np.ma.isMaskedArray(points):
            points = np.ma.filled(points, np.nan)
        if hasattr(points, "columns"):
            missing = [name for name in self.parameters if name not in list(points.columns)]
            if missing:
                raise _core.InputError(f"the points have no column {', '.join(missing)}; expected {', '.join(self.parameters)}")
            points = np.column_stack([points[name] for name in self.parameters])
        array = np.ascontiguousarray(np.atleast_2d(np.asarray(points, dtype=np.float64)))
        if array.ndim != 2:
            raise _core.InputError(f"points have {array.ndim} dimensions; give an array of shape (n, d)")
        return array

    def draw(self, count: int, rng: np.random.Generator | int | None = None) -> npt.NDArray[np.float64]:
        """Draw valid points of the density, by rejection, with a generator or seed of NumPy (not the numbers of `sample`)."""
        if count < 0:
            raise ValueError(f"{count} points; give at least 0")
        seed = int(np.random.default_rng(rng).integers(2**63))
        return super()._draw(count, seed) if count > 0 else np.empty((0, len(self.parameters)))

    def estimate(
        self, points: npt.ArrayLike, log_density: npt.ArrayLike | None = None, *, level: float = 0.95
    ) -> dict[str, Any]:
        """Estimate the probability of failure from points that another model drew, such as a normalizing flow.

        Parameters
        ----------
        points : array of shape (n, d) or data frame
            Independent draws. Points outside the valid region cannot fail.
        log_density : array of shape (n,), optional
            ln of the density that each point was drawn from, over the parameters in their units. With it the points are a
            proposal, weighted to this density; it must cover the density wherever a failure is possible. Without it the
            points stand for themselves: the estimate is that of the other model within the valid region.
        level : float
            Level of the interval.

        Returns
        -------
        dict
            ``probability``, ``low``, ``high``, ``level``, ``points``, ``valid``, ``failures``, ``effective_failures``
            and ``mean_weight`` (both None without `log_density`), ``verdict`` and ``warnings``.
        """
        self._check_driver()
        logs = None if log_density is None else np.ascontiguousarray(log_density, dtype=np.float64).reshape(-1)
        found: dict[str, Any] = json.loads(super()._estimate(self._array(points), logs, level))
        return found
