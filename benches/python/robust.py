"""How far from a limit can binary32 and binary64 judge a case differently? `python benches/python/robust.py CASES SEED`.

Runs random cut-ins and leader decelerations in both, and prints as CSV, per kind, profile and driver: the cases, the differing
verdicts, those that `robust` misses, and the largest distance from a contact where one of the two has none, in metres and in m/s.
"""

import sys

import lanesweep
import numpy as np
import polars as pl

count, rng = int(sys.argv[1]), np.random.default_rng(int(sys.argv[2]))
ego = rng.uniform(40, 130, count)
kinds = {
    "cut-in": {
        "speed_kmh": np.clip(ego - rng.uniform(0, 70, count), 10, None),
        "gap_m": rng.uniform(3, 80, count),
        "lateral_speed_mps": rng.uniform(0.2, 1.8, count),
        "acceleration_mps2": rng.uniform(-2, 0, count),
    },
    "lvd": {
        "gap_m": rng.uniform(5, 80, count),
        "acceleration_mps2": rng.uniform(-8, -1, count),
        "duration_s": rng.uniform(1, 6, count),
    },
}
verdicts = ["collision", "ttc", "btn"]
print("kind,profile,model,cases,differing,missed,gap_m,closing_speed_mps")
for kind, case in kinds.items():
    for profile in ("paper", "un-r157"):
        for model in lanesweep.options.MODELS:
            run = {"category": kind, "models": model, "profile": profile}
            cases = {"ego_speed_kmh": ego, **case}
            fast, exact = (lanesweep.simulate(cases, reference=of, **run).to_polars() for of in (False, True))
            differing = fast.filter(pl.any_horizontal(*(fast[name] != exact[name] for name in verdicts)))
            contacts = fast.filter(fast["collision"] != exact["collision"])
            gap = contacts.filter(~contacts["collision"])["min_gap_m"].max()
            closing = contacts.filter(contacts["collision"])["impact_closing_speed_mps"].max()
            print(kind, profile, model, count, len(differing), differing["robust"].sum(), gap, closing, sep=",")
