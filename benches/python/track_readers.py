"""Other readers and writers of tracks beside lanesweep's: lxd-io reads the exiD fixture, omega-prime writes the same traffic.

    cargo test --release --test library an_exid_fixture -- --ignored
    pip install lxd-io omega-prime pandas
    python track_readers.py LANESWEEP target/tmp/exid"""
import csv
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

import pandas as pd
import polars as pl


def run(program, *words):
    return subprocess.run([program, "-q", *words], check=True, capture_output=True, text=True).stdout


def scenarios(program, path):
    return [json.loads(line) for line in run(program, "mine", str(path)).splitlines()]


def by_lxd_io(program, fixture, folder):
    from lxd_io import Dataset

    root = folder / "exid-dataset-v2.0"
    (root / "data").mkdir(parents=True)
    for file in fixture.glob("*.csv"):
        shutil.copy(file, root / "data")
    for name in ("00", "01"):  # it asks for pictures, which it does not open here
        (root / "data" / f"{name}_background.png").write_bytes(b"")
    dataset = Dataset(root, "exid", 2, 0, 1.0)
    recording = dataset.get_recording(1)
    table = folder / "own.csv"
    straight = folder / "straight"
    straight.mkdir()
    for file in fixture.glob("01_*.csv"):
        shutil.copy(file, straight)
    run(program, "tracks", str(straight), "--convert", str(table))
    ours = pd.read_csv(table)
    worst, vehicles = {}, 0
    for track_id in recording.track_ids:
        track = recording.get_track(track_id)
        series = {name: track.get_data(name) for name in ("frame", "xCenter", "xVelocity", "yVelocity")}
        own = ours[ours.vehicle == track_id]
        vehicles += 1
        meta = {"length": track.get_meta_data("length"), "width": track.get_meta_data("width")}
        for name, theirs, mine in [
            ("samples", len(series["frame"]), len(own)),
            ("length, m", meta["length"], own.length.iloc[0]),
            ("width, m", meta["width"], own.width.iloc[0]),
        ]:
            worst[name] = max(worst.get(name, 0), abs(float(theirs) - float(mine)))
        columns = {"x": "xCenter", "vx": "xVelocity", "vy": "yVelocity"}
        for mine, theirs in columns.items():
            difference = max(abs(a - b) for a, b in zip(own[mine].to_list(), list(series[theirs])))
            worst[mine] = max(worst.get(mine, 0), difference)
    print(f"lxd-io: {vehicles} vehicles; largest differences: " + ", ".join(f"{k} {v:.2g}" for k, v in worst.items()))


def by_omega_prime(program, fixture, folder):
    import omega_prime

    tracks = pd.read_csv(fixture / "00_tracks.csv", usecols=["trackId", "frame", "xCenter", "yCenter", "heading", "width", "length", "xVelocity", "yVelocity", "xAcceleration", "yAcceleration"])
    classes = pd.read_csv(fixture / "00_tracksMeta.csv").set_index("trackId")["class"]
    zero = 0.0 * tracks.xCenter
    frame = pl.DataFrame(
        {
            "total_nanos": (tracks.frame * 40_000_000).to_numpy(),
            "idx": tracks.trackId.to_numpy(),
            "x": tracks.xCenter.to_numpy(), "y": tracks.yCenter.to_numpy(), "z": zero.to_numpy(),
            "vel_x": tracks.xVelocity.to_numpy(), "vel_y": tracks.yVelocity.to_numpy(), "vel_z": zero.to_numpy(),
            "acc_x": tracks.xAcceleration.to_numpy(), "acc_y": tracks.yAcceleration.to_numpy(), "acc_z": zero.to_numpy(),
            "length": tracks.length.to_numpy(), "width": tracks.width.to_numpy(), "height": (zero + 1.5).to_numpy(),
            "roll": zero.to_numpy(), "pitch": zero.to_numpy(), "yaw": (tracks.heading * 3.141592653589793 / 180).to_numpy(),
            "type": (2 + 0 * tracks.trackId).to_numpy(),
            "role": (0 * tracks.trackId).to_numpy(),
            "subtype": tracks.trackId.map(classes).map({"car": 4, "truck": 6}).to_numpy(),
        }
    )
    path = folder / "00.parquet"
    omega_prime.Recording(frame).to_parquet(str(path))
    curved = folder / "curved"
    curved.mkdir()
    for file in fixture.glob("00_*.csv"):
        shutil.copy(file, curved)
    theirs, ours = scenarios(program, path), scenarios(program, curved)
    key = lambda row: (row["category"], row["ego_id"], row["target_id"])
    left, late = list(ours), []
    for row in theirs:
        match = min((o for o in left if key(o) == key(row)), key=lambda o: abs(o["frame0"] - row["frame0"]), default=None)
        if match:
            left.remove(match)
            late.append((abs(row["frame0"] - match["frame0"]), row["kept"] == match["kept"]))
    print(
        f"omega-prime: {len(theirs)} scenarios, {len(ours)} from exiD; {len(late)} with the same vehicles, "
        f"{sum(frames <= 1 for frames, _ in late)} within a frame, {sum(kept for _, kept in late)} equally kept"
    )


def main():
    program, fixture = str(pathlib.Path(sys.argv[1]).resolve()), pathlib.Path(sys.argv[2]).resolve()
    with tempfile.TemporaryDirectory() as folder:
        by_lxd_io(program, fixture, pathlib.Path(folder))
        by_omega_prime(program, fixture, pathlib.Path(folder))


main()
