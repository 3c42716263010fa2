"""Verbs of the program as functions. Written by tools/generate.py; do not edit."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TypeAlias

from ._driver import Driver
from ._result import Result
from ._run import run

Path: TypeAlias = str | os.PathLike[str]
Value: TypeAlias = str | float | Path
Values: TypeAlias = Value | Sequence[Value] | Mapping[str, Value]
Models: TypeAlias = str | Driver | Sequence[str | Driver]

__all__ = [
    "check",
    "compare",
    "export_xosc",
    "fit",
    "justify",
    "map",
    "merge",
    "mine",
    "sample",
    "search",
    "study",
    "synth",
    "trace",
    "tracks",
]


def study(
    recordings: Value | None = None,
    *,
    scenarios: Value | None = None,
    external: Values | None = None,
    preset: Value | None = None,
    accept_implausible: bool = False,
    synth_recordings: Value | None = None,
    categories: Values | None = None,
    thw: Values | None = None,
    published: bool = False,
    reference: bool = False,
    models: Models | None = None,
    cross_validate: bool = False,
    profile: Value | None = None,
    compare_reference: bool = False,
    dt: Value | None = None,
    rows: Value | None = None,
    keep_plan: Value | None = None,
    shard: Value | None = None,
    config: Values | None = None,
    backend: Value | None = None,
    device: Value | None = None,
    seed: Value | None = None,
    plan: Value | None = None,
    plan_only: bool = False,
    stop_after: Value | None = None,
    threads: Value | None = None,
    out: Path | None = None,
) -> Result:
    """How far do parameterized scenarios agree with recorded ones?

    Mines cut-ins, cut-outs and leader decelerations. Replays each as recorded (S) and parameterized (S') from ten
    time headways with every driver model, evaluates collision, TTC and BTN, and scores S' against S. Without data
    it uses generated recordings. The answer goes to stdout, tables and figures to --out.

    Parameters
    ----------
    recordings : Value
        Folder of recordings, or a track file [default: synthetic recordings]. highD's format, or that of a
        preset, which the names of the columns tell; see `lanesweep tracks`.
    scenarios : Value
        Scenario file (.jsonl, .parquet, .csv) instead of recordings.
    external : Values
        S' of another program (scenario file), or winner.json of `search`. A scenario file has the ids of S; its
        series may have any sample rate and length. Repeatable.
    preset : Value
        Format of the recordings: exid, sumo-fcd, … or a TOML file [default: detected].
    accept_implausible : bool
        Use physically impossible values (a speed of 108 m/s) with a warning.
    synth_recordings : Value, default 84
        Number of generated recordings. They are called `01`, `02`, ….
    categories : Values
        Kinds of scenario: cut-in, cut-out, lvd [default: all].
    thw : Values, default paper
        Time headways, s; paper: 2.0, 1.8, … 0.2; r157; observed: the recorded gaps. The paper's claims need all
        of its headways. r157: the minimum following distance of UN R157, 5.2.3.3, for the ego's speed; a list
        may contain it. observed: each scenario starts from its recorded gap, and a density draws the headway as
        one more parameter; it cannot be combined with other headways.
    published : bool
        Add the paper's published numbers (of highD) to tables and page.
    reference : bool
        Compute in binary64 on the CPU, not in the f32 lane arithmetic.
    models : Models
        Driver models: Reg157, CCHDM, RSS, FSM [default: all].
    cross_validate : bool
        Also replay scenarios by bases that have not seen them. Scenarios are divided into folds by recording
        ([search] folds). Each decomposition gets a variant, 5-cv. A basis fitted on the scenarios that it
        replays flatters itself.
    profile : Value, default paper
        paper, paper-fit, jrc-2021, un-r157. Name of a profile, or a TOML file of your own. `map --preset jrc`
        takes jrc-2021 unless it is set.
    compare_reference : bool
        Run both arithmetics and list every verdict that differs (reference.csv in --out).
    dt : Value, s
        Time step [default: the profile's].
    rows : Value
        Also write one row per lane: .csv, .jsonl or .parquet.
    keep_plan : Value, default auto
        Keep the plan in --out for `simulate --from`. The plan is run-plan.json; with it you can repeat each
        lane. auto keeps it up to 256 MiB, about 135,000 scenarios.
        One of auto, always, never.
    shard : Value
        Compute shard I of N (from 0); `cluster merge` merges them. The part is written to --out. `auto/N` takes
        I from a Kubernetes Indexed Job or a Slurm array.
    config : Values
        Configuration file, or one key of it; repeatable. `lanesweep config init` writes such a file. Without
        --config, LANESWEEP_CONFIG names it.
    backend : Value, default auto
        Backend; auto: a GPU if there is one.
        One of auto, cpu, gpu.
    device : Value
        Device, by part of its name, PCI bus id or index. `lanesweep verify devices` lists the devices. The
        default is the first GPU.
    seed : Value, default 157
        Seed that chooses the lanes to check on the CPU. No score depends on it.
    plan : Value
        Run a plan that --plan-only wrote.
    plan_only : bool
        Write the plan, plan.json in --out, and stop.
    stop_after : Value, s
        After this time, finish the current chunk and stop, as after Ctrl-C; the same command resumes.
    threads : Value
        Threads; results do not depend on it [default: all cores].
    out : path, optional
        Where the files stay; without it they go with the result.

    Returns
    -------
    Result
    """
    return run(
        'study',
        [
            (None, recordings, False),
            ('scenarios', scenarios, False),
            ('external', external, False),
            ('preset', preset, False),
            ('accept-implausible', accept_implausible, False),
            ('synth-recordings', synth_recordings, False),
            ('categories', categories, True),
            ('thw', thw, True),
            ('published', published, False),
            ('reference', reference, False),
            ('models', models, True),
            ('cross-validate', cross_validate, False),
            ('profile', profile, False),
            ('compare-reference', compare_reference, False),
            ('dt', dt, False),
            ('rows', rows, False),
            ('keep-plan', keep_plan, False),
            ('shard', shard, False),
            ('config', config, False),
            ('backend', backend, False),
            ('device', device, False),
            ('seed', seed, False),
            ('plan', plan, False),
            ('plan-only', plan_only, False),
            ('stop-after', stop_after, False),
            ('threads', threads, False),
        ],
        out=out,
        default_out='study',
    )


def tracks(
    paths: Value,
    *,
    preset: Value | None = None,
    write_preset: Value | None = None,
    convert: Value | None = None,
    config: Values | None = None,
    threads: Value | None = None,
    out: Path | None = None,
) -> Result:
    """What is in a track file? Check it, draw it, convert it

    Finds the format by the names of the columns, reads the tracks and says what was understood: rate, vehicles,
    road, lanes, speeds, scenarios. Checks the file against itself: units, axes, reference point, lanes, jumps,
    overlaps. Verbs that take recordings read the same files. A preset is a TOML file that says what the columns
    mean.

    Parameters
    ----------
    paths : Values
        Track files, or folders of them.
    preset : Value
        Format of the files: exid, sumo-fcd, … or a TOML file [default: detected].
    write_preset : Value
        Write a first preset for a file that no preset fits.
    convert : Value
        Write the tracks in highD's format into this folder, or as one table: .csv, .parquet.
    config : Values
        Configuration file, or one key of it; repeatable. `lanesweep config init` writes such a file. Without
        --config, LANESWEEP_CONFIG names it.
    threads : Value
        Threads; results do not depend on it [default: all cores].
    out : path, optional
        Where the files stay; without it they go with the result.

    Returns
    -------
    Result
    """
    return run(
        'tracks',
        [
            (None, paths, False),
            ('preset', preset, False),
            ('write-preset', write_preset, False),
            ('convert', convert, False),
            ('config', config, False),
            ('threads', threads, False),
        ],
        out=out,
        default_out='tracks',
    )


def mine(
    recordings: Value,
    *,
    kept: bool = False,
    preset: Value | None = None,
    accept_implausible: bool = False,
    config: Values | None = None,
    threads: Value | None = None,
    out: Path | None = None,
) -> Result:
    """Mine cut-ins, cut-outs and leader decelerations from recordings

    Reads recordings in highD's format or another one (see `lanesweep tracks`) and writes one JSON line per scenario
    with its series, or one row if FILE ends in .parquet; `study --scenarios FILE` reads it. The driven time and
    distance go to FILE.exposure.json beside it, so that `fit --scenarios FILE` can compute events per hour.

    Parameters
    ----------
    recordings : Value
        Folder of recordings, or a track file.
    kept : bool
        Only scenarios that pass the paper's filters.
    preset : Value
        Format of the recordings: exid, sumo-fcd, … or a TOML file [default: detected].
    accept_implausible : bool
        Use physically impossible values (a speed of 108 m/s) with a warning.
    config : Values
        Configuration file, or one key of it; repeatable. `lanesweep config init` writes such a file. Without
        --config, LANESWEEP_CONFIG names it.
    threads : Value
        Threads; results do not depend on it [default: all cores].
    out : path, optional
        Where the files stay; without it they go with the result.

    Returns
    -------
    Result
    """
    return run(
        'mine',
        [
            (None, recordings, False),
            ('kept', kept, False),
            ('preset', preset, False),
            ('accept-implausible', accept_implausible, False),
            ('config', config, False),
            ('threads', threads, False),
        ],
        out=out,
        default_out='scenarios.jsonl',
    )


def fit(
    recordings: Value | None = None,
    *,
    scenarios: Value | None = None,
    hours: Value | None = None,
    km: Value | None = None,
    preset: Value | None = None,
    accept_implausible: bool = False,
    synth_recordings: Value | None = None,
    categories: Values | None = None,
    parameterizations: Values | None = None,
    with_thw: bool = False,
    density: Value | None = None,
    no_comparison: bool = False,
    without_scenarios: bool = False,
    bandwidth_rule: Value | None = None,
    config: Values | None = None,
    seed: Value | None = None,
    threads: Value | None = None,
    out: Path | None = None,
) -> Result:
    """How are the parameters of scenarios distributed?

    Fits a density to the kept scenarios of each category under each parameterization. Computes the physically
    possible fraction of each density, how often such scenarios occur, and how well drawn scenarios represent unseen
    real ones. Writes one density file per parameterization. Without data it uses generated recordings. Tables go to
    stdout, files to --out.

    Parameters
    ----------
    recordings : Value
        Folder of recordings, or a track file [default: synthetic recordings]. highD's format, or that of a
        preset, which the names of the columns tell; see `lanesweep tracks`.
    scenarios : Value
        Scenario file (.jsonl, .parquet, .csv) instead of recordings.
    hours : Value, h
        Driven time of all egos [default: from the recordings].
    km : Value, km
        Driven distance of all egos [default: from the recordings].
    preset : Value
        Format of the recordings: exid, sumo-fcd, … or a TOML file [default: detected].
    accept_implausible : bool
        Use physically impossible values (a speed of 108 m/s) with a warning.
    synth_recordings : Value, default 84
        Number of generated recordings. They are called `01`, `02`, ….
    categories : Values
        Kinds of scenario: cut-in, cut-out, lvd [default: all].
    parameterizations : Values
        Parameterizations: 1…7, a…g, i…v, files of `search` [default: all]. 1…7 are for cut-ins, a…g for cut-
        outs, i…v for leader decelerations. A name that ends in .json is a file.
    with_thw : bool
        Add the observed time headway as a parameter (thw_s).
    density : Value, default kernel
        Form of the density. Intervals of a mixture or copula cover the draws alone, and they have no ratio to
        recorded scenarios.
        One of kernel, mixture, copula.
    no_comparison : bool
        Skip the comparison of drawn with unseen scenarios.
    without_scenarios : bool
        Leave the recorded series out of the density files. `sample` then cannot compare its rates with those of
        the recorded scenarios. Use it if you share the file but not the recordings.
    bandwidth_rule : Value, default reduction
        Search interval of the bandwidth.
        One of reduction, wide.
    config : Values
        Configuration file, or one key of it; repeatable. `lanesweep config init` writes such a file. Without
        --config, LANESWEEP_CONFIG names it.
    seed : Value, default 157
        Seed of P_valid and of the splits for M.
    threads : Value
        Threads; results do not depend on it [default: all cores].
    out : path, optional
        Where the files stay; without it they go with the result.

    Returns
    -------
    Result
    """
    return run(
        'fit',
        [
            (None, recordings, False),
            ('scenarios', scenarios, False),
            ('hours', hours, False),
            ('km', km, False),
            ('preset', preset, False),
            ('accept-implausible', accept_implausible, False),
            ('synth-recordings', synth_recordings, False),
            ('categories', categories, True),
            ('parameterizations', parameterizations, True),
            ('with-thw', with_thw, False),
            ('density', density, False),
            ('no-comparison', no_comparison, False),
            ('without-scenarios', without_scenarios, False),
            ('bandwidth-rule', bandwidth_rule, False),
            ('config', config, False),
            ('seed', seed, False),
            ('threads', threads, False),
        ],
        out=out,
        default_out='densities',
    )


def sample(
    density: Value | None = None,
    *,
    distribution: Value | None = None,
    proposal: Values | None = None,
    accept_implausible: bool = False,
    thw: Values | None = None,
    given: Values | None = None,
    category: Value | None = None,
    rename: Values | None = None,
    set: Values | None = None,
    models: Models | None = None,
    profile: Value | None = None,
    estimator: Value | None = None,
    samples: Value | None = None,
    criterion: Value | None = None,
    half_width: Value | None = None,
    other_profile: Value | None = None,
    dt: Value | None = None,
    points: Value | None = None,
    interval: Value | None = None,
    level: Value | None = None,
    time_limit: Value | None = None,
    map: Value | None = None,
    rows: Value | None = None,
    simultaneous: bool = False,
    worst: Value | None = None,
    shard: Value | None = None,
    config: Values | None = None,
    backend: Value | None = None,
    device: Value | None = None,
    seed: Value | None = None,
    plan: Value | None = None,
    plan_only: bool = False,
    stop_after: Value | None = None,
    threads: Value | None = None,
    out: Path | None = None,
) -> Result:
    """How likely does a driver fail?

    Draws concrete scenarios from a density (see `lanesweep fit`), runs each against the driver models and estimates
    the probability of failure with its interval, by crude Monte Carlo or importance sampling. With --half-width it
    takes the cheaper one for each question. Each estimate has a verdict on whether to trust it. A table goes to
    stdout, files to --out.

    Parameters
    ----------
    density : Value
        Density file.
    distribution : Value
        OpenSCENARIO file with stochastic distributions, not a density. Its numberOfTestRuns and randomSeed are
        the defaults of --samples and --seed.
    proposal : Values
        Proposal file to sample, with --estimator is; repeatable. Several are mixed with equal weights.
    accept_implausible : bool
        Use physically impossible values (a speed of 108 m/s) with a warning.
    thw : Values
        Time headways, s [default: the density's, else paper]. paper is 2.0, 1.8, … 0.2. observed (or sampled):
        the headway is drawn from the recorded ones, as a parameter of the density, which needs `fit --with-
        thw`.
    given : Values
        Draw from the density conditional on this value (mc); repeatable.
    category : Value
        With --distribution: kind of scenario: cut-in, cut-out, lvd.
    rename : Values
        With --distribution: map a parameter of the file to one of lanesweep, times a factor, or to `none`;
        repeatable.
    set : Values
        With --distribution: constant parameter; repeatable.
    models : Models
        Driver models: Reg157, CCHDM, RSS, FSM [default: all].
    profile : Value, default paper
        paper, paper-fit, jrc-2021, un-r157. Name of a profile, or a TOML file of your own. `map --preset jrc`
        takes jrc-2021 unless it is set.
    estimator : Value, default auto
        Crude, importance, or the cheaper one. Importance sampling searches the failures, then draws around
        them; `auto` chooses for each model and headway, and is `mc` without a half-width.
        One of auto, mc, is.
    samples : Value
        Number of samples [default: 100000, or as needed]. With a half-width: the maximum.
    criterion : Value, default collision
        Criterion to map, rank or estimate.
        One of collision, ttc, btn.
    half_width : Value
        Reach this half-width over estimate. It is that of the draws' interval; mc checks it after 4096·2^k
        samples. The default of is is 0.1 unless the number of samples is given; else none.
    other_profile : Value
        Also run the samples under this profile and write ratios to profiles.csv (mc).
    dt : Value, s
        Time step [default: the profile's].
    points : Value, default random
        Kind of points of `mc`.
        One of random, sobol.
    interval : Value, default wilson
        Kind of interval of `mc`.
        One of wilson, clopper-pearson.
    level : Value, default 0.95
        Level of the intervals.
    time_limit : Value, s
        Stop at the first check after this time (not reproducible) [default: no limit].
    map : Value
        Failure map over two parameters, or `none` [default: the first two].
    rows : Value
        Also write one row per lane: .csv, .jsonl or .parquet.
    simultaneous : bool
        Intervals of all rows hold together at --level (Bonferroni), not each on its own.
    worst : Value, default 20
        Worst lanes to list per model; 0 runs faster.
    shard : Value
        Compute shard I of N (from 0); `cluster merge` merges them. The part is written to --out. `auto/N` takes
        I from a Kubernetes Indexed Job or a Slurm array.
    config : Values
        Configuration file, or one key of it; repeatable. `lanesweep config init` writes such a file. Without
        --config, LANESWEEP_CONFIG names it.
    backend : Value, default auto
        Backend; auto: a GPU if there is one.
        One of auto, cpu, gpu.
    device : Value
        Device, by part of its name, PCI bus id or index. `lanesweep verify devices` lists the devices. The
        default is the first GPU.
    seed : Value, default 157
        Seed of the draws.
    plan : Value
        Run a plan that --plan-only wrote.
    plan_only : bool
        Write the plan, plan.json in --out, and stop.
    stop_after : Value, s
        After this time, finish the current chunk and stop, as after Ctrl-C; the same command resumes.
    threads : Value
        Threads; results do not depend on it [default: all cores].
    out : path, optional
        Where the files stay; without it they go with the result.

    Returns
    -------
    Result
    """
    return run(
        'sample',
        [
            (None, density, False),
            ('distribution', distribution, False),
            ('proposal', proposal, False),
            ('accept-implausible', accept_implausible, False),
            ('thw', thw, True),
            ('given', given, False),
            ('category', category, False),
            ('rename', rename, False),
            ('set', set, False),
            ('models', models, True),
            ('profile', profile, False),
            ('estimator', estimator, False),
            ('samples', samples, False),
            ('criterion', criterion, False),
            ('half-width', half_width, False),
            ('other-profile', other_profile, False),
            ('dt', dt, False),
            ('points', points, False),
            ('interval', interval, False),
            ('level', level, False),
            ('time-limit', time_limit, False),
            ('map', map, False),
            ('rows', rows, False),
            ('simultaneous', simultaneous, False),
            ('worst', worst, False),
            ('shard', shard, False),
            ('config', config, False),
            ('backend', backend, False),
            ('device', device, False),
            ('seed', seed, False),
            ('plan', plan, False),
            ('plan-only', plan_only, False),
            ('stop-after', stop_after, False),
            ('threads', threads, False),
        ],
        out=out,
        default_out='sample',
    )


def compare(
    recordings: Value | None = None,
    *,
    scenarios: Value | None = None,
    hours: Value | None = None,
    km: Value | None = None,
    preset: Value | None = None,
    accept_implausible: bool = False,
    synth_recordings: Value | None = None,
    categories: Values | None = None,
    parameterizations: Values | None = None,
    thw: Values | None = None,
    models: Models | None = None,
    profile: Value | None = None,
    samples: Value | None = None,
    forms: bool = False,
    dt: Value | None = None,
    config: Values | None = None,
    backend: Value | None = None,
    device: Value | None = None,
    seed: Value | None = None,
    threads: Value | None = None,
    out: Path | None = None,
) -> Result:
    """Which parameterizations give the right risk, not only the right labels?

    Simulates the recorded scenarios (S) and their parameterized replays (S'), fits a density per parameterization
    on the same scenarios, draws --samples scenarios from each, and compares the rates of failure per category,
    driver model and criterion, with the ratio to S and its interval. A ratio agrees if its interval lies within the
    margin. Without data it uses generated recordings. Tables go to stdout, files to --out.

    Parameters
    ----------
    recordings : Value
        Folder of recordings, or a track file [default: synthetic recordings]. highD's format, or that of a
        preset, which the names of the columns tell; see `lanesweep tracks`.
    scenarios : Value
        Scenario file (.jsonl, .parquet, .csv) instead of recordings.
    hours : Value, h
        Driven time of all egos [default: from the recordings].
    km : Value, km
        Driven distance of all egos [default: from the recordings].
    preset : Value
        Format of the recordings: exid, sumo-fcd, … or a TOML file [default: detected].
    accept_implausible : bool
        Use physically impossible values (a speed of 108 m/s) with a warning.
    synth_recordings : Value, default 84
        Number of generated recordings. They are called `01`, `02`, ….
    categories : Values
        Kinds of scenario: cut-in, cut-out, lvd [default: all].
    parameterizations : Values
        Parameterizations: 1…7, a…g, i…v, files of `search` [default: all]. 1…7 are for cut-ins, a…g for cut-
        outs, i…v for leader decelerations. A name that ends in .json is a file.
    thw : Values, default paper
        Time headways, s; paper: 2.0, 1.8, … 0.2; r157; observed: the recorded gaps. The paper's claims need all
        of its headways. r157: the minimum following distance of UN R157, 5.2.3.3, for the ego's speed; a list
        may contain it. observed: each scenario starts from its recorded gap, and a density draws the headway as
        one more parameter; it cannot be combined with other headways.
    models : Models
        Driver models: Reg157, CCHDM, RSS, FSM [default: all].
    profile : Value, default paper
        paper, paper-fit, jrc-2021, un-r157. Name of a profile, or a TOML file of your own. `map --preset jrc`
        takes jrc-2021 unless it is set.
    samples : Value, default 20000
        Samples of each density; each runs from every headway.
    forms : bool
        Sample Gaussian mixtures and copulas too, to see what the form of the density changes.
    dt : Value, s
        Time step [default: the profile's].
    config : Values
        Configuration file, or one key of it; repeatable. `lanesweep config init` writes such a file. Without
        --config, LANESWEEP_CONFIG names it.
    backend : Value, default auto
        Backend; auto: a GPU if there is one.
        One of auto, cpu, gpu.
    device : Value
        Device, by part of its name, PCI bus id or index. `lanesweep verify devices` lists the devices. The
        default is the first GPU.
    seed : Value, default 157
        Seed of the draws.
    threads : Value
        Threads; results do not depend on it [default: all cores].
    out : path, optional
        Where the files stay; without it they go with the result.

    Returns
    -------
    Result
    """
    return run(
        'compare',
        [
            (None, recordings, False),
            ('scenarios', scenarios, False),
            ('hours', hours, False),
            ('km', km, False),
            ('preset', preset, False),
            ('accept-implausible', accept_implausible, False),
            ('synth-recordings', synth_recordings, False),
            ('categories', categories, True),
            ('parameterizations', parameterizations, True),
            ('thw', thw, True),
            ('models', models, True),
            ('profile', profile, False),
            ('samples', samples, False),
            ('forms', forms, False),
            ('dt', dt, False),
            ('config', config, False),
            ('backend', backend, False),
            ('device', device, False),
            ('seed', seed, False),
            ('threads', threads, False),
        ],
        out=out,
        default_out='compare',
    )


def search(
    recordings: Value | None = None,
    *,
    scenarios: Value | None = None,
    held_out: Value | None = None,
    preset: Value | None = None,
    accept_implausible: bool = False,
    synth_recordings: Value | None = None,
    category: Value | None = None,
    thw: Values | None = None,
    models: Models | None = None,
    criterion: Value | None = None,
    objective: Value | None = None,
    profile: Value | None = None,
    max_parameters: Value | None = None,
    studies: Value | None = None,
    shuffled: bool = False,
    dt: Value | None = None,
    folds: Value | None = None,
    shard: Value | None = None,
    config: Values | None = None,
    backend: Value | None = None,
    device: Value | None = None,
    seed: Value | None = None,
    threads: Value | None = None,
    out: Path | None = None,
) -> Result:
    """Search for a parameterization: the fewest parameters that keep the outcomes

    Fits descriptions of many families and sizes: decompositions, physical features, polynomials, splines, constant
    accelerations, and decompositions whose weights are tuned to the outcomes. Scores each by cross-validation over
    recordings. The best of each size form a front beside the paper's parameterizations. The winner is a file for
    `study`, `fit`, `sample`, `justify` and `export`. Without data it uses generated recordings.

    Parameters
    ----------
    recordings : Value
        Folder of recordings, or a track file [default: synthetic recordings]. highD's format, or that of a
        preset, which the names of the columns tell; see `lanesweep tracks`.
    scenarios : Value
        Scenario file (.jsonl, .parquet, .csv) instead of recordings.
    held_out : Value
        Data that the search does not read, to judge its front. A folder of recordings, or a scenario file.
    preset : Value
        Format of the recordings: exid, sumo-fcd, … or a TOML file [default: detected].
    accept_implausible : bool
        Use physically impossible values (a speed of 108 m/s) with a warning.
    synth_recordings : Value, default 84
        Number of generated recordings. They are called `01`, `02`, ….
    category : Value
        Kind of scenario: cut-in, cut-out, lvd.
    thw : Values, default paper
        Time headways, s; paper: 2.0, 1.8, … 0.2; r157; observed: the recorded gaps. The paper's claims need all
        of its headways. r157: the minimum following distance of UN R157, 5.2.3.3, for the ego's speed; a list
        may contain it. observed: each scenario starts from its recorded gap, and a density draws the headway as
        one more parameter; it cannot be combined with other headways.
    models : Models
        Driver models: Reg157, CCHDM, RSS, FSM [default: all].
    criterion : Value, default collision
        Criterion to map, rank or estimate. For worst lanes, failure maps, fractions, stop rules and the
        adaptive estimators.
    objective : Value, default f1
        What to keep: F1, recall, or the ratio of failure rates.
    profile : Value, default paper
        paper, paper-fit, jrc-2021, un-r157. Name of a profile, or a TOML file of your own. `map --preset jrc`
        takes jrc-2021 unless it is set.
    max_parameters : Value, default 8
        Maximum number of parameters, the duration T counted (8).
    studies : Value, default 8000
        Studies for the optimiser of the weights (8000).
    shuffled : bool
        Give every scenario the outcomes of another one: no gain may be left on held-out data.
    dt : Value, s
        Time step [default: the profile's].
    folds : Value, default 5
        Folds of the cross-validation, also of `study` (5).
    shard : Value
        Evaluate part I of N (from 0) only; without it: conclude. Parts share the folder. The command without
        this flag, in the same folder, concludes.
    config : Values
        Configuration file, or one key of it; repeatable. `lanesweep config init` writes such a file. Without
        --config, LANESWEEP_CONFIG names it.
    backend : Value, default auto
        Backend; auto: a GPU if there is one.
        One of auto, cpu, gpu.
    device : Value
        Device, by part of its name, PCI bus id or index. `lanesweep verify devices` lists the devices. The
        default is the first GPU.
    seed : Value, default 157
        Seed of the optimiser.
    threads : Value
        Threads; results do not depend on it [default: all cores].
    out : path, optional
        Where the files stay; without it they go with the result.

    Returns
    -------
    Result
    """
    return run(
        'search',
        [
            (None, recordings, False),
            ('scenarios', scenarios, False),
            ('held-out', held_out, False),
            ('preset', preset, False),
            ('accept-implausible', accept_implausible, False),
            ('synth-recordings', synth_recordings, False),
            ('category', category, False),
            ('thw', thw, True),
            ('models', models, True),
            ('criterion', criterion, False),
            ('objective', objective, False),
            ('profile', profile, False),
            ('max-parameters', max_parameters, False),
            ('studies', studies, False),
            ('shuffled', shuffled, False),
            ('dt', dt, False),
            ('folds', folds, False),
            ('shard', shard, False),
            ('config', config, False),
            ('backend', backend, False),
            ('device', device, False),
            ('seed', seed, False),
            ('threads', threads, False),
        ],
        out=out,
        default_out='search',
    )


def justify(
    recordings: Value | None = None,
    *,
    scenarios: Value | None = None,
    preset: Value | None = None,
    accept_implausible: bool = False,
    synth_recordings: Value | None = None,
    parameterization: Value | None = None,
    thw: Values | None = None,
    models: Models | None = None,
    criterion: Value | None = None,
    profile: Value | None = None,
    dt: Value | None = None,
    author: Value | None = None,
    date: Value | None = None,
    config: Values | None = None,
    backend: Value | None = None,
    device: Value | None = None,
    threads: Value | None = None,
    out: Path | None = None,
) -> Result:
    """Is a parameterization appropriate for this driver model, scenario type and criterion?

    Replays the recorded scenarios as recorded (S) and parameterized (S'), fits a density, and applies the rules of
    [justify] in the configuration: appropriate, not appropriate, or undecided, with the amount of data that would
    decide. The dossier (report.html) lists the failures that S' hides, shows the worst of them, and gives the risk
    ratio, the coverage and the alternatives. Without data it uses generated recordings. Exit status: 0 appropriate,
    11 not appropriate, 8 undecided, 4 parts of the input were skipped.

    Parameters
    ----------
    recordings : Value
        Folder of recordings, or a track file [default: synthetic recordings]. highD's format, or that of a
        preset, which the names of the columns tell; see `lanesweep tracks`.
    scenarios : Value
        Scenario file (.jsonl, .parquet, .csv) instead of recordings.
    preset : Value
        Format of the recordings: exid, sumo-fcd, … or a TOML file [default: detected].
    accept_implausible : bool
        Use physically impossible values (a speed of 108 m/s) with a warning.
    synth_recordings : Value, default 84
        Number of generated recordings. They are called `01`, `02`, ….
    parameterization : Value
        Parameterization: 1…7 (cut-in), a…g (cut-out), i…v (LVD), or a file of `search`.
    thw : Values, default paper
        Time headways, s; paper: 2.0, 1.8, … 0.2; r157; observed: the recorded gaps. The paper's claims need all
        of its headways. r157: the minimum following distance of UN R157, 5.2.3.3, for the ego's speed; a list
        may contain it. observed: each scenario starts from its recorded gap, and a density draws the headway as
        one more parameter; it cannot be combined with other headways.
    models : Models
        Driver model: Reg157, CCHDM, RSS, FSM.
    criterion : Value, default collision
        Criterion to map, rank or estimate. For worst lanes, failure maps, fractions, stop rules and the
        adaptive estimators.
    profile : Value, default paper
        paper, paper-fit, jrc-2021, un-r157. Name of a profile, or a TOML file of your own. `map --preset jrc`
        takes jrc-2021 unless it is set.
    dt : Value, s
        Time step [default: the profile's].
    author : Value
        Person responsible for the dossier [default: a line to fill in].
    date : Value
        Date of the dossier [default: a line to fill in].
    config : Values
        Configuration file, or one key of it; repeatable. `lanesweep config init` writes such a file. Without
        --config, LANESWEEP_CONFIG names it.
    backend : Value, default auto
        Backend; auto: a GPU if there is one.
        One of auto, cpu, gpu.
    device : Value
        Device, by part of its name, PCI bus id or index. `lanesweep verify devices` lists the devices. The
        default is the first GPU.
    threads : Value
        Threads; results do not depend on it [default: all cores].
    out : path, optional
        Where the files stay; without it they go with the result.

    Returns
    -------
    Result
    """
    return run(
        'justify',
        [
            (None, recordings, False),
            ('scenarios', scenarios, False),
            ('preset', preset, False),
            ('accept-implausible', accept_implausible, False),
            ('synth-recordings', synth_recordings, False),
            ('parameterization', parameterization, False),
            ('thw', thw, True),
            ('models', models, False),
            ('criterion', criterion, False),
            ('profile', profile, False),
            ('dt', dt, False),
            ('author', author, False),
            ('date', date, False),
            ('config', config, False),
            ('backend', backend, False),
            ('device', device, False),
            ('threads', threads, False),
        ],
        out=out,
        default_out='dossier',
    )


def map(
    category: Value,
    *,
    distribution: Value | None = None,
    accept_implausible: bool = False,
    preset: Value | None = None,
    rename: Values | None = None,
    x: Value | None = None,
    y: Value | None = None,
    panel: Values | None = None,
    set: Values | None = None,
    closing: bool = False,
    native_gap: bool = False,
    models: Models | None = None,
    criterion: Value | None = None,
    against: Value | None = None,
    robust: bool = False,
    profile: Value | None = None,
    reference: bool = False,
    dt: Value | None = None,
    config: Values | None = None,
    backend: Value | None = None,
    device: Value | None = None,
    threads: Value | None = None,
    out: Path | None = None,
) -> Result:
    """Map outcomes over two parameters, and where two models or profiles differ

    Every cell is one concrete case. --preset takes the grids of the JRC's evidence (jrc) or of the regulation's
    Annex 3 (r157, to 60 and to 130 km/h); --x, --y, --panel and --set define any other grid. Writes a sheet per
    grid and model (SVG), cells.csv, differences.csv and map.json. The percentages of cells with a failure go to
    stdout.

    Parameters
    ----------
    distribution : Value
        OpenSCENARIO file with deterministic distributions. The first two parameters with several values are the
        axes, unless --x and --y name others; the others define the panels.
    accept_implausible : bool
        Use physically impossible values (a speed of 108 m/s) with a warning.
    category : Value
        Kind of scenario: cut-in, cut-out, lvd.
    preset : Value
        Predefined grids with their models: jrc, r157.
    rename : Values
        With --distribution: map a parameter of the file to one of lanesweep, times a factor, or to `none`;
        repeatable.
    x : Value
        Parameter of the x axis: NAME=FROM..TO/STEP or NAME=A,B,C. With --distribution also a NAME of the file.
    y : Value
        Parameter of the y axis.
    panel : Values
        Parameter of the panels; repeatable. Several of them give one panel per combination.
    set : Values
        Constant parameter; repeatable.
    closing : bool
        Only panels in which the ego is faster than the other vehicle.
    native_gap : bool
        Start each model at its following distance in the JRC's simulator, not gap_m or thw_s.
    models : Models
        Driver models: Reg157, CCHDM, RSS, FSM [default: all].
    criterion : Value, default collision
        Criterion to map, rank or estimate. For worst lanes, failure maps, fractions, stop rules and the
        adaptive estimators.
    against : Value
        Model or profile to compare with; maps the differences.
    robust : bool
        Mark cells whose outcome changes with a tenth of the time step, 1 cm or 0.1 km/h. They are undecided.
        Each cell is simulated eight times; sheets show undecided cells in their own colour.
    profile : Value, default paper
        paper, paper-fit, jrc-2021, un-r157. Name of a profile, or a TOML file of your own. `map --preset jrc`
        takes jrc-2021 unless it is set.
    reference : bool
        Compute in binary64 on the CPU: the reference of the lane arithmetic.
    dt : Value, s
        Time step [default: the profile's].
    config : Values
        Configuration file, or one key of it; repeatable. `lanesweep config init` writes such a file. Without
        --config, LANESWEEP_CONFIG names it.
    backend : Value, default auto
        Backend; auto: a GPU if there is one.
        One of auto, cpu, gpu.
    device : Value
        Device, by part of its name, PCI bus id or index. `lanesweep verify devices` lists the devices. The
        default is the first GPU.
    threads : Value
        Threads; results do not depend on it [default: all cores].
    out : path, optional
        Where the files stay; without it they go with the result.

    Returns
    -------
    Result
    """
    return run(
        'map',
        [
            ('distribution', distribution, False),
            ('accept-implausible', accept_implausible, False),
            (None, category, False),
            ('preset', preset, False),
            ('rename', rename, False),
            ('x', x, False),
            ('y', y, False),
            ('panel', panel, False),
            ('set', set, False),
            ('closing', closing, False),
            ('native-gap', native_gap, False),
            ('models', models, True),
            ('criterion', criterion, False),
            ('against', against, False),
            ('robust', robust, False),
            ('profile', profile, False),
            ('reference', reference, False),
            ('dt', dt, False),
            ('config', config, False),
            ('backend', backend, False),
            ('device', device, False),
            ('threads', threads, False),
        ],
        out=out,
        default_out='map',
    )


def check(
    file: Value | None = None,
    *,
    row: Value | None = None,
    scenario: Value | None = None,
    accept_implausible: bool = False,
    category: Value | None = None,
    ego_speed: Value | None = None,
    speed: Value | None = None,
    gap: Value | None = None,
    thw: Value | None = None,
    lateral_speed: Value | None = None,
    acceleration: Value | None = None,
    ahead_gap: Value | None = None,
    lateral_distance: Value | None = None,
    end_speed: Value | None = None,
    ahead_speed: Value | None = None,
    length: Value | None = None,
    width: Value | None = None,
    ego_length: Value | None = None,
    ego_width: Value | None = None,
    lane_width: Value | None = None,
    models: Models | None = None,
    profiles: Values | None = None,
    sheet: Value | None = None,
    series: Value | None = None,
    config: Values | None = None,
    threads: Value | None = None,
) -> Result:
    """Check concrete cases: do the reference drivers of UN R157 avoid the collision?

    The case comes from flags, from a TOML file or a table (keys and columns are the flags' names with `_`, speeds
    with their unit, `ego_speed_kmh`; flags override them), or from a scenario of a file. Every model runs under
    every profile. The case is preventable if CCHDM or FSM, the drivers of Annex 3, avoids the collision under the
    first profile. It has no conflict if nothing collides even when the ego never reacts. It is undecided if a tenth
    of the time step or a measurement error of an input changes the answer. It is outside Annex 3 if the annex does
    not describe such a case. The output also has the margins, the clauses, and the distance to another answer along
    each parameter. A table without --row is judged whole, under one profile, with a line per row; its exit status
    is that of its worst answer, in the order not preventable, undecided, outside Annex 3, preventable, no conflict.
    Exit status: 0 preventable, 1 not preventable, 8 undecided, 9 no conflict, 10 outside Annex 3, 4 parts of the
    input were skipped.

    Parameters
    ----------
    file : Value
        TOML file, table (.csv, .parquet) or scenario file (.jsonl) with the case.
    row : Value
        Row of a table, from 1 after the header [default: all rows].
    scenario : Value
        Scenario of a scenario file, by its id. It starts with its observed gap, or with --gap or --thw.
    accept_implausible : bool
        Use physically impossible values (a speed of 108 m/s) with a warning.
    category : Value
        Kind of scenario: cut-in, cut-out, lvd.
    ego_speed : Value
        Initial speed of the ego, with its unit: 60km/h.
    speed : Value
        Initial speed of the other vehicle, with its unit [default: the ego's].
    gap : Value, m
        Initial gap, bumper to bumper.
    thw : Value, s
        Initial time headway instead of the gap.
    lateral_speed : Value, m/s
        Cut-in, cut-out: lateral speed.
    acceleration : Value, m/s²
        Acceleration of the other vehicle; an LVD needs one [default: 0].
    ahead_gap : Value, m
        Cut-out: gap between the two, bumper to bumper.
    lateral_distance : Value, m
        Cut-in: lateral distance at the start; cut-out: at the end [default: the lane's width].
    end_speed : Value
        Speed at which the acceleration ends, with its unit [default: standstill, or never].
    ahead_speed : Value
        Cut-out: speed of the vehicle ahead of the cutting-out one, with its unit [default: 0].
    length : Value, m
        Length of every vehicle [default: the profile's].
    width : Value, m
        Width of every vehicle [default: the profile's].
    ego_length : Value, m
        Length of the ego [default: that of every vehicle].
    ego_width : Value, m
        Width of the ego [default: that of every vehicle].
    lane_width : Value, m
        Width of the lanes [default: the scenario's, else 3.5].
    models : Models
        Driver models: Reg157, CCHDM, RSS, FSM [default: all].
    profiles : Values
        Profiles; the first one decides [default: un-r157, the two of EU 2022/1426, jrc-2021, paper, paper-fit].
    sheet : Value
        Also write the case sheet as an HTML page for printing.
    series : Value
        Also write every step of every model under the first profile.
    config : Values
        Configuration file, or one key of it; repeatable. `lanesweep config init` writes such a file. Without
        --config, LANESWEEP_CONFIG names it.
    threads : Value
        Threads; results do not depend on it [default: all cores].

    Returns
    -------
    Result
    """
    return run(
        'check',
        [
            (None, file, False),
            ('row', row, False),
            ('scenario', scenario, False),
            ('accept-implausible', accept_implausible, False),
            ('category', category, False),
            ('ego-speed', ego_speed, False),
            ('speed', speed, False),
            ('gap', gap, False),
            ('thw', thw, False),
            ('lateral-speed', lateral_speed, False),
            ('acceleration', acceleration, False),
            ('ahead-gap', ahead_gap, False),
            ('lateral-distance', lateral_distance, False),
            ('end-speed', end_speed, False),
            ('ahead-speed', ahead_speed, False),
            ('length', length, False),
            ('width', width, False),
            ('ego-length', ego_length, False),
            ('ego-width', ego_width, False),
            ('lane-width', lane_width, False),
            ('models', models, True),
            ('profiles', profiles, True),
            ('sheet', sheet, False),
            ('series', series, False),
            ('config', config, False),
            ('threads', threads, False),
        ],
    )


def trace(
    *,
    case_file: Value | None = None,
    table: Value | None = None,
    row: Value | None = None,
    scenarios: Value | None = None,
    from_: Value | None = None,
    lane: Value | None = None,
    accept_implausible: bool = False,
    category: Value | None = None,
    ego_speed: Value | None = None,
    speed: Value | None = None,
    gap: Value | None = None,
    thw: Value | None = None,
    lateral_speed: Value | None = None,
    acceleration: Value | None = None,
    ahead_gap: Value | None = None,
    compare: Values | None = None,
    lateral_distance: Value | None = None,
    end_speed: Value | None = None,
    ahead_speed: Value | None = None,
    length: Value | None = None,
    width: Value | None = None,
    ego_length: Value | None = None,
    ego_width: Value | None = None,
    lane_width: Value | None = None,
    models: Models | None = None,
    profile: Value | None = None,
    dt: Value | None = None,
    plot: Value | None = None,
    plot_end: Value | None = None,
    config: Values | None = None,
    threads: Value | None = None,
) -> Result:
    """Run one concrete scenario and print or draw its time series

    The case comes from flags, from a TOML file, from a row of a table (keys and columns are the flags' names with
    `_`, speeds with their unit, `ego_speed_kmh`; flags override them), or from a finished run or a scenario file
    with a lane key. The series goes to stdout as CSV, the outcome to stderr, the figure to --plot. Several models
    (--models FSM,RSS) or variants (--compare) follow one another in the CSV and share one figure.

    Parameters
    ----------
    case_file : Value
        TOML file with the case.
    table : Value
        Table (.csv, .parquet) with one case per row.
    row : Value
        Row of the table, from 1 after the header; needed if it has several.
    scenarios : Value
        Scenario file (.jsonl, .parquet, .csv) for --lane.
    from_ : Value
        Folder (--out) of a study or sample, for --lane. Repeats that lane with the run's profile and options,
        bit for bit, and reports whether f64 gives another outcome.
    lane : Value
        Lane key: scenario/variant/headway/model.
    accept_implausible : bool
        Use physically impossible values (a speed of 108 m/s) with a warning.
    category : Value
        Kind of scenario: cut-in, cut-out, lvd.
    ego_speed : Value
        Initial speed of the ego, with its unit: 60km/h.
    speed : Value
        Initial speed of the other vehicle, with its unit [default: the ego's].
    gap : Value, m
        Initial gap, bumper to bumper.
    thw : Value, s
        Initial time headway instead of the gap.
    lateral_speed : Value, m/s
        Cut-in, cut-out: lateral speed.
    acceleration : Value, m/s²
        Acceleration of the other vehicle; an LVD needs one [default: 0].
    ahead_gap : Value, m
        Cut-out: gap between the two, bumper to bumper.
    compare : Values
        Also simulate other variants of the lane's scenario. S (the recorded scenario; the default without a
        value), keys of parameterizations, or all.
    lateral_distance : Value, m
        Cut-in: lateral distance at the start; cut-out: at the end [default: the lane's width].
    end_speed : Value
        Speed at which the acceleration ends, with its unit [default: standstill, or never].
    ahead_speed : Value
        Cut-out: speed of the vehicle ahead of the cutting-out one, with its unit [default: 0].
    length : Value, m
        Length of every vehicle [default: the profile's].
    width : Value, m
        Width of every vehicle [default: the profile's].
    ego_length : Value, m
        Length of the ego [default: that of every vehicle].
    ego_width : Value, m
        Width of the ego [default: that of every vehicle].
    lane_width : Value, m
        Width of the lanes [default: the scenario's, else 3.5].
    models : Models
        Driver models: Reg157, CCHDM, RSS, FSM [default: all].
    profile : Value, default paper
        paper, paper-fit, jrc-2021, un-r157. Name of a profile, or a TOML file of your own. `map --preset jrc`
        takes jrc-2021 unless it is set.
    dt : Value, s
        Time step [default: the profile's].
    plot : Value
        Also draw the time series. Speed, acceleration, gap, TTC, BTN, PFS, CFS and lateral position, with
        reaction, braking and contact.
    plot_end : Value, s
        End of the figure's time axis [default: 2 s after the last change].
    config : Values
        Configuration file, or one key of it; repeatable. `lanesweep config init` writes such a file. Without
        --config, LANESWEEP_CONFIG names it.
    threads : Value
        Threads; results do not depend on it [default: all cores].

    Returns
    -------
    Result
    """
    return run(
        'simulate',
        [
            ('case-file', case_file, False),
            ('table', table, False),
            ('row', row, False),
            ('scenarios', scenarios, False),
            ('from', from_, False),
            ('lane', lane, False),
            ('accept-implausible', accept_implausible, False),
            ('category', category, False),
            ('ego-speed', ego_speed, False),
            ('speed', speed, False),
            ('gap', gap, False),
            ('thw', thw, False),
            ('lateral-speed', lateral_speed, False),
            ('acceleration', acceleration, False),
            ('ahead-gap', ahead_gap, False),
            ('compare', compare, True),
            ('lateral-distance', lateral_distance, False),
            ('end-speed', end_speed, False),
            ('ahead-speed', ahead_speed, False),
            ('length', length, False),
            ('width', width, False),
            ('ego-length', ego_length, False),
            ('ego-width', ego_width, False),
            ('lane-width', lane_width, False),
            ('models', models, True),
            ('profile', profile, False),
            ('dt', dt, False),
            ('plot', plot, False),
            ('plot-end', plot_end, False),
            ('config', config, False),
            ('threads', threads, False),
        ],
    )


def export_xosc(
    *,
    case_file: Value | None = None,
    from_: Value | None = None,
    scenarios: Value | None = None,
    lane: Values | None = None,
    accept_implausible: bool = False,
    category: Value | None = None,
    ego_speed: Value | None = None,
    speed: Value | None = None,
    gap: Value | None = None,
    thw: Value | None = None,
    lateral_speed: Value | None = None,
    acceleration: Value | None = None,
    ahead_gap: Value | None = None,
    ego: Value | None = None,
    lateral_distance: Value | None = None,
    end_speed: Value | None = None,
    ahead_speed: Value | None = None,
    length: Value | None = None,
    width: Value | None = None,
    ego_length: Value | None = None,
    ego_width: Value | None = None,
    lane_width: Value | None = None,
    variant: Values | None = None,
    duration: Value | None = None,
    side: Value | None = None,
    models: Models | None = None,
    criterion: Value | None = None,
    profile: Value | None = None,
    dt: Value | None = None,
    worst: Value | None = None,
    config: Values | None = None,
    threads: Value | None = None,
    out: Path | None = None,
) -> Result:
    """Write lanes as ASAM OpenSCENARIO XML 1.2 with an OpenDRIVE road

    Exports named lanes of a study, a sampling run or a scenario file, the worst lanes of a run, or one case from
    flags. Every lane becomes NNN-KEY.xosc and NNN-KEY.xodr; index.csv lists them with their outcomes. The other
    vehicles follow their own motion, step by step. The ego follows the path that the driver model drove; with --ego
    external only its position and speed at the start are written.

    Parameters
    ----------
    case_file : Value
        TOML file with the case.
    from_ : Value
        Folder (--out) of a study or sample, for --lane or --worst.
    scenarios : Value
        Scenario file for --lane. With --from a study: the study's scenarios, for sizes, side and lane width.
    lane : Values
        Lane key: scenario/variant/headway/model; repeatable.
    accept_implausible : bool
        Use physically impossible values (a speed of 108 m/s) with a warning.
    category : Value
        Kind of scenario: cut-in, cut-out, lvd.
    ego_speed : Value
        Initial speed of the ego, with its unit: 60km/h.
    speed : Value
        Initial speed of the other vehicle, with its unit [default: the ego's].
    gap : Value, m
        Initial gap, bumper to bumper.
    thw : Value, s
        Initial time headway instead of the gap.
    lateral_speed : Value, m/s
        Cut-in, cut-out: lateral speed.
    acceleration : Value, m/s²
        Acceleration of the other vehicle; an LVD needs one [default: 0].
    ahead_gap : Value, m
        Cut-out: gap between the two, bumper to bumper.
    ego : Value, default model
        Driver of the ego.
        One of model, external.
    lateral_distance : Value, m
        Cut-in: lateral distance at the start; cut-out: at the end [default: the lane's width].
    end_speed : Value
        Speed at which the acceleration ends, with its unit [default: standstill, or never].
    ahead_speed : Value
        Cut-out: speed of the vehicle ahead of the cutting-out one, with its unit [default: 0].
    length : Value, m
        Length of every vehicle [default: the profile's].
    width : Value, m
        Width of every vehicle [default: the profile's].
    ego_length : Value, m
        Length of the ego [default: that of every vehicle].
    ego_width : Value, m
        Width of the ego [default: that of every vehicle].
    lane_width : Value, m
        Width of the lanes [default: the scenario's, else 3.5].
    variant : Values
        Variants of --worst: S, keys of parameterizations [default: all].
    duration : Value, s
        End of the scenario with --ego external [default: 10 s after the lane's last event and end].
    side : Value
        Side that the other vehicle comes from or leaves to [default: the scenario's, else left].
        One of left, right.
    models : Models
        Driver models: Reg157, CCHDM, RSS, FSM [default: all].
    criterion : Value
        Criterion of --worst [default: collision]. For a sampling run it must be the criterion of worst.csv.
    profile : Value, default paper
        paper, paper-fit, jrc-2021, un-r157. Name of a profile, or a TOML file of your own. `map --preset jrc`
        takes jrc-2021 unless it is set.
    dt : Value, s
        Time step [default: the profile's].
    worst : Value
        The N worst lanes of the run per model. For a sampling run: the lanes of worst.csv. For a study: the
        scenarios with the smallest margin of --criterion, each with its worst lane.
    config : Values
        Configuration file, or one key of it; repeatable. `lanesweep config init` writes such a file. Without
        --config, LANESWEEP_CONFIG names it.
    threads : Value
        Threads; results do not depend on it [default: all cores].

    Returns
    -------
    Result
    """
    return run(
        'export xosc',
        [
            ('case-file', case_file, False),
            ('from', from_, False),
            ('scenarios', scenarios, False),
            ('lane', lane, False),
            ('accept-implausible', accept_implausible, False),
            ('category', category, False),
            ('ego-speed', ego_speed, False),
            ('speed', speed, False),
            ('gap', gap, False),
            ('thw', thw, False),
            ('lateral-speed', lateral_speed, False),
            ('acceleration', acceleration, False),
            ('ahead-gap', ahead_gap, False),
            ('ego', ego, False),
            ('lateral-distance', lateral_distance, False),
            ('end-speed', end_speed, False),
            ('ahead-speed', ahead_speed, False),
            ('length', length, False),
            ('width', width, False),
            ('ego-length', ego_length, False),
            ('ego-width', ego_width, False),
            ('lane-width', lane_width, False),
            ('variant', variant, True),
            ('duration', duration, False),
            ('side', side, False),
            ('models', models, True),
            ('criterion', criterion, False),
            ('profile', profile, False),
            ('dt', dt, False),
            ('worst', worst, False),
            ('config', config, False),
            ('threads', threads, False),
        ],
        out=out,
        default_out=None,
    )


def synth(
    folder: Value,
    *,
    synth_recordings: Value | None = None,
    config: Values | None = None,
    threads: Value | None = None,
) -> Result:
    """Write the synthetic recordings that `study` uses without data

    The files have the format of highD; `study DIR` on them gives the same result as `study` without data.

    Parameters
    ----------
    folder : Value
        Folder for the recordings; created if it does not exist.
    synth_recordings : Value, default 84
        Number of generated recordings. They are called `01`, `02`, ….
    config : Values
        Configuration file, or one key of it; repeatable. `lanesweep config init` writes such a file. Without
        --config, LANESWEEP_CONFIG names it.
    threads : Value
        Threads; results do not depend on it [default: all cores].

    Returns
    -------
    Result
    """
    return run(
        'synth',
        [
            (None, folder, False),
            ('synth-recordings', synth_recordings, False),
            ('config', config, False),
            ('threads', threads, False),
        ],
        path=folder,
    )


def merge(
    folder: Value,
    *,
    config: Values | None = None,
    threads: Value | None = None,
) -> Result:
    """Merge the parts of a run into its result

    Checks that the parts in DIR (written by `--shard`) belong to the plan in DIR, are complete, and cover every
    lane exactly once. Names each missing, duplicate, foreign or damaged part, with the command that recomputes it.
    The result is written to DIR; it equals, bit for bit, the result of the unsplit run.

    Parameters
    ----------
    folder : Value
        The run's folder.
    config : Values
        Configuration file, or one key of it; repeatable. `lanesweep config init` writes such a file. Without
        --config, LANESWEEP_CONFIG names it.
    threads : Value
        Threads; results do not depend on it [default: all cores].

    Returns
    -------
    Result
    """
    return run(
        'cluster merge',
        [
            (None, folder, False),
            ('config', config, False),
            ('threads', threads, False),
        ],
        path=folder,
    )
