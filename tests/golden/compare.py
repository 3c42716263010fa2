#!/usr/bin/env python3
"""Compares a table of your own simulator with a golden table: python3 compare.py GOLDEN OWN.

Both are CSV. OWN holds the input columns of GOLDEN, which name a row, and any of its result columns; other columns and the
order of rows do not matter. Values agree within 1e-6 (relative above 1), everything else exactly; an empty cell says that
the event did not happen. On rows with robust = 0 rounding decides the outcome: they are counted apart. Exit status: 0 every
robust row agrees, 1 some differ or are missing, 2 the tables cannot be compared.
"""

import csv
import sys

RESULTS = {
    # outcomes
    "aborted_large_ttc", "btn", "collision", "crash_type", "front_crash", "n_steps", "ttc",
    # values
    "gap_at_step0", "gap_to_front_at_step0", "impact_rel_speed", "impact_speed", "jrc_min2dttc", "lat_offset_at_step0",
    "max_btn", "max_cfs", "max_pfs", "min_gap", "min_ttc", "t_crash", "t_end", "t_react", "t_switch", "v_end", "value",
}  # fmt: skip
TOLERANCE = 1e-6
MAX_SHOWN = 20


def is_result(column):
    return column in RESULTS or column.startswith(("v@", "x@"))


def number(text):
    """A cell as a number, or as the text that it is: 2 and 2.0 name the same row."""
    try:
        return float(text)
    except ValueError:
        return text.strip()


def agree(golden, own):
    a, b = number(golden), number(own)
    if isinstance(a, str) or isinstance(b, str):
        return a == b
    return a == b or abs(a - b) <= TOLERANCE * max(1.0, abs(a))


def read(path):
    with open(path, newline="", encoding="utf-8-sig") as file:
        return list(csv.DictReader(file))


def main(golden_path, own_path):
    golden, own = read(golden_path), read(own_path)
    inputs = [column for column in golden[0] if column != "robust" and not is_result(column)]
    results = [column for column in golden[0] if is_result(column) and own and column in own[0]]
    missing = [column for column in inputs if column not in own[0]] if own else inputs
    if missing or not results:
        print(f"{own_path}: no column {', '.join(missing) or 'of results'}", file=sys.stderr)
        return 2
    rows = {tuple(number(row[column]) for column in inputs): row for row in own}
    counts = dict.fromkeys(["robust", "differ", "missing", "fragile_differ"], 0)
    shown = []
    for line, row in enumerate(golden, 2):
        robust = row.get("robust", "1") == "1"
        counts["robust"] += robust
        theirs = rows.get(tuple(number(row[column]) for column in inputs))
        if theirs is None:
            counts["missing"] += 1
            shown.append(f"{golden_path}:{line}: your table has no such row")
            continue
        wrong = [column for column in results if not agree(row[column], theirs[column] or "")]
        counts["differ" if robust else "fragile_differ"] += bool(wrong)
        if robust:
            shown += [f"{golden_path}:{line}: {c} is {row[c] or 'empty'}, yours {theirs[c] or 'empty'}" for c in wrong]
    for text in shown[:MAX_SHOWN] + ["…"] * (len(shown) > MAX_SHOWN):
        print(text)
    print(f"compared: {', '.join(results)}")
    print(
        f"{len(golden)} rows, {counts['robust']} robust: {counts['differ']} differ, {counts['missing']} are missing; "
        f"of the other {len(golden) - counts['robust']}, {counts['fragile_differ']} differ (information)"
    )
    return int(counts["differ"] + counts["missing"] > 0)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        sys.exit(2)
    sys.exit(main(*sys.argv[1:]))
