"""The examples run on small data."""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

import lanesweep
import pandas as pd

EXAMPLES = Path(__file__).parents[1] / "examples"


def test_an_autoencoder_goes_through_external_s_prime(scenarios: Path, tmp_path: Path) -> None:
    command = [sys.executable, str(EXAMPLES / "autoencoder.py"), str(scenarios.parent / "recordings")]
    command += ["--category", "lvd", "--size", "3", "--out", str(tmp_path / "study")]
    subprocess.run(command, check=True, capture_output=True, cwd=tmp_path)
    with (tmp_path / "study" / "results.csv").open(encoding="utf-8") as lines:
        scores = [(row["variant"], float(row["f1"])) for row in csv.DictReader(lines) if row["headway"] == "all" and row["f1"]]
    assert {"iii", "iii-cv", "autoencoder-3"} <= dict(scores).keys()
    assert max(f1 for variant, f1 in scores if variant == "autoencoder-3") > 0.5


def test_tables_are_external_s_prime_by_their_names(scenarios: Path, tmp_path: Path) -> None:
    lanesweep.mine(scenarios.parent / "recordings", out=tmp_path / "scenarios.parquet")
    frame = pd.read_parquet(tmp_path / "scenarios.parquet")
    options = {"scenarios": scenarios, "categories": "lvd", "models": "FSM", "thw": 0.6}
    study = lanesweep.study(external={"same": frame}, **options)
    found = study.table("results").to_pandas()
    assert "same" in set(found["variant"]) and (found["data"] == "synthetic").all()
    assert "external" in set(lanesweep.study(external=frame, **options).table("results").to_pandas()["variant"])
