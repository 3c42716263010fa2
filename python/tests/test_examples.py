"""The examples run on small data."""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

EXAMPLES = Path(__file__).parents[1] / "examples"


def test_an_autoencoder_goes_through_external_s_prime(scenarios: Path, tmp_path: Path) -> None:
    command = [sys.executable, str(EXAMPLES / "autoencoder.py"), str(scenarios)]
    command += ["--category", "lvd", "--size", "3", "--out", str(tmp_path)]
    subprocess.run(command, check=True, capture_output=True, cwd=tmp_path)
    with (tmp_path / "study" / "variants.csv").open(encoding="utf-8") as lines:
        rows = {row["variant"]: row for row in csv.DictReader(lines)}
    assert {"iii", "iii-cv", "autoencoder-3"} <= rows.keys()
    assert 0 < float(rows["autoencoder-3"]["RMSE"]) < 1
