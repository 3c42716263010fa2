"""Reads the tables in a folder with pandas, pyarrow, Polars and DuckDB and compares them with the CSV: rows, sums, units.

Writes the folder's scenarios with each of them, for lanesweep to read. Run by .ci/tables.
"""

import json
import pathlib
import sys

import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pyarrow.parquet as pq

folder = pathlib.Path(sys.argv[1])


def check(holds, what):
    if not holds:
        sys.exit(f"read_tables: {what}")


for table, sums in [("lanes", ["max_btn", "reaction_s", "impact_speed_mps", "end_s", "contact_type"]),
                    ("samples", ["sample", "min_ttc_s", "max_btn", "end_s", "v_target_mps"])]:
    path = str(folder / f"{table}.parquet")
    csv = pd.read_csv(folder / f"{table}.csv", dtype={"variant": str}, keep_default_na=True)
    frames = {
        "pandas": pd.read_parquet(path),
        "Polars": pl.read_parquet(path).to_pandas(),
        "DuckDB": duckdb.sql(f"select * from '{path}'").df(),
        "JSON Lines": pd.read_json(folder / f"{table}.jsonl", lines=True, dtype={"variant": str}),
    }
    for program, frame in frames.items():
        check(list(frame.columns) == list(csv.columns), f"{table}, {program}: columns {list(frame.columns)}")
        check(len(frame) == len(csv) > 1000, f"{table}, {program}: {len(frame)} rows, {len(csv)} in the CSV")
        for column in sums:
            ours, theirs = (f[column].astype(float) for f in (csv, frame))
            check(ours.isna().sum() == theirs.isna().sum(), f"{table}, {program}: empty fields of {column}")
            check(np.isinf(ours).sum() == np.isinf(theirs).sum(), f"{table}, {program}: infinite fields of {column}")
            ours, theirs = (values[np.isfinite(values)] for values in (ours, theirs))
            near = np.isclose(ours.sum(), theirs.sum(), rtol=1e-6)
            check(near, f"{table}, {program}: {column} sums to {theirs.sum()}, in the CSV to {ours.sum()}")
        for column in ["collision", "ttc", "btn"]:
            check(frame[column].sum() == csv[column].sum() > 0, f"{table}, {program}: failures of {column}")
    # Units: with the columns, and among the file's keys.
    schema = pq.read_schema(path)
    units = {field.name: field.metadata[b"unit"].decode() for field in schema}
    about = pl.read_parquet_metadata(path)
    keys = f"select decode(value) from parquet_kv_metadata('{path}') where decode(key) = 'lanesweep.columns'"
    for words in (about["lanesweep.columns"], duckdb.sql(keys).fetchall()[0][0]):
        check({word["name"]: word["unit"] for word in json.loads(words)} == units, f"{table}: units {units}")
    check(units["max_btn"] == "1" and "s" in units.values(), f"{table}: units {units}")
    check(about["lanesweep.table"] == table and about["lanesweep.profile"] == "paper", f"{table}: {about}")
    print(f"{table}: {len(csv)} rows and {len(units)} columns agree in pandas, Polars, DuckDB and JSON Lines")

# Scenarios, written by each.
path = str(folder / "scenarios.parquet")
frame = pd.read_parquet(path)
check(len(frame) == sum(1 for _ in open(folder / "scenarios.jsonl")), "scenarios: rows")
few = frame[frame["category"].isin(["lvd", "cut_in"])]
few.to_parquet(folder / "from-pandas.parquet")
pl.read_parquet(path).filter(pl.col("category").cast(pl.String).is_in(["lvd", "cut_in"])).write_parquet(
    folder / "from-polars.parquet"
)
duckdb.sql(f"copy (select * from '{path}' where category in ('lvd', 'cut_in')) to '{folder}/from-duckdb.parquet'")
# And as a row per instant, in another unit where that is exact to the last bit: none is, so in m/s.
instants = few.drop(columns=[c for c in few.columns if c.startswith("lead") or c == "tag_frames"])
instants = instants.explode(["target_v", "target_y"])
instants["time_s"] = instants.groupby("id", sort=False).cumcount() / instants["fps"]
instants.rename(columns={"ego_v0": "ego_v0_mps", "target_v": "target_v_mps"}).to_csv(
    folder / "from-pandas.csv", index=False
)
print(f"scenarios: {len(few)} written by pandas (Parquet, CSV), Polars and DuckDB")
