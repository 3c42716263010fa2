# %% [markdown]
# # From lanes.parquet to a figure
#
# How often does each driver model fail in the recorded scenarios (S) and in their parameterized counterparts (S'), at
# which headway do the two part, and which scenarios change their verdict?
#
#     lanesweep study --rows lanes.parquet
#     pip install -r docs/examples/requirements.txt
#     python docs/examples/from_parquet_to_figure.py lanes.parquet figure.png --category cut_in --variant 2
#
# The cells (`# %%`) run one by one in editors that know them, or as a notebook (`jupytext`).

# %% What is drawn
import argparse

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pyarrow.parquet as pq

parser = argparse.ArgumentParser(description="Failures of S and S' by headway, and the scenarios that change verdict")
parser.add_argument("lanes", help="table of lanes (.parquet)")
parser.add_argument("figure", help="file to write (.png, .svg, .pdf)")
parser.add_argument("--category", default="cut_in", choices=["cut_in", "cut_out", "lvd"])
parser.add_argument("--variant", default="2", help="key of the parameterization")
parser.add_argument("--criterion", default="collision", choices=["collision", "ttc", "btn"])
parser.add_argument("--scenarios", type=int, default=18, help="scenarios to list")
chosen = parser.parse_args()

# %% Read: only the columns that are needed, and the unit of the axis
keys = pq.read_metadata(chosen.lanes).metadata
about = {key.decode(): value.decode() for key, value in keys.items() if key.startswith(b"lanesweep.")}
columns = ["id", "variant", "headway", "model", chosen.criterion, "robust"]
lanes = pd.read_parquet(chosen.lanes, columns=columns, filters=[("category", "==", chosen.category)])
# "0.4s"; a gap or an observed headway has no place on the axis.
lanes["thw"] = pd.to_numeric(lanes["headway"].astype(str).str.removesuffix("s"), errors="coerce")
lanes = lanes[lanes["thw"].notna()].rename(columns={chosen.criterion: "failed"})
keys = sorted(lanes["variant"].unique())
if chosen.variant not in keys:
    raise SystemExit(f"no lanes of {chosen.category} have the parameterization {chosen.variant!r}: there are {keys}")

# %% S beside S': one row per scenario, headway and model
beside = lanes[lanes["variant"].isin(["S", chosen.variant])].pivot(
    index=["model", "thw", "id"], columns="variant", values="failed"
)
beside = beside.rename(columns={"S": "s", chosen.variant: "s_prime"}).dropna().astype(bool).reset_index()
beside["change"] = beside["s_prime"].astype(int) - beside["s"].astype(int)  # -1: only S fails; +1: only S' fails
models = [name for name in ["Reg157", "CCHDM", "RSS", "FSM"] if name in set(beside["model"])]
models += sorted(set(beside["model"]) - set(models))
headways = np.sort(beside["thw"].unique())


# %% Share with Wilson's 95 % interval: at one headway every scenario is one trial
def wilson(failures, trials, z=1.959964):
    share = failures / trials
    middle = (share + z**2 / (2 * trials)) / (1 + z**2 / trials)
    half = z / (1 + z**2 / trials) * np.sqrt(share * (1 - share) / trials + z**2 / (4 * trials**2))
    return share, np.maximum(middle - half, 0), np.minimum(middle + half, 1)


# %% Draw
ink, blue, orange, grey = "#222222", "#0072B2", "#D55E00", "#999999"  # Okabe and Ito
plt.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False, "axes.titlesize": 10})
figure = plt.figure(figsize=(11, 8.2), layout="constrained")
above, below = figure.subfigures(2, 1, height_ratios=[1, 1.25])
panels = above.subplots(1, len(models), sharey=True, squeeze=False)[0]
maps = below.subplots(1, len(models), sharey=True, squeeze=False)[0]
count = beside["id"].nunique()
label = f"S' ({chosen.variant})"

for panel, model in zip(panels, models):
    of_model = beside[beside["model"] == model].groupby("thw")
    trials = of_model.size().reindex(headways).to_numpy()
    for column, colour, style, marker, name in [
        ("s", blue, "-", "o", "S (recorded)"),
        ("s_prime", orange, "--", "s", label),
    ]:
        share, low, high = wilson(of_model[column].sum().reindex(headways).to_numpy(), trials)
        panel.fill_between(headways, 100 * low, 100 * high, color=colour, alpha=0.18, linewidth=0)
        panel.plot(headways, 100 * share, style, color=colour, marker=marker, markersize=3.5, label=name)
    panel.set_title(model, color=ink)
    panel.set_xlabel("initial time headway (s)")
    panel.grid(axis="y", color="#dddddd", linewidth=0.6)
    panel.set_axisbelow(True)
    # The square root of the share: what happens in one case of a hundred is seen beside what happens in most.
    panel.set_yscale("function", functions=(lambda share: np.sqrt(np.maximum(share, 0)), np.square))
panels[0].set_ylim(0, min(100, 1.05 * max(panel.dataLim.y1 for panel in panels)))
ticks = np.array([0, 0.1, 0.5, 2, 5, 10, 20, 30, 50, 70, 100])
panels[0].set_yticks(ticks[ticks <= panels[0].get_ylim()[1]], minor=False)
panels[0].yaxis.set_major_formatter(lambda value, _: f"{value:g}")
panels[0].set_ylabel(f"share failing {chosen.criterion} (%, square root)")
panels[-1].legend(frameon=False, loc="upper right")

changes = beside[beside["change"] != 0]
order = changes.groupby("id").size().sort_values(ascending=False, kind="stable").index
listed = sorted(order[: chosen.scenarios], key=list(order).index)
colours = matplotlib.colors.ListedColormap([blue, "#f2f2f2", orange])
for panel, model in zip(maps, models):
    of_model = beside[(beside["model"] == model) & beside["id"].isin(listed)]
    grid = of_model.pivot(index="id", columns="thw", values="change").reindex(index=listed, columns=headways)
    panel.pcolormesh(grid.to_numpy(float), cmap=colours, vmin=-1, vmax=1, edgecolors="white", linewidth=0.8)
    panel.set_xticks(np.arange(len(headways)) + 0.5, [f"{h:g}" if k % 2 else "" for k, h in enumerate(headways)])
    panel.set_yticks(np.arange(len(listed)) + 0.5, listed, fontsize=7)
    panel.tick_params(length=0)
    panel.spines[:].set_visible(False)
    missed = (changes[changes["model"] == model]["change"] == -1).sum()
    false = (changes[changes["model"] == model]["change"] == 1).sum()
    panel.set_title(f"{model}: {missed} missed, {false} false", color=ink)
    panel.set_xlabel("initial time headway (s)")
if listed:
    maps[0].invert_yaxis()
below.legend(
    handles=[
        matplotlib.patches.Patch(color=blue, label="only S fails (missed by S')"),
        matplotlib.patches.Patch(color=orange, label="only S' fails (false alarm)"),
        matplotlib.patches.Patch(color="#f2f2f2", label="same verdict"),
    ],
    loc="outside lower center",
    ncols=3,
    frameon=False,
)
of_all = f"the {len(listed)} scenarios that change most, of {changes['id'].nunique()} that change"
below.suptitle(f"Where S and S' disagree: {of_all}", fontsize=11, color=ink)
data = "SYNTHETIC DATA, " if about.get("lanesweep.synthetic") == "true" else ""
above.suptitle(
    f"{chosen.category.replace('_', '-')}: failures by headway, {count} scenarios, bands: Wilson 95 %\n"
    f"{data}profile {about.get('lanesweep.profile', '?')}, lanesweep {about.get('lanesweep.version', '?')}",
    fontsize=11,
    color=ink,
)
figure.savefig(chosen.figure, dpi=150)

# %% The same in numbers
shares = beside.groupby("model")[["s", "s_prime"]].mean().reindex(models).mul(100).round(2)
shares.columns = ["S fails %", f"{label} fails %"]
fragile = (~lanes["robust"]).sum()
print(shares.to_string())
print(f"{len(changes)} of {len(beside)} verdicts change, in {changes['id'].nunique()} of {count} scenarios")
print(f"{fragile} of {len(lanes)} lanes are decided by less than a nanometre of initial gap")
