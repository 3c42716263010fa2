"""Formats in Python: the traffic that was written is the traffic that is read, and what a file does not say is an error."""

from __future__ import annotations

import ast
import gzip
import json
import math
import os
import re
import shutil
import warnings
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import lanesweep
import numpy as np
import polars as pl
import pytest
from lanesweep.tracks import automatum, commonroad, i24, lists, sumo, swiftraj
from polars.testing import assert_frame_equal

ROOT = Path(__file__).parents[2]
SHARED = Path(os.environ.get("LANESWEEP_SHARED", ROOT.parent / "shared"))
FOOT_M = 0.3048


@pytest.fixture(scope="module")
def traffic(tmp_path_factory: pytest.TempPathFactory) -> pl.DataFrame:
    """A generated recording: forty vehicles of each direction, in our columns, sorted by vehicle and time."""
    folder = tmp_path_factory.mktemp("traffic")
    lanesweep.tracks(convert=folder / "recordings", synth_recordings=1)
    lanesweep.tracks(folder / "recordings", convert=folder / "own.parquet")
    own = pl.read_parquet(folder / "own.parquet")
    forward = pl.col("vx") > 0
    way = pl.when(forward).then(1.0).otherwise(-1.0)
    names = {"time": "time_s", "x": "x_m", "y": "y_m", "vx": "vx_mps", "vy": "vy_mps", "acceleration": "acceleration_mps2"}
    frame = own.with_columns(
        vehicle_id=pl.col("vehicle").cast(pl.String),
        direction=way,
        heading_deg=pl.arctan2("vy", "vx").degrees(),
        speed_mps=(pl.col("vx") ** 2 + pl.col("vy") ** 2).sqrt(),
        lane=pl.when(forward).then(pl.lit("E_")).otherwise(pl.lit("W_")) + pl.col("lane").cast(pl.String),
    )
    frame = frame.rename(names | {"length": "length_m", "width": "width_m"})
    shown = frame.filter(pl.col("vehicle").rank("dense").over("direction") <= 40)
    return shown.sort("vehicle", "time_s").drop("vehicle", "recording")


def of_vehicles(frame: pl.DataFrame) -> Iterator[dict[str, Any]]:
    """The columns of each vehicle as lists."""
    for one in frame.partition_by("vehicle_id", maintain_order=True):
        yield one.to_dict(as_series=False)


def write_fcd(path: Path, frame: pl.DataFrame, extra: str = "") -> None:
    """The front bumpers, as SUMO writes them; types are `car4.2x1.8` and the like."""
    with path.open("w", encoding="utf-8") as file:
        file.write("<fcd-export>\n")
        for step in frame.sort("time_s", maintain_order=True).partition_by("time_s", maintain_order=True):
            file.write(f'<timestep time="{step["time_s"][0]}">\n')
            for row in step.iter_rows(named=True):
                angle = math.radians(row["heading_deg"])
                x, y = (at + 0.5 * row["length_m"] * of(angle) for at, of in ((row["x_m"], math.cos), (row["y_m"], math.sin)))
                values = {"id": row["vehicle_id"], "x": x, "y": y, "angle": 90.0 - row["heading_deg"]}
                values |= {
                    "type": f"{row['class']}{row['length_m']}x{row['width_m']}",
                    "speed": row["speed_mps"],
                    "pos": 0,
                    "lane": row["lane"],
                }
                file.write("<vehicle " + " ".join(f'{name}="{value}"' for name, value in values.items()) + "/>\n")
            file.write(f"{extra}</timestep>\n")
        file.write("</fcd-export>\n")


def write_types(path: Path, frame: pl.DataFrame) -> None:
    """The types of `write_fcd`, lorries in a distribution."""
    lines = {"car": "", "truck": ""}
    for kind, length, width in frame.select("class", "length_m", "width_m").unique().sort("length_m").iter_rows():
        vclass = "passenger" if kind == "car" else "trailer"
        lines[kind] += f'<vType id="{kind}{length}x{width}" vClass="{vclass}" length="{length}" width="{width}"/>'
    path.write_text(f'<routes>{lines["car"]}<vTypeDistribution id="lorries">{lines["truck"]}</vTypeDistribution></routes>')


def state(tag: str, row: dict[str, Any]) -> str:
    """A state of CommonRoad."""
    exact = {"orientation": math.radians(row["heading_deg"]), "time": row["frame"], "velocity": row["speed_mps"]}
    exact["acceleration"] = row["acceleration_mps2"]
    values = "".join(f"<{name}><exact>{value}</exact></{name}>" for name, value in exact.items())
    return f"<{tag}><position><point><x>{row['x_m']}</x><y>{row['y_m']}</y></point></position>{values}</{tag}>"


def obstacle(vehicle: pl.DataFrame) -> str:
    """A vehicle of CommonRoad, with its frames."""
    rows = list(vehicle.iter_rows(named=True))
    first, size = rows[0], "".join(f"<{of}>{rows[0][of + '_m']}</{of}>" for of in ("length", "width"))
    states = "".join(state("state", row) for row in rows[1:])
    facts = f"<type>{first['class']}</type><shape><rectangle>{size}</rectangle></shape>{state('initialState', first)}"
    return f'<dynamicObstacle id="{first["vehicle_id"]}">{facts}<trajectory>{states}</trajectory></dynamicObstacle>\n'


def lanelet(name: int, left: list[tuple[float, float]], right: list[tuple[float, float]]) -> str:
    """A lanelet with its boundaries."""
    sides = {"leftBound": left, "rightBound": right}
    points = {side: "".join(f"<point><x>{x}</x><y>{y}</y></point>" for x, y in of) for side, of in sides.items()}
    return f'<lanelet id="{name}">' + "".join(f"<{side}>{of}</{side}>" for side, of in points.items()) + "</lanelet>\n"


def scene(*parts: str, version: str = "2020a", step_s: float = 0.2) -> str:
    return f'<commonRoad commonRoadVersion="{version}" timeStepSize="{step_s}">\n{"".join(parts)}</commonRoad>'


def same(ours: pl.DataFrame, traffic: pl.DataFrame, *columns: str, off: float = 0.0) -> None:
    """The table is that of the traffic: same columns, same order of vehicles' rows, and the same bits unless values were moved."""
    expected = traffic.select(columns).sort("vehicle_id", "time_s")
    assert_frame_equal(ours.sort("vehicle_id", "time_s"), expected, check_exact=off == 0, abs_tol=off, rel_tol=0)


def mined(table: Path, **options: Any) -> list[dict[str, Any]]:
    """Scenarios of a table."""
    lanesweep.mine(table, out=table.with_suffix(".jsonl"), **options)
    return [json.loads(line) for line in table.with_suffix(".jsonl").read_text(encoding="utf-8").splitlines()]


def facts(scenarios: list[dict[str, Any]]) -> set[tuple[Any, ...]]:
    return {(one["category"], one["ego_id"], one["target_id"], one["frame0"], one["kept"], round(one["gap0"], 3)) for one in scenarios}


SUMO_COLUMNS = ("vehicle_id", "time_s", "x_m", "y_m", "heading_deg", "speed_mps", "length_m", "width_m", "class", "lane")


@pytest.fixture(scope="module")
def simulated(traffic: pl.DataFrame, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The traffic as SUMO's floating car data, and its types."""
    folder = tmp_path_factory.mktemp("sumo")
    write_fcd(folder / "fcd.xml", traffic.filter(pl.col("time_s") < 60))
    write_types(folder / "demo.rou.xml", traffic)
    return folder / "fcd.xml", folder / "demo.rou.xml"


def as_sumo(traffic: pl.DataFrame) -> pl.DataFrame:
    kind = pl.when(pl.col("class") == "car").then(pl.lit("passenger")).otherwise(pl.lit("truck"))
    return traffic.filter(pl.col("time_s") < 60).with_columns(kind.alias("class"))


def test_floating_car_data_give_the_middles_of_the_boxes_and_the_sizes_of_the_types(traffic, simulated) -> None:
    same(sumo(*simulated), as_sumo(traffic), *SUMO_COLUMNS, off=1e-9)


def test_a_table_of_floating_car_data_has_the_scenarios_of_the_traffic(traffic, simulated, tmp_path) -> None:
    as_sumo(traffic).select(SUMO_COLUMNS).write_parquet(tmp_path / "traffic.parquet")
    sumo(*simulated).sort("vehicle_id", "time_s").write_parquet(tmp_path / "fcd.parquet")
    sumo(*simulated).write_csv(tmp_path / "table.csv")
    ours = facts(mined(tmp_path / "fcd.parquet"))
    assert len(ours) > 10
    assert ours == facts(mined(tmp_path / "traffic.parquet")) == facts(mined(tmp_path / "table.csv"))


def test_floating_car_data_may_be_packed_and_a_table(traffic, simulated, tmp_path) -> None:
    fcd, types = simulated
    expected = sumo(fcd, types)
    packed = tmp_path / "fcd.xml.gz"
    packed.write_bytes(gzip.compress(fcd.read_bytes()))
    assert_frame_equal(sumo(packed, [types]), expected)
    attributes = re.compile(r'(\w+)="([^"]*)"')
    rows, time = [], ""
    for line in fcd.read_text(encoding="utf-8").splitlines():
        found = dict(attributes.findall(line))
        time = found.pop("time", time)
        rows += [{"timestep_time": time} | {f"vehicle_{name}": value for name, value in found.items()}] if found else []
    table = pl.DataFrame(rows)
    # A step without vehicles, as xml2csv writes it.
    empty = pl.DataFrame({"timestep_time": ["0.0"]})
    pl.concat([empty, table], how="diagonal").write_csv(tmp_path / "fcd.csv", separator=";")
    assert_frame_equal(sumo(tmp_path / "fcd.csv", types), expected)
    numbers = pl.col("timestep_time", "vehicle_x", "vehicle_y", "vehicle_angle", "vehicle_speed").cast(pl.Float64)
    table.with_columns(numbers).write_parquet(tmp_path / "fcd.parquet")
    assert_frame_equal(sumo(tmp_path / "fcd.parquet", types), expected)


STEP = '<timestep time="{time}"><vehicle id="a" x="10" y="2" angle="90" type="{kind}" speed="20" lane="E_0"/></timestep>'


def one_vehicle(folder: Path, kind: str = "T", more: str = "", time: str = "0.5") -> Path:
    path = folder / "fcd.xml"
    path.write_text("<fcd-export>" + STEP.format(kind=kind, time=time).replace("</timestep>", more + "</timestep>") + "</fcd-export>")
    return path


def types_of(folder: Path, text: str, name: str = "demo.add.xml") -> Path:
    (folder / name).write_text(f"<additional>{text}</additional>")
    return folder / name


@pytest.mark.parametrize(
    ("vtype", "size"),
    [
        ('vClass="passenger"', (5.0, 1.8, "passenger")),
        ('guiShape="bus"', (5.0, 1.8, "T")),
        ('vClass="truck"', (7.1, 2.4, "truck")),
        ('vClass="trailer"', (16.5, 2.55, "truck")),
        ('vClass="coach" width="2.4"', (14.0, 2.4, "truck")),
        ('vClass="delivery"', (6.5, 2.16, "truck")),
        ('vClass="motorcycle" length="2"', (2.0, 0.9, "motorcycle")),
    ],
)
def test_a_type_without_a_size_has_that_which_sumo_documents_for_its_class(vtype, size, tmp_path) -> None:
    types = types_of(tmp_path, f'<vType id="T" {vtype}/>')
    for kind in ("T", "T@mixed"):
        table = sumo(one_vehicle(tmp_path, kind), types)
        assert table.select("length_m", "width_m", "class").row(0) == size
        assert table["x_m"][0] == 10 - size[0] / 2 and table["heading_deg"][0] == 0


def test_a_type_that_no_file_defines_is_an_error_and_sumos_own_default_is_none(tmp_path) -> None:
    assert sumo(one_vehicle(tmp_path, "DEFAULT_VEHTYPE"))["length_m"][0] == 5.0
    with pytest.raises(lanesweep.InputError, match=r"fcd.xml: vehicle a: no vType gives a size of its type `T`\n  help: .*rou.xml"):
        sumo(one_vehicle(tmp_path))
    with pytest.raises(ValueError, match="no vType gives a size"):
        sumo(one_vehicle(tmp_path), types_of(tmp_path, '<vType id="T" vClass="hovercraft"/>'))


def test_two_sizes_of_one_type_are_an_error(tmp_path) -> None:
    several = [types_of(tmp_path, f'<vType id="T" length="{length}"/>', f"{length}.rou.xml") for length in (4.2, 4.9)]
    assert sumo(one_vehicle(tmp_path), [several[0], several[0]])["length_m"][0] == 4.2
    with pytest.raises(lanesweep.InputError, match=r"4.9.rou.xml: vType `T`"):
        sumo(one_vehicle(tmp_path), several)
    with pytest.raises(lanesweep.InputError, match=r"vType `T`: 'long' is not a number"):
        sumo(one_vehicle(tmp_path), types_of(tmp_path, '<vType id="T" length="long"/>'))


def test_persons_trains_and_what_is_in_no_lane_are_left_out_and_named(tmp_path, caplog) -> None:
    more = (
        '<vehicle id="rail1" x="0" y="0" angle="90" type="R" speed="20" lane="E_9"/><person id="walker" x="0" y="0" angle="0" speed="1"/>'
    )
    more += '<vehicle id="p1" x="0" y="0" angle="90" type="W" speed="1"/><container id="box" x="0" y="0"/>'
    types = types_of(tmp_path, '<vType id="T"/><vType id="R" vClass="rail"/>')
    assert sumo(one_vehicle(tmp_path, more=more), types)["vehicle_id"].to_list() == ["a"]
    assert all(name in caplog.text for name in ("rail1", "p1", "walker", "box"))
    # As xml2csv, and as SUMO's own CSV, have them.
    path = tmp_path / "fcd.csv"
    header = "timestep_time,vehicle_id,vehicle_x,vehicle_y,vehicle_angle,vehicle_type,person_id,person_x\n"
    path.write_text(header + "0.0,a,10,2,90,T,,\n0.0,,,,,,who,3\n")
    table = sumo(path, types)
    assert table["vehicle_id"].to_list() == ["a"] and table["speed_mps"].to_list() == [None] and "who" in caplog.text
    rows = "0.0;a;10;2;90;T;20;E_0\n0.0;p0;0;-3;90;DEFAULT_PEDTYPE;1;\n0.0;p1;0;-4;90;walker;1;\n"
    path.write_text("timestep_time;vehicle_id;vehicle_x;vehicle_y;vehicle_angle;vehicle_type;vehicle_speed;vehicle_lane\n" + rows)
    assert sumo(path, types)["vehicle_id"].to_list() == ["a"]


def test_times_with_hours_are_seconds(tmp_path) -> None:
    types = types_of(tmp_path, '<vType id="T"/>')
    for time, seconds in (("30.25", 30.25), ("08:15:30.25", 29_730.25), ("1:08:15:30.25", 116_130.25)):
        assert sumo(one_vehicle(tmp_path, time=time), types)["time_s"][0] == seconds


def test_a_lane_change_of_one_step_is_named(tmp_path, caplog) -> None:
    steps = [(0.0, 10, 2.0, "E_0"), (0.1, 13, 2.0, "E_0"), (0.2, 16, 5.5, "E_1"), (0.3, 19, 5.5, "E_1")]
    text = "".join(
        STEP.format(kind="T", time=t).replace('x="10" y="2"', f'x="{x}" y="{y}"').replace("E_0", lane) for t, x, y, lane in steps
    )
    (tmp_path / "fcd.xml").write_text(f"<fcd-export>{text}</fcd-export>")
    sumo(tmp_path / "fcd.xml", types_of(tmp_path, '<vType id="T"/>'))
    assert "1 lane changes take one step, such as that of a" in caplog.text and "lanechange.duration" in caplog.text


def test_a_file_that_is_no_floating_car_data_says_what_is_missing(tmp_path) -> None:
    types = types_of(tmp_path, '<vType id="T"/>')
    path = tmp_path / "fcd.xml"
    path.write_text(
        '<netstate><timestep time="0"><edge id="E"><lane id="E_0"><vehicle id="a" pos="3"/></lane></edge></timestep></netstate>'
    )
    with pytest.raises(lanesweep.InputError, match=r"no step has a vehicle\n  help: .*--fcd-output"):
        sumo(path, types)
    for attribute, ours in (("x", "x_m"), ("angle", "heading_deg"), ("type", "class")):
        path.write_text(one_vehicle(tmp_path).read_text().replace(f" {attribute}=", f" no-{attribute}="))
        with pytest.raises(lanesweep.InputError, match=f"vehicle a, time 0.5: there is no `{ours}`"):
            sumo(path, types)
    for speed in ("fast", "nan", "inf"):
        path.write_text(one_vehicle(tmp_path).read_text().replace('speed="20"', f'speed="{speed}"'))
        with pytest.raises(lanesweep.InputError, match=rf"vehicle_id a, time_s 0.5: `speed_mps` is '?{speed}'?; expected a number"):
            sumo(path, types)
    with pytest.raises(lanesweep.InputError, match=r"`length_m` is -4.0; expected a size"):
        sumo(one_vehicle(tmp_path), types_of(tmp_path, '<vType id="T" length="-4"/>'))


def test_a_truncated_file_is_an_error(simulated, tmp_path) -> None:
    fcd, types = simulated
    text = fcd.read_bytes()
    (tmp_path / "fcd.xml").write_bytes(text[: len(text) // 2])
    with pytest.raises(lanesweep.InputError, match=r"fcd.xml: inside `\w+`: not well-formed XML, or truncated"):
        sumo(tmp_path / "fcd.xml", types)
    packed = gzip.compress(text)
    (tmp_path / "fcd.xml.gz").write_bytes(packed[: len(packed) // 2])
    with pytest.raises(lanesweep.InputError, match="truncated"):
        sumo(tmp_path / "fcd.xml.gz", types)
    (tmp_path / "d.json").write_text('{"objects": [{"UUID": "a", "time": [0.0')
    with pytest.raises(lanesweep.InputError, match=r"d.json: not JSON, or truncated"):
        automatum(tmp_path / "d.json")
    for name, content in (("fcd.parquet", b"PAR1"), ("fcd.csv", b'a,b\n1,2,3\n"')):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(lanesweep.InputError, match=f"{name}: the file: no table, or truncated"):
            sumo(tmp_path / name, types)
    with pytest.raises(FileNotFoundError):
        sumo(tmp_path / "none.xml", types)


@pytest.mark.parametrize("read", [automatum, i24, lambda path: lists(path, {"zz": "time_s"})])
@pytest.mark.parametrize("content", ['{"obj": []}', '{"objects": {"UUIDs": []}}', '[{"UUIDs": "a", "time": [0.0]}]'])
def test_json_of_another_format_says_which_column_is_not_there(read, content, tmp_path) -> None:
    (tmp_path / "other.json").write_text(content)
    with pytest.raises(lanesweep.InputError, match=r"other.json: column `(UUID|_id|zz)`: not there; the file has obj|UUIDs"):
        read(tmp_path / "other.json")


AUTOMATUM = {"time": "time_s", "x_vec": "x_m", "y_vec": "y_m", "vx_vec": "vx_mps", "vy_vec": "vy_mps", "lane_id_vec": "lane"}


def write_automatum(path: Path, frame: pl.DataFrame) -> None:
    objects = []
    for one in of_vehicles(frame):
        single = {"UUID": one["vehicle_id"][0], "type": one["class"][0], "length": one["length_m"][0], "width": one["width_m"][0]}
        zeros = [0] * len(one["time_s"])
        psi = {"psi_vec": [math.radians(angle) for angle in one["heading_deg"]], "ax_vec": zeros, "ay_vec": zeros}
        objects.append(single | {theirs: one[ours] for theirs, ours in AUTOMATUM.items()} | psi)
    path.write_text(json.dumps({"UUID": "recording", "objects": objects}))


def test_automatum_has_the_bits_and_the_scenarios_of_the_traffic(traffic, tmp_path) -> None:
    write_automatum(tmp_path / "dynamicWorld.json", traffic)
    table = automatum(tmp_path / "dynamicWorld.json")
    columns = ("vehicle_id", "time_s", "x_m", "y_m", "vx_mps", "vy_mps", "length_m", "width_m", "class", "lane")
    same(table.drop("heading_deg", "ax_mps2", "ay_mps2"), traffic, *columns)
    assert (table["heading_deg"] - traffic["heading_deg"]).abs().max() < 1e-12
    table.drop("ax_mps2", "ay_mps2").write_parquet(tmp_path / "dynamicWorld.parquet")
    traffic.select(columns).write_parquet(tmp_path / "traffic.parquet")
    assert facts(mined(tmp_path / "dynamicWorld.parquet")) == facts(mined(tmp_path / "traffic.parquet"))


def test_i24_is_in_metres_at_the_middle_of_the_box_and_smoothed_by_its_preset(traffic, tmp_path) -> None:
    vehicles = []
    for one in of_vehicles(traffic):
        way, length, lorry = one["direction"][0], one["length_m"][0], one["class"][0] == "truck"
        rear = [(x - way * length / 2) / FOOT_M for x in one["x_m"]]
        lists_of = {"timestamp": [1.6e9 + t for t in one["time_s"]], "x_position": rear, "y_position": [y / FOOT_M for y in one["y_m"]]}
        single = {"_id": {"$oid": one["vehicle_id"][0]}, "length": length / FOOT_M, "width": one["width_m"][0] / FOOT_M}
        vehicles.append(lists_of | single | {"direction": int(way), "coarse_vehicle_class": 4.0 if lorry else 0})
    (tmp_path / "day.json").write_text(json.dumps(vehicles))
    table = i24(tmp_path / "day.json")
    kind = pl.when(pl.col("class") == "car").then(pl.lit("sedan")).otherwise(pl.lit("semi"))
    expected = traffic.with_columns(kind.alias("class"), time_s=1.6e9 + pl.col("time_s"), s_m="x_m", d_m="y_m")
    columns = ("vehicle_id", "time_s", "s_m", "d_m", "length_m", "width_m", "class", "direction")
    same(table, expected, *columns, off=1e-9)
    # One vehicle per line is the same.
    (tmp_path / "lines.json").write_text("\n".join(map(json.dumps, vehicles)))
    assert_frame_equal(i24(tmp_path / "lines.json"), table)
    table.write_parquet(tmp_path / "day.i24.parquet")
    shutil.copy(tmp_path / "day.i24.parquet", tmp_path / "other.parquet")
    found = facts(mined(tmp_path / "day.i24.parquet"))
    assert len(found) > 10 and found == facts(mined(tmp_path / "other.parquet", preset="i24"))
    assert i24(tmp_path / "lines.json")["class"].n_unique() == 2
    for direction in (0, None):
        vehicles[0]["direction"] = direction
        (tmp_path / "day.json").write_text(json.dumps(vehicles))
        with pytest.raises(lanesweep.InputError, match="`direction`"):
            i24(tmp_path / "day.json")


def test_swiftraj_keeps_its_positions_along_the_road(traffic, tmp_path) -> None:
    frame = traffic.with_columns(
        frame=(pl.col("time_s") * 25).round().cast(pl.Int64),
        forward_speed_mps=pl.col("direction") * pl.col("vx_mps"),
        leftward_speed_mps=pl.col("direction") * pl.col("vy_mps"),
        s_m="x_m",
        d_m="y_m",
    )
    names = {"frame": "frame_index", "s_m": "frenet_s", "d_m": "frenet_d", "forward_speed_mps": "frenet_s_speed"}
    names |= {"leftward_speed_mps": "frenet_d_speed", "acceleration_mps2": "frenet_s_accel", "lane": "lane_id"}
    single = {"length_m": "vehicle_length", "width_m": "vehicle_width", "class": "vehicle_class"}
    packed = frame.group_by("vehicle_id", maintain_order=True)
    firsts = (pl.col(ours).first().alias(theirs) for ours, theirs in single.items())
    packed.agg(*(pl.col(ours).alias(theirs) for ours, theirs in names.items()), *firsts).write_parquet(tmp_path / "sw.parquet")
    ours = swiftraj(tmp_path / "sw.parquet", frame_interval_s=0.04)
    columns = ("vehicle_id", "frame", "time_s", "s_m", "d_m", "forward_speed_mps", "leftward_speed_mps", "acceleration_mps2")
    same(ours, frame.with_columns(time_s=pl.col("frame") * 0.04), *columns, "length_m", "width_m", "class", "lane")
    ours.write_parquet(tmp_path / "along.parquet")
    lanesweep.tracks(tmp_path / "along.parquet", convert=tmp_path / "converted.parquet")
    converted = pl.read_parquet(tmp_path / "converted.parquet").filter(pl.col("vx") > 0)
    assert converted["x"].to_list() == frame.filter(pl.col("direction") > 0)["s_m"].to_list()
    assert len(mined(tmp_path / "along.parquet")) > 10
    for interval_s in (0, -0.1, math.nan, None):
        with pytest.raises(lanesweep.InputError, match=f"`frame_interval_s`: {interval_s} is not a number above 0"):
            swiftraj(tmp_path / "sw.parquet", interval_s)


def test_lists_of_other_names_are_read_and_must_be_equally_long(tmp_path) -> None:
    vehicles = pl.DataFrame({"track": ["a", "b"], "t": [[0.0, 0.1], [0.0]], "x": [[1, 2], [3]], "y": [[0, 0], [4]], "size": [4.5, 12.0]})
    columns = {"track": "vehicle_id", "t": "time_s", "x": "x_m", "y": "y_m", "size": "length_m"}
    vehicles.write_parquet(tmp_path / "own.parquet")
    expected = pl.DataFrame({"vehicle_id": ["a", "a", "b"], "time_s": [0.0, 0.1, 0.0], "x_m": [1.0, 2.0, 3.0], "y_m": [0.0, 0.0, 4.0]})
    expected = expected.with_columns(length_m=pl.Series([4.5, 4.5, 12.0]))
    assert_frame_equal(lists(tmp_path / "own.parquet", columns), expected)
    (tmp_path / "own.json").write_text(json.dumps(vehicles.to_dicts()))
    assert_frame_equal(lists(tmp_path / "own.json", columns), expected)
    with pytest.raises(lanesweep.InputError, match="column `speed`: not there; the file has track, t"):
        lists(tmp_path / "own.parquet", columns | {"speed": "speed_mps"})
    vehicles.with_columns(x=pl.Series([[1.0], [3.0]])).write_parquet(tmp_path / "own.parquet")
    with pytest.raises(lanesweep.InputError, match="vehicle 1 of the list: the lists of `time_s` and `x_m` differ in length"):
        lists(tmp_path / "own.parquet", columns)
    wrong = [{**one, "x": "far"} if one["track"] == "b" else one for one in vehicles.to_dicts()]
    (tmp_path / "own.json").write_text(json.dumps(wrong))
    with pytest.raises(lanesweep.InputError, match="vehicle 2 of the list: `x` is 'far'"):
        lists(tmp_path / "own.json", columns)
    (tmp_path / "own.json").write_text(json.dumps([{**one, "x": ["far"] * len(one["x"])} for one in vehicles.to_dicts()]))
    with pytest.raises(lanesweep.InputError, match=r"vehicle_id a, time_s 0.0: `x_m` is 'far'; expected a number"):
        lists(tmp_path / "own.json", columns)
    with pytest.raises(lanesweep.InputError, match="`x`: it is no column of tracks; there are vehicle_id"):
        lists(tmp_path / "own.json", {"x": "x"})
    fixed = vehicles.head(1).with_columns(pl.col("t", "x", "y").list.to_array(2))
    fixed.write_parquet(tmp_path / "own.parquet")
    assert_frame_equal(lists(tmp_path / "own.parquet", columns), expected.head(2))
    fixed.with_columns(size=pl.lit(math.nan)).write_parquet(tmp_path / "own.parquet")
    assert lists(tmp_path / "own.parquet", columns)["length_m"].to_list() == [None, None]
    (tmp_path / "own.json").write_text("[]")
    with pytest.raises(lanesweep.InputError, match="no vehicle"):
        lists(tmp_path / "own.json", {})


CR_COLUMNS = ("vehicle_id", "frame", "time_s", "x_m", "y_m", "speed_mps", "acceleration_mps2", "length_m", "width_m", "class")


def test_commonroad_has_the_bits_of_the_traffic_and_names_the_lanelets(traffic, tmp_path) -> None:
    frame = traffic.with_columns(frame=(pl.col("time_s") * 25).round().cast(pl.Int64)).filter(
        pl.col("direction") > 0, pl.col("frame") % 5 == 0
    )
    frame = frame.with_columns(frame=pl.col("frame") // 5).with_columns(time_s=pl.col("frame") * 0.2)
    middles = frame.group_by("lane").agg(pl.col("y_m").median()).sort("y_m")["y_m"].to_list()
    edges = [middles[0] - 1.75, *(0.5 * (a + b) for a, b in pairwise(middles)), middles[-1] + 1.75]
    lanelets = [lanelet(k, [(-100, edges[k + 1]), (900, edges[k + 1])], [(-100, edges[k]), (900, edges[k])]) for k in range(len(middles))]
    vehicles = [obstacle(one) for one in frame.partition_by("vehicle_id", maintain_order=True)]
    (tmp_path / "scene.xml").write_text(scene(*lanelets, *vehicles))
    table = commonroad(tmp_path / "scene.xml")
    same(table.drop("heading_deg", "lane"), frame, *CR_COLUMNS)
    inside = np.digitize(table["y_m"].to_numpy(), edges) - 1
    assert table["lane"].to_list() == [str(k) if 0 <= k < len(middles) else None for k in inside]
    table.write_parquet(tmp_path / "scene.parquet")
    frame.select(*CR_COLUMNS, "lane").write_parquet(tmp_path / "traffic.parquet")
    found = facts(mined(tmp_path / "scene.parquet"))
    assert len(found) > 10 and found == facts(mined(tmp_path / "traffic.parquet"))


def test_a_lanelet_may_be_curved(tmp_path) -> None:
    ring = [[(radius * math.sin(a / 10), radius * math.cos(a / 10)) for a in range(16)] for radius in (103.5, 100.0)]
    row = {"heading_deg": 0.0, "speed_mps": 20.0, "acceleration_mps2": 0.0, "class": "car", "length_m": 4.5, "width_m": 1.8}
    at = {radius: (radius * math.sin(0.77), radius * math.cos(0.77)) for radius in (99.0, 102.0, 104.5)}
    cars = [
        obstacle(pl.DataFrame({**row, "vehicle_id": f"{radius}", "frame": [0, 1], "x_m": x, "y_m": y})) for radius, (x, y) in at.items()
    ]
    (tmp_path / "scene.xml").write_text(scene(lanelet(7, *ring), *cars))
    assert commonroad(tmp_path / "scene.xml")["lane"].to_list() == [None, None, "7", "7", None, None]


def test_what_stands_is_there_all_the_time_and_other_obstacles_are_named(tmp_path, caplog) -> None:
    row = {"heading_deg": 0.0, "speed_mps": 20.0, "acceleration_mps2": 0.0, "length_m": 4.5, "width_m": 1.8, "y_m": 2.0, "x_m": 1.0}
    car = obstacle(pl.DataFrame({**row, "vehicle_id": "1", "class": "car", "frame": [3, 4, 5]}))
    others = [obstacle(pl.DataFrame({**row, "vehicle_id": "2", "class": "pedestrian", "frame": [3, 4]}))]
    for name, kind in (("3", "parkedVehicle"), ("4", "constructionZone")):
        one = obstacle(pl.DataFrame({**row, "vehicle_id": name, "class": kind, "frame": [0]})).replace("dynamicObstacle", "staticObstacle")
        others.append(one.replace("<velocity><exact>20.0</exact></velocity>", ""))
    (tmp_path / "scene.xml").write_text(scene(car, *others))
    table = commonroad(tmp_path / "scene.xml")
    assert table.select("vehicle_id", "frame").rows() == [("1", 3), ("1", 4), ("1", 5), ("3", 3), ("3", 4), ("3", 5)]
    assert "2 (pedestrian)" in caplog.text and "4 (constructionZone)" in caplog.text
    for text, problem in (
        (scene(car, version="2018b"), "the root: CommonRoad 2018b"),
        (scene(car).replace("timeStepSize", "step"), "`timeStepSize` of the root"),
        (scene(car).replace("<x>1.0</x>", ""), "obstacle 1: a state has no exact time and position"),
        (scene(car).replace("<x>1.0</x>", "<x>far</x>"), "vehicle_id 1, frame 3: `x_m` is 'far'"),
        (scene(car, lanelet(7, [(0, 1)], [(0, 0)]).replace("<y>1</y>", "<y/>")), "lanelet 7: '' is not a number"),
        (scene(car)[:-20], "not well-formed XML, or truncated"),
        (scene(), "there is no vehicle"),
    ):
        (tmp_path / "scene.xml").write_text(text)
        with pytest.raises(lanesweep.InputError, match=re.escape(problem)):
            commonroad(tmp_path / "scene.xml")


def test_the_verb_of_the_name_of_the_module_is_still_called(tmp_path) -> None:
    assert lanesweep.tracks.sumo is sumo
    with pytest.raises(lanesweep.MissingFile):
        lanesweep.tracks(tmp_path / "none.csv")


def test_a_format_is_a_function_of_at_most_forty_lines() -> None:
    for path in Path(lanesweep.__file__).parent.joinpath("tracks").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                said = ast.get_docstring(node, clean=False) or ""
                lines = (node.end_lineno or 0) - node.lineno - said.count("\n")
                assert lines <= 40, f"{path.name}: {node.name} has {lines}"


def test_the_code_of_the_chapter_runs(tmp_path, monkeypatch, traffic) -> None:
    monkeypatch.chdir(tmp_path)
    write_vissim(tmp_path / "run.fzp", traffic)
    text = (ROOT / "docs/src/tracks.md").read_text(encoding="utf-8")
    names: dict[str, Any] = {"__name__": "__main__"}
    blocks = re.findall(r"^```python\n(.*?)^```", text, re.M | re.S)
    assert len(blocks) == 2
    for block in blocks:
        exec(compile(block, "tracks.md", "exec"), names)
    columns = ("vehicle_id", "time_s", "x_m", "y_m", "length_m", "width_m", "class")
    record = pl.read_parquet("run.parquet").select(columns).with_columns(pl.col("vehicle_id").cast(pl.String))
    same(record, traffic, *columns, off=1e-9)


def write_vissim(path: Path, frame: pl.DataFrame) -> None:
    """PTV Vissim's vehicle record."""
    lines = ["$VISION", "* File: demo.inpx", "*", "$VEHICLE:SIMSEC;NO;VEHTYPE;COORDFRONT;COORDREAR;WIDTH"]
    for row in frame.sort("time_s", maintain_order=True).iter_rows(named=True):
        angle, half = math.radians(row["heading_deg"]), row["length_m"] / 2
        front, rear = (f"{row['x_m'] + by * math.cos(angle)} {row['y_m'] + by * math.sin(angle)} 0.000" for by in (half, -half))
        kind = 200 if row["class"] == "truck" else 100
        lines.append(f"{row['time_s']};{row['vehicle_id']};{kind};{front};{rear};{row['width_m']}")
    path.write_text("\n".join(lines) + "\n")


def shared(path: str) -> Path:
    """A file that is not part of the repository."""
    found = SHARED / path
    if not found.exists():
        warnings.warn(f"SKIPPED: {found} is not there", stacklevel=2)
        pytest.skip(f"{found} is not there")
    return found


FIELD = [
    ("public/sumo-class-truck/fcd.xml", "demo.rou.xml", [("fcd_cut_in_v1_v2_39", True, 25.501087), ("fcd_lvd_v4_v3_51", True, 35.93)]),
    ("public/sumo-class-trailer/fcd.xml", "demo.rou.xml", [("fcd_cut_in_v1_v2_39", True, 25.501087), ("fcd_lvd_v4_v3_51", True, 31.23)]),
    ("public/sumo-vtype-add/fcd.xml", "types.add.xml", [("fcd_cut_in_v1_v2_39", True, 26.150913), ("fcd_lvd_v4_v3_51", True, 37.38)]),
    ("public/sumo-10hz-instant/fcd.xml", "demo.rou.xml", [("fcd_lvd_v4_v3_51", True, 37.38)]),
]


@pytest.mark.parametrize(("fcd", "types", "expected"), FIELD)
def test_files_of_the_field_have_the_scenarios_that_the_rust_reader_found(fcd, types, expected, tmp_path) -> None:
    path = shared(f"field/{fcd}")
    sumo(path, path.with_name(types)).write_parquet(tmp_path / "fcd.parquet")
    found = mined(tmp_path / "fcd.parquet")
    assert [(one["id"], one["kept"], one["gap0"]) for one in found] == expected


def test_tables_of_the_field_have_persons_empty_steps_and_a_truncated_file(tmp_path) -> None:
    types = (
        '<vType id="pkw" length="4.6"/><vType id="lkw" vClass="truck"/><vType id="sattel" vClass="trailer"/><vType id="bus" vClass="bus"/>'
    )
    path = types_of(tmp_path, types)
    vehicles = sumo(shared("field/public/sumo-csv-with-person.csv"), path).unique("vehicle_id")
    assert vehicles.filter(pl.col("class") == "pkw").height == 27 and vehicles.height == 35
    assert sumo(shared("field/public/sumo-xml2csv-empty-steps.csv"), path)["time_s"].min() == 3.0
    with pytest.raises(lanesweep.InputError, match=r"vehicle b.0: no vType gives a size of its type `bus`"):
        sumo(shared("field/public/sumo-xml2csv-empty-steps.csv"))
    cut = shared("field/public/silent-omission/xml-cut/run2.xml")
    with pytest.raises(lanesweep.InputError, match=r"run2.xml: inside `.*truncated"):
        sumo(cut, cut.with_name("demo.rou.xml"))


def test_a_parked_vehicle_of_the_field_is_the_obstacle_of_a_cut_out(tmp_path) -> None:
    table = commonroad(shared("field/turn5/commonroad-static/DEU_Own-1_1_T-1.xml"))
    # Two tracks do not tell where the road goes; x is along it.
    table.rename({"x_m": "s_m", "y_m": "d_m"}).write_parquet(tmp_path / "own.parquet")
    (found,) = mined(tmp_path / "own.parquet")
    assert (found["kept"], found["lead_id"], round(found["D"], 6)) == (True, 2900, 27.65)


@pytest.mark.parametrize(("name", "vehicles", "rows"), [("4", 22, 1271), ("5", 25, 1619), ("26", 27, 1591)])
def test_scenes_of_us_101_have_their_vehicles_in_lanelets(name, vehicles, rows, tmp_path) -> None:
    table = commonroad(shared(f"data/us101/USA_US101-{name}_1_T-1.xml"))
    assert (table["vehicle_id"].n_unique(), len(table)) == (vehicles, rows)
    assert table["lane"].is_not_null().mean() > 0.98
    table.write_parquet(tmp_path / "scene.parquet")
    assert lanesweep.tracks(tmp_path / "scene.parquet").status == "ok"
