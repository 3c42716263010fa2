"""SUMO's own output read by `lanesweep.tracks`, beside an independent conversion to highD's format: the same scenarios?

    python gen_sumo.py SIM --lanes 3 --flow 3600 --truck 0.2 --dur 120 --warm 220 --seed 1 --kg 0.7 --kr 0.7
    python gen_sumo.py SIM --lanes 3 --flow 4200 --truck 0.18 --ramp --wave --dur 120 --warm 220 --seed 4 --kg 0.7 --kr 0.7
    python fcd2highd.py SIM HIGHD 1 --nosmooth
    python sumo_tracks.py LANESWEEP SIM HIGHD [straight]

The conversion keeps the vehicles whose box is inside a window of 420 m, with at least 27 frames; here the rows of fcd.csv are
cut in the same way (`straight`: with the angles of the road, which tells what headings do), so that both hold the same samples.
Scenarios are compared by category, vehicles and frames. Needs `lanesweep[tracks]`."""
import csv
import json
import pathlib
import subprocess
import sys
import tempfile

from lanesweep.tracks import sumo


def scenarios(program, path):
    command = [program, "-q", "mine", path]
    return [json.loads(line) for line in subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()]


def main():
    program, sim, highd = sys.argv[1:4]
    sim = pathlib.Path(sim)
    meta = json.load(open(sim / "meta.json"))
    rows = list(csv.DictReader(open(sim / "fcd.csv"), delimiter=";"))
    if sys.argv[4:] == ["straight"]:
        rows = [{**row, "vehicle_angle": "270" if row["vehicle_id"].startswith("fw") else "90"} for row in rows]
    kept = {}
    for row in rows:
        size = meta["types"][row["vehicle_type"]]
        is_east = not row["vehicle_id"].startswith("fw")
        x = float(row["vehicle_x"]) - meta["x0"]
        centre = x - size["length"] / 2 if is_east else x + size["length"] / 2
        if 0 <= centre - size["length"] / 2 and centre + size["length"] / 2 <= meta["W"]:
            kept.setdefault(row["vehicle_id"], []).append(row)
    kept = {name: rows for name, rows in kept.items() if len(rows) >= 27}
    # The conversion numbers vehicles by first appearance.
    frame = lambda row: round((float(row["timestep_time"]) - meta["warm"]) / meta["step"]) + 1
    order = sorted(kept, key=lambda name: (frame(kept[name][0]), 2 if not name.startswith("fw") else 1))
    number = {name: str(at + 1) for at, name in enumerate(order)}
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "fcd.csv"
        with open(path, "w") as file:
            names = list(rows[0])
            file.write(";".join(names) + "\n")
            for name in order:
                for row in kept[name]:
                    file.write(";".join({**row, "vehicle_id": number[name]}[key] for key in names) + "\n")
        types = "".join(
            f'<vType id="{name}" length="{size["length"]}" width="{size["width"]}" '
            f'vClass="{"truck" if size["cls"] == "truck" else "passenger"}"/>'
            for name, size in meta["types"].items()
        )
        (pathlib.Path(folder) / "types.rou.xml").write_text(f"<routes>{types}</routes>")
        sumo(path, path.with_name("types.rou.xml")).write_parquet(path.with_suffix(".parquet"))
        ours = scenarios(program, str(path.with_suffix(".parquet")))
    theirs = scenarios(program, highd)
    key = lambda row: (row["category"], row["ego_id"], row["target_id"])
    for name in ("cut_in", "cut_out", "lvd"):
        a, b = ([row for row in rows if row["category"] == name] for rows in (ours, theirs))
        left, near, frames, kept_equal = list(b), 0, [], 0
        for row in a:
            match = min((o for o in left if key(o) == key(row)), key=lambda o: abs(o["frame0"] - row["frame0"]), default=None)
            if match:
                left.remove(match)
                near += 1
                frames.append(row["frame0"] - match["frame0"])
                kept_equal += match["kept"] == row["kept"]
        # The conversion counts frames from the end of the warm-up, from 1.
        late = sorted(value - round(meta["warm"] / meta["step"]) + 1 for value in frames)
        within = sum(abs(value) <= 1 for value in late)
        print(
            f"{name}: direct {len(a)} found, {sum(r['kept'] for r in a)} kept; converted {len(b)} found, "
            f"{sum(r['kept'] for r in b)} kept; {near} with the same vehicles, {within} within a frame, "
            f"{kept_equal} equally kept; frames late: {' '.join(map(str, late))}"
        )


main()
