#!/usr/bin/env python3
"""One table of a card: table.py OUT, where `measure` has written device.csv and, where it could, peers.csv.

Lane-steps per second of a study at many headways: ours, by the device's clock, with what the program chooses; numba.cuda and
JAX on copies of the same kind of lanes; and the ceiling: the card's issue rate over the instructions of a step that does not
branch, if every lane of every warp were busy.
"""
import csv
import subprocess
import sys
from pathlib import Path

# Multiprocessors; a card's name does not tell them.
MULTIPROCESSORS = {"H100": 132, "H200": 132, "A100": 108, "L40": 142}
# Instructions that a multiprocessor issues per clock, for 32 lanes each.
ISSUED = 4 * 32


def rows(path):
    if not path.exists():
        return []
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def issue_rate():
    """Instructions per second of the card, lane by lane; None if it is not known."""
    query = ["nvidia-smi", "--query-gpu=name,clocks.max.sm", "--format=csv,noheader,nounits"]
    try:
        name, clock = subprocess.run(query, capture_output=True, text=True, check=True).stdout.splitlines()[0].split(",")
    except (OSError, subprocess.CalledProcessError, IndexError, ValueError):
        return None
    units = next((units for card, units in MULTIPROCESSORS.items() if card in name), None)
    return units and units * ISSUED * float(clock) * 1e6


def main(out):
    here = Path(__file__).parent
    instructions = {}
    for row in rows(here / "instructions.csv"):
        parts = row["kernel"].split(".")
        if row["device"].endswith("sm_90") and len(parts) == 4 and parts[0] == "paper" and row["step_least"]:
            key = (parts[1].lower().replace("-", "_"), parts[2])
            instructions[key] = min(instructions.get(key, 1e9), float(row["step_least"]))
    ours, peers, issue = {}, {}, issue_rate()
    for row in rows(out / "device.csv"):
        if row["backend"] == "device" and row["wanted"] == "Verdicts":
            seconds = float(row["device_seconds"] or 0) or float(row["seconds"])
            key = (row["category"].lower(), row["model"])
            ours[key] = max(ours.get(key, 0), float(row["lane_steps"]) / seconds)
    for row in rows(out / "peers.csv"):
        peers[row["category"].lower(), row["model"], row["peer"]] = float(row["lane_steps_per_s"])
    print("category,model,ours,numba.cuda,jax-cuda,ceiling,ours_of_ceiling")
    for (category, model), rate in sorted(ours.items()):
        of_peer = [peers.get((category, model, peer)) for peer in ("numba.cuda", "jax-cuda")]
        least = instructions.get((category, model))
        ceiling = issue / least if issue and least else None
        cells = [rate, *of_peer, ceiling]
        shown = [f"{cell:.3g}" if cell else "" for cell in cells] + [f"{rate / ceiling:.2f}" if ceiling else ""]
        print(",".join([category, model, *shown]))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
