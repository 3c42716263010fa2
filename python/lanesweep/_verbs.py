"""Verbs of the program as functions: the same work, with values as arguments and a `Result` in place of text."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ._result import Result
from ._run import run
from .options import (
    Case,
    Categories,
    Category,
    Criterion,
    Data,
    Float,
    Headways,
    Int,
    Keys,
    Models,
    Number,
    Path,
    Paths,
    Plausibility,
    Run,
    Split,
    Sweep,
    Values,
)

if TYPE_CHECKING:
    from typing_extensions import Unpack

__all__ = [
    "check",
    "fit",
    "map",
    "merge",
    "mine",
    "sample",
    "study",
    "trace",
    "tracks",
]


class _Mining(Plausibility, Run, total=False):
    preset: Path


class _Fit(Data, Run, total=False): ...


class _Study(Data, Split, total=False): ...


class _Sample(Plausibility, Split, total=False): ...


class _Map(Plausibility, Sweep, total=False): ...



def study(
    recordings: Path | None = None,
    *,
    categories: Categories | None = None,
    models: Models | None = None,
    thw: Headways | None = None,
    external: Paths | Mapping[str, Any] | None = None,
    cross_validate: bool = False,
    published: bool = False,
    rows: Path | None = None,
    seed: Int | None = None,
    out: Path | None = None,
    **options: Unpack[_Study],
) -> Result:
    """Measure how far parameterized scenarios agree with recorded ones.

    Mines cut-ins, cut-outs and leader decelerations. Replays each as recorded (S) and parameterized (S') from ten time headways
    with every driver model, evaluates collision, TTC and BTN, and scores S' against S.

    Parameters
    ----------
    recordings : path, optional
        Folder of recordings, or a track file, in highD's format or that of a preset; by default recordings are generated.
    categories : list of {"cut-in", "cut-out", "lvd"}
        Kinds of scenario, by default all.
    models : list of str or Driver
        Driver models, by default Reg157, CCHDM, RSS and FSM.
    thw : list of float
        Time headways, s. ``"paper"``, the default: 2.0, 1.8, … 0.2, which the paper's claims need. ``"r157"``: the minimum following
        distance of UN R157, 5.2.3.3, at the ego's speed; a list may contain it. ``"observed"``: the recorded gaps.
    external : list of paths, or mapping of names to tables
        S' of another program: scenario files with the ids of S, whose series may have any sample rate and length.
        Tables of pandas, Polars or pyarrow have a name each.
    cross_validate : bool
        Also replay scenarios by bases that have not seen them: each decomposition gets a variant, such as ``5-cv``. A basis fitted on
        the scenarios that it replays flatters itself.
    published : bool
        Set the paper's published numbers (of highD) beside ours: on the page and in run.json.
    rows : path
        Also write one row per lane: .csv, .jsonl or .parquet.
    seed : int
        Chooses the lanes that are checked on the CPU; no score depends on it.
    out : path, optional
        Folder of the files; without it they go with the result.
    **options
        `Data`, `Sweep` and `Split` of `lanesweep.options`.

    Returns
    -------
    Result
    """
    return run("study", locals(), default_out="study")


def tracks(
    paths: Paths | None = None,
    *,
    preset: Path | None = None,
    convert: Path | None = None,
    synth_recordings: Int | None = None,
    out: Path | None = None,
    **options: Unpack[Run],
) -> Result:
    """Say what is in track files; check, draw and convert them.

    Finds the format by the names of the columns, reads the tracks and says what was understood: rate, vehicles, road, lanes, speeds,
    scenarios. Checks the file against itself: units, axes, reference point, lanes, jumps, overlaps.

    Parameters
    ----------
    paths : list of paths
        Track files, or folders of them. Without any, `convert` is a folder for the generated recordings that `study` uses without data.
    preset : str or path
        Format: ``"exid"``, ``"sumo-fcd"``, … or a TOML file that says what the columns mean; by default it is detected.
    convert : path
        Write the tracks in highD's format into this folder, or as one table: .csv, .parquet, .jsonl.
    synth_recordings : int
        Number of generated recordings, by default 84.
    out : path, optional
        Folder for tracks.json and a figure of each recording. Without it those of a single path go with the result.
    **options
        `Run` of `lanesweep.options`.

    Returns
    -------
    Result
    """
    if paths is None:
        return run("tracks", locals(), path=convert)
    return run("tracks", locals(), default_out=None if _are_several(paths) else "tracks")


def _are_several(paths: Paths) -> bool:
    """Whether figures could have the same names."""
    return isinstance(paths, Collection) and not isinstance(paths, str) and len(paths) > 1


def mine(recordings: Path, *, kept: bool = False, out: Path | None = None, **options: Unpack[_Mining]) -> Result:
    """Mine cut-ins, cut-outs and leader decelerations from recordings.

    Parameters
    ----------
    recordings : path
        Folder of recordings, or a track file.
    kept : bool
        Only scenarios that pass the paper's filters.
    out : path, optional
        Scenario file, .jsonl or .parquet: a line or row per scenario with its series. The driven time and distance go beside it, from
        which `fit` computes events per hour. Without it the file goes with the result.
    **options
        `preset` and `accept_implausible` of `Data`, and `Run`, of `lanesweep.options`.

    Returns
    -------
    Result
    """
    return run("mine", locals(), default_out="scenarios.jsonl")


def fit(
    recordings: Path | None = None,
    *,
    categories: Categories | None = None,
    parameterizations: Keys | None = None,
    with_thw: bool = False,
    hours: Float | None = None,
    km: Float | None = None,
    without_scenarios: bool = False,
    seed: Int | None = None,
    out: Path | None = None,
    **options: Unpack[_Fit],
) -> Result:
    """Fit densities to the parameters of scenarios, a file per category and parameterization.

    Also computes the physically possible share of each density, and how often such scenarios occur.

    Parameters
    ----------
    recordings : path, optional
        Folder of recordings, or a track file; by default recordings are generated.
    categories : list of {"cut-in", "cut-out", "lvd"}
        Kinds of scenario, by default all.
    parameterizations : list of str
        1 to 7 of cut-ins, a to g of cut-outs, i to v of leader decelerations; by default all.
    with_thw : bool
        Add the observed time headway as a parameter (thw_s).
    hours, km : float
        Driven time, h, and distance, km, of all egos; by default those of the recordings.
    without_scenarios : bool
        Leave the recorded series out of the files, which can then be shared; `sample` cannot compare its rates with theirs.
    seed : int
        Seed of P_valid.
    out : path, optional
        Folder of the density files, or one file .json; without it they go with the result.
    **options
        `Data` and `Run` of `lanesweep.options`.

    Returns
    -------
    Result
        `Result.densities` has the files.
    """
    return run("fit", locals(), default_out="densities")


def sample(
    density: Path | None = None,
    *,
    models: Models | None = None,
    thw: Headways | None = None,
    criterion: Criterion | None = None,
    samples: Int | None = None,
    half_width: Float | None = None,
    estimator: Literal["auto", "mc", "is"] | None = None,
    level: Float | None = None,
    proposal: Paths | None = None,
    time_limit: Float | None = None,
    rows: Path | None = None,
    failures: Path | None = None,
    seed: Int | None = None,
    out: Path | None = None,
    **options: Unpack[_Sample],
) -> Result:
    """Estimate how likely a driver fails.

    Draws concrete scenarios from a density, runs each against the driver models, and estimates the probability of failure with its
    interval, by crude Monte Carlo or importance sampling. Each estimate has a verdict on whether to trust it.

    Parameters
    ----------
    density : path
        Density file of `fit`, or a fit with one density.
    models : list of str or Driver
        Driver models, by default Reg157, CCHDM, RSS and FSM.
    thw : list of float
        Time headways, s; by default that of the density, else ``"paper"``: 2.0, 1.8, … 0.2. ``"observed"``: drawn as a parameter of the
        density, which needs ``fit(with_thw=True)``.
    criterion : {"collision", "ttc", "btn"}
        Criterion to estimate to `half_width`; by default collision.
    samples : int
        Number of samples, by default 100,000 or as many as needed; with a half-width the maximum.
    half_width : float
        Half-width of the interval over the estimate to reach; 0.1 by default with ``estimator="is"`` and no `samples`.
    estimator : {"auto", "mc", "is"}
        Crude Monte Carlo, importance sampling, or the cheaper one for each question. ``"auto"`` without a half-width is ``"mc"``.
    level : float
        Level of the intervals, by default 0.95.
    proposal : list of paths
        Proposals to sample, with ``estimator="is"``; several are mixed with equal weights.
    time_limit : float
        Stop at the first check after this time, s; not reproducible.
    rows : path
        Also write one row per lane: .csv, .jsonl or .parquet.
    failures : path
        Also write the first failing lanes of each model and criterion, at most 1000 of each (key ``sample.failures_limit``), with the
        columns of `rows`.
    seed : int
        Seed of the draws.
    out : path, optional
        Folder of the files; without it they go with the result.
    **options
        `Sweep`, `Split` and `accept_implausible` of `lanesweep.options`.

    Returns
    -------
    Result
    """
    return run("sample", locals(), default_out="sample")


def map(
    category: Category,
    *,
    preset: Literal["jrc", "r157"] | None = None,
    x: str | None = None,
    y: str | None = None,
    panel: Values | None = None,
    set: Values | None = None,
    models: Models | None = None,
    criterion: Criterion | None = None,
    robust: bool = False,
    out: Path | None = None,
    **options: Unpack[_Map],
) -> Result:
    """Map outcomes over two parameters; every cell is a concrete case.

    Parameters
    ----------
    category : {"cut-in", "cut-out", "lvd"}
        Kind of scenario.
    preset : {"jrc", "r157"}
        Grids of the JRC's evidence, or of the regulation's Annex 3 (to 60 and to 130 km/h), with their models.
    x, y : str
        Parameter of an axis: ``"gap_m=5..40/1"``, ``"gap_m=5,10,20"``.
    panel : mapping
        Parameters of the panels: ``{"ego_speed_kmh": [60, 90]}``; several give one panel per combination.
    set : mapping
        Constant parameters: ``{"ego_speed_kmh": 108}``.
    models : list of str or Driver
        Driver models, by default all, or those of the preset.
    criterion : {"collision", "ttc", "btn"}
        Criterion, by default collision.
    robust : bool
        Mark cells whose outcome changes with a tenth of the time step, 1 cm or 0.1 km/h: they are undecided.
    out : path, optional
        Folder of the files; without it they go with the result.
    **options
        `Sweep` and `accept_implausible` of `lanesweep.options`.

    Returns
    -------
    Result
    """
    return run("map", locals(), default_out="map")


def check(
    file: Path | None = None,
    *,
    row: Int | None = None,
    scenario: str | None = None,
    models: Models | None = None,
    profiles: Paths | None = None,
    nominal: bool = False,
    sheet: Path | None = None,
    rows: Path | None = None,
    backend: Literal["auto", "cpu", "gpu"] | None = None,
    device: str | Int | None = None,
    date: str | None = None,
    author: str | None = None,
    **case: Unpack[Case],
) -> Result:
    """Check whether the reference drivers of UN R157 avoid the collision of a concrete case.

    Every model runs under every profile. The case is preventable if CCHDM or FSM, the drivers of Annex 3, avoids the collision under the
    first profile. It has no conflict if nothing collides even when the ego never reacts. It is undecided if a tenth of the time step or
    a measurement error of an input changes the answer. It is outside Annex 3 if the annex does not describe such a case.

    Parameters
    ----------
    file : path, optional
        TOML file, table (.csv, .parquet) or scenario file (.jsonl) with the case. A table without `row` is judged whole.
    row : int
        Row of a table, from 1 after the header.
    scenario : str
        Scenario of a scenario file, by its id. It starts with its observed gap, or with `gap` or `thw`.
    models : list of str or Driver
        Driver models, by default Reg157, CCHDM, RSS and FSM.
    profiles : list of str or path
        Profiles; the first one decides. By default un-r157, the two of EU 2022/1426, jrc-2021, paper and paper-fit.
    nominal : bool
        Only the computed answers of a table, by lanes: a million rows take seconds. No perturbation, clause or boundary is examined.
    sheet : path
        Also write the case sheet as an HTML page.
    rows : path
        Also write a table's answers, one row per case: .csv, .jsonl or .parquet.
    backend : {"auto", "cpu", "gpu"}
        Of `nominal`. ``"auto"``: a GPU if there is one.
    device : str or int
        Device of `nominal`, by part of its name, PCI bus id or index.
    date, author : str
        Date of the run and author, as the sheet is to show them. The clock is not asked.
    **case
        `Case` of `lanesweep.options`; it overrides values of a file.

    Returns
    -------
    Result
        Its status is ``"ok"`` (preventable), ``"not preventable"``, ``"undecided"``, ``"no conflict"``, ``"outside Annex 3"`` or
        ``"incomplete"``; of a whole table, that of its worst answer, in the order not preventable, undecided, outside Annex 3,
        preventable, no conflict.
    """
    return run("check", locals())


def trace(
    *,
    from_: Path | None = None,
    lane: str | Collection[str] | None = None,
    scenarios: Path | None = None,
    compare: Keys | bool = False,
    case_file: Path | None = None,
    table: Path | None = None,
    row: Int | None = None,
    models: Models | None = None,
    profile: Path | None = None,
    dt: Float | None = None,
    plot: Path | None = None,
    plot_end: Number | None = None,
    xosc: Path | None = None,
    ego: Literal["model", "external"] | None = None,
    duration: Number | None = None,
    side: Literal["left", "right"] | None = None,
    **case: Unpack[Case],
) -> Result:
    """Run one case, or lanes of a finished run, step by step. For many cases there is `simulate`.

    Parameters
    ----------
    from_ : path
        Folder of a study or sample: repeats `lane` with the run's profile and options, bit for bit.
    lane : list of str
        Keys of lanes: scenario/variant/headway/model.
    scenarios : path
        Scenario file, for `lane`; with a study and `xosc`: its scenarios, for sizes, side and lane width.
    compare : bool or list of str
        Also simulate other variants of the lane's scenario: True for S, keys of parameterizations, or ``"all"``.
    case_file : path
        TOML file with the case.
    table : path
        Table (.csv, .parquet) with one case per row.
    row : int
        Row of the table, from 1 after the header; needed if it has several.
    models : list of str or Driver
        Driver models, by default Reg157, CCHDM, RSS and FSM.
    profile : str or path
        Constants of drivers and criteria, by default ``"paper"``.
    dt : float
        Time step, s; by default that of the profile.
    plot : path
        Also draw the series, as SVG.
    plot_end : float
        End of the figure's time axis, s.
    xosc : path
        Also write every lane as ASAM OpenSCENARIO XML 1.2 with an OpenDRIVE road into this folder; index.csv lists them with their
        outcomes. The other vehicles follow their own motion, step by step.
    ego : {"model", "external"}
        In `xosc` the ego follows the path that the driver model drove; or only its start is written, for a controller of your own.
    duration : float
        End of the scenario with ``ego="external"``, s; by default 10 s after the lane's last event and end.
    side : {"left", "right"}
        Side in `xosc` that the other vehicle comes from or leaves to; by default the scenario's, else left.
    **case
        `Case` of `lanesweep.options`; it overrides values of a file.

    Returns
    -------
    Result
        Its text is the series, as CSV.
    """
    if isinstance(compare, (bool, np.bool_)):
        return run("trace", {**locals(), "compare": "S" if compare else None})
    return run("trace", locals())


def merge(folder: Path, *, failures: Path | None = None, **options: Unpack[Run]) -> Result:
    """Merge the parts of a run into its result, bit for bit that of the whole run.

    Checks that the parts belong to the plan in the folder, are complete, and cover every lane exactly once. Names each missing, double,
    foreign or damaged part.

    Parameters
    ----------
    folder : path
        Folder of the run, with its plan and parts.
    failures : path
        Of a sampling run: also write the first failing lanes, as of `sample`.
    **options
        `Run` of `lanesweep.options`.

    Returns
    -------
    Result
    """
    return run("merge", locals(), path=folder)
