"""Drivers in Python."""

from __future__ import annotations

import ctypes
import os
import shutil
import signal
import subprocess
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
    study = lanesweep.study(scenarios=scenarios, models=models).table("results").to_pandas()
    by_model = {name: group.drop(columns="model").reset_index(drop=True) for name, group in study.groupby("model")}
    assert by_model["Reg157-numpy"].equals(by_model["Reg157"])


def test_a_driver_is_scored_sampled_and_mapped_like_the_built_in_ones(scenarios, density) -> None:
    idm = IDM(headway_s=1.2)
    study = lanesweep.study(scenarios=scenarios, models=["FSM", idm], thw="1.2,0.4")
    assert {row["model"] for row in study.table("results").to_polars().rows(named=True)} == {"FSM", "IDM"}
    assert "IDM" in str(study)
    sample = lanesweep.sample(density, models=[idm], samples=500, thw=1.2)
    assert [row["model"] for row in sample.table("estimates").to_polars().rows(named=True)]== ["IDM"] * 3
    grid = lanesweep.map("cut-in", models=[idm], x="gap_m=5..25/5", y="other_speed_kmh=40..80/5", **FIXED)
    assert grid.status == "ok"


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
            found.append((a, lanesweep.simulate(CASES, category="cut-in", models=[Wrong(a)])["collision"].sum()))

    threads = [threading.Thread(target=run, args=(a,)) for a in expected]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert len(found) == 30 and all(expected[a] == count for a, count in found)


def test_work_that_a_driver_asks_for_is_refused() -> None:
    def nested(view: lanesweep.View) -> float:
        lanesweep.simulate(CASES, category="cut-in", models="FSM")
        return 0.0

    with pytest.raises(lanesweep.InputError) as raised:
        lanesweep.simulate(CASES, category="cut-in", models=[Wrong(nested)])
    assert isinstance(raised.value.__cause__, lanesweep.BusyError)


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

    class Blocks(lanesweep.Driver):
        may_accelerate = False

        def __init__(self, released: threading.Event) -> None:
            self.released = released

        def __getstate__(self) -> None:
            """An event says nothing about what the driver computes."""

        def acceleration(self, view: lanesweep.View, state: Any) -> float:
            self.released.wait(60)
            return 0.0

    for delay_s in (0.5, 1.0):
        threading.Timer(delay_s, lambda: signal.raise_signal(signal.SIGINT)).start()
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        lanesweep.simulate(CASES, category="cut-in", models=[Blocks(released)])
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


class Brake(lanesweep.Driver):
    """Brakes from the start on."""

    may_accelerate = False

    def __init__(self, decel: float) -> None:
        self.decel = decel

    def acceleration(self, view: lanesweep.View, state: Any) -> Any:
        return np.full(len(view), -self.decel)


def outcomes(driver: lanesweep.Driver) -> Any:
    return lanesweep.simulate(CASES, category="cut-in", models=[driver]).to_pandas()


def test_a_driver_is_its_present_values_and_another_object_with_these_values_is_a_fresh_one() -> None:
    expected = {decel: outcomes(Brake(decel)) for decel in (6.0, 4.0, 0.2)}
    assert len({frame["collision"].sum() for frame in expected.values()}) == 3
    base = Brake(6.0)
    for decel in (6.0, 4.0, 0.2):
        base.decel = decel
        assert outcomes(base).equals(expected[decel]), decel
    assert outcomes(Brake(6.0)).equals(expected[6.0])
    # The name alone stands for the last driver of that name, as it is now.
    base = Brake(6.0)
    outcomes(base)
    base.decel = 0.2
    named = lanesweep.simulate(CASES, category="cut-in", models="Brake").to_pandas()
    assert named.equals(expected[0.2]) and outcomes(Brake(6.0)).equals(expected[6.0])
    # Values within values, changed in place.
    fixed = [outcomes(one) for one in (Listed([-6.0]), Listed([-0.2]))]
    listed = Listed([-6.0])
    assert outcomes(listed).equals(fixed[0])
    listed.values[0] = -0.2
    assert outcomes(listed).equals(fixed[1]) and outcomes(Listed([-6.0])).equals(fixed[0])


BRAKES_IN_C = """
#include <stdint.h>
/* Brakes at parameters[0] once state, the time since the first step, exceeds parameters[1]. */
void brakes(int64_t lanes, int64_t stride, int64_t step, double dt_s, const float *view, float *state, const float *parameters, float *acceleration)
{
    for (int64_t i = 0; i < lanes; i++) {
        acceleration[i] = state[stride + i] > parameters[1] && view[9 * stride + i] == 0 ? -parameters[0] : 0;
        state[stride + i] += dt_s;
    }
}
"""


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> Path:
    if shutil.which("cc") is None:
        pytest.skip("there is no compiler for C")
    folder = tmp_path_factory.mktemp("c")
    (folder / "brakes.c").write_text(BRAKES_IN_C)
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", folder / "brakes.so", folder / "brakes.c"], check=True)
    return folder / "brakes.so"


class InC(lanesweep.Driver):
    """Brakes after a second, without `acceleration`."""

    may_accelerate = False
    state_rows = 2

    def __init__(self, library: Path, decel: float = 4.0) -> None:
        self.library = str(library)
        self.parameters = [decel, 1.0]

    @property
    def compiled(self) -> Any:
        return ctypes.CDLL(self.library).brakes


class InBoth(InC):
    """The same beside its NumPy form."""

    def start(self, lanes: int, dt_s: float) -> Any:
        return np.zeros(lanes, np.float32), np.float32(dt_s)

    def acceleration(self, view: lanesweep.View, state: Any) -> Any:
        passed, dt_s = state
        brakes = passed[view.lane] > 1.0
        passed[view.lane] += dt_s
        return np.where(brakes & ~view.ahead.present, -self.decel(), 0)

    def decel(self) -> Any:
        return np.float32(self.parameters[0])


class InNumPy(InBoth):
    compiled = None


class Different(InBoth):
    def decel(self) -> Any:
        return np.float32(self.parameters[0] + 0.5)


def test_a_driver_in_c_gives_the_lanes_of_its_numpy_form_everywhere(library, scenarios, density) -> None:
    from lanesweep import parts

    found = [outcomes(one(library)).drop(columns="model") for one in (InC, InBoth, InNumPy)]
    assert found[0].equals(found[2]) and found[1].equals(found[2]) and found[0]["collision"].nunique() == 2
    # More lanes than a batch, of all categories: they end at other steps, and their states move.
    study = lanesweep.study(scenarios=scenarios, models=[InC(library), InNumPy(library)], thw="paper").table("results").to_pandas()
    by_model = {name: group.drop(columns="model").reset_index(drop=True) for name, group in study.groupby("model")}
    assert by_model["InC"].equals(by_model["InNumPy"]) and by_model["InC"]["failures"].max() > 0
    options = {"samples": 2000, "thw": 0.6}
    whole = [lanesweep.sample(density, models=[one(library)], **options).table("estimates")["probability"] for one in (InC, InNumPy)]
    assert np.array_equal(*whole) and 0 < whole[0][0] < 1
    plan = parts.plan(lanesweep.sample, density, models=[InC(library)], shards=2, **options)
    joined = parts.join(plan, [parts.run(plan, shard) for shard in range(2)])
    assert np.array_equal(joined.table("estimates")["probability"], whole[0])
    limit_states = [lanesweep.LimitState(density, model=one(library), thw=0.6) for one in (InC, InNumPy)]
    points = limit_states[0].draw(2000, rng=1)
    assert np.array_equal(*(limit_state(points) for limit_state in limit_states))


def test_a_driver_in_c_is_known_by_its_library_and_its_parameters(library, tmp_path) -> None:
    from lanesweep._driver import fingerprint

    other = tmp_path / "other.so"
    shutil.copy(library, other)
    named = InC(library)
    named.library = str(other)
    # The path is a value of this driver.
    assert fingerprint(InC(library)) == fingerprint(InC(library)) != fingerprint(named)
    assert fingerprint(InC(library, 3.0)) != fingerprint(InC(library))
    before = fingerprint(named)
    # A library that is loaded must not be written to.
    changed = tmp_path / "changed.so"
    changed.write_bytes(library.read_bytes() + b" ")
    changed.replace(other)
    assert fingerprint(named) != before


def test_a_compiled_driver_that_differs_from_its_numpy_form_is_refused(library) -> None:
    with pytest.raises(lanesweep.InputError, match=r"(?s)driver Different, step \d+: `compiled` decides -4 m/s² where `acceleration` decides -4.5"):
        outcomes(Different(library))


@pytest.mark.parametrize(("code", "message"), [(0, "give a function of"), ("text", "give a function of"), (True, "give a function of"), (None, "neither")])
def test_what_is_no_compiled_driver_is_named(code, message) -> None:
    driver = lanesweep.Driver()
    driver.compiled = code
    with pytest.raises(TypeError, match=f"driver Driver: .*{message}"):
        outcomes(driver)


def test_an_address_is_a_driver_and_a_wrong_acceleration_of_it_an_error() -> None:
    pointer = ctypes.POINTER(ctypes.c_float)
    kind = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 3, ctypes.c_double, *[pointer] * 4)
    answer = [-3.0]

    @kind
    def constant(lanes, stride, step, dt_s, view, state, parameters, acceleration):  # type: ignore[no-untyped-def]
        for lane in range(lanes):
            acceleration[lane] = answer[0]

    class Address(lanesweep.Driver):
        may_accelerate = False
        compiled = ctypes.cast(constant, ctypes.c_void_p).value

    assert outcomes(Address()).drop(columns="model").equals(outcomes(Wrong(-3.0)).drop(columns="model"))
    answer[0] = float("nan")
    with pytest.raises(lanesweep.InputError, match="driver Address, step 0: its acceleration is NaN"):
        outcomes(Address())


def test_the_compiled_examples_are_those_in_numpy() -> None:
    pytest.importorskip("numba")
    sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
    from compiled_driver import FastIDM, policy

    short = type("Short", (lanesweep.Driver,), {"compiled": lambda lanes, stride: None})
    with pytest.raises(lanesweep.UsageError, match=r"driver Short: `compiled` is not compiled by numba.*\n.*its signature is void\("):
        outcomes(short())
    ours, theirs = outcomes(FastIDM()), outcomes(IDM())
    assert (ours["collision"] == theirs["collision"]).mean() > 0.99 and np.allclose(ours["min_gap_m"], theirs["min_gap_m"], atol=0.01)
    in_numpy = policy()
    in_numpy.compiled = None
    assert (outcomes(policy())["collision"] == outcomes(in_numpy)["collision"]).mean() > 0.99


class Listed(lanesweep.Driver):
    may_accelerate = False

    def __init__(self, values: list[float]) -> None:
        self.values = values

    def acceleration(self, view: lanesweep.View, state: Any) -> Any:
        return np.full(len(view), self.values[0])


SCRIPT = """
import numpy as np, lanesweep

CASES = {{"ego_speed_mps": np.linspace(15, 40, 200), "speed_mps": np.linspace(10, 30, 200), "gap": 20.0, "lateral_speed_mps": 1.0}}

class Brake(lanesweep.Driver):
    may_accelerate = False
    def acceleration(self, view, state):
        return np.full(len(view), -{first})

weak = lanesweep.simulate(CASES, category="cut-in", models=[Brake()])["collision"].sum()

class Brake(lanesweep.Driver):
    may_accelerate = False
    def acceleration(self, view, state):
        return np.full(len(view), -{second})

print(weak, lanesweep.simulate(CASES, category="cut-in", models=[Brake()])["collision"].sum())
"""


def test_two_classes_of_one_name_in_a_script_are_two_drivers(tmp_path) -> None:
    script = tmp_path / "two.py"
    script.write_text(SCRIPT.format(first=0.2, second=8.0))
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    weak, strong = map(int, done.stdout.split())
    assert weak > strong


MODULE = "import numpy as np, lanesweep\n"
MODULE += "DECEL = {decel}\n"
MODULE += "def helper(n): return np.full(n, -DECEL)\n"
MODULE += "class Constant(lanesweep.Driver):\n"
MODULE += "    may_accelerate = False\n"
MODULE += "    def acceleration(self, view, state): return helper(len(view))\n"


def test_what_the_code_reads_is_a_part_of_the_driver_wherever_it_stands(tmp_path) -> None:
    """Constants, functions, closures, defaults and class attributes, by their values, not by their text."""
    from lanesweep._driver import fingerprint

    def made(decel: float, comment: str = "") -> str:
        space: dict[str, Any] = {"__name__": "__main__"}
        exec(MODULE.format(decel=decel) + comment, space)
        return fingerprint(space["Constant"]())

    assert made(6.0) == made(6.0) == made(6.0, "\n# a comment") != made(4.0)

    def closed(decel: float) -> lanesweep.Driver:
        class Closed(lanesweep.Driver):
            def acceleration(self, view: lanesweep.View, state: Any, scale: float = decel / 2) -> Any:
                return [-decel * scale] * len(view)

        return Closed()

    assert fingerprint(closed(6.0)) == fingerprint(closed(6.0)) != fingerprint(closed(4.0))

    class Fixed(Brake):
        factor = 1.0

        def acceleration(self, view: lanesweep.View, state: Any) -> Any:
            return super().acceleration(view, state) * self.factor

    before = fingerprint(Fixed(6.0))
    Fixed.factor = 0.5
    assert fingerprint(Fixed(6.0)) != before
    # A module of one's own, read by attribute.
    (tmp_path / "own_constants.py").write_text("DECEL = 6.0\nUNUSED = 1\n")
    sys.path.insert(0, str(tmp_path))
    try:
        import own_constants  # type: ignore[import-not-found]

        driver = Wrong(lambda view: -own_constants.DECEL)
        before = fingerprint(driver)
        own_constants.UNUSED = 2
        assert fingerprint(driver) == before
        held = fingerprint(Wrong(own_constants))
        own_constants.DECEL = 4.0
        assert fingerprint(driver) != before and fingerprint(Wrong(own_constants)) != held
    finally:
        sys.path.remove(str(tmp_path))


def test_a_resumed_run_does_not_mix_drivers_whose_constant_changed(density, tmp_path) -> None:
    module = tmp_path / "constant_driver.py"
    script = "import sys, lanesweep\nfrom constant_driver import Constant\ndensity, out, *rest = sys.argv[1:]\n"
    script += "lanesweep.sample(density, models=[Constant()], samples=100_000, thw=0.6, out=out, config={'run': {'stop_after_s': rest[0]}} if rest else None)\n"
    (tmp_path / "run.py").write_text(script)

    def run(decel: float, out: str, *words: str) -> str:
        module.write_text(MODULE.format(decel=decel))
        command = [sys.executable, "-B", tmp_path / "run.py", density, tmp_path / out, *words]
        return subprocess.run(command, capture_output=True, text=True, check=False).stderr

    assert "RunStopped" in run(6.0, "out", "0.3")
    # The journal is that of another driver: the run starts again.
    assert run(0.5, "out") == run(0.5, "fresh") == ""
    estimates = [(tmp_path / out / "estimates.csv").read_bytes() for out in ("out", "fresh")]
    assert estimates[0] == estimates[1]
    assert run(6.0, "strong") == "" and (tmp_path / "strong" / "estimates.csv").read_bytes() != estimates[0]


def test_a_part_of_a_run_is_refused_where_the_driver_is_another_one(density) -> None:
    from lanesweep import parts

    driver = Brake(6.0)
    plan = parts.plan(lanesweep.sample, density, samples=2000, thw=0.6, models=[driver], shards=2)
    first = parts.run(plan, 0)
    driver.decel = 4.0
    with pytest.raises(lanesweep.InputError, match="not the one that was planned"):
        parts.run(plan, 1)
    driver.decel = 6.0
    assert parts.join(plan, [first, parts.run(plan, 1)]).status == "ok"


LOCK = threading.Lock()


@pytest.mark.parametrize(
    ("driver", "message"),
    [
        (Wrong(threading.Lock()), "attribute `answer` is a `lock`"),
        (Wrong(lambda view: LOCK.locked() * -1.0), "`LOCK`, which `<lambda>` reads, is a `lock`"),
        (Wrong([open(os.devnull)]), r"attribute `answer`\[0\] is a `TextIOWrapper`"),
    ],
)
def test_a_driver_that_cannot_be_told_from_another_is_refused_with_what_to_do(driver, message) -> None:
    with pytest.raises(lanesweep.UsageError, match=f"(?s)driver Wrong: {message}.*`start`.*`__getstate__`"):
        lanesweep.simulate(CASES, category="cut-in", models=[driver])


def test_a_limit_state_refuses_a_driver_that_has_changed(density) -> None:
    driver = Brake(6.0)
    limit_state = lanesweep.LimitState(density, model=driver, thw=0.6)
    points = limit_state.draw(50, rng=1)
    before = limit_state(points)
    driver.decel = 0.2
    with pytest.raises(lanesweep.UsageError, match="has changed since"):
        limit_state(points)
    weak = lanesweep.LimitState(density, model=driver, thw=0.6)(points)
    driver.decel = 6.0
    assert np.array_equal(limit_state(points), before) and (weak <= before).all() and (weak < before).any()


def test_what_is_no_model_is_named() -> None:
    for models, message in [
        (Brake, r"`models` is the class Brake.*Brake\(…\)"),
        ([Brake], r"`models` holds the class Brake.*Brake\(…\)"),
        ([3], "`models` holds 3"),
        (3.5, "`models` is 3.5"),
    ]:
        for call in (lambda: lanesweep.simulate(CASES, category="cut-in", models=models), lambda: lanesweep.study(models=models)):
            with pytest.raises(TypeError, match=message):
                call()


def test_importance_sampling_with_a_driver_moves_a_bar_and_ends(density, monkeypatch, caplog) -> None:
    from lanesweep import _run

    seen: list[tuple[str, int, int]] = []
    monkeypatch.setattr(_run, "progress", lambda: (lambda *bar: seen.append(bar), lambda: None))
    options = {"estimator": "is", "half_width": 0.5, "thw": 0.4}
    (ours,) = lanesweep.sample(density, models=[Reg157()], **options).table("estimates").to_polars().rows(named=True)
    searched, bounded = [done for what, done, _ in seen if what == "searching, at most"], list(seen)
    (theirs,) = lanesweep.sample(density, models="Reg157", **options).table("estimates").to_polars().rows(named=True)
    assert ours["low"] < theirs["probability"] < ours["high"]
    assert len(set(searched)) > 2 and all(0 <= done <= total for _, done, total in seen)
    # A driver that never fails would be drawn for two million times.
    assert all(total < 500_000 for what, _, total in bounded if what == "searching, at most")
    # One that may accelerate is slow, and that is said before it starts.
    with caplog.at_level("WARNING", logger="lanesweep"), pytest.raises(lanesweep.RunStopped):
        lanesweep.sample(density, models=[IDM()], **options, config={"run": {"stop_after_s": 1}})
    assert "IDM may accelerate" in caplog.text and "3,000 steps" in caplog.text
