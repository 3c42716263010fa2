"""Times the peers on the lanes of `cargo bench --bench peers` and compares their verdicts with ours.

`run.py FOLDER` starts one process per peer and category, so that no library's threads or settings reach another's;
each is held to one core. CSV rows go to stdout, a table to stderr. Where a CUDA device is found, numba.cuda and JAX compute
the lanes on it too, each a hundred times.
"""

from __future__ import annotations

import argparse
import csv
import importlib
import itertools
import json
import os
import platform
import subprocess
import sys
import time
from ctypes.util import find_library
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

# Read when the libraries are loaded; NumPy's own loops have one thread anyway.
ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
    "JAX_PLATFORMS": "cpu",
    "JAX_ENABLE_X64": "0",
}
# The rest of XLA's threads follow the one core that the process may use.
XLA_ONE_THREAD = "--xla_cpu_multi_thread_eigen=false"


# So many lanes with another verdict are named.
NAMED = 3


@dataclass(frozen=True)
class Peer:
    """One way to compute the lanes."""

    name: str
    module: str
    # Package whose version is shown; none for the language alone.
    package: str | None
    repetitions: int
    # Computes every so many lanes only, by category; all where none is given.
    strides: dict[str, int] = field(default_factory=dict)
    xla_flags: str = XLA_ONE_THREAD
    # Computes on a CUDA device, each lane so many times.
    copies: int = 0

    def label(self) -> str:
        """Name and version."""
        return f"{self.name} {version(self.package) if self.package else platform.python_version()}"


PEERS = (
    # Prime to the ten headways.
    Peer("python", "plain", None, repetitions=3, strides={"lvd": 11, "cut_out": 101}),
    Peer("numpy", "vectorized", "numpy", repetitions=5),
    Peer("numba", "compiled", "numba", repetitions=7),
    Peer("jax", "scanned", "jax", repetitions=5),
    # XLA contracts multiplication and addition where the processor can. AVX alone cannot: this shows what that changes.
    Peer("jax-no-fma", "scanned", "jax", repetitions=5, xla_flags=f"{XLA_ONE_THREAD} --xla_cpu_max_isa=AVX"),
)
# Only where a CUDA device is found, with the packages of requirements-cuda.txt.
ON_CUDA = (
    Peer("numba.cuda", "on_cuda", "numba-cuda", repetitions=7, copies=100),
    Peer("jax-cuda", "scanned", "jax", repetitions=3, copies=100, xla_flags=""),
)


def has_cuda() -> bool:
    """Whether the driver of a CUDA device is there, and the packages for it."""
    return find_library("cuda") is not None and find_spec("numba_cuda") is not None


@dataclass(frozen=True)
class Row:
    """One row of the output."""

    peer: str
    category: str
    model: str
    lanes: int
    lane_steps: int
    seconds: float
    lane_steps_per_s: float
    ratio_to_ours: float
    verdicts_differing: int
    ends_differing: int


@dataclass(frozen=True)
class Measured:
    """A row, and what is left out of its time."""

    row: Row
    label: str
    # First call beyond the best one: compilation and first use of memory, s.
    first_call_extra_s: float
    # Lanes with another bit, per bit, and the names of some of them.
    differing: dict[str, int]
    named: list[str]


def measure(peer: Peer, folder: Path, category: str) -> list[Measured]:
    """Runs one peer on all models of a category, in this process."""
    import lanes as lane_files

    everything, ours_of = lane_files.read(folder / category)
    stride = peer.strides.get(category, 1)
    lanes = everything.repeated(peer.copies) if peer.copies else everything.every(stride)
    module = importlib.import_module(peer.module)
    bits = {
        "collision": lane_files.COLLISION,
        "TTC": lane_files.TTC,
        "BTN": lane_files.BTN,
        "capped": lane_files.CAPPED,
    }
    measured = []
    for model in lane_files.MODELS:
        ours = ours_of[model]
        work = module.prepare(lanes, model)
        times = []
        # The first call compiles and is not counted.
        for _ in range(1 + peer.repetitions):
            start = time.perf_counter()
            result = work()
            times.append(time.perf_counter() - start)
        seconds = min(times[1:])
        verdicts, end_step = ours.verdicts[::stride], ours.end_step[::stride]
        if peer.copies:
            verdicts, end_step = verdicts.repeat(peer.copies), end_step.repeat(peer.copies)
        # Steps that a lane needs, not those that a peer spends on lanes that have ended.
        steps = int(end_step.sum(dtype="u8")) + len(lanes)
        other_bits = result.verdicts ^ verdicts
        row = Row(
            peer=peer.name,
            category=category,
            model=model,
            lanes=len(lanes),
            lane_steps=steps,
            seconds=seconds,
            lane_steps_per_s=steps / seconds,
            ratio_to_ours=ours.lane_steps_per_s * seconds / steps,
            verdicts_differing=int((other_bits != 0).sum()),
            ends_differing=int((result.end_step != end_step).sum()),
        )
        differing = {name: int(((other_bits & bit) != 0).sum()) for name, bit in bits.items()}
        named = [ours.keys[lane * stride // max(1, peer.copies)] for lane in other_bits.nonzero()[0][:NAMED]]
        measured.append(Measured(row, peer.label(), max(0.0, times[0] - seconds), differing, named))
    return measured


def child(peer: Peer, folder: Path, category: str) -> None:
    """Measures one peer in one category and prints the results as JSON."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    print(json.dumps([asdict(measured) for measured in measure(peer, folder, category)]))


def parent(folder: Path, peers: tuple[Peer, ...]) -> int:
    """Starts one process per peer and category; gives the number of those that failed."""
    from lanes import CATEGORIES

    writer = csv.writer(sys.stdout, lineterminator="\n")
    all_measured: list[Measured] = []
    failed = 0
    for category, peer in itertools.product(CATEGORIES, peers):
        environment = os.environ | ONE_THREAD | {"XLA_FLAGS": peer.xla_flags}
        if peer.copies:
            environment["JAX_PLATFORMS"] = "cuda"
        command = [sys.executable, __file__, str(folder), "--peer", peer.name, "--category", category]
        done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=False)
        if done.returncode != 0:
            print(f"FAILED: {peer.name}, {category}, ended with {done.returncode}", file=sys.stderr)
            failed += 1
            continue
        for values in json.loads(done.stdout):
            measured = Measured(**(values | {"row": Row(**values["row"])}))
            writer.writerow(asdict(measured.row).values())
            sys.stdout.flush()
            all_measured.append(measured)
    table(all_measured)
    return failed


def table(all_measured: list[Measured]) -> None:
    """What the rows say, and what they leave out, for people."""
    heading = f"{'peer':<20} {'category':<8} {'model':<7} {'M lane-steps/s':>15} {'ours/peer':>10} {'compile etc.':>13}"
    print(f"\n{heading}  differing verdicts (ends) of lanes", file=sys.stderr)
    for measured in all_measured:
        row = measured.row
        bits = ", ".join(f"{name} {count}" for name, count in measured.differing.items() if count)
        print(
            f"{measured.label if row.peer != 'jax-no-fma' else row.peer:<20} {row.category:<8} {row.model:<7}"
            f" {row.lane_steps_per_s / 1e6:>15.3f} {row.ratio_to_ours:>10.2f}"
            f" {measured.first_call_extra_s:>11.2f} s"
            f"  {row.verdicts_differing} ({row.ends_differing}) of {row.lanes}{': ' + bits if bits else ''}",
            file=sys.stderr,
        )
        if measured.named:
            print(f"{'':<20} first of them: {', '.join(measured.named)}", file=sys.stderr)


def main() -> int:
    """Exit code 1 where a peer failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="the lanes, as `cargo bench --bench peers` writes them")
    everyone = PEERS + ON_CUDA
    parser.add_argument("--peer", choices=[peer.name for peer in everyone], help="only this one, in this process")
    parser.add_argument("--cuda", action="store_true", help="only those on a CUDA device")
    parser.add_argument("--category", default="lvd", help="of a single peer: lvd or cut_out")
    arguments = parser.parse_args()
    if arguments.peer is None:
        if not has_cuda():
            print("SKIPPED: no CUDA device with numba-cuda; only peers on the CPU run", file=sys.stderr)
        on_cpu = () if arguments.cuda else PEERS
        return min(1, parent(arguments.folder, on_cpu + (ON_CUDA if has_cuda() else ())))
    child(next(peer for peer in everyone if peer.name == arguments.peer), arguments.folder, arguments.category)
    return 0


if __name__ == "__main__":
    sys.exit(main())
