"""Verbs of the program as functions: the same work, with values as arguments and a `Result` in place of text.

Written by ``python tools/verbs.py`` from the help of the program.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, TypedDict

from ._result import Result
from ._run import run
from .options import (
    Categories,
    Category,
    Config,
    Criterion,
    Float,
    Headways,
    Int,
    Keys,
    Models,
    Number,
    Path,
    Paths,
    Speed,
    Table,
    Values,
)

__all__ = [
    "Case",
    "check",
    "devices",
    "fit",
    "map",
    "merge",
    "mine",
    "sample",
    "study",
    "trace",
    "tracks",
]


class Case(TypedDict, total=False):
    """One case, as a mapping. A table of cases has these names as columns."""

    category: Category
    """Kind of scenario: cut-in, cut-out, lvd."""
    ego_speed: Speed
    """Initial speed of the ego, with its unit: 60km/h."""
    speed: Speed
    """Initial speed of the other vehicle, with its unit, by default the ego's."""
    gap: Number
    """Initial gap, bumper to bumper (m)."""
    thw: Number
    """Initial time headway instead of the gap (s)."""
    lateral_speed: Number
    """Cut-in, cut-out: lateral speed (m/s)."""
    lateral_distance: Number
    """Cut-in: lateral distance at the start; cut-out: at the end, by default the lane's width (m)."""
    acceleration: Number
    """Acceleration of the other vehicle; an LVD needs one, by default 0 (m/s²)."""
    end_speed: Speed
    """Speed at which the acceleration ends, with its unit, by default standstill, or never."""
    ahead_speed: Speed
    """Cut-out: speed of the vehicle ahead of the cutting-out one, with its unit, by default 0."""
    ahead_gap: Number
    """Cut-out: gap between the two, bumper to bumper (m)."""
    length: Number
    """Length of every vehicle, by default the profile's (m)."""
    width: Number
    """Width of every vehicle, by default the profile's (m)."""
    ego_length: Number
    """Length of the ego, by default that of every vehicle (m)."""
    ego_width: Number
    """Width of the ego, by default that of every vehicle (m)."""
    lane_width: Number
    """Width of the lanes, by default the scenario's, else 3.5 (m)."""
    ego_speed_kmh: Float
    speed_kmh: Float
    end_speed_kmh: Float
    ahead_speed_kmh: Float
    duration: Number


def study(
    recordings: Path | None = None,
    *,
    preset: Path | None = None,
    scenarios: Path | Table | None = None,
    filter: bool = False,
    accept_implausible: bool = False,
    external: Paths | Mapping[str, Any] | None = None,
    synth_recordings: Int | None = None,
    categories: Categories | None = None,
    thw: Headways | None = None,
    published: bool = False,
    models: Models | None = None,
    profile: Path | None = None,
    dt: Number | None = None,
    out: Path | None = None,
    rows: Path | None = None,
    figures: Literal["titled", "plain"] | None = None,
    config: Config | None = None,
    backend: Literal["auto", "cpu", "gpu"] | None = None,
    device: str | Int | None = None,
    seed: Int | None = None,
    threads: Int | None = None,
) -> Result:
    """How far do parameterized scenarios agree with recorded ones?

    Mines cut-ins, cut-outs and leader decelerations. Replays each as recorded (S) and parameterized (S') from ten time
    headways with every driver model, evaluates collision, TTC and BTN, and scores S' against S. Without data it uses
    generated recordings. The answer goes to stdout, tables and figures to `out`.

    Parameters
    ----------
    recordings : Path
        Folder of recordings, or a track file, by default synthetic recordings. highD's format, or that of a preset,
        which the names of the columns tell; see `lanesweep tracks`.
    preset : Path
        Format of the recordings: exid, sumo-fcd, … or a TOML file, by default detected.
    scenarios : Path | Table
        Scenario file (.jsonl, .parquet, .csv) instead of recordings.
    filter : bool
        Keep only scenarios of the file that pass the filters of mining, by default kept as given.
    accept_implausible : bool
        Use physically impossible values (a speed of 108 m/s) with a warning.
    external : Paths | Mapping[str, Any]
        S' of another program, a scenario file. It has the ids of S; its series may have any sample rate and length.
    synth_recordings : Int
        Number of generated recordings. They are called `01`, `02`, ….
    categories : Categories
        Kinds of scenario: cut-in, cut-out, lvd, by default all.
    thw : Headways
        Time headways, s: numbers, paper, r157, observed. paper: 2.0, 1.8, … 0.2. The paper's claims need all of its
        headways. r157: the minimum following distance of UN R157, 5.2.3.3, for the ego's speed; a list may contain it.
        observed: each scenario starts from its recorded gap, and a density draws the headway as one more parameter; it
        cannot be combined with other headways.
    published : bool
        Set the paper's published numbers (of highD) beside ours on the page; run.json has the differences.
    models : Models
        Driver models: Reg157, CCHDM, RSS, FSM, by default all.
    profile : Path
        Name of a profile, or a TOML file of your own. Profiles: paper, paper-fit, jrc-2021, un-r157, eu-2022-1426,
        eu-2022-1426-standing. `map --preset jrc` takes jrc-2021 unless it is set.
    dt : Number, s
        Time step, by default the profile's.
    out : Path
        Folder for tables, figures and run.json.
    rows : Path
        Also write one row per lane: .csv, .jsonl or .parquet.
    figures : Literal["titled", "plain"]
        Figures with their texts, or plain ones for a paper: 88 or 180 mm wide, the texts in NAME.txt.
    config : Config
        Configuration file, or one key of it. `lanesweep config init` writes such a file. Without `config`,
        LANESWEEP_CONFIG names it.
    backend : Literal["auto", "cpu", "gpu"]
        Backend; auto: a GPU if there is one.
    device : str | Int
        Device, by part of its name, PCI bus id or index. `lanesweep devices` lists the devices. The default is the
        first GPU.
    seed : Int
        Seed that chooses the lanes to check on the CPU. No score depends on it.
    threads : Int
        Threads; results do not depend on it, by default all cores.

    Returns
    -------
    Result

    Examples
    --------
    >>> result = lanesweep.study(synth_recordings=2, models=["Reg157", "FSM"])
    >>> result.table("results").shape[0] > 100
    True
    """
    return run("study", locals())


def tracks(
    paths: Paths | None = None,
    *,
    preset: Path | None = None,
    synth_recordings: Int | None = None,
    out: Path | None = None,
    convert: Path | None = None,
    config: Config | None = None,
    threads: Int | None = None,
) -> Result:
    """What is in a track file? Check it, draw it, convert it.

    Finds the format by the names of the columns, reads the tracks and says what was understood: rate, vehicles, road,
    lanes, speeds, scenarios. Checks the file against itself: units, axes, reference point, lanes, jumps, overlaps.
    Verbs that take recordings read the same files. A preset is a TOML file that says what the columns mean. Without a
    path, `convert` DIR writes the synthetic recordings that `study` uses without data.

    Parameters
    ----------
    paths : Paths
        Track files, or folders of them.
    preset : Path
        Format of the files: exid, sumo-fcd, … or a TOML file, by default detected.
    synth_recordings : Int
        Number of generated recordings. They are called `01`, `02`, ….
    out : Path
        Folder for tracks.json and a figure of each recording: positions across the road.
    convert : Path
        Write the tracks in highD's format into this folder, or as one table: .csv, .parquet.
    config : Config
        Configuration file, or one key of it. `lanesweep config init` writes such a file. Without `config`,
        LANESWEEP_CONFIG names it.
    threads : Int
        Threads; results do not depend on it, by default all cores.

    Returns
    -------
    Result

    Examples
    --------
    >>> recordings = lanesweep.tracks(convert="recordings", synth_recordings=1)  # in highD's format
    >>> "nothing contradicts itself" in lanesweep.tracks(recordings).text
    True
    """
    return run("tracks", locals())


def mine(
    recordings: Path,
    *,
    preset: Path | None = None,
    kept: bool = False,
    accept_implausible: bool = False,
    out: Path | None = None,
    config: Config | None = None,
    threads: Int | None = None,
) -> Result:
    """Mine cut-ins, cut-outs and leader decelerations from recordings.

    Reads recordings in highD's format or another one (see `lanesweep tracks`) and writes one JSON line per scenario
    with its series, or one row if FILE ends in .parquet; `study --scenarios FILE` reads it. The driven time and
    distance go to FILE.exposure.json beside it, so that `fit --scenarios FILE` can compute events per hour.

    Parameters
    ----------
    recordings : Path
        Folder of recordings, or a track file.
    preset : Path
        Format of the recordings: exid, sumo-fcd, … or a TOML file, by default detected.
    kept : bool
        Only scenarios that pass the paper's filters.
    accept_implausible : bool
        Use physically impossible values (a speed of 108 m/s) with a warning.
    out : Path
        File to write, .jsonl or .parquet, by default standard output, JSON Lines.
    config : Config
        Configuration file, or one key of it. `lanesweep config init` writes such a file. Without `config`,
        LANESWEEP_CONFIG names it.
    threads : Int
        Threads; results do not depend on it, by default all cores.

    Returns
    -------
    Result

    Examples
    --------
    >>> mined = lanesweep.mine(lanesweep.tracks(convert="recordings", synth_recordings=1))
    >>> lanesweep.study(scenarios=mined, thw=1.2).status
    'ok'
    """
    return run("mine", locals())


def fit(
    recordings: Path | None = None,
    *,
    preset: Path | None = None,
    scenarios: Path | Table | None = None,
    filter: bool = False,
    accept_implausible: bool = False,
    hours: Float | None = None,
    km: Float | None = None,
    synth_recordings: Int | None = None,
    categories: Categories | None = None,
    parameterizations: Keys | None = None,
    with_thw: bool = False,
    without_scenarios: bool = False,
    out: Path | None = None,
    config: Config | None = None,
    seed: Int | None = None,
    threads: Int | None = None,
) -> Result:
    """How are the parameters of scenarios distributed?

    Fits a density to the kept scenarios of each category under each parameterization. Computes the physically possible
    fraction of each density, and how often such scenarios occur. Writes one density file per parameterization. Without
    data it uses generated recordings. Tables go to stdout, files to `out`.

    Parameters
    ----------
    recordings : Path
        Folder of recordings, or a track file, by default synthetic recordings. highD's format, or that of a preset,
        which the names of the columns tell; see `lanesweep tracks`.
    preset : Path
        Format of the recordings: exid, sumo-fcd, … or a TOML file, by default detected.
    scenarios : Path | Table
        Scenario file (.jsonl, .parquet, .csv) instead of recordings.
    filter : bool
        Keep only scenarios of the file that pass the filters of mining, by default kept as given.
    accept_implausible : bool
        Use physically impossible values (a speed of 108 m/s) with a warning.
    hours : Float, h
        Driven time of all egos, by default from the recordings.
    km : Float, km
        Driven distance of all egos, by default from the recordings.
    synth_recordings : Int
        Number of generated recordings. They are called `01`, `02`, ….
    categories : Categories
        Kinds of scenario: cut-in, cut-out, lvd, by default all.
    parameterizations : Keys
        Parameterizations: 1…7, a…g, i…v, by default all. 1…7 are for cut-ins, a…g for cut-outs, i…v for leader
        decelerations.
    with_thw : bool
        Add the observed time headway as a parameter (thw_s).
    without_scenarios : bool
        Leave the recorded series out of the density files. `sample` then cannot compare its rates with those of the
        recorded scenarios. Use it if you share the file but not the recordings.
    out : Path
        Folder of density files, or one file.json for one density.
    config : Config
        Configuration file, or one key of it. `lanesweep config init` writes such a file. Without `config`,
        LANESWEEP_CONFIG names it.
    seed : Int
        Seed of P_valid.
    threads : Int
        Threads; results do not depend on it, by default all cores.

    Returns
    -------
    Result

    Examples
    --------
    >>> fitted = lanesweep.fit(synth_recordings=4, categories="cut-in", parameterizations=2)
    >>> list(fitted.densities)
    ['cut-in-2']
    """
    return run("fit", locals())


def sample(
    density: Path | None = None,
    *,
    proposal: Path | None = None,
    accept_implausible: bool = False,
    thw: Headways | None = None,
    models: Models | None = None,
    profile: Path | None = None,
    dt: Number | None = None,
    estimator: Literal["auto", "mc", "is"] | None = None,
    samples: Int | None = None,
    criterion: Criterion | None = None,
    level: Float | None = None,
    half_width: Float | None = None,
    time_limit: Number | None = None,
    assurance: Literal["draws", "search"] | None = None,
    rows: Path | None = None,
    failures: Path | None = None,
    out: Path | None = None,
    config: Config | None = None,
    backend: Literal["auto", "cpu", "gpu"] | None = None,
    device: str | Int | None = None,
    seed: Int | None = None,
    threads: Int | None = None,
) -> Result:
    """How likely does a driver fail?

    Draws concrete scenarios from a density (see `lanesweep fit`), runs each against the driver models and estimates the
    probability of failure with its interval, by crude Monte Carlo or importance sampling. With `half_width` it takes
    the cheaper one for each question. Each estimate has a verdict on whether to trust it. A table goes to stdout, files
    to `out`.

    Parameters
    ----------
    density : Path
        Density file.
    proposal : Path
        Proposal file to sample, with `estimator` is.
    accept_implausible : bool
        Use physically impossible values (a speed of 108 m/s) with a warning.
    thw : Headways
        Time headways, s, by default the density's, else paper. paper is 2.0, 1.8, … 0.2. observed (or sampled): the
        headway is drawn from the recorded ones, as a parameter of the density, which needs `fit --with-thw`.
    models : Models
        Driver models: Reg157, CCHDM, RSS, FSM, by default all.
    profile : Path
        Name of a profile, or a TOML file of your own. Profiles: paper, paper-fit, jrc-2021, un-r157, eu-2022-1426,
        eu-2022-1426-standing. `map --preset jrc` takes jrc-2021 unless it is set.
    dt : Number, s
        Time step, by default the profile's.
    estimator : Literal["auto", "mc", "is"]
        Crude, importance, or the cheaper one. Importance sampling searches the failures, then draws around them; `auto`
        chooses for each model and headway, and is `mc` without a half-width.
    samples : Int
        Number of samples, by default 100000, or as needed. With a half-width: the maximum.
    criterion : Criterion
        Criterion of importance sampling and of a half-width.
    level : Float
        Level of the intervals.
    half_width : Float
        Reach this half-width over estimate. It is that of the draws' interval; mc checks it after 4096·2^k samples. The
        default of is is 0.1 unless the number of samples is given; else none.
    time_limit : Number, s
        Stop at the first check after this time (not reproducible), by default no limit.
    assurance : Literal["draws", "search"]
        What importance sampling rests on. `draws` of the density bound what its search missed; the `search` alone costs
        20,000 to 65,000 lanes a question as a rule, for drivers that take a millisecond a lane, and bounds nothing.
    rows : Path
        Also write one row per lane: .csv, .jsonl or .parquet.
    failures : Path
        Also write the first failing lanes of each model and criterion: .csv, .jsonl or .parquet. The first 1000, or
        sample.failures_limit; with the columns of `rows`. With importance sampling it may take as long as the run, on
        the CPU. For a run in parts: `merge --failures`.
    out : Path
        Folder for estimate.json, tables and figures.
    config : Config
        Configuration file, or one key of it. `lanesweep config init` writes such a file. Without `config`,
        LANESWEEP_CONFIG names it.
    backend : Literal["auto", "cpu", "gpu"]
        Backend; auto: a GPU if there is one.
    device : str | Int
        Device, by part of its name, PCI bus id or index. `lanesweep devices` lists the devices. The default is the
        first GPU.
    seed : Int
        Seed of the draws.
    threads : Int
        Threads; results do not depend on it, by default all cores.

    Returns
    -------
    Result

    Examples
    --------
    >>> fitted = lanesweep.fit(synth_recordings=4, categories="cut-in", parameterizations=2)
    >>> estimates = lanesweep.sample(fitted, samples=20_000, thw=0.6, models="FSM").table("estimates")
    >>> estimates["criterion"].tolist()
    ['collision', 'ttc', 'btn']
    """
    return run("sample", locals())


def map(
    category: Category,
    *,
    accept_implausible: bool = False,
    preset: str | None = None,
    x: str | None = None,
    y: str | None = None,
    panel: Values | None = None,
    set: Values | None = None,
    models: Models | None = None,
    criterion: Criterion | None = None,
    robust: bool = False,
    profile: Path | None = None,
    dt: Number | None = None,
    out: Path | None = None,
    config: Config | None = None,
    backend: Literal["auto", "cpu", "gpu"] | None = None,
    device: str | Int | None = None,
    threads: Int | None = None,
) -> Result:
    """Map outcomes over two parameters.

    Every cell is one concrete case. `preset` takes the grids of the JRC's evidence (jrc) or of the regulation's Annex 3
    (r157, to 60 and to 130 km/h); `x`, `y`, `panel` and `set` define any other grid. Writes a sheet per grid and model
    (SVG), cells.csv and map.json. The percentages of cells with a failure go to stdout.

    Parameters
    ----------
    category : Category
        Kind of scenario: cut-in, cut-out, lvd.
    accept_implausible : bool
        Use physically impossible values (a speed of 108 m/s) with a warning.
    preset : str
        Predefined grids with their models: jrc, r157.
    x : str
        Parameter of the x axis: NAME=FROM..TO/STEP or NAME=A,B,C.
    y : str
        Parameter of the y axis.
    panel : Values
        Parameter of the panels. Several of them give one panel per combination.
    set : Values
        Constant parameter.
    models : Models
        Driver models: Reg157, CCHDM, RSS, FSM, by default all.
    criterion : Criterion
        Criterion to evaluate.
    robust : bool
        Mark cells whose outcome changes with a tenth of the time step, 1 cm or 0.1 km/h. They are undecided. Each cell
        is simulated eight times; sheets show undecided cells in their own colour.
    profile : Path
        Name of a profile, or a TOML file of your own. Profiles: paper, paper-fit, jrc-2021, un-r157, eu-2022-1426,
        eu-2022-1426-standing. `map --preset jrc` takes jrc-2021 unless it is set.
    dt : Number, s
        Time step, by default the profile's.
    out : Path
        Folder of the results.
    config : Config
        Configuration file, or one key of it. `lanesweep config init` writes such a file. Without `config`,
        LANESWEEP_CONFIG names it.
    backend : Literal["auto", "cpu", "gpu"]
        Backend; auto: a GPU if there is one.
    device : str | Int
        Device, by part of its name, PCI bus id or index. `lanesweep devices` lists the devices. The default is the
        first GPU.
    threads : Int
        Threads; results do not depend on it, by default all cores.

    Returns
    -------
    Result

    Examples
    --------
    >>> found = lanesweep.map("cut-in", x="gap_m=5..40/5", y="lateral_speed_mps=0.5..1.5/0.5", set={"ego_speed_kmh": 60, "other_speed_kmh": 40})
    >>> len(found.table("cells"))
    96
    """
    return run("map", locals())


def check(
    file: Path | Case | Table | None = None,
    *,
    row: Int | None = None,
    scenario: str | None = None,
    accept_implausible: bool = False,
    gap: Number | None = None,
    thw: Number | None = None,
    models: Models | None = None,
    profiles: Paths | None = None,
    nominal: bool = False,
    full: bool = False,
    sheet: Path | None = None,
    rows: Path | None = None,
    date: str | None = None,
    author: str | None = None,
    config: Config | None = None,
    backend: Literal["auto", "cpu", "gpu"] | None = None,
    device: str | Int | None = None,
    threads: Int | None = None,
) -> Result:
    """Check concrete cases: do the reference drivers of UN R157 avoid the collision?

    The case comes from flags, from a TOML file or a table (keys and columns are the flags' names with `_`, speeds with
    their unit, `ego_speed_kmh`; flags override them), or from a scenario of a file. Every model runs under every
    profile. The case is preventable if CCHDM or FSM, the drivers of Annex 3, avoids the collision under the first
    profile. It has no conflict if nothing collides even when the ego never reacts. It is undecided if a tenth of the
    time step or a measurement error of an input changes the answer. It is outside Annex 3 if the annex does not
    describe such a case. The output also has the margins, the clauses, and the distance to another answer along each
    parameter. A table without `row` is judged whole, under one profile, with a line per row; its exit status is that of
    its worst answer, in the order not preventable, undecided, outside Annex 3, preventable, no conflict. Exit status: 0
    preventable, 1 not preventable, 8 undecided, 9 no conflict, 10 outside Annex 3, 4 parts of the input were skipped.

    Parameters
    ----------
    file : Path | Case | Table
        TOML file, table (.csv, .parquet) or scenario file (.jsonl) with the case.
    row : Int
        Row of a table, from 1 after the header, by default all rows.
    scenario : str
        Scenario of a scenario file, by its id. It starts with its observed gap, or with `gap` or `thw`.
    accept_implausible : bool
        Use physically impossible values (a speed of 108 m/s) with a warning.
    gap : Number, m
        Initial gap, bumper to bumper.
    thw : Number, s
        Initial time headway instead of the gap.
    models : Models
        Driver models: Reg157, CCHDM, RSS, FSM, by default all.
    profiles : Paths
        Profiles; the first one decides, by default un-r157, and the five others.
    nominal : bool
        Only the computed answers of a table, by lanes: a million rows take seconds. No perturbation, clause or boundary
        is examined, so that no answer is robust.
    full : bool
        Print the whole sheet of a case: other profiles, clauses, readings, hashes.
    sheet : Path
        Also write the sheet of a case, a page to print.
    rows : Path
        Also write a table's answers, one row per case: .csv, .jsonl or .parquet.
    date : str
        Date of the run, as the sheet is to show it; the clock is not asked.
    author : str
        Author, as the sheet is to show it.
    config : Config
        Configuration file, or one key of it. `lanesweep config init` writes such a file. Without `config`,
        LANESWEEP_CONFIG names it.
    backend : Literal["auto", "cpu", "gpu"]
        Backend; auto: a GPU if there is one.
    device : str | Int
        Device, by part of its name, PCI bus id or index. `lanesweep devices` lists the devices. The default is the
        first GPU.
    threads : Int
        Threads; results do not depend on it, by default all cores.

    Returns
    -------
    Result

    Examples
    --------
    >>> case = {"category": "cut-in", "ego_speed": "60km/h", "speed": "40km/h", "gap": 15, "lateral_speed": 1}
    >>> lanesweep.check(case).status
    'preventable'
    """
    return run("check", locals())


def trace(
    *,
    case_file: Path | None = None,
    table: Path | Case | Table | None = None,
    row: Int | None = None,
    scenarios: Path | Table | None = None,
    from_: Path | None = None,
    lane: Values | None = None,
    accept_implausible: bool = False,
    gap: Number | None = None,
    thw: Number | None = None,
    compare: Keys | bool | None = None,
    models: Models | None = None,
    profile: Path | None = None,
    dt: Number | None = None,
    plot: Path | None = None,
    plot_end: Number | None = None,
    xosc: Path | None = None,
    ego: Literal["model", "external"] | None = None,
    duration: Number | None = None,
    side: Literal["left", "right"] | None = None,
    config: Config | None = None,
    threads: Int | None = None,
) -> Result:
    """Run one concrete scenario and print or draw its time series.

    The case comes from flags, from a TOML file, from a row of a table (keys and columns are the flags' names with `_`,
    speeds with their unit, `ego_speed_kmh`; flags override them), or from a finished run or a scenario file with a lane
    key. The series goes to stdout as CSV, the outcome to stderr, the figure to `plot`, OpenSCENARIO files to `xosc`.
    Several models (`models` FSM,RSS), variants (`compare`) or lanes follow one another in the CSV and share one figure.

    Parameters
    ----------
    case_file : Path
        TOML file with the case.
    table : Path | Case | Table
        Table (.csv, .parquet) with one case per row.
    row : Int
        Row of the table, from 1 after the header; needed if it has several.
    scenarios : Path | Table
        Scenario file (.jsonl, .parquet, .csv) for `lane`. With `from_` a study and `xosc`: the study's scenarios, for
        sizes, side and lane width.
    from_ : Path
        Folder (`out`) of a study or sample, for `lane`. Repeats that lane with the run's profile and options, bit for
        bit, and reports whether f64 gives another outcome.
    lane : Values
        Lane key: scenario/variant/headway/model.
    accept_implausible : bool
        Use physically impossible values (a speed of 108 m/s) with a warning.
    gap : Number, m
        Initial gap, bumper to bumper.
    thw : Number, s
        Initial time headway instead of the gap.
    compare : Keys | bool
        Also simulate other variants of the lane's scenario. S (the recorded scenario; the default without a value),
        keys of parameterizations, or all.
    models : Models
        Driver models: Reg157, CCHDM, RSS, FSM, by default all.
    profile : Path
        Name of a profile, or a TOML file of your own. Profiles: paper, paper-fit, jrc-2021, un-r157, eu-2022-1426,
        eu-2022-1426-standing. `map --preset jrc` takes jrc-2021 unless it is set.
    dt : Number, s
        Time step, by default the profile's.
    plot : Path
        Also draw the time series. Speed, acceleration, gap, TTC, BTN, PFS, CFS and lateral position, with reaction,
        braking and contact. `rsvg-convert` makes PNG and PDF of it.
    plot_end : Number, s
        End of the figure's time axis, by default 2 s after the last decisive event.
    xosc : Path
        Also write ASAM OpenSCENARIO XML 1.2 with OpenDRIVE roads. Every lane becomes NNN-KEY.xosc and NNN-KEY.xodr in
        this folder; index.csv lists them with their outcomes. The other vehicles follow their own motion, step by step.
    ego : Literal["model", "external"]
        Driver of the ego in `xosc`. model: the ego follows the path that the driver model drove. external: your own
        controller drives the ego; only its position and speed at the start are written.
    duration : Number, s
        End of the scenario with `ego` external, by default 10 s after the lane's last event and end.
    side : Literal["left", "right"]
        Side in `xosc` that the other vehicle comes from or leaves to, by default the scenario's, else left.
    config : Config
        Configuration file, or one key of it. `lanesweep config init` writes such a file. Without `config`,
        LANESWEEP_CONFIG names it.
    threads : Int
        Threads; results do not depend on it, by default all cores.

    Returns
    -------
    Result

    Examples
    --------
    >>> case = {"category": "cut-in", "ego_speed": "60km/h", "speed": "40km/h", "gap": 15, "lateral_speed": 1}
    >>> steps = lanesweep.trace(table=case, models="FSM").table("steps")
    >>> steps.columns[:3]
    ['t_s', 'x_ego_m', 'v_ego_mps']
    """
    return run("trace", locals())


def merge(
    folder: Path,
    *,
    failures: Path | None = None,
    config: Config | None = None,
    threads: Int | None = None,
) -> Result:
    """Merge the parts of a run into its result.

    Checks that the parts in DIR (written by `shard`) belong to the plan in DIR, are complete, and cover every lane
    exactly once. Names each missing, duplicate, foreign or damaged part, with the command that recomputes it. The
    result is written to DIR; it equals, bit for bit, the result of the unsplit run.

    Parameters
    ----------
    folder : Path
        The run's folder.
    failures : Path
        Of a sampling run: also write the first failing lanes, as `sample --failures`.
    config : Config
        Configuration file, or one key of it. `lanesweep config init` writes such a file. Without `config`,
        LANESWEEP_CONFIG names it.
    threads : Int
        Threads; results do not depend on it, by default all cores.

    Returns
    -------
    Result
    """
    return run("merge", locals())


def devices(
    *,
    config: Config | None = None,
    threads: Int | None = None,
) -> Result:
    """List the compute devices and the one that is used.

    Each device of each driver, by name, interface and PCI bus id, and whether it has the exact path; then what
    `--backend auto` selects: the first GPU, discrete before virtual before integrated, never software.

    Parameters
    ----------
    config : Config
        Configuration file, or one key of it. `lanesweep config init` writes such a file. Without `config`,
        LANESWEEP_CONFIG names it.
    threads : Int
        Threads; results do not depend on it, by default all cores.

    Returns
    -------
    Result

    Examples
    --------
    >>> print(lanesweep.devices())  # doctest: +SKIP
    """
    return run("devices", locals())
