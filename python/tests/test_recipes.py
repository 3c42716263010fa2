"""Recipes: each result beside one that is known."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

import lanesweep
import numpy as np
import polars as pl
import pytest
from lanesweep import recipes
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


def test_braking_is_compared_too_and_a_foreign_id_is_refused(cases: pl.DataFrame, tmp_path: Path) -> None:
    few = cases.head(3)
    few.write_csv(tmp_path / "few.csv")
    sheet = lanesweep.check(tmp_path / "few.csv", row=1, profiles="un-r157").document
    (driver,) = [of for of in sheet["profiles"][0]["models"] if of["model"] == "CCHDM"]
    results = {"id": ["case-0"], "collision": [driver["collision"]], "braking_s": [driver["braking_s"] + 0.1]}
    assert recipes.compare_results(few, results).cases["braking_s"][0] == pytest.approx(0.1)
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
    assert found.draws.height == 20_000 and found.draws["answer"].null_count() == 0


def test_draws_that_are_no_case_have_no_answer_and_one_answer_has_no_index() -> None:
    case = {"category": "lvd", "ego_speed": "60km/h", "gap": 0.2, "acceleration": -6}
    found = recipes.uncertain(case, {"gap": stats.uniform(-0.5, 1.0)}, draws=500)
    invalid = found.draws.filter(pl.col("gap") < 0)
    assert invalid["answer"].null_count() == invalid.height == 500 - found.answers["of"][0] > 100
    assert found.answers["answer"].to_list() == ["not preventable"] and found.indices["index"].to_list() == [None]
