"""Does P from few recordings mean anything? Fits densities of cut-ins to some generated recordings and compares P with the
failures of 990 others, as recorded.

    python benches/rare-failures/recordings.py PROGRAM [SEEDS]        # a row per seed, recordings, density and driver

`report FILE` makes the table of the book from these rows.
"""

import csv
import math
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

RECORDINGS = [12, 40, 99]
HEADWAYS = ["1", "1.6"]
OTHERS = [900001 + k for k in range(10)]


def run(program, folder, *words):
    subprocess.run([program, "-q", *words], cwd=folder, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def table(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def truths(program, folder):
    """Runs and collisions of S in all other recordings, by driver and headway."""
    sums = {}
    for seed in OTHERS:
        generated = ["--synth-recordings", "99", "--config", f"generator.seed={seed}", "--config", "study.folds=1"]
        run(program, folder, "study", *generated, "--categories", "cut-in", "--thw", ",".join(HEADWAYS), "--out", f"s{seed}")
        for row in table(folder / f"s{seed}/results.csv"):
            if row["variant"] == "S" and row["criterion"] == "collision" and row["headway"] != "all":
                runs, failures = sums.get((row["model"], row["headway"]), (0, 0))
                sums[row["model"], row["headway"]] = (runs + int(row["simulations"]), failures + int(row["failures"]))
    return sums


def estimates(program, folder, recordings, seed):
    """Estimates of all densities over some recordings."""
    generated = ["--synth-recordings", str(recordings), "--config", f"generator.seed={seed}"]
    run(program, folder, "fit", *generated, "--categories", "cut-in", "--without-scenarios", "--out", "d")
    for density in sorted((folder / "d").glob("cut-in-*.json")):
        run(program, folder, "sample", str(density), "--samples", "20000", "--thw", ",".join(HEADWAYS), "--out", "e")
        for row in table(folder / "e/estimates.csv"):
            if row["criterion"] == "collision" and row["headway"] != "all":
                yield row


def main(program, seeds):
    columns = ["probability", "low", "high", "probability_narrow", "probability_wide"]
    print("recordings,seed,variant,model,headway,truth_runs,truth_failures," + ",".join(columns), flush=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        known = truths(program, folder)
        for recordings in RECORDINGS:
            for seed in range(1, seeds + 1):
                for row in estimates(program, folder, recordings, seed):
                    runs, failures = known[row["model"], row["headway"]]
                    of = [recordings, seed, row["variant"], row["model"], row["headway"], runs, failures]
                    print(*of, *(row[column] for column in columns), sep=",", flush=True)


def report(path):
    """A row per parameterization: median of P over the truth, tenths, and how often the interval over scenarios holds it."""
    groups = {}
    for row in table(path):
        truth = int(row["truth_failures"]) / int(row["truth_runs"])
        ends = [float(row[column]) for column in ("low", "high")]
        bandwidth = [float(row[column]) for column in ("probability_narrow", "probability_wide")]
        held = [min(of) <= truth <= max(of) for of in (ends, ends + bandwidth)]
        groups.setdefault((row["variant"], int(row["recordings"])), []).append((float(row["probability"]) / truth, held))

    def cell(of):
        ratios = sorted(ratio for ratio, _ in of)
        low, high = (ratios[math.floor(q * (len(ratios) - 1))] for q in (0.1, 0.9))
        held, with_bandwidth = (f"{100 * statistics.mean(row[k] for _, row in of):.0f} %" for k in (0, 1))
        more = "" if held == with_bandwidth else f" ({with_bandwidth} with the bandwidth's)"
        return f"{statistics.median(ratios):.2f} ({low:.2f}–{high:.2f}), {held}{more}"

    print("| cut-in |", " | ".join(f"{recordings} recordings" for recordings in RECORDINGS), "|")
    for variant in sorted({variant for variant, _ in groups}):
        cells = (cell(groups[variant, recordings]) for recordings in RECORDINGS if (variant, recordings) in groups)
        print(f"| {variant} |", " | ".join(cells), "|")


if __name__ == "__main__":
    if sys.argv[1] == "report":
        report(sys.argv[2])
    else:
        main(str(Path(sys.argv[1]).resolve()), int(sys.argv[2]) if len(sys.argv) > 2 else 50)
