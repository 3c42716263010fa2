"""Recipes: each result beside one that is known."""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lanesweep
import numpy as np
import polars as pl
import pytest
from lanesweep import recipes
from lanesweep.recipes import _shared
from scipy import stats

CASE = {"category": "cut-in", "ego_speed_kmh": 60, "speed_kmh": 30, "gap_m": 17, "lateral_speed": 1.0}


def test_a_recipe_has_at_most_forty_lines() -> None:
    for path in Path(recipes.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                assert node.end_lineno is not None
                assert node.end_lineno - node.lineno < 40, f"{path.name}: {node.name}"


def test_a_missing_library_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "statsmodels.stats.proportion", None)
    with pytest.raises(ImportError, match=r"lanesweep\[recipes\]"):
        recipes.uncertain(CASE, {"gap_m": 1}, draws=10)


@pytest.fixture
def cases() -> pl.DataFrame:
    """Sixty cut-ins."""
    rng = np.random.default_rng(1)
    numbers = {"ego_speed_kmh": (60, 130), "speed_kmh": (20, 60), "gap_m": (5, 60), "lateral_speed": (0.5, 2)}
    columns = {name: rng.uniform(*ends, 60).round(1) for name, ends in numbers.items()}
    return pl.DataFrame({"id": [f"case-{k}" for k in range(60)], "category": "cut-in", **columns})


@pytest.fixture
def theirs(cases: pl.DataFrame) -> pl.DataFrame:
    """Results that are ours."""
    own = pl.DataFrame(lanesweep.simulate(cases, models="CCHDM", profile="un-r157"))
    return own.select("id", "collision", "reaction_s", "min_gap_m", "min_ttc_s", "contact_s", "impact_speed_mps")


def test_our_own_results_have_no_difference(cases: pl.DataFrame, theirs: pl.DataFrame, tmp_path: Path) -> None:
    assert theirs["min_ttc_s"].is_infinite().any() and theirs["contact_s"].null_count()
    theirs.write_csv(tmp_path / "theirs.csv")
    for results in (theirs, theirs.to_pandas(), tmp_path / "theirs.csv"):
        found = recipes.compare_results(cases, results)
        assert found.causes.is_empty() and found.agreement[0] == found.agreement[2] == 1.0
        assert found.cases["first"].null_count() == 60


def test_the_first_quantity_that_differs_has_its_sign_and_the_cases_that_differ(cases: pl.DataFrame, theirs: pl.DataFrame) -> None:
    # Late in ten cases by 0.3 s, and a smaller gap in all: the gap is an effect where the reaction differs.
    late = theirs.filter(pl.col("reaction_s").is_not_null())["id"].head(10).to_list()
    is_late = pl.col("id").is_in(late)
    shifted = theirs.with_columns(pl.when(is_late).then(pl.col("reaction_s") + 0.3).otherwise(pl.col("reaction_s")))
    shifted = shifted.with_columns(pl.when(~pl.col("collision")).then(pl.col("min_gap_m") - 0.2).otherwise(pl.col("min_gap_m")))
    causes = recipes.compare_results(cases, shifted).causes.rows_by_key("quantity", named=True)
    assert [causes["reaction_s"][0][what] for what in ("cases", "median", "min", "max")] == pytest.approx([10, 0.3, 0.3, 0.3])
    of_gap = causes["min_gap_m"][0]
    assert of_gap["max"] < 0 and of_gap["median"] == pytest.approx(-0.2, abs=1e-4)


def test_a_difference_that_equals_a_tolerance_is_none(cases: pl.DataFrame, theirs: pl.DataFrame) -> None:
    def later(by: float) -> int:
        results = theirs.select("id", "collision", reaction_s=pl.col("reaction_s") + by)
        return recipes.compare_results(cases, results).cases["first"].count()

    assert later(0.05) == later(-0.05) == 0
    assert later(0.051) == theirs["reaction_s"].count() > 40


def test_infinite_is_a_value_and_empty_is_unknown(cases: pl.DataFrame, theirs: pl.DataFrame) -> None:
    results = theirs.select("id", "collision", "min_ttc_s")
    closing = results.filter(pl.col("min_ttc_s").is_finite())["id"][0]
    of = pl.col("id") == closing
    never = results.with_columns(min_ttc_s=pl.when(of).then(float("inf")).otherwise("min_ttc_s"))
    found = recipes.compare_results(cases, never)
    assert found.causes.row(0) == ("min_ttc_s", 1, np.inf, np.inf, np.inf)
    unknown = results.with_columns(min_ttc_s=pl.when(of).then(None).otherwise("min_ttc_s"))
    assert recipes.compare_results(cases, unknown).causes.is_empty()
    silent = recipes.compare_results(cases, results.with_columns(collision=pl.when(of).then(None).otherwise("collision")))
    assert (silent.agreement[0], silent.missing) == (1.0, 1)
    assert recipes.compare_results(cases, results, tolerances={"reaction_s": 0.1}).ignored == ["min_ttc_s"]


def test_braking_is_compared_too_and_a_foreign_id_is_refused(cases: pl.DataFrame, tmp_path: Path) -> None:
    few = cases.head(3).with_columns(answer=pl.lit("preventable"))
    few.drop("answer").write_csv(tmp_path / "few.csv")
    sheet = lanesweep.check(tmp_path / "few.csv", row=1, profiles="un-r157").document
    (driver,) = [of for of in sheet["profiles"][0]["models"] if of["model"] == "CCHDM"]
    results = {"id": ["case-0"], "collision": [driver["collision"]], "braking_s": [driver["braking_s"] + 0.1]}
    compared = recipes.compare_results(few, {**results, "impact_speed_kmh": [3.0]})
    assert compared.cases["braking_s"][0] == pytest.approx(0.1)
    assert (compared.missing, compared.ignored) == (2, ["impact_speed_kmh"])
    with pytest.raises(ValueError, match="twice"):
        recipes.compare_results(few, pl.concat([pl.DataFrame(results)] * 2))
    with pytest.raises(ValueError, match="no case"):
        recipes.compare_results(few, {**results, "id": ["other"]})


def test_variations_lie_inside_at_and_outside_the_ranges() -> None:
    ranges = {"gap_m": (12.0, 42.0), "lateral_speed": (0.5, 2.0)}
    counts = {"inside": 32, "edge": 8, "outside": 8, "boundary": 4}
    found = recipes.variations(CASE, ranges, seed=7, **counts)
    assert found.equals(recipes.variations(CASE, ranges, seed=7, **counts))
    assert not found.equals(recipes.variations(CASE, ranges, seed=8, **counts))
    low, high = np.array(list(ranges.values())).T

    def places(of: str) -> np.ndarray:
        return (found.filter(pl.col("id").str.starts_with(of)).select(list(ranges)).to_numpy() - low) / (high - low)

    assert len(places("inside")) == 32 and ((places("inside") >= 0) & (places("inside") <= 1)).all()
    at_end = np.minimum(abs(places("edge")), abs(places("edge") - 1)) < 1e-6
    assert len(at_end) == 8 and (at_end.sum(axis=1) == 1).all()
    beyond = np.maximum(-places("outside"), places("outside") - 1)
    assert len(beyond) == 8 and ((beyond > 0).sum(axis=1) == 1).all() and 0.2 < beyond.max() <= 0.25
    pairs = places("boundary").reshape(-1, 2, 2)
    assert len(pairs) == 2 and abs(pairs[:, 0] - pairs[:, 1]).max() < 1.1e-3


def test_the_cases_of_a_pair_have_two_answers_of_check() -> None:
    found = recipes.variations(CASE, {"gap_m": (5, 45), "lateral_speed": (0.5, 2)}, edge=0, outside=0, boundary=2)
    pairs = found.filter(pl.col("id").str.starts_with("boundary"))
    answers = pairs["answer"].to_list()
    assert all(one != other for one, other in zip(answers[::2], answers[1::2], strict=True))
    # Where the sheet of one case finds the change: at 13.87 m. A gap below 0 is no case, and has no row.
    gaps = recipes.variations(CASE, {"gap_m": (8, 40)}, inside=16, edge=0, outside=2, boundary=1)
    pair = gaps.filter(pl.col("id").str.starts_with("boundary"))
    assert pair["gap_m"].to_list() == pytest.approx([13.87, 13.87], abs=0.04)
    nearer = recipes.variations(CASE, {"gap_m": (0, 40)}, inside=4, edge=0, outside=2, boundary=0)
    assert nearer.filter(pl.col("id").str.starts_with("outside")).height == 1
    ends = recipes.variations(gaps.row(0, named=True), {"gap_m": (8, 40)}, inside=0, edge=16, outside=0)
    assert ends.select("id", "gap_m").rows() == [("edge-1", 8.0), ("edge-2", 40.0)]


def test_a_case_that_is_none_is_named() -> None:
    without_gap = {name: value for name, value in CASE.items() if name != "gap_m"}
    with pytest.raises(lanesweep.InputError, match="the initial distance is missing"):
        recipes.variations(without_gap, {"speed_kmh": (20, 40)}, inside=4, boundary=0)
    with pytest.raises(ValueError, match="ego_speed_kmh"):
        recipes.uncertain({"category": "lvd", "ego_speed": "60km/h", "gap": 9, "acceleration": -6}, {"ego_speed": 1})


def test_uncertain_shares_are_those_of_the_verb_that_they_replace() -> None:
    errors = {"gap_m": 1, "ego_speed_kmh": 2, "speed_kmh": 2, "lateral_speed": 0.1}
    found = recipes.uncertain(CASE, errors)
    answers = {row["answer"]: row for row in found.answers.to_dicts()}
    # 3,000,000 draws of `check --uncertain`, commit ca0e1992: 92.470 %.
    assert answers["preventable"]["low"] < 0.92470 < answers["preventable"]["high"]
    drivers = {row["driver"]: row for row in found.drivers.to_dicts()}
    assert drivers["CCHDM"]["share"] == pytest.approx(0.2186, abs=0.01)
    indices = {row["input"]: row for row in found.indices.to_dicts()}
    for name, index in {"gap_m": 0.080, "ego_speed_kmh": 0.168, "speed_kmh": 0.157, "lateral_speed": 0.005}.items():
        assert indices[name]["index"] == pytest.approx(index, abs=0.03)
    # Of one input alone the index is 1: nothing else can explain the answer. RBD-FAST of SALib has 0.94 here.
    alone = recipes.uncertain(CASE, {"gap_m": 3.0}).indices.row(0, named=True)
    assert alone["index"] > 0.99 - alone["half_width"] and alone["half_width"] < 0.02
    few = recipes.uncertain(CASE | {"gap_m": 13.9}, {"gap_m": 3.0}, draws=100).indices.row(0, named=True)
    assert 0.5 < few["index"] <= 1.0 and np.isfinite(few["half_width"])
    assert found.draws.height == 20_000 and found.draws["answer"].null_count() == 0


def test_draws_that_are_no_case_have_no_answer_and_one_answer_has_no_index() -> None:
    case = {"category": "lvd", "ego_speed": "60km/h", "gap": 0.2, "acceleration": -6}
    found = recipes.uncertain(case, {"gap": stats.uniform(-0.5, 1.0)}, draws=500)
    invalid = found.draws.filter(pl.col("gap") < 0)
    assert invalid["answer"].null_count() == invalid.height == 500 - found.answers["of"][0] > 100
    assert found.answers["answer"].to_list() == ["not preventable"] and found.indices["index"].to_list() == [None]


@pytest.fixture(scope="module")
def study(scenarios: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Lanes and F1 of leader decelerations, with decompositions that have not seen what they replay."""
    rows = tmp_path_factory.mktemp("study") / "lanes.parquet"
    found = lanesweep.study(scenarios=scenarios, categories="lvd", models="Reg157", rows=rows)
    return pl.read_parquet(rows), pl.DataFrame(found.table("results"))


@pytest.mark.parametrize("key", ["i", "iii-cv"])
def test_a_justification_has_the_scores_and_intervals_of_the_study(study: tuple[pl.DataFrame, pl.DataFrame], key: str) -> None:
    lanes, f1 = study
    for criterion in ("collision", "ttc"):
        found = recipes.justification(lanes, key.removesuffix("-cv"), model="Reg157", criterion=criterion)
        (of,) = f1.filter(variant=key, criterion=criterion, headway="all").to_dicts()
        scores = {row["quantity"]: row for row in found.scores.to_dicts()}
        assert scores["recall"]["variant"] == key
        for name, column in {"recall": "recall", "precision": "precision", "F1": "f1"}.items():
            assert scores[name]["value"] == pytest.approx(of[column])
        if of["f1_low"] is not None:
            assert [scores["F1"]["low"], scores["F1"]["high"]] == pytest.approx([of["f1_low"], of["f1_high"]])
        assert scores["S'/S"]["value"] == pytest.approx((of["tp"] + of["fp"]) / (of["tp"] + of["fn"]))
        assert found.hidden.height == of["fn"] and not found.hidden[f"{criterion}_parameterized"].any()


def test_the_lanes_of_few_failing_scenarios_give_a_ratio_its_interval() -> None:
    lanes = {"id": [1, 1, 2, 2] * 2, "headway": ["1s", "2s"] * 4, "variant": ["S"] * 4 + ["i"] * 4, "model": "FSM", "collision": True}
    found = recipes.justification(pl.DataFrame({**lanes, "impact_speed_mps": 1.0, "min_ttc_s": 0.0}), "i", model="FSM")
    value, low, high = found.scores.filter(quantity="S'/S").select("value", "low", "high").row(0)
    assert low < value == 1.0 < high


def test_the_rows_may_be_csv(study: tuple[pl.DataFrame, pl.DataFrame], tmp_path: Path) -> None:
    lanes = study[0].with_columns(pl.col("collision", "ttc", "btn").cast(pl.Int64))
    lanes.write_csv(tmp_path / "lanes.csv")
    found = [recipes.justification(of, "ii", model="Reg157").scores for of in (study[0], tmp_path / "lanes.csv")]
    assert found[0].equals(found[1])


def test_limits_are_the_users_and_an_interval_over_a_limit_is_undecided(study: tuple[pl.DataFrame, pl.DataFrame]) -> None:
    limits = {"recall": (0.0, 1.0), "precision": (1.0, 1.0), "F1": (0.0, 0.01)}
    found = recipes.justification(study[0], "i", model="Reg157", criterion="ttc", limits=limits).scores
    assert dict(found.select("quantity", "within").iter_rows()) == {
        "recall": "yes", "precision": "undecided", "F1": "no", "S'/S": None,
    }  # fmt: skip
    with pytest.raises(ValueError, match="there is no quantity `f1`; there are recall"):
        recipes.justification(study[0], "i", model="Reg157", limits={"f1": (0.9, 1)})
    with pytest.raises(ValueError, match="no parameterization"):
        recipes.justification(study[0], "1", model="Reg157")


@pytest.fixture(scope="module")
def sampled(density: Path, tmp_path_factory: pytest.TempPathFactory) -> pl.DataFrame:
    """Lanes of two drivers."""
    rows = tmp_path_factory.mktemp("sample") / "rows.parquet"
    lanesweep.sample(density, samples=2000, models=["CCHDM", "FSM"], thw=[0.6, 1.2], rows=rows)
    return pl.read_parquet(rows)


def test_risk_has_the_estimates_of_every_density(density: Path, tmp_path: Path) -> None:
    found = recipes.risk({"one": density, "other": density}, samples=500, models="FSM", thw=0.6)
    assert found["name"].unique(maintain_order=True).to_list() == ["one", "other"]
    fitted = lanesweep.fit(synth_recordings=2, categories="lvd", parameterizations=["i", "ii"])
    found_of_fit = recipes.risk(fitted, samples=100, models="FSM", thw=0.6, rows=tmp_path / "rows.parquet")
    assert set(found_of_fit["name"]) == {"lvd-i", "lvd-ii"}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["rows-lvd-i.parquet", "rows-lvd-ii.parquet"]
    own = pl.DataFrame(lanesweep.sample(density, samples=500, models="FSM", thw=0.6).table("estimates"))
    for name in ("probability", "replayed_ratio", "sampled_ratio_low", "sampled_ratio_high"):
        assert found.filter(name="one")[name].to_list() == found.filter(name="other")[name].to_list() == own[name].to_list()


def test_the_ratio_of_two_drivers_is_that_of_their_counts(sampled: pl.DataFrame) -> None:
    fsm, cchdm = sampled.filter(model="FSM"), sampled.filter(model="CCHDM")
    found = recipes.failure_ratio(fsm, cchdm)
    assert found["headway"].to_list() == ["all", "0.6s", "1.2s"]
    assert found["ratio"][0] == pytest.approx(fsm["collision"].sum() / cchdm["collision"].sum())
    turned = recipes.failure_ratio(cchdm, fsm)
    assert turned["low"][1] == pytest.approx(1 / found["high"][1]) and found["low"][1] < found["ratio"][1] < found["high"][1]
    assert recipes.failure_ratio(fsm, fsm).row(0)[1:] == (1.0, 1.0, 1.0)
    with pytest.raises(ValueError, match="other cases"):
        recipes.failure_ratio(fsm, cchdm.head(10))
    with pytest.raises(ValueError, match="filter its rows by model"):
        recipes.failure_ratio(fsm, sampled)
    with pytest.raises(lanesweep.InputError, match="other cases"):
        recipes.failure_ratio(fsm, cchdm.with_columns(pl.col("v_ego_mps") + 1))


def test_rows_in_json_have_the_numbers_of_parquet(density: Path, sampled: pl.DataFrame, scenarios: Path, tmp_path: Path) -> None:
    lanesweep.sample(density, samples=2000, models=["CCHDM", "FSM"], thw=[0.6, 1.2], rows=tmp_path / "rows.jsonl")
    for criterion in ("collision", "ttc", "btn"):
        ours, theirs = (recipes.worst(rows, 50, criterion=criterion).select("model", "sample").rows() for rows in (tmp_path / "rows.jsonl", sampled))
        assert ours == theirs
    ours, theirs = (recipes.failure_map(rows, "min_ttc_s", "max_btn", bins=3)["lanes"] for rows in (tmp_path / "rows.jsonl", sampled))
    assert ours.to_list() == theirs.to_list() and sampled["min_ttc_s"].is_infinite().any()
    lanesweep.mine(scenarios.parent / "recordings", out=tmp_path / "scenarios.parquet")
    cut_ins = [_shared.table(file).filter(category="cut_in") for file in (scenarios, tmp_path / "scenarios.parquet")]
    assert np.array_equal(*(recipes.fit_description(of, 2).mean for of in cut_ins))


def _rows(**columns: Any) -> pl.DataFrame:
    lanes = {"id": [1, 2], "headway": "1s", "model": "FSM", "collision": [True, False], "min_ttc_s": [0.0, 2.0], "x": [1.0, 2.0]}
    more = {"impact_closing_speed_mps": [1.0, None], "contact_type": 2, "min_gap_m": 0.0, "category": ["lvd", "cut_in"], "target_v": [[1.0]] * 2}
    return pl.DataFrame({**lanes, **more, "variant": "S", "fps": 25.0, **columns})


WRONG = [
    (lambda: recipes.variations(CASE, {"gapp_m": (1, 2)}), "no quantity of a case `gapp`; there are category.*\n.*`gap`"),
    (lambda: recipes.variations(CASE | {"headway_s": 1}, {"gap_m": (1, 2)}), "no quantity of a case `headway`"),
    (lambda: recipes.uncertain(CASE | {"deceleration_mps2": 3}, {"deceleration_mps2": 1}), "`deceleration`.*\n.*`acceleration`"),
    (lambda: recipes.variations(CASE, {}), "nothing varies"),
    (lambda: recipes.variations(CASE, {"gap_m": (1, 2)}, inside=-1), "`inside` is -1"),
    (lambda: recipes.compare_results(_rows(), _rows().head(0)), "no rows"),
    (lambda: recipes.compare_results(_rows(), _rows(), tolerances={"reaction": 1}), "`reaction`.*\n.*`reaction_s`"),
    (lambda: recipes.largest_gap({"x": [1]}, {"x": (0, 2)}, draws={"x": []}), "no rows"),
    (lambda: recipes.largest_gap({"x": [1]}, {"x": (2, 0)}), "x goes from 2 to 0"),
    (lambda: recipes.failure_map(_rows(), "x", "x", bins=0), "`bins` is 0"),
    (lambda: recipes.failure_map(_rows(), "x", "y"), "no column `y`; there are id"),
    (lambda: recipes.risk({}), "`densities` has none"),
    (lambda: recipes.fit_description(_rows(), 2), "give those of one category"),
    (lambda: recipes.fit_description(_rows(category="cut-in"), 2), "no category `cut-in`.*\\n.*`cut_in`"),
    (lambda: recipes.found_emphasis(_rows(), 2, criterion="tttc"), "no criterion `tttc`.*\n.*`ttc`"),
    (lambda: recipes.worst(_rows(), criterion="collison"), "no criterion `collison`.*\n.*`collision`"),
    (lambda: recipes.injury_risk(9.0, "nhtsa"), "no curve `nhtsa`; there are nhtsa-2022"),
    (lambda: recipes.delta_v(_rows(), ego_kg=-1), "`ego_kg` is -1"),
    (lambda: recipes.justification(_rows(), "i", model="FSM", level=95), "`level` is 95"),
    (lambda: recipes.failure_ratio(_rows(id=1), _rows(), by="id"), "filter its rows by model, and by variant"),
    (lambda: recipes.worst("rows.txt"), "no reader of rows.txt: `.txt`; there are .csv, .jsonl, .parquet"),
]


@pytest.mark.parametrize(("call", "message"), WRONG)
def test_a_wrong_argument_is_named(call: Callable[[], Any], message: str) -> None:
    with pytest.raises((lanesweep.UsageError, lanesweep.InputError), match=message):
        call()


def test_a_map_counts_every_lane_once(sampled: pl.DataFrame) -> None:
    found = recipes.failure_map(sampled, "v_target_mps", "v_ego_mps", bins=10)
    assert found["lanes"].sum() == sampled.height and found["failures"].sum() == sampled["collision"].sum()
    assert found["v_ego_mps_high"].max() == pytest.approx(sampled["v_ego_mps"].max())
    cell = found.sort("lanes").row(-1, named=True)
    inside = [pl.col(name).is_between(cell[f"{name}_low"], cell[f"{name}_high"], closed="left") for name in ("v_target_mps", "v_ego_mps")]
    assert sampled.filter(*inside, model=cell["model"]).height == cell["lanes"]
    holes = sampled.with_columns(v_ego_mps=pl.when(pl.col("sample") > 2).then("v_ego_mps"))
    some = recipes.failure_map(holes, "v_target_mps", "v_ego_mps", bins=10)
    assert some["lanes"].sum() == holes["v_ego_mps"].count() < sampled.height and some["v_ego_mps_low"].is_finite().all()


def test_the_worst_lanes_have_the_fastest_contacts(sampled: pl.DataFrame) -> None:
    found = recipes.worst(sampled, 3)
    assert found["model"].to_list() == ["CCHDM"] * 3 + ["FSM"] * 3
    fastest = sampled.filter(model="FSM")["impact_closing_speed_mps"].drop_nulls().sort(descending=True).head(3)
    assert found["impact_closing_speed_mps"].tail(3).to_list() == fastest.to_list()
    for criterion, column in {"ttc": "min_ttc_s", "btn": "max_btn"}.items():
        found = recipes.worst(sampled, 1, criterion=criterion)
        (of,) = sampled.filter(model="FSM", **{column: found[column][1]}).select(pl.max("impact_closing_speed_mps")).row(0)
        assert found["impact_closing_speed_mps"][1] == of


def test_failing_lanes_have_the_worst_contacts_of_all_rows(density: Path, sampled: pl.DataFrame, tmp_path: Path) -> None:
    failures = tmp_path / "failures.parquet"
    lanesweep.sample(density, samples=2000, models=["CCHDM", "FSM"], thw=[0.6, 1.2], failures=failures)
    found = recipes.worst(failures, 5).select("model", "sample", "headway")
    assert found.rows() == recipes.worst(sampled, 5).select("model", "sample", "headway").rows()


def test_momentum_divides_the_closing_speed_and_curves_have_the_numbers_of_their_sources() -> None:
    # The last one comes from the side, 2.67 m behind the ego's front.
    rows = {"contact_type": [2, 1, 2, 0, 2], "impact_closing_speed_mps": [10.0, 10.0, -1.0, None, 18.1]}
    rows["min_gap_m"] = [-0.2, -0.2, 0.0, 5.0, -2.67]
    equal, truck = recipes.delta_v(rows), recipes.delta_v(rows, other_kg=16_000)
    assert equal["delta_v_ego_mps"].to_list() == [5.0, None, None, None, None]
    assert truck["delta_v_ego_mps"][0] == pytest.approx(10 * 16_000 / 17_500)
    mph = 0.44704
    for curve, at, risk in [
        ("nhtsa-2022-frontal-mais3", 30, 0.1074),
        ("nhtsa-2022-frontal-fatal", 55, 0.4009),
        ("joksch-1993-fatal", 35.5, 1 / 16),
    ]:
        assert recipes.injury_risk([at * mph], curve)[0] == pytest.approx(risk, abs=1e-4)
        assert np.isnan(recipes.injury_risk(72 * mph, curve)) and recipes.INJURY_CURVES[curve].source


def test_the_largest_gap_is_between_neighbours_or_to_an_end(density: Path) -> None:
    found = recipes.largest_gap({"a": [1, 2, 4, 9.0], "b": [0.0, 4.0, 5, 10]}, {"a": (0, 10), "b": (5, 8)})
    assert found.rows() == [("b", 5.0, 8.0, 1.0), ("a", 4.0, 9.0, 0.5)]
    equal = recipes.largest_gap({"a": [15, 20, 30]}, {"a": (10, 40)}, draws={"a": [25, 31, 35]})
    assert equal.select("from", "to", "exposure").rows() == [(30.0, 40.0, pytest.approx(2 / 3))]
    limit_state = lanesweep.LimitState(density, model="FSM", thw=1.0)
    draws = dict(zip(limit_state.parameters, limit_state.draw(1000, 1).T, strict=True))
    (likely,) = recipes.largest_gap({"v_ego_mps": [10.0, 60.0]}, {"v_ego_mps": (10, 60)}, draws=draws).to_dicts()
    assert 0.98 < likely["low"] < likely["exposure"] < likely["high"] <= 1.0


XOSC = """<OpenSCENARIO><FileHeader revMajor="1" revMinor="2"/><ParameterValueDistribution><ScenarioFile filepath="a.xosc"/>
{}</ParameterValueDistribution></OpenSCENARIO>"""


def test_listed_values_become_every_combination(tmp_path: Path) -> None:
    one = "<DeterministicSingleParameterDistribution parameterName='{}'>{}</DeterministicSingleParameterDistribution>"
    sets = "".join(
        f"<ParameterValueSet><ParameterAssignment parameterRef='ego_speed_kmh' value='{ego}'/>"
        f"<ParameterAssignment parameterRef='speed_kmh' value='{other}'/></ParameterValueSet>"
        for ego, other in ((60, 30), (120, 80))
    )
    multi = "<DeterministicMultiParameterDistribution><ValueSetDistribution>{}</ValueSetDistribution></DeterministicMultiParameterDistribution>"
    parts = [
        one.format("gap_m", "<DistributionRange stepWidth='0.1'><Range lowerLimit='20' upperLimit='20.3'/></DistributionRange>"),
        one.format("road", "<DistributionSet><Element value='left'/><Element value='right'/></DistributionSet>"),
        multi.format(sets),
    ]
    file = tmp_path / "grid.xosc"
    file.write_text(XOSC.format(f"<Deterministic>{''.join(parts)}</Deterministic>"), encoding="utf-8-sig")
    found = recipes.logical_scenario(file)
    assert found.height == 4 * 2 * 2 and found["gap_m"].unique().sort().to_list() == [20.0, 20.1, 20.2, 20.3]
    assert found.columns == ["gap_m", "road", "ego_speed_kmh", "speed_kmh"]
    assert set(found.select("ego_speed_kmh", "speed_kmh").iter_rows()) == {(60.0, 30.0), (120.0, 80.0)}
    outcomes = lanesweep.simulate(found.with_columns(lateral_speed=1.0), category="cut-in", models="FSM")
    assert len(outcomes) == 16 and set(outcomes["road"]) == {"left", "right"}
    reference = one.format("a", "<DistributionSet><Element value='$b'/></DistributionSet>")
    file.write_text(XOSC.format(f"<Deterministic>{reference}</Deterministic>"))
    with pytest.raises(ValueError, match="not evaluated"):
        recipes.logical_scenario(file)


def test_random_values_are_drawn_within_their_ranges(tmp_path: Path) -> None:
    ends = "<Range lowerLimit='{}' upperLimit='{}'/>"
    kinds = {
        "normal": f"<NormalDistribution expectedValue='100' variance='225'>{ends.format(60, 130)}</NormalDistribution>",
        "uniform": f"<UniformDistribution>{ends.format(50, 90)}</UniformDistribution>",
        "poisson": f"<PoissonDistribution expectedValue='0.5'>{ends.format(0, 2)}</PoissonDistribution>",
        "bins": f"<Histogram><Bin weight='1'>{ends.format(0, 1)}</Bin><Bin weight='3'>{ends.format(2, 4)}</Bin></Histogram>",
        "set": "<ProbabilityDistributionSet><Element value='0.5' weight='3'/><Element value='1' weight='1'/></ProbabilityDistributionSet>",
    }
    parts = "".join(f"<StochasticDistribution parameterName='{name}'>{of}</StochasticDistribution>" for name, of in kinds.items())
    file = tmp_path / "random.xosc"
    file.write_text(XOSC.format(f"<Stochastic numberOfTestRuns='20000' randomSeed='0.5'>{parts}</Stochastic>"))
    found = recipes.logical_scenario(file)
    assert found.height == 20_000 and found.equals(recipes.logical_scenario(file))
    assert not found.equals(recipes.logical_scenario(file, seed=1)) and recipes.logical_scenario(file, draws=7).height == 7
    # Kolmogorov and Smirnov; frequencies within five standard errors.
    cut = stats.truncnorm(-40 / 15, 2, 100, 15)
    for name, of in {"normal": cut, "uniform": stats.uniform(50, 40)}.items():
        assert stats.kstest(found[name].to_numpy(), of.cdf).pvalue > 1e-3
    expected = stats.poisson(0.5).pmf([0, 1, 2]) / stats.poisson(0.5).cdf(2)
    assert [(found["poisson"] == k).mean() for k in range(3)] == pytest.approx(expected, abs=0.018)
    assert (found["set"] == 0.5).mean() == pytest.approx(0.75, abs=0.016)
    assert (found["bins"] < 1).mean() == pytest.approx(0.25, abs=0.016) and found["bins"].is_between(1, 2).sum() == 0


def test_draws_of_a_tail_lie_in_their_range_and_no_draw_is_an_error(tmp_path: Path) -> None:
    def drawn(variance: float, low: float, high: float, more: str = "") -> pl.Series:
        of = f"<NormalDistribution expectedValue='100' variance='{variance}'><Range lowerLimit='{low}' upperLimit='{high}'/></NormalDistribution>"
        one = f"<Stochastic numberOfTestRuns='500'><StochasticDistribution parameterName='a'>{of}</StochasticDistribution></Stochastic>"
        (tmp_path / "a.xosc").write_text(XOSC.format(one + more))
        return recipes.logical_scenario(tmp_path / "a.xosc")["a"]

    assert drawn(225, 250, 300).is_between(250, 300).all() and drawn(225, -100, -50).is_between(-100, -50).all()
    wrong = {"nothing can be drawn": (0, 60, 130), "goes from 130.0 to 60.0": (225, 130, 60), "either": (225, 60, 130, "<Deterministic/>")}
    for message, values in wrong.items():
        with pytest.raises(lanesweep.InputError, match=message):
            drawn(*values)


def test_a_description_without_emphasis_is_the_decomposition_of_the_study(scenarios: Path, tmp_path: Path) -> None:
    mined = lanesweep.mine(scenarios.parent / "recordings", out=tmp_path / "scenarios.parquet")
    kept = pl.read_parquet(Path(mined)).filter(pl.col("kept"), category="lvd")
    ours = recipes.replayed(recipes.fit_description(kept, 3), kept)
    f1 = pl.DataFrame(lanesweep.study(scenarios=kept, categories="lvd", external={"ours": ours}).table("results"))
    counts = {key: f1.filter(variant=key, headway="all").select("tp", "fn", "fp", "tn").rows() for key in ("iii", "ours")}
    assert counts["ours"] == counts["iii"] and len(counts["iii"]) == 12
    # A number that all scenarios share, here a duration of 1 s, stays what it is.
    alike = kept.with_columns(fps=pl.col("target_v").list.len() - 1.0)
    assert recipes.replayed(recipes.fit_description(alike, 3), alike)["fps"].to_numpy() == pytest.approx(49.0)
    emphasis, score = recipes.found_emphasis(kept, 3, evaluations=12)
    assert emphasis.shape == (5,) and 0.5 < score <= 1.0
