from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import lanesweep
import pytest

# A shell starts background work with interrupts ignored, and Python then leaves them so.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def program() -> Callable[..., subprocess.CompletedProcess[str]]:
    """The command line in a process of its own."""

    def run(*words: object) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "lanesweep", *map(str, words)]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    return run


@pytest.fixture(scope="session")
def scenarios(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Mined scenarios of two generated recordings."""
    folder = tmp_path_factory.mktemp("data")
    lanesweep.tracks(convert=folder / "recordings", synth_recordings=2)
    return Path(lanesweep.mine(folder / "recordings", out=folder / "scenarios.jsonl"))


@pytest.fixture(scope="session")
def density(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A density of cut-ins."""
    folder = tmp_path_factory.mktemp("density")
    lanesweep.fit(synth_recordings=6, categories="cut-in", parameterizations=2, out=folder)
    return folder / "cut-in-2.json"
