"""Verbs as functions: the program's own files, and its errors as exceptions."""

from __future__ import annotations

import doctest
import importlib.util
import json
import logging
import os
import pickle
import re
import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import lanesweep
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest


def test_the_functions_are_those_of_the_program() -> None:
    tools = Path(__file__).parents[1] / "tools" / "verbs.py"
    spec = importlib.util.spec_from_file_location("verbs", tools)
    verbs = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(verbs)
    assert verbs.module() == (tools.parents[1] / "lanesweep" / "_verbs.py").read_text(encoding="utf-8"), f"run {tools}"


@pytest.mark.parametrize("module", [lanesweep, lanesweep._verbs, lanesweep._simulate, lanesweep._driver])
def test_examples_in_docstrings_print_what_they_say(module, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    found = doctest.testmod(module, extraglobs={"lanesweep": lanesweep})
    assert found.attempted > 0 and found.failed == 0


def test_lists_have_what_the_verbs_take() -> None:
    options = lanesweep.options
    assert options.MODELS == ["Reg157", "CCHDM", "RSS", "FSM"] and len(options.PARAMETERIZATIONS) == 19
    assert {"cut-in-2", "cut-out-g", "lvd-ii"} <= options.PARAMETERIZATIONS.keys()
    assert all(lanesweep.profile(name) for name in options.PROFILES)
    assert "time step" in options.KEYS["run.dt_s"].lower()
    assert all(name in options.KEYS["run.profile"] for name in options.PROFILES)


def test_mined_scenarios_are_a_table_without_a_file(scenarios) -> None:
    mined = lanesweep.mine(scenarios.parent / "recordings").table("scenarios").to_polars()
    read = [json.loads(line) for line in scenarios.read_text().splitlines()]
    for name in ("id", "kept", "gap0", "lane_width", "peak_decel"):
        assert mined[name].to_list() == [one.get(name) for one in read]
    assert mined["target_v"].to_list() == [one["target"]["v"] for one in read]
    options = {"categories": "cut-in", "models": "FSM", "thw": 1.2}
    found = [lanesweep.study(scenarios=of, **options).table("results").to_polars() for of in (mined, scenarios)]
    assert found[0].equals(found[1])


def test_a_study_has_the_bytes_of_the_command_line(program, scenarios, tmp_path) -> None:
    ours = lanesweep.study(scenarios=scenarios, backend="cpu", out=tmp_path / "ours")
    theirs = program("-q", "study", "--scenarios", scenarios, "--backend", "cpu", "--out", tmp_path / "theirs")
    assert theirs.returncode == 0, theirs.stderr
    names, theirs_names = ({str(path.relative_to(of)) for path in of.rglob("*.*")} for of in (tmp_path / "ours", tmp_path / "theirs"))
    assert names == theirs_names and len(names) > 15
    # Times and paths are in the record, in the page, and in the list with their checksums.
    for name in names - {"run.json", "report.html", "lanesweep-files.json"}:
        assert (tmp_path / "ours" / name).read_bytes() == (tmp_path / "theirs" / name).read_bytes(), name
    assert ours.status == "ok" and ours.folder == tmp_path / "ours"


def test_tracks_say_what_a_table_holds_and_other_verbs_read_it(tmp_path) -> None:
    recordings = lanesweep.tracks(convert=tmp_path / "recordings", synth_recordings=1).folder
    table = tmp_path / "own.csv"
    lanesweep.tracks(recordings, convert=table)
    about = lanesweep.tracks(table, out=tmp_path / "figures")
    assert about.status == "ok" and "preset     generic" in about.text and "nothing contradicts itself" in about.text
    assert {path.suffix for path in (tmp_path / "figures").iterdir()} == {".svg", ".json"}
    found = lanesweep.mine(table, out=tmp_path / "own.jsonl")
    assert found.status == "ok" and (tmp_path / "own.jsonl").read_text().count("\n") > 200


def test_a_sample_has_the_bytes_of_the_command_line(program, density, tmp_path) -> None:
    options = {"samples": 3000, "thw": [1.2, 0.4], "models": ["FSM", "RSS"]}
    lanesweep.sample(density, **options, backend="cpu", out=tmp_path / "ours")
    words = ["--samples=3000", "--thw=1.2,0.4", "--models=FSM,RSS", "--backend=cpu", f"--out={tmp_path / 'theirs'}"]
    theirs = program("-q", "sample", density, *words)
    assert theirs.returncode == 0, theirs.stderr
    for name in ["estimates.csv", "tables/convergence.csv", "density.json"]:
        assert (tmp_path / "ours" / name).read_bytes() == (tmp_path / "theirs" / name).read_bytes(), name


def test_a_device_gives_the_same_bytes(density, scenarios, tmp_path) -> None:
    def both(device: dict[str, str]) -> dict[str, bytes]:
        folder = tmp_path / device["backend"]
        lanesweep.sample(density, samples=2000, thw=1.2, **device, failures=folder / "failures.csv", out=folder / "sample")
        lanesweep.study(scenarios=scenarios, thw=1.2, **device, out=folder / "study")
        names = ["sample/estimates.csv", "failures.csv", "study/results.csv"]
        return {name: (folder / name).read_bytes() for name in names}

    try:
        on_device = both({"backend": "gpu", "device": "llvmpipe"})
    except (lanesweep.DeviceError, lanesweep.UsageError) as error:
        if os.environ.get("LANESWEEP_REQUIRE_DEVICE"):
            raise
        pytest.skip(f"no software device: {error}")
    assert on_device == both({"backend": "cpu"})


def test_a_result_has_tables_figures_and_a_page(scenarios) -> None:
    result = lanesweep.study(scenarios=scenarios, thw="1.2,0.6", backend="cpu")
    frame = result.table("results").to_pandas()
    assert set(frame["model"]) == {"Reg157", "CCHDM", "RSS", "FSM"}
    assert frame["variant"].map(type).eq(str).all() and frame["failures"].dtype.kind == "i"
    assert "-cv" in "".join(frame["variant"].unique()) and set(frame["headway"]) == {"all", "0.6s", "1.2s"}
    shown = repr(result.table("results"))
    assert shown.startswith("category") and "Reg157" in shown and f"[{len(frame)} rows;" in shown
    assert max(map(len, shown.splitlines())) <= 120
    assert frame["f1"].dropna().between(0, 1).all()
    assert len(result.table("results")) == len(result.table("results").to_polars())
    assert "<svg" in result.figure("radar-cut-in").svg
    assert "<iframe" in result._repr_html_() and "SYNTHETIC" in str(result)
    header = (Path(result) / "results.csv").read_text().splitlines()[0].split(",")
    assert result.table("results").columns == header and (frame["data"] == "synthetic").all()
    with pytest.raises(KeyError, match="there are .*claims"):
        result.table("f2")
    folder = Path(result)
    assert folder.is_dir()
    del result
    assert not folder.exists()


CASE = {"category": "cut-in", "ego_speed": "108km/h", "speed": "40km/h", "gap": 25, "lateral_speed": 1}


def test_every_table_of_every_verb_opens_with_one_schema_whatever_its_values(scenarios, density, tmp_path) -> None:
    table = tmp_path / "cases.csv"
    table.write_text("category,ego_speed_kmh,speed_kmh,gap,lateral_speed\ncut-in,60,40,15,1\ncut-in,90,40,5,1\n")
    grid = {"x": "deceleration_mps2=2,4", "set": {"thw_s": 1.2}, "models": "FSM"}
    calls = {
        "check": [lambda: lanesweep.check(CASE), lambda: lanesweep.check({**CASE, "gap": 400, "speed": "108km/h"})],
        "rows": [lambda: lanesweep.check(table)],
        "trace": [lambda: lanesweep.trace(table=CASE), lambda: lanesweep.trace(table={**CASE, "gap": 400, "speed": "108km/h"})],
        # Without and with failures, without and with intervals, of some categories.
        "study": [lambda: lanesweep.study(scenarios=scenarios), lambda: lanesweep.study(scenarios=scenarios, models="FSM", thw=9, categories="cut-in")],
        "sample": [lambda: lanesweep.sample(density, samples=10, thw=9, models="FSM"), lambda: lanesweep.sample(density, samples=3000, thw=0.4)],
        "mine": [lambda: lanesweep.mine(scenarios.parent / "recordings"), lambda: lanesweep.mine(scenarios.parent / "recordings", kept=True)],
        "map": [lambda: lanesweep.map("lvd", y="ego_speed_kmh=60,90", **grid), lambda: lanesweep.map("lvd", y="ego_speed_kmh=60", **grid)],
    }
    for verb, made in calls.items():
        schemas: dict[str, Any] = {}
        results = [one() for one in made]
        assert results[0].tables, verb
        for result in results:
            for name in result.tables:
                frame = result.table(name)
                arrow = pa.table(frame)
                assert schemas.setdefault(name, arrow.schema).equals(arrow.schema, check_metadata=True), (verb, name)
                assert arrow.num_rows == len(frame) == len(frame.to_pandas()) == len(frame.to_polars())
                kinds = {of.name: of.type.value_type if pa.types.is_list(of.type) else of.type for of in arrow.schema}
                numbers = [of for of, kind in kinds.items() if pa.types.is_floating(kind) or pa.types.is_integer(kind)]
                assert set(frame.units) == set(numbers), (verb, name)
                texts = [column.to_pylist() for column in arrow.columns if pa.types.is_string(column.type)]
                assert not any(str(text).startswith(("{", "[")) for column in texts for text in column), (verb, name)
                shown = repr(frame) + frame._repr_html_()
                assert all(name in shown for name in frame.columns[:1])
    best = lanesweep.study(scenarios=scenarios, models="FSM", thw=0.6).table("best")
    assert "interval" in best.descriptions["f1_low"] and "f1" not in best.descriptions and best.units["failing_scenarios"] == "1"
    drivers = lanesweep.check({**CASE, "gap": 400, "speed": "108km/h"}).table("profiles")
    assert np.isinf(drivers["min_ttc_s"]).any() and np.isinf(lanesweep.trace(table=CASE, models="FSM").table("lanes")["max_drac_mps2"]).all()


def test_a_row_of_a_frame_is_a_case_of_check_and_trace() -> None:
    frame = pl.DataFrame({"category": "cut-in", "ego_speed_kmh": [108.0, 60.0], "speed_kmh": 40.0, "gap_m": [25.0, 15.0], "lateral_speed_mps": 1.0, "length": None})
    expected = [lanesweep.check(CASE), lanesweep.trace(table=CASE, models="FSM")]
    for row in (frame.row(0, named=True), frame.to_pandas().iloc[0]):
        found = [lanesweep.check(row), lanesweep.trace(table=row, models="FSM")]
        for ours, theirs, name in zip(found, expected, ("profiles", "lanes"), strict=True):
            assert ours.status == theirs.status and ours.table(name)["min_gap_m"].tolist() == theirs.table(name)["min_gap_m"].tolist()
    for table in (frame, frame.to_pandas()):
        assert len(lanesweep.check(table.drop("length", axis=1) if table is not frame else table.drop("length")).table("cases")) == 2
        assert lanesweep.check(frame.drop("length"), row=2).status == "preventable"


def test_an_error_names_the_argument_and_no_file_that_nobody_made(caplog) -> None:
    case = {"category": "cut-in", "ego_speed": "60km/h", "speed": "40km/h", "gap": -3, "lateral_speed": 1, "site": "a"}
    frame = pl.DataFrame([case, case])
    wrong = [lambda: lanesweep.check(case), lambda: lanesweep.trace(table=frame, row=2), lambda: lanesweep.check(frame.row(0))]
    wrong += [lambda: lanesweep.study(frame), lambda: lanesweep.tracks(frame.to_pandas()), lambda: lanesweep.simulate({}), lambda: lanesweep.simulate("a.csv")]
    says = ["`file`, column `gap`", "`table`, column `gap`, row 2", "`file` is", "`recordings` is a table in", "`paths` is a table in", "`cases` is", "`cases` is"]
    for call, says_of_call in zip(wrong, says, strict=True):
        with pytest.raises((lanesweep.InputError, lanesweep.UsageError), match=f"^{says_of_call}") as raised:
            call()
        assert "lanesweep-" not in str(raised.value)
    assert lanesweep.check(next(pd.DataFrame([case | {"gap": 15}]).itertuples(index=False))).status == "preventable"
    assert "`file`: these columns are not used: site" in caplog.text and "lanesweep-" not in caplog.text


def test_a_figure_is_saved_as_what_its_name_says(scenarios, tmp_path) -> None:
    pytest.importorskip("matplotlib")
    figure = lanesweep.study(scenarios=scenarios, thw="1.2,0.6", backend="cpu").figure("f1-cut-in")
    assert figure.save(tmp_path / "f.png").read_bytes().startswith(b"\x89PNG")
    assert "<svg" in figure.save(tmp_path / "f.svg").read_text()
    with pytest.raises(ValueError, match="xyz"):
        figure.save(tmp_path / "f.xyz")


def test_a_figure_outlives_its_result(scenarios) -> None:
    figure = lanesweep.study(scenarios=scenarios, thw=1.2, models="FSM", backend="cpu").figure("radar-cut-in")
    assert "<svg" in figure.svg


def test_figures_are_drawn_with_matplotlib(scenarios, tmp_path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    result = lanesweep.study(scenarios=scenarios, models=["FSM", "RSS"], backend="cpu")
    for name in result.figures:
        drawn = result.figure(name).plot()
        assert drawn.axes and all(axes.has_data() for axes in drawn.axes), name
        assert "SYNTHETIC DATA" in drawn.get_suptitle()
        drawn.savefig(tmp_path / "figure.png")
        matplotlib.pyplot.close(drawn)


def test_a_time_limit_is_no_interrupt(density, tmp_path) -> None:
    options = {"samples": 10**8, "thw": 1.2, "models": "FSM", "backend": "cpu"}
    with pytest.raises(lanesweep.RunStopped, match="continues"):
        lanesweep.sample(density, **options, config={"run": {"stop_after_s": 0.5}}, out=tmp_path)


def test_a_check_has_its_answer_as_status() -> None:
    safe = lanesweep.check({"category": "cut-in", "ego_speed": "60km/h", "speed": "40km/h", "gap": 30, "lateral_speed": 1})
    assert safe.status == "preventable" and "preventable" in str(safe.document).lower()
    close = lanesweep.check({"category": "cut-in", "ego_speed": "60km/h", "speed": "20km/h", "gap": 10, "lateral_speed": 1})
    assert close.status == "not preventable"


def test_errors_are_exceptions_with_place_and_help(tmp_path) -> None:
    with pytest.raises(lanesweep.UsageError, match="no driver model `FSN`") as raised:
        lanesweep.study(synth_recordings=1, models="FSN")
    assert raised.value.exit_code == 2 and "did you mean `FSM`?" in raised.value.help
    with pytest.raises(lanesweep.LanesweepError, match="nothing-here"):
        lanesweep.study(tmp_path / "nothing-here")
    bad = tmp_path / "bad.jsonl"
    bad.write_text("{}\n")
    with pytest.raises(lanesweep.InputError, match=r"bad\.jsonl, line 1"):
        lanesweep.study(scenarios=bad)
    with pytest.raises(lanesweep.UsageError, match="synth-recordings|synth_recordings"):
        lanesweep.study(synth_recordings="many")
    assert not list(tmp_path.glob("**/.*"))


def test_messages_go_to_logging(caplog, scenarios) -> None:
    with caplog.at_level(logging.INFO, "lanesweep"):
        lanesweep.study(scenarios=scenarios, thw=1.2, models="FSM", backend="cpu")
    assert any("runs on" in record.message for record in caplog.records)


@pytest.mark.skipif(os.name == "nt", reason="signals")
def test_an_interrupt_ends_a_run_and_a_next_one_works(density) -> None:
    threading.Timer(1.0, lambda: signal.raise_signal(signal.SIGINT)).start()
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        lanesweep.sample(density, samples=10**10, thw=1.2, backend="cpu", config={"run": {"stop_after_s": 60}})
    assert time.monotonic() - start < 15
    assert lanesweep.sample(density, samples=100, thw=1.2, backend="cpu").status == "ok"


@pytest.mark.skipif(os.name == "nt", reason="signals")
def test_an_interrupt_ends_reading_and_generating_recordings(tmp_path) -> None:
    long = {"synth_recordings": 99, "config": "generator.duration_s=1000"}
    for call in (lambda: lanesweep.tracks(convert=tmp_path / "recordings", **long), lambda: lanesweep.study(**long)):
        threading.Timer(0.5, lambda: signal.raise_signal(signal.SIGINT)).start()
        start = time.monotonic()
        with pytest.raises(KeyboardInterrupt):
            call()
        assert time.monotonic() - start < 8
    assert not (tmp_path / "recordings").exists() or not any((tmp_path / "recordings").iterdir())


def test_input_that_is_left_out_is_named_in_the_messages(tmp_path) -> None:
    recordings = lanesweep.tracks(convert=tmp_path / "recordings", synth_recordings=2)
    (tmp_path / "recordings" / "02_tracks.csv").write_text("frame,id\n")
    mined = lanesweep.mine(recordings)
    assert mined.status == "incomplete" and any("02_tracks.csv" in line for line in mined.messages)


def test_the_bar_of_a_table_whose_rows_nobody_counted_has_no_end(monkeypatch) -> None:
    seen: list[tuple[str, int, int | None]] = []
    monkeypatch.setattr(lanesweep._run, "progress", lambda: (lambda *bar: seen.append(bar), lambda: None))
    case = {"category": "cut-in", "ego_speed_mps": 20.0, "speed_mps": 15.0, "lateral_speed_mps": 1.0}
    lanesweep.check(pd.DataFrame([case | {"gap_m": float(gap)} for gap in range(10, 70)]))
    assert {(what, total) for what, _, total in seen} == {("judging", None)}


def test_runs_of_two_threads_take_turns(density) -> None:
    def probability(seed: int) -> object:
        return lanesweep.sample(density, samples=20_000, thw=1.2, models="FSM", backend="cpu", seed=seed).document["estimates"]

    expected = [probability(seed) for seed in (1, 2, 3, 4)]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(probability, (1, 2, 3, 4))) == expected


def test_errors_are_those_of_python_too(tmp_path) -> None:
    for call in (lambda: lanesweep.study(tmp_path / "none"), lambda: lanesweep.check(tmp_path / "none.csv")):
        with pytest.raises(FileNotFoundError) as raised:
            call()
        assert isinstance(raised.value, lanesweep.MissingFile) and raised.value.help == "check the path for typing errors"
    with pytest.raises(ValueError, match="no driver model `X`"):
        lanesweep.study(models="X")
    with pytest.raises(ValueError):
        lanesweep.simulate({"ego_speed_mps": [-1.0], "gap": [9.0], "acceleration": [-5.0]}, category="lvd")


def test_a_table_in_memory_is_a_scenario_file(tmp_path) -> None:
    rows = {"id": ["a", "b", "c"], "category": "cut-in", "ego_speed_kmh": [90.0, 100.0, 110.0], "speed_kmh": 70.0, "lateral_speed": 1.0}
    table = pd.DataFrame(rows)
    table.to_csv(tmp_path / "scenarios.csv", index=False)
    options = {"categories": "cut-in", "thw": [0.6], "backend": "cpu"}
    expected = lanesweep.study(scenarios=tmp_path / "scenarios.csv", **options).table("results").to_polars().rows(named=True)
    for given in (table, pl.DataFrame(rows), pa.Table.from_pandas(table)):
        assert lanesweep.study(scenarios=given, **options).table("results").to_polars().rows(named=True) == expected


def test_a_star_import_leaves_the_names_of_python_alone() -> None:
    names: dict[str, object] = {}
    exec("from lanesweep import *", names)
    assert "map" not in names and "study" in names and callable(lanesweep.map)


def test_the_command_line_is_complete(program) -> None:
    assert program("--version").stdout.startswith("lanesweep ")
    refused = program("study", "--no-such-flag")
    assert refused.returncode == 2 and "no-such-flag" in refused.stderr


def test_infinite_numbers_and_empty_tables_of_verbs_are_what_they_are(density, tmp_path) -> None:
    options = {"models": ["Reg157", "FSM"], "thw": 0.4, "samples": 2000}
    lanesweep.sample(density, **options, rows=tmp_path / "rows.csv", failures=tmp_path / "failures.csv")
    failing = pd.read_csv(tmp_path / "failures.csv")
    assert len(failing) > 50 and failing[["min_ttc_s", "max_btn", "min_gap_m"]].notna().all().all()
    collided = failing[failing["collision"] == 1]
    assert len(collided) and np.isinf(collided["max_btn"]).all() and (collided["min_gap_m"] <= 0).all()
    rows = pd.read_csv(tmp_path / "rows.csv")
    assert (rows["btn"].astype(bool) == (rows["max_btn"] > 0.8)).all() and np.isinf(rows["max_btn"]).any()
    # JSON has no infinity: there it is a text, which no filter drops in silence.
    lanesweep.sample(density, **options, rows=tmp_path / "rows.jsonl")
    lines = [json.loads(line) for line in (tmp_path / "rows.jsonl").read_text().splitlines()]
    assert [line["max_btn"] == "Infinity" for line in lines] == list(np.isinf(rows["max_btn"]))
    assert np.allclose(pd.read_json(tmp_path / "rows.jsonl", lines=True)["max_btn"], rows["max_btn"])
    # A ratio without a failure has no value, and an interval around no failure is infinitely wide.
    rare = lanesweep.sample(density, models="FSM", thw=2.0, samples=100).table("estimates").to_pandas()
    assert (rare["failures"] == 0).any() and np.isinf(rare.loc[rare["failures"] == 0, "relative_half_width"]).all()


def test_a_density_outlives_its_fit() -> None:
    options = {"synth_recordings": 6, "categories": "cut-in", "parameterizations": 2}
    density = lanesweep.fit(**options).densities["cut-in-2"]
    assert lanesweep.sample(density, samples=100, thw=1.2, models="FSM").status == "ok"
    limit_state = lanesweep.LimitState(lanesweep.fit(**options), thw=1.0)
    assert pickle.loads(pickle.dumps(limit_state)).parameters == limit_state.parameters
    folder = density.parent
    del density
    assert not folder.exists()


def test_a_single_density_is_among_the_densities_of_its_fit(density, tmp_path) -> None:
    options = {"synth_recordings": 6, "categories": "cut-in", "parameterizations": 2}
    one = lanesweep.fit(**options, out=tmp_path / "one.json")
    assert one.densities == {"one": tmp_path / "one.json"} and os.fspath(one) == str(tmp_path / "one.json")
    assert lanesweep.sample(one.densities["one"], samples=100, thw=1.2, models="FSM").status == "ok"


def test_messages_name_arguments_and_no_flags(density) -> None:
    for call, kind, message in [
        (lambda: lanesweep.study(synth_recordings=1, thw="soon"), lanesweep.UsageError, "`thw`: `soon` is not a time headway"),
        (lambda: lanesweep.study(synth_recordings=1, categories="cut"), lanesweep.UsageError, "`categories`"),
        (lambda: lanesweep.study(synth_recordings="many"), lanesweep.UsageError, "`synth_recordings`"),
        (lambda: lanesweep.sample(density, samples=True), lanesweep.UsageError, "`samples`"),
        (lambda: lanesweep.sample(density, criterion="speed", thw=1), lanesweep.UsageError, "`criterion`"),
        (lambda: lanesweep.study(synth_recordings=1, thw=[]), ValueError, "`thw` is empty"),
        (lambda: lanesweep.study(synth_recordings=1, models=[]), ValueError, "`models` is empty"),
        (lambda: lanesweep.study(synth_recordings=1, thw=False), lanesweep.UsageError, "`thw`: False is not a value of it"),
        (lambda: lanesweep.study(synth_recordings=1, backnd="cpu"), TypeError, "unexpected keyword argument 'backnd'"),
        (lambda: lanesweep.study("recordings", scenarios="a.jsonl"), lanesweep.UsageError, "cannot be used with"),
        (lambda: lanesweep.mine([]), ValueError, "`recordings` is empty"),
        (lambda: lanesweep.study(synth_recordings=1, categories=object()), TypeError, "`categories` has the value <object"),
        (lambda: lanesweep.study(synth_recordings=1, dt=[object()]), TypeError, "`dt` has the value <object"),
    ]:
        with pytest.raises(kind, match=message) as raised:
            call()
        assert not re.search(r"(?<![a-z])--[a-z]", str(raised.value)), raised.value


def test_values_keep_their_meaning_and_names_their_letters(density, scenarios, tmp_path) -> None:
    tiny = {"models": "FSM", "backend": "cpu"}
    # A path is one path, whatever it holds; a result stands for what a function reads of it.
    odd = tmp_path / "a,b c.json"
    odd.write_bytes(density.read_bytes())
    assert lanesweep.sample(odd, samples=np.int64(200), thw=np.float32(1.2), **tiny).status == "ok"
    headways = [np.array([0.6], dtype="float32"), pd.Series([0.6], dtype="Float32"), {0.6}, (0.6,), np.array(0.6)]
    studies = [lanesweep.study(scenarios=scenarios, thw=thw, **tiny).table("results").to_polars().rows(named=True) for thw in headways]
    assert all(study == studies[0] for study in studies)
    panels = {"ego_speed_kmh": {90, 60, 120}}
    options = {"x": "gap_m=5..9/2", "y": "other_speed_kmh=30,40", "set": pd.Series({"lateral_speed_mps": 1.0})}
    assert lanesweep.map("cut-in", panel=panels, config={"run": {"dt_s": 0.02}}, **options, **tiny).status == "ok"
    case = {"category": "cut-in", "ego_speed": "60km/h", "speed": "40km/h", "gap": 15, "lateral_speed": 1.0}
    for call, kind, message in [
        (lambda: lanesweep.check(case, gap_=3), TypeError, "unexpected keyword argument 'gap_'"),
        (lambda: lanesweep.check(case, quiet=True), TypeError, "unexpected keyword argument 'quiet'"),
        (lambda: lanesweep.check(case, row=7), lanesweep.LanesweepError, "row 7"),
        (lambda: lanesweep.check(row=7), lanesweep.UsageError, "`row`: it needs `file`"),
        (lambda: lanesweep.trace(from_=tmp_path), lanesweep.UsageError, "`from_`: it needs `lane`"),
        (lambda: lanesweep.study(scenarios), lanesweep.UsageError, "give it as `scenarios`"),
        (lambda: lanesweep.study(scenarios=scenarios, out=""), lanesweep.UsageError, "`out`: it is empty"),
        (lambda: lanesweep.study(scenarios=tmp_path / "my --models.jsonl"), lanesweep.LanesweepError, "my --models.jsonl"),
        (lambda: lanesweep.tracks(), lanesweep.UsageError, "there is nothing to read"),
        (lambda: lanesweep.tracks(scenarios), lanesweep.InputError, "scenarios.jsonl"),
        (lambda: lanesweep.study(thw=[[1.0]]), TypeError, "`thw` has the value"),
    ]:
        with pytest.raises(kind, match=re.escape(message)):
            call()
