"""Reads the scenarios below a folder and compares them with the lanes that they are of. See .ci/openscenario."""

import contextlib
import csv
import io
import logging
import subprocess
import sys
import warnings
from pathlib import Path
from xml.etree import ElementTree

from qc_baselib import Configuration, Result
from qc_opendrive import constants as xodr_constants
from qc_opendrive import main as xodr_checker
from qc_openscenario import constants as xosc_constants
from qc_openscenario import main as xosc_checker
from scenariogeneration import xosc

logging.disable(logging.CRITICAL)
# Positions are exact. A lane in binary32 rounds half the sum of two lengths, from which its gap is counted.
GAP_TOLERANCE_M = 1e-6


def issues(path, checker, constants):
    """What the ASAM quality checker has against a file."""
    config, result = Configuration(), Result()
    config.set_config_param("InputFile", str(path))
    result.register_checker_bundle(name=constants.BUNDLE_NAME, description="", version="1", summary="")
    result.set_result_version(version="1")
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        checker.run_checks(config, result)
    found = []
    for bundle in result.get_checker_bundle_results():
        completed = 0
        for check in bundle.checkers:
            completed += check.status is not None and check.status.value == "completed"
            if check.status is not None and check.status.value == "error":
                found.append(f"{check.checker_id}: {check.summary}")
            for issue in check.issues:
                where = [location.description for location in issue.locations]
                found.append(f"{check.checker_id}: {issue.description} {where}")
        if completed < 5:
            found.append(f"only {completed} checks were made")
    return found


def check_file(path):
    if path.suffix == ".xosc":
        return issues(path, xosc_checker, xosc_constants)
    return issues(path, xodr_checker, xodr_constants)


def parse(path):
    """A scenario by scenariogeneration's parser, which validates against its own copy of the schema."""
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("error")
        return xosc.ParseOpenScenario(str(path))


def spoilt_copies_are_caught(scenario, work):
    text = scenario.read_text()
    for name, old, new in [
        ("attribute", ' followingMode="position"', ""),
        ("element", "<CatalogLocations/>", ""),
        ("entity", 'EntityRef entityRef="Other"', 'EntityRef entityRef="Nobody"'),
    ]:
        assert old in text, old
        copy = work / f"spoilt-{name}.xosc"
        copy.write_text(text.replace(old, new, 1))
        assert check_file(copy), f"a spoilt {name} was not noticed"
    road = scenario.with_suffix(".xodr")
    copy = work / "spoilt.xodr"
    copy.write_text(road.read_text().replace('type="driving"', 'type="flying"', 1))
    assert check_file(copy), "a spoilt road was not noticed"


def vehicles(scenario):
    """Name -> (start, box centre ahead of the reference point, length, path of the reference point)."""
    boxes = {o.name: o.entityobject.boundingbox for o in scenario.entities.scenario_objects}
    starts = {}
    for name, actions in scenario.storyboard.init.initactions.items():
        starts[name] = next(a.position for a in actions if isinstance(a, xosc.TeleportAction))
    paths = {name: [] for name in boxes}
    for act in scenario.storyboard.stories[0].acts:
        for group in act.maneuvergroup:
            name = group.actors.actors[0].entity
            action = group.maneuvers[0].events[0].action[0].action
            shape = action.trajectory.shapes
            paths[name] = list(zip(shape.time, shape.positions))
    return boxes, starts, paths


def compare(scenario, rows, side):
    boxes, starts, paths = vehicles(scenario)
    largest = 0.0
    for name, prefix in [("Ego", None), ("Other", "other"), ("Ahead", "ahead")]:
        if name not in boxes:
            continue
        offset = boxes[name].center.x
        columns = ("x_ego_m", None) if prefix is None else (f"{prefix}_x_m", f"{prefix}_y_m")
        place = lambda row: (float(row[columns[0]]) - offset, side * float(row[columns[1]]) if columns[1] else 0.0)
        assert (starts[name].x, starts[name].y) == place(rows[0]), name
        if name == "Ego" and not paths[name]:
            continue
        assert len(paths[name]) >= len(rows), name
        for (time, position), row in zip(paths[name], rows):
            assert float(time) == float(row["t_s"]), (name, time)
            x, y = place(row)
            assert (position.x, position.y, position.h) == (x, y, 0.0), (name, time)
    for (_, ego), (_, other), row in zip(paths["Ego"], paths["Other"], rows):
        front = ego.x + boxes["Ego"].center.x + boxes["Ego"].boundingbox.length / 2
        rear = other.x + boxes["Other"].center.x - boxes["Other"].boundingbox.length / 2
        largest = max(largest, abs(rear - front - float(row["other_gap_m"])))
    assert largest < GAP_TOLERANCE_M, largest
    return sum(len(path) for path in paths.values()), largest


def main():
    split = sys.argv.index("--")
    work, program = Path(sys.argv[1]), sys.argv[split + 1 :]
    scenarios = sorted(work.glob("*/*.xosc"))
    assert len(scenarios) >= 20, scenarios
    spoilt_copies_are_caught(scenarios[0], work)
    vertices, largest = 0, 0.0
    for path in scenarios:
        for file in (path, path.with_suffix(".xodr")):
            found = check_file(file)
            assert not found, (file, found)
        scenario = parse(path)
        found = ElementTree.parse(path).iter("Property")
        key = {entry.get("name"): entry.get("value") for entry in found}["lanesweep.lane"]
        folder = path.parent.name
        if folder.startswith(("any", "two")):
            run = [*program, "simulate", "--from", str(work / "run"), "--lane", key]
            text = subprocess.run(run, check=True, capture_output=True, text=True).stdout
        else:
            text = (path.parent / f"{key.rsplit('/', 1)[1]}.csv").read_text()
        rows = list(csv.DictReader(io.StringIO(text)))
        side = 1.0 if folder.startswith("any") else -1.0
        count, off = compare(scenario, rows, side)
        vertices, largest = vertices + count, max(largest, off)
    print(f"{len(scenarios)} scenarios and roads: no issue of the ASAM quality checker; {vertices} vertices read by")
    print(f"scenariogeneration are the lanes' to the bit, the gaps between the boxes to {largest:.1e} m")


main()
