"""A nonlinear autoencoder as parameterization: `python autoencoder.py scenarios.jsonl`. Needs the package `scikit-learn`.

Each scenario is a vector of its series at 50 instants, its initial speed, gap and duration. A network with a bottleneck of a few
numbers learns to reproduce the vectors of the other folds; the folds are those of `study`. The reproduced
scenarios go back as S' by `study --external`. The decompositions beside them have seen none of the scenarios that they replay
either.
"""

from __future__ import annotations

import argparse
import csv
import json
import warnings
from pathlib import Path
from typing import Any

import lanesweep
import numpy as np
import numpy.typing as npt
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPRegressor

INSTANTS = 50
Array = npt.NDArray[np.float64]
Scenario = dict[str, Any]


def vector(scenario: Scenario) -> Array:
    """The series at equidistant instants, then initial speed, gap and duration."""
    samples = len(scenario["target"]["v"])
    at = np.linspace(0, samples - 1, INSTANTS)
    names = [("target", "v")]
    if scenario["category"] != "lvd":
        names.append(("target", "y"))
    if scenario["category"] == "cut_out":
        names.append(("lead", "v"))
    series = [np.interp(at, np.arange(samples), scenario[actor][name]) for actor, name in names]
    numbers = [scenario["ego"]["v0"], scenario.get("D") or 0.0, (samples - 1) / scenario["fps"]]
    return np.concatenate([*series, numbers])


def replayed(scenario: Scenario, z: Array) -> Scenario:
    """The scenario with the motions of a vector."""
    parts = z[:-3].reshape(-1, INSTANTS)
    ego_speed, gap, duration = float(max(z[-3], 0.0)), float(max(z[-2], 0.0)), float(max(z[-1], 0.1))
    target = {**scenario["target"], "v": np.maximum(parts[0], 0.0).tolist()}
    target["y"] = parts[1].tolist() if scenario["category"] != "lvd" else [0.0] * INSTANTS
    own = {name: scenario[name] for name in ("id", "category", "side")}
    own |= {"fps": (INSTANTS - 1) / duration, "ego": {**scenario["ego"], "v0": ego_speed}, "target": target}
    if scenario["category"] == "cut_out":
        lead = {**scenario["lead"], "v": np.maximum(parts[2], 0.0).tolist(), "y": [0.0] * INSTANTS}
        own |= {"lead": lead, "D": gap}
    return own


def weights_of(z: Array) -> Array:
    """A series counts as much as a number: its mean spread, over the root of its instants."""
    spread = z.std(axis=0)
    series = spread[:-3].reshape(-1, INSTANTS).mean(axis=1).repeat(INSTANTS) * np.sqrt(INSTANTS)
    return np.asarray(1.0 / np.maximum(np.concatenate([series, spread[-3:]]), 1e-9))


def reproduce(train: Array, test: Array, size: int) -> Array:
    """The test vectors from `size` numbers each, by a network trained on others."""
    weights = np.where(train.std(axis=0) > 1e-9, weights_of(train), 0.0)
    centre = train.mean(axis=0)
    x = (train - centre) * weights
    hidden = (32, size, 32)
    network = MLPRegressor(
        hidden_layer_sizes=hidden, activation="tanh", solver="lbfgs", alpha=1e-3, max_iter=1500, random_state=157
    )
    with warnings.catch_warnings():
        # The number of iterations is the early stopping.
        warnings.simplefilter("ignore", ConvergenceWarning)
        network.fit(x, x)
    y = network.predict((test - centre) * weights)
    return np.asarray(np.where(weights > 0, y / np.where(weights > 0, weights, 1.0), 0.0) + centre)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenarios", type=Path, help="scenario file of `lanesweep mine`, .jsonl")
    parser.add_argument("--category", default="cut-in", help="cut-in, cut-out or lvd")
    parser.add_argument("--size", type=int, default=4, help="numbers of the bottleneck")
    parser.add_argument("--out", type=Path, default=Path("autoencoder"), help="folder")
    given = parser.parse_args()
    lanesweep.study(scenarios=given.scenarios, categories=given.category, out=given.out / "folds")
    with (given.out / "folds" / "tables" / "folds.csv").open(encoding="utf-8") as lines:
        folds = {row["id"]: int(row["fold"]) for row in csv.DictReader(lines)}
    with given.scenarios.open(encoding="utf-8") as lines:
        scenarios = [scenario for scenario in map(json.loads, lines) if scenario["id"] in folds]
    z = np.array([vector(scenario) for scenario in scenarios])
    of = np.array([folds[scenario["id"]] for scenario in scenarios])
    reproduced = np.empty_like(z)
    for fold in np.unique(of):
        reproduced[of == fold] = reproduce(z[of != fold], z[of == fold], given.size)
    external = given.out / f"autoencoder-{given.size}.jsonl"
    with external.open("w", encoding="utf-8") as file:
        for scenario, own in zip(scenarios, reproduced, strict=True):
            file.write(json.dumps(replayed(scenario, own)) + "\n")
    lanesweep.study(
        scenarios=given.scenarios,
        categories=given.category,
        external=external,
        out=given.out / "study",
    )
    # Mean F1 over drivers and criteria, of every description.
    sums: dict[str, list[float]] = {}
    with (given.out / "study" / "results.csv").open(encoding="utf-8") as lines:
        for row in csv.DictReader(lines):
            if row["headway"] == "all" and row["f1"]:
                sums.setdefault(row["variant"], []).append(float(row["f1"]))
    for variant, values in sums.items():
        print(f"{variant}: {sum(values) / len(values):.3f}")


if __name__ == "__main__":
    main()
