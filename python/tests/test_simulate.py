"""Tables of concrete cases."""

from __future__ import annotations

import os
import pickle
import signal
import time
import warnings
from decimal import Decimal

import lanesweep
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

CASES = {
    "ego_speed_mps": [30.0, 25.0, 33.0],
    "speed_mps": [20.0, 20.0, 15.0],
    "gap_m": [12.0, 40.0, 20.0],
    "lateral_speed_mps": [1.0, 1.5, 2.0],
}


def test_a_speed_has_its_unit_in_the_name_or_in_the_value_or_is_refused() -> None:
    options = {"category": "cut-in", "models": "FSM"}
    named = {"ego_speed_kmh": [60.0, 90.0], "speed_kmh": [40, 0], "gap": [15, 40], "lateral_speed": 1.0}
    written = {"ego_speed": ["60km/h", "25m/s"], "speed": ["40 km/h", 0], "gap": ["15m", "40"], "lateral_speed": "1m/s"}
    assert lanesweep.simulate(named, **options).to_polars().rows(named=True) == lanesweep.simulate(written, **options).to_polars().rows(named=True)
    for bare in ([60.0, 90.0], [0, 60], ["60", "90"]):
        with pytest.raises(lanesweep.InputError, match="60 has no unit: as m/s it is 216 km/h, as km/h 16.67 m/s") as raised:
            lanesweep.simulate({"ego_speed": bare, "speed_kmh": 40, "gap": 15, "lateral_speed": 1}, **options)
        assert "ego_speed_kmh" in raised.value.help and "row" in str(raised.value)
    with pytest.raises(lanesweep.InputError, match="says the same"):
        lanesweep.simulate({**named, "speed_mps": 11.0}, **options)
    for column, wrong in (("gap", "15km"), ("speed", "40m"), ("lateral_speed", "fast")):
        with pytest.raises(lanesweep.InputError, match=f"{column}.*{wrong}"):
            others = {key: values for key, values in named.items() if not key.startswith(column)}
            lanesweep.simulate({**others, column: wrong}, **options)
    with pytest.raises(lanesweep.InputError, match="60 has no unit"):
        lanesweep.check({"category": "cut-in", "ego_speed": 60, "speed": "40km/h", "gap": 15, "lateral_speed": 1})


def test_every_case_has_its_own_id() -> None:
    cases = {"ego_speed_kmh": 90.0, "gap": [15.0, 40.0], "acceleration": -5}
    assert len(lanesweep.simulate({**cases, "id": ["a", "b"]}, category="lvd", models="FSM").to_polars().rows(named=True)) == 2
    for ids in (["a", "a"], [7, 7]):
        with pytest.raises(lanesweep.InputError, match="row 1.*this id belongs to row 0 too|id.*row 0 too"):
            lanesweep.simulate({**cases, "id": ids}, category="lvd", models="FSM")


def test_every_library_of_tables_gives_the_same_outcomes() -> None:
    tables = [CASES, pd.DataFrame(CASES), pl.DataFrame(CASES), pa.table(CASES), {k: np.array(v) for k, v in CASES.items()}]
    frames = [lanesweep.simulate(table, category="cut-in").to_pandas() for table in tables]
    assert len(frames[0]) == 12 and list(frames[0]["case"]) == [0] * 4 + [1] * 4 + [2] * 4
    for frame in frames[1:]:
        pd.testing.assert_frame_equal(frame, frames[0])


def test_a_row_is_the_case_that_trace_runs() -> None:
    frame = lanesweep.simulate(CASES, category="cut-in", models="FSM")
    for row in frame.to_polars().rows(named=True):
        at = row["case"]
        with_unit = {"mps": "{}m/s", "m": "{}m"}
        case = {key.rsplit("_", 1)[0]: with_unit[key.rsplit("_", 1)[1]].format(values[at]) for key, values in CASES.items()}
        traced = lanesweep.trace(table={"category": "cut-in", **case}, models="FSM").document["lanes"][0]
        outcome = traced.get("outcome", traced)
        assert outcome["collision"] == row["collision"]
        # A trace is in binary64.
        assert row["min_ttc_s"] == pytest.approx(outcome["min_ttc_s"], rel=1e-4)


def test_a_case_within_rounding_of_a_limit_is_not_robust_and_the_reference_is_what_trace_says() -> None:
    # The last is far from any limit.
    cases = {
        "ego_speed_mps": [38.69395536938895, 27.421864529919716, 33.6767980294175, 29.00674810658949, 30.0],
        "speed_mps": [24.483329487285424, 15.197090112295333, 19.587822472628055, 17.119653931908772, 20.0],
        "gap": [30.462145330837288, 24.120127121291684, 58.47113429192097, 46.32344642788733, 40.0],
        "lateral_speed": [1.692366964456078, 1.0969398616077397, 1.2827202148940062, 1.87297914513876, 1.0],
    }
    ours, reference = (lanesweep.simulate(cases, category="cut-in", models=["FSM", "CCHDM"], reference=of) for of in (False, True))
    differs = np.any([ours[name] != reference[name] for name in ("collision", "ttc", "btn")], axis=0)
    assert differs.tolist() == [True, False, True, False, False, True, False, True, False, False]
    assert np.array_equal(ours["robust"], ~differs) and reference["robust"].all()
    for at, model in ((0, "FSM"), (2, "CCHDM")):
        case = {name.removesuffix("_mps"): f"{values[at]!r}{'m' if name == 'gap' else 'm/s'}" for name, values in cases.items()}
        traced = lanesweep.trace(table={"category": "cut-in", **case}, models=model).table("lanes")
        for name in ("collision", "ttc", "btn", "min_ttc_s", "min_gap_m", "end_s"):
            assert traced[name][0] == reference[name][2 * at + (model == "CCHDM")], name
    rng = np.random.default_rng(1)
    ranges = {"ego_speed_mps": (15, 40), "speed_mps": (10, 35), "gap": (2, 80), "lateral_speed": (0.3, 2.5)}
    many = {name: rng.uniform(*ends, 5000) for name, ends in ranges.items()}
    ours, reference = (lanesweep.simulate(many, category="cut-in", reference=of) for of in (False, True))
    differs = np.any([ours[name] != reference[name] for name in ("collision", "ttc", "btn")], axis=0)
    assert np.array_equal(ours["robust"], ~differs)
    # It closes at 0.6 m/s at its contact, and there is none in binary64.
    fast = {
        "ego_speed_kmh": 121.71203589273037,
        "speed_kmh": 59.67013465236302,
        "gap_m": 56.617872592265556,
        "lateral_speed_mps": 1.606558333132428,
        "acceleration_mps2": -0.8911871682689099,
    }
    ours, reference = (lanesweep.simulate(fast, category="cut-in", models="FSM", reference=of) for of in (False, True))
    assert [ours["collision"][0], reference["collision"][0], ours["robust"][0]] == [True, False, False]
    with pytest.raises(lanesweep.UsageError, match="reference"):
        lanesweep.simulate(CASES, category="cut-in", reference=True, backend="gpu")
    with pytest.raises(lanesweep.UsageError, match="(?s)Reg157-numpy.*help: leave out `reference`"):
        lanesweep.simulate(CASES, category="cut-in", reference=True, models=[lanesweep.drivers.Reg157()])


def test_headways_for_all_cases_and_mixed_categories_keep_the_order() -> None:
    table = {
        "category": ["lvd", "cut-in", "lvd"],
        "ego_speed_mps": [30, 30, 20],
        "speed_mps": [30, 20, 20],
        "lateral_speed": [None, 1.0, None],
        "acceleration": [-6.0, None, -6.0],
    }
    frame = lanesweep.simulate(pd.DataFrame(table), thw=[1.2, "0.4"], models=["RSS", "FSM"])
    rows = [(row["case"], row["headway"], row["model"]) for row in frame.to_polars().rows(named=True)]
    assert rows == [(case, thw, model) for case in range(3) for thw in ("1.2s", "0.4s") for model in ("RSS", "FSM")]
    assert frame.units["min_ttc_s"] == "s" and "collision" in frame.descriptions["collision"]


def test_cases_of_any_number_are_those_of_their_parts() -> None:
    rng = np.random.default_rng(1)
    n = 70_000
    table = {
        "ego_speed_mps": rng.uniform(10, 40, n),
        "speed_mps": rng.uniform(5, 35, n),
        "gap": rng.uniform(2, 60, n),
        "lateral_speed": rng.uniform(0.3, 2.5, n),
    }
    whole = lanesweep.simulate(table, category="cut-in", models="FSM", backend="cpu")
    part = lanesweep.simulate({k: v[66_000:] for k, v in table.items()}, category="cut-in", models="FSM", backend="cpu")
    assert np.array_equal(whole["case"], np.arange(n))
    for column in ("collision", "ttc", "btn", "min_gap_m"):
        assert np.array_equal(whole[column][66_000:], part[column]), column
    assert 0 < whole["collision"].sum() < n


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"ego_speed_mps": [30.0, float("nan"), 33.0]}, "row 1.*ego_speed|ego_speed.*row 1"),
        ({"ego_speed_mps": [30.0, float("inf"), 33.0]}, "row 1.*ego_speed|ego_speed.*row 1"),
        ({"ego_speed_mps": [30.0, 300.0, 33.0]}, "ego_speed.*row 1|row 1.*ego_speed"),
        ({"ego_speed_mps": ["fast", "slow", "30"]}, "ego_speed"),
        ({"lateral_sped": [1.0] * 3}, "lateral_sped.*no such column"),
        ({"model": ["a"] * 3}, "model.*the result has a column of this name"),
        ({"when": np.array(["2026-01-01"] * 3, dtype="M8[s]")}, "when"),
        ({"gap": [1.0, 2.0, 3.0]}, "gap.*says the same"),
        ({"thw_s": [1.0, 1.0, 1.0]}, "both gap and time headway"),
        ({"gap_m": []}, "differ in length"),
        ({"category": ["cut-in"] * 3}, "argument `category` is given too"),
        ({"gap_m": np.zeros((3, 2))}, r"the shape \(3, 2\)"),
    ],
)
def test_wrong_cases_are_named(change, message) -> None:
    with pytest.raises(lanesweep.InputError, match=message):
        lanesweep.simulate({**CASES, **change}, category="cut-in")


def test_other_columns_ids_and_the_index_are_repeated_for_every_lane_of_their_case() -> None:
    own = {"id": ["a", "b", "c"], "site": ["x", None, "y"], "lane": [1, 2, 3], "wet": [True, False, True]}
    frame = pd.DataFrame({**CASES, **own}, index=pd.Index([7, 5, 9], name="run"))
    found = lanesweep.simulate(frame, category="cut-in", models=["FSM", "RSS"]).to_pandas()
    assert list(found["run"]) == [7, 7, 5, 5, 9, 9] and list(found["id"]) == list("aabbcc")
    assert list(found["lane"]) == [1, 1, 2, 2, 3, 3] and list(found["wet"]) == [True, True, False, False, True, True]
    assert found["site"].fillna("-").tolist() == ["x", "x", "-", "-", "y", "y"]
    # They change no outcome.
    outcomes = lanesweep.simulate(CASES, category="cut-in", models=["FSM", "RSS"]).to_pandas()
    pd.testing.assert_frame_equal(found[list(outcomes)], outcomes)


def test_values_of_other_types_are_cast_or_repeated_or_refused_by_column_and_type() -> None:
    expected = lanesweep.simulate(CASES, category="cut-in", models="FSM").to_pandas()
    table = pa.table(CASES)
    gaps, at = table["gap_m"].to_pylist(), table.schema.get_field_index("gap_m")
    for kind in (pa.decimal128(8, 3), pa.float16(), pa.dictionary(pa.int8(), pa.float64())):
        values = [Decimal(str(gap)) for gap in gaps] if pa.types.is_decimal(kind) else np.array(gaps, np.float16) if kind == pa.float16() else gaps
        array = pa.array(gaps).dictionary_encode() if pa.types.is_dictionary(kind) else pa.array(values, kind)
        given = table.set_column(at, "gap_m", array)
        pd.testing.assert_frame_equal(lanesweep.simulate(given, category="cut-in", models="FSM").to_pandas(), expected)
    with pytest.raises(lanesweep.InputError, match=r"column `gap_m`: holds values of the type Duration"):
        lanesweep.simulate(table.set_column(at, "gap_m", pa.array([1, 2, 3], pa.duration("s"))), category="cut-in")
    times = pd.to_datetime(["2026-01-01", None, "2026-01-03"])
    own = {"time": times, "kind": pd.Categorical([3, 1, 3]), "list": [[1, 2], [], [3]]}
    found = lanesweep.simulate(pd.DataFrame(CASES).assign(**own), category="cut-in", models=["FSM", "RSS"])
    shown = found.to_pandas()
    assert (shown["time"][::2].reset_index(drop=True).dropna() == times.dropna()).all() and "Timestamp" in found._repr_html_()
    assert shown["kind"].tolist() == [3, 3, 1, 1, 3, 3] and found.to_polars()["list"].to_list()[:2] == [[1, 2], [1, 2]]


def test_a_frame_has_a_shape_columns_and_a_pickle() -> None:
    frame = lanesweep.simulate(CASES, category="cut-in", models=["FSM", "RSS"])
    assert frame.shape == (6, len(frame.columns)) and list(frame["case"]) == [0, 0, 1, 1, 2, 2]
    assert list(frame.to_numpy()) == frame.columns and (frame["model"] == "FSM").sum() == 3
    copy = pickle.loads(pickle.dumps(frame))
    assert copy.to_polars().rows(named=True) == frame.to_polars().rows(named=True) and copy.units == frame.units and copy.descriptions == frame.descriptions
    with pytest.raises(KeyError, match="no column `gap`"):
        frame["gap"]


def test_an_index_that_only_counts_is_no_column_and_missing_values_are_not_given() -> None:
    frame = pd.DataFrame(CASES)
    shuffled = frame.iloc[[2, 0, 1]]
    assert "index" not in lanesweep.simulate(frame, category="cut-in", models="FSM").columns
    ours = lanesweep.simulate(shuffled, category="cut-in", models="FSM")["min_gap_m"]
    theirs = lanesweep.simulate(frame, category="cut-in", models="FSM")["min_gap_m"]
    assert np.array_equal(ours, theirs[[2, 0, 1]])
    lengths = [None, 4.0, pd.NA]
    expected = lanesweep.simulate({**CASES, "length": [4.3, 4.0, 4.3]}, category="cut-in").to_pandas()
    masked = np.ma.masked_invalid([np.nan, 4.0, np.nan])
    for given in (lengths, masked, [np.nan, 4.0, np.nan]):
        found = lanesweep.simulate({**CASES, "length": given}, category="cut-in").to_pandas()
        pd.testing.assert_frame_equal(found, expected)
    empty = pl.DataFrame(CASES).with_columns(pl.lit(None).alias("length"))
    assert len(lanesweep.simulate(empty, category="cut-in")) == 12


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_a_child_of_a_process_that_has_simulated_simulates_too() -> None:
    table = {key: np.tile(values, 2000) for key, values in CASES.items()}
    lanesweep.simulate(table, category="cut-in")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        os._exit(0 if len(lanesweep.simulate(table, category="cut-in")) == 24_000 else 1)
    for _ in range(600):
        process, status = os.waitpid(child, os.WNOHANG)
        if process:
            break
        time.sleep(0.1)
    else:
        os.kill(child, signal.SIGKILL)
        pytest.fail("the child hangs")
    assert os.waitstatus_to_exitcode(status) == 0


def test_kilometres_per_hour_and_speeds_that_are_not_given() -> None:
    kmh = {"ego_speed_kmh": [108.0, 90.0], "speed_kmh": [72.0, 72.0], "gap": [12, 40], "lateral_speed": [1.0, 1.5]}
    mps = {"ego_speed_mps": [30.0, 25.0], "speed_mps": [20.0, 20.0], "gap": [12, 40], "lateral_speed": [1.0, 1.5]}
    ours, theirs = (lanesweep.simulate(table, category="cut-in", models="FSM").to_pandas() for table in (kmh, mps))
    pd.testing.assert_frame_equal(ours, theirs)
    with pytest.warns(UserWarning, match="speed.*row 1.*the ego's speed"):
        lanesweep.simulate(pd.DataFrame(mps).assign(speed_mps=[20.0, None]), category="cut-in", models="FSM")


def test_what_is_no_table_is_refused() -> None:
    with pytest.raises(TypeError, match="no table"):
        lanesweep.simulate([1, 2, 3])
    with pytest.raises(lanesweep.InputError, match="no rows"):
        lanesweep.simulate(pd.DataFrame({"ego_speed_mps": pd.Series([], dtype=float)}), category="cut-in", thw=1)
    with pytest.raises(lanesweep.InputError, match="initial distance is missing"):
        lanesweep.simulate({"ego_speed_mps": 30, "speed_mps": 20, "lateral_speed": 1}, category="cut-in")
    for thw in ("soon", -1, float("nan"), float("inf"), "observed"):
        with pytest.raises(lanesweep.UsageError, match="no headway"):
            lanesweep.simulate({"ego_speed_mps": 30, "lateral_speed": 1}, category="cut-in", thw=thw)
    with pytest.raises(lanesweep.UsageError, match="no profile|profile"):
        lanesweep.simulate({"ego_speed_mps": 30, "lateral_speed": 1}, category="cut-in", thw=1, profile="none-such")


def test_infinity_stays_infinity_and_null_is_no_value() -> None:
    """A lane for which no braking helps has the largest BTN of all: it may not vanish from a filter or a mean."""
    rng = np.random.default_rng(4)
    table = {
        "ego_speed_mps": rng.uniform(10, 40, 4000),
        "speed_mps": rng.uniform(5, 35, 4000),
        "gap_m": rng.uniform(0, 20, 4000),
        "lateral_speed_mps": rng.uniform(0.3, 2.5, 4000),
    }
    frame = lanesweep.simulate(table, category="cut-in")
    for found in (frame.to_pandas(), frame.to_polars().to_pandas(), pa.table(frame).to_pandas()):
        assert found[["min_ttc_s", "max_btn", "min_gap_m"]].notna().all().all()
        btn, collision = found["btn"].astype(bool), found["collision"].astype(bool)
        assert (btn == (found["max_btn"] > 0.8)).all() and np.isinf(found.loc[collision, "max_btn"]).any()
        assert np.isinf(found["min_ttc_s"]).any()
        # Vehicles that touch have no gap left, side contacts included.
        assert (found.loc[collision, "min_gap_m"] <= 0).all() and (found.loc[~collision, "min_gap_m"] > 0).all()
        # An event that did not happen has no value.
        assert (found["impact_speed_mps"].isna() == ~collision).all()
    said = frame.descriptions
    assert all("infinite" in said[name] for name in ("min_ttc_s", "max_btn", "min_gap_m"))
    assert all("null" in said[name] for name in ("reaction_s", "impact_speed_mps", "impact_closing_speed_mps"))


def test_a_headway_has_its_shortest_decimal_form_however_it_was_computed() -> None:
    case = {"ego_speed_mps": 30.0, "speed_mps": 20.0, "lateral_speed_mps": 1.0}
    computed = np.arange(0.2, 1.45, 0.2)
    assert "0.6000000000000001" in map(str, computed)
    for thw in (computed, list(computed), computed.astype(np.float32), pd.Series(computed), [f"{thw}s" for thw in computed]):
        frame = lanesweep.simulate(case, category="cut-in", models="FSM", thw=thw)
        assert list(frame["headway"]) == ["0.2s", "0.4s", "0.6s", "0.8s", "1s", "1.2s", "1.4s"]


def test_an_empty_list_is_refused_and_never_everything() -> None:
    case = {"ego_speed_mps": 30.0, "speed_mps": 20.0, "lateral_speed_mps": 1.0, "gap": 20.0}
    for name in ("thw", "models"):
        for empty in ([], (), np.array([])):
            with pytest.raises(ValueError, match=f"`{name}` is empty"):
                lanesweep.simulate(case, category="cut-in", **{name: empty})
    for thw in (object(), [None], {"a": object()}, [[1.0]]):
        with pytest.raises(TypeError, match="`thw`"):
            lanesweep.simulate(case, category="cut-in", thw=thw)


def test_a_quantity_under_another_name_is_a_warning_and_what_a_row_cannot_choose_is_refused() -> None:
    without = {key: values for key, values in CASES.items() if not key.startswith("speed")}
    speeds = np.array([20.0, 20.0, 20.0])
    for name in ("target_speed_kmh", "speedkmh", "relative_speed_mps", "v_target_mps"):
        with pytest.warns(UserWarning) as said:
            lanesweep.simulate({**without, name: speeds}, category="cut-in", models="FSM")
        texts = [str(one.message) for one in said]
        assert any(f"`{name}` is repeated and not used" in text for text in texts), texts
        assert any("column `speed`: 3 rows without a value" in text for text in texts), texts
    for name in ("models", "rate_hz"):
        with pytest.raises(lanesweep.InputError, match=f"{name}.*\n? *a row cannot choose it"):
            lanesweep.simulate(pd.DataFrame(CASES).assign(**{name: "FSM"}), category="cut-in")
    with pytest.raises(lanesweep.InputError, match="values of one type"):
        lanesweep.simulate(pd.DataFrame(CASES).assign(site=["a", 1, None]), category="cut-in")


def test_an_index_of_some_rows_is_repeated() -> None:
    frame = pd.DataFrame(CASES)
    assert lanesweep.simulate(frame.iloc[1:], category="cut-in", models="FSM")["index"].tolist() == [1, 2]
    assert lanesweep.simulate(frame.iloc[::2], category="cut-in", models="FSM")["index"].tolist() == [0, 2]


def test_units_and_descriptions_stand_in_the_order_of_the_columns() -> None:
    frame = lanesweep.simulate(CASES, category="cut-in", models="FSM")
    for texts in (frame.units, frame.descriptions):
        assert list(texts) == [name for name in frame.columns if name in texts]
