"""Drivers in Python."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

import lanesweep
import numpy as np
import pytest
from lanesweep.drivers import IDM, Reg157

FIXED = {"set": {"ego_speed_kmh": 90, "lateral_speed_mps": 1.0}}

CASES = {
    "ego_speed_mps": np.linspace(15, 40, 200),
    "speed_mps": np.linspace(10, 30, 200),
    "gap": np.tile([5.0, 15.0, 30.0, 60.0], 50),
    "lateral_speed": np.tile([0.5, 1.0, 1.5, 2.0, 2.5], 40),
}


def test_reg157_in_numpy_is_the_built_in_model_to_the_bit(scenarios) -> None:
    models = [Reg157(), "Reg157"]
    frame = lanesweep.simulate(CASES, category="cut-in", models=models).to_pandas()
    ours, theirs = (frame[frame["model"] == name].reset_index(drop=True) for name in ("Reg157-numpy", "Reg157"))
    columns = ["collision", "ttc", "btn", "min_ttc_s", "max_btn", "min_gap_m", "end_s", "impact_speed_mps"]
    assert len(ours) == 200 and ours["collision"].nunique() == 2
    assert ours[columns].equals(theirs[columns])
    # All lanes of a study: cut-ins, cut-outs and leaders, recorded and parameterized.
    study = lanesweep.study(scenarios=scenarios, models=models).table("failures").to_pandas()
    by_model = {name: group.drop(columns="model").reset_index(drop=True) for name, group in study.groupby("model")}
    assert by_model["Reg157-numpy"].equals(by_model["Reg157"])


def test_a_driver_is_scored_sampled_and_mapped_like_the_built_in_ones(scenarios, density) -> None:
    idm = IDM(headway_s=1.2)
    study = lanesweep.study(scenarios=scenarios, models=["FSM", idm], thw="1.2,0.4")
    assert {row["model"] for row in study.table("f1").rows()} == {"FSM", "IDM"}
    assert "IDM" in str(study)
    sample = lanesweep.sample(density, models=[idm], samples=500, thw=1.2)
    assert [row["model"] for row in sample.table("estimates").rows()]== ["IDM"] * 3
    grid = lanesweep.map("cut-in", models=[idm], x="gap_m=5..25/5", y="other_speed_kmh=40..80/5", **FIXED)
    assert grid.status == "ok"
    numpy = Reg157()
    small = {"synth_recordings": 2, "models": [numpy], "thw": "1.2,0.6"}
    compared = lanesweep.compare(**small, categories="cut-in", parameterizations=2, samples=300)
    assert {row["model"] for row in compared.table("compare").rows()} == {numpy.name}
    justified = lanesweep.justify(**small, parameterization=1, criterion="ttc")
    statuses = {"appropriate": "ok", "not_appropriate": "not appropriate", "undecided": "undecided"}
    assert justified.status == statuses[justified.document["conclusion"]]


class Wrong(lanesweep.Driver):
    may_accelerate = False

    def __init__(self, answer: Any) -> None:
        self.answer = answer

    def acceleration(self, view: lanesweep.View, state: Any) -> Any:
        return self.answer(view) if callable(self.answer) else self.answer


def fail(view: lanesweep.View) -> None:
    raise ZeroDivisionError("the driver fell asleep")


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (fail, "step 0.*ZeroDivisionError"),
        (lambda view: np.zeros(len(view) + 1), "201 numbers for 200 lanes"),
        (lambda view: np.zeros((len(view), 2)), "2 dimensions"),
        (lambda view: np.full(len(view), np.nan), "NaN"),
        (lambda view: np.full(len(view), -1000.0), "-1000"),
        (lambda view: ["hard"] * len(view), "ValueError"),
        (None, "step 0"),
        (lambda view: np.full(len(view), 0.5), "(?s)0.5 m/s.*may accelerate"),
    ],
)
def test_a_wrong_driver_is_an_error_with_its_cause(answer, message) -> None:
    with pytest.raises(lanesweep.InputError, match=message) as raised:
        lanesweep.simulate(CASES, category="cut-in", models=[Wrong(answer)])
    if answer is fail:
        assert isinstance(raised.value.__cause__, ZeroDivisionError)
    assert len(lanesweep.simulate(CASES, category="cut-in", models="FSM")) == 200


def test_a_number_for_all_lanes_and_lists_are_accelerations_too() -> None:
    constant = lanesweep.simulate(CASES, category="cut-in", models=[Wrong(-3.0)]).to_pandas()
    listed = lanesweep.simulate(CASES, category="cut-in", models=[Wrong(lambda view: [-3] * len(view))]).to_pandas()
    assert constant.equals(listed) and (constant["reaction_s"] == 0).all()


def test_a_driver_that_brakes_harder_collides_less() -> None:
    counts = [
        lanesweep.simulate(CASES, category="cut-in", models=[Wrong(a)])["collision"].sum() for a in (0.0, -1.0, -4.0, -9.0)
    ]
    assert counts == sorted(counts, reverse=True) and counts[0] > counts[-1]


def test_what_ends_the_program_is_no_error_of_the_driver() -> None:
    def leave(view: lanesweep.View) -> None:
        raise SystemExit(3)

    with pytest.raises(SystemExit):
        lanesweep.simulate(CASES, category="cut-in", models=[Wrong(leave)])


def test_drivers_of_one_name_are_told_apart_in_threads() -> None:
    expected = {a: lanesweep.simulate(CASES, category="cut-in", models=[Wrong(a)])["collision"].sum() for a in (-1.0, -5.0, -9.0)}
    found: list[tuple[float, int]] = []

    def run(a: float) -> None:
        for _ in range(10):
            while True:
                try:
                    found.append((a, lanesweep.simulate(CASES, category="cut-in", models=[Wrong(a)])["collision"].sum()))
                    break
                except lanesweep.BusyError:
                    continue

    threads = [threading.Thread(target=run, args=(a,)) for a in expected]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert len(found) == 30 and all(expected[a] == count for a, count in found)


def test_names_that_cannot_be_are_refused() -> None:
    for name in ("FSM", "two words", "a/b"):
        driver = Wrong(0.0)
        driver.name = name
        with pytest.raises(lanesweep.UsageError):
            lanesweep.simulate(CASES, category="cut-in", models=[driver])


@pytest.mark.skipif(os.name == "nt", reason="signals")
def test_an_interrupt_stops_a_slow_driver() -> None:
    def slow(view: lanesweep.View) -> float:
        threading.Event().wait(0.05)
        return 0.0

    threading.Timer(0.5, lambda: signal.raise_signal(signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        lanesweep.simulate(CASES, category="cut-in", models=[Wrong(slow)])
    assert len(lanesweep.simulate(CASES, category="cut-in", models="FSM")) == 200


@pytest.mark.skipif(os.name == "nt", reason="signals")
def test_a_second_interrupt_leaves_a_driver_that_blocks() -> None:
    released = threading.Event()

    def block(view: lanesweep.View) -> float:
        released.wait(60)
        return 0.0

    for delay_s in (0.5, 1.0):
        threading.Timer(delay_s, lambda: signal.raise_signal(signal.SIGINT)).start()
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        lanesweep.simulate(CASES, category="cut-in", models=[Wrong(block)])
    assert time.monotonic() - start < 20
    with pytest.raises(lanesweep.BusyError):
        lanesweep.simulate(CASES, category="cut-in", models="FSM")
    released.set()
    for _ in range(200):
        try:
            assert len(lanesweep.simulate(CASES, category="cut-in", models="FSM")) == 200
            break
        except lanesweep.BusyError:
            time.sleep(0.1)
    else:
        pytest.fail("the driver was released, and its work has not ended")


def test_the_example_in_jax_avoids_what_it_can() -> None:
    pytest.importorskip("jax")
    sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
    from driver_in_jax import JaxDriver

    counts = [lanesweep.simulate(CASES, category="cut-in", models=[model])["collision"].sum() for model in (JaxDriver(), Wrong(0))]
    assert 0 < counts[0] < counts[1]
