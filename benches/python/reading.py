"""Measures what programs take to read a large table of tracks: `python benches/python/reading.py BYTES PROGRAM...`.

Writes a table of about BYTES in time's order (without noise: vehicles at the speeds of their lanes), and DuckDB's Parquet of it,
into a temporary folder. Reads each with every PROGRAM (paths of lanesweep) and with DuckDB (a group by over all columns), in turn.
Prints CSV: peak of resident memory, processor time and clock of each process.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

RATE_HZ, ROAD_M = 25, 1000.0
SPEEDS_MPS, HEADWAYS_S = (33.0, 29.0, 24.0), (2.1, 2.3, 3.1)
SIZES = ("4.52,1.83,car", "4.21,1.79,car", "4.87,1.92,car", "16.50,2.55,truck", "12.02,2.50,truck")
ONE_THREAD = "import duckdb, sys; duckdb.execute('set threads=1'); duckdb.sql(sys.argv[1]).fetchall()"
ALL = "select lane, class, count(*), sum(time), sum(x), sum(y), sum(vx), sum(vy), max(length), max(width) from '{}' group by all"
PARQUET = "copy (from '{}') to '{}' (format parquet, compression zstd)"


def write(path: Path, size: int) -> None:
    live: list[tuple[int, int, int, str]] = []
    entered = [0, 0, 0]
    frame = written = 0
    with path.open("w") as table:
        table.write("vehicle_id,time,x,y,vx,vy,length,width,class,lane\n")
        while written < size:
            for lane in range(3):
                while int(entered[lane] * HEADWAYS_S[lane] * RATE_HZ) <= frame:
                    n = 3 * entered[lane] + lane
                    kind = 3 + n % 2 if lane == 2 and entered[lane] % 4 else n % 3
                    live.append((frame, n, lane, f"{SIZES[kind]},{lane}"))
                    entered[lane] += 1
            live = [v for v in live if (frame - v[0]) * SPEEDS_MPS[v[2]] <= ROAD_M * RATE_HZ]
            for first, n, lane, tail in live:
                t = (frame - first) / RATE_HZ
                amplitude, phase = 0.15 + 0.05 * (n % 7) / 7, 0.4 * t + n % 11 * 0.6
                y, vy = -1.75 - 3.5 * lane + amplitude * math.sin(phase), 0.4 * amplitude * math.cos(phase)
                speed = SPEEDS_MPS[lane]
                row = f"{n + 1},{frame / RATE_HZ:.2f},{speed * t:.6f},{y:.6f},{speed:.6f},{vy:.6f},{tail}\n"
                written += table.write(row)
            frame += 1


def measured(command: list[str]) -> tuple[float, float, float]:
    """Peak memory, GB, processor time, s, clock, s."""
    start = time.perf_counter()
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    if status != 0:
        raise SystemExit(f"{command} ended with {status}")
    return usage.ru_maxrss * 1024 / 1e9, usage.ru_utime + usage.ru_stime, time.perf_counter() - start


def main(size: int, programs: list[str]) -> None:
    print("program,verb,file,file_gb,peak_gb,processor_s,clock_s")
    with tempfile.TemporaryDirectory() as folder:
        csv, parquet = Path(folder, "tracks.csv"), Path(folder, "tracks.parquet")
        write(csv, size)
        subprocess.run([sys.executable, "-c", ONE_THREAD, PARQUET.format(csv, parquet)], check=True)
        for file in (csv, parquet):
            verbs = ("tracks", "mine")
            commands = [(program, verb, [program, "-q", verb, str(file)]) for program in programs for verb in verbs]
            commands.append(("duckdb", "group by", [sys.executable, "-c", ONE_THREAD, ALL.format(file)]))
            for program, verb, command in commands:
                cells = ",".join(f"{value:.2f}" for value in measured(command))
                print(f"{Path(program).name},{verb},{file.suffix[1:]},{file.stat().st_size / 1e9:.2f},{cells}", flush=True)


if __name__ == "__main__":
    main(int(float(sys.argv[1])), sys.argv[2:])
