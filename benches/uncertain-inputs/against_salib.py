"""First-order indices of SALib beside those of `check --uncertain`: `against_salib.py PROGRAM ISHIGAMI.csv > indices.csv`.

Needs SALib and the Python module of lanesweep, which is the black box: SALib's Saltelli sample of the errors becomes a table of
cases, `simulate` runs its drivers, and the answer of a row is 1 where it is that of the case without errors. PROGRAM is
the lanesweep of the same source. ISHIGAMI.csv has our rows of Ishigami's function:
`cargo test --release --lib --package lanesweep-stats first_order::tests::rows -- --ignored --nocapture`.
"""

from __future__ import annotations

import csv
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import lanesweep
import numpy as np
from SALib.analyze import sobol as analyze
from SALib.sample import sobol as sample

PAIRS, SEED = 1 << 16, 157
# Standard errors, SI units.
CASE = {"ego_speed": 100 / 3.6, "speed": 50 / 3.6, "gap": 30.2, "lateral_speed": 1.0}
ERRORS = {"ego_speed": 1 / 3.6, "speed": 1 / 3.6, "gap": 0.5, "lateral_speed": 0.05}
COLUMNS = {"ego_speed": "ego_speed_mps", "speed": "speed_mps", "gap": "gap", "lateral_speed": "lateral_speed"}


def indices(names: list[str], bounds: list[list[float]], dists: list[str], model) -> list[tuple[float, float]]:
    problem = {"num_vars": len(names), "names": names, "bounds": bounds, "dists": dists}
    values = model(sample.sample(problem, PAIRS, calc_second_order=False, seed=SEED))
    found = analyze.analyze(problem, values, calc_second_order=False, seed=SEED)
    return list(zip(found["S1"], found["S1_conf"]))


def ishigami(x: np.ndarray) -> np.ndarray:
    return np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def profile_without_reaction(folder: str) -> Path:
    """The profile under which Reg157 never reacts, as in `src/run/grid/robustness.rs`."""
    text = (Path(__file__).parents[2] / "configs/profiles/un-r157.toml").read_text()
    for old, new in [
        ("lateral_gate_m = 0.5 ", "lateral_gate_m = -100.0 "),
        ("lane_intrusion_m = 0.3 ", "lane_intrusion_m = 0.0 "),
        ("reaction_time_s = 0.35", "reaction_time_s = 0.0"),
        ("visible_lateral_movement_s = 0.72", "visible_lateral_movement_s = 0.0"),
        ("margin_s = 0.0", "margin_s = 10.0"),
        ('name = "un-r157"', 'name = "unreacting"'),
    ]:
        assert old in text, old
        text = text.replace(old, new, 1)
    path = Path(folder) / "unreacting.toml"
    path.write_text(text)
    return path


def is_preventable(values: np.ndarray, unreacting: Path) -> np.ndarray:
    cases = {COLUMNS[name]: values[:, at] for at, name in enumerate(CASE)}

    def collides(model: str, profile) -> np.ndarray:
        outcomes = lanesweep.simulate(cases, category="cut-in", models=[model], profile=profile, backend="cpu")
        return np.asarray(outcomes["collision"], dtype=bool)

    threatens = collides("Reg157", unreacting)
    avoids = ~collides("CCHDM", "un-r157") | ~collides("FSM", "un-r157")
    return (threatens & avoids).astype(float)


def ours(program: str) -> dict:
    errors = ",".join(f"{name}={error}{'m/s' if 'speed' in name else 'm'}" for name, error in ERRORS.items())
    flags = [f"--{name.replace('_', '-')}={value}{'m/s' if 'speed' in name else 'm'}" for name, value in CASE.items()]
    command = [program, "check", "--category", "cut-in", *flags, "--profiles", "un-r157", "--uncertain", errors, "--format", "json"]
    found = json.loads(subprocess.run(command, capture_output=True, text=True).stdout)
    assert found["profiles"][0]["nominal_answer"] == "preventable", found["verdict"]
    return found["uncertainty"]


def main() -> None:
    program, rows = sys.argv[1:]
    out = csv.writer(sys.stdout)
    out.writerow(["problem", "input", "truth", "ours", "ours_low", "ours_high", "ours_pairs", "salib", "salib_half", "salib_pairs"])
    known = list(csv.DictReader(Path(rows).open()))
    theirs = indices(["x1", "x2", "x3"], [[-math.pi, math.pi]] * 3, ["unif"] * 3, ishigami)
    for row, (index, half) in zip(known, theirs):
        own = [row[key] for key in ("input", "truth", "index", "low", "high", "pairs")]
        out.writerow(["ishigami", *own, f"{index:.6f}", f"{half:.6f}", PAIRS])
    found = ours(program)
    with tempfile.TemporaryDirectory() as folder:
        unreacting = profile_without_reaction(folder)
        bounds = [[CASE[name], ERRORS[name]] for name in CASE]
        theirs = indices(list(CASE), bounds, ["norm"] * len(CASE), lambda values: is_preventable(values, unreacting))
    of = {row["input"]: row["first_order"] for row in found["inputs"]}
    for name, (index, half) in zip(CASE, theirs):
        own = [f"{of[name][key]:.6f}" for key in ("index", "low", "high")]
        out.writerow(["cut-in", name, "", *own, found["pairs"], f"{index:.6f}", f"{half:.6f}", PAIRS])


if __name__ == "__main__":
    main()
