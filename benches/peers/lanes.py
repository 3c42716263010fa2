"""The lanes that every peer computes, and the constants of the profile `paper`.

Written from the specification of the driver models (sections 1, 2.1, 2.4 and 4). The ego starts at a time headway
and reacts as its driver model says to vehicles that move along given series. In a leader deceleration that is one
vehicle, the leader. In a cut-out another one is between the two at first and leaves the ego's lane: the cutter.
The leader stays in the middle of the ego's lane, so nothing lateral is computed for it, and a lane asks for its
verdicts only.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

MODELS = ("Reg157", "FSM")
CATEGORIES = ("lvd", "cut_out")

# Verdict bits.
COLLISION, TTC, BTN, CAPPED = 1, 2, 4, 8

DT_S = 0.04
STEP_CAP = 3000
JERK_MPS3 = 12.65
MAX_DECELERATION_MPS2 = 7.59294


def delay_steps(delay_s: float) -> int:
    """Whole steps of a delay."""
    return math.ceil(delay_s / DT_S - 1e-9)


class Constants(NamedTuple):
    """What a step needs, worked out in binary64; `rounded` gives the lane arithmetic."""

    dt: float = DT_S
    inverse_dt: float = 1.0 / DT_S
    zero: float = 0.0
    one: float = 1.0
    # TTC below this fails, s.
    ttc_threshold: float = 1.0
    # BTN above 0.8 fails: closing² > 2·0.8·a_max·(gap − closing·a_max/(2·jerk)).
    btn_two_a_limit: float = 2.0 * 0.8 * MAX_DECELERATION_MPS2
    btn_ramp_delay: float = MAX_DECELERATION_MPS2 / (2.0 * JERK_MPS3)
    # Reg157: unsafe below a TTC of dv/(2·6) + 0.35 + 0.1 s; brakes at 6 m/s².
    reg157_half_inverse: float = 1.0 / (2.0 * 6.0)
    reg157_constant: float = 0.35 + 0.1
    reg157_deceleration: float = 6.0
    # Reg157 looks at vehicles up to this lateral gap, m.
    reg157_gate: float = 0.5
    # FSM: τ, b_comf, b_max − b_comf, 1/(2b) of both and of the leader's 7 m/s², d1.
    tau: float = 0.75
    half_tau: float = 0.75 / 2.0
    b_comf: float = 4.0
    b_span: float = 6.0 - 4.0
    half_inverse_comf: float = 1.0 / (2.0 * 4.0)
    half_inverse_max: float = 1.0 / (2.0 * 6.0)
    half_inverse_lead: float = 1.0 / (2.0 * 7.0)
    margin: float = 2.0
    # FSM: added to the time in which a vehicle comes in, s.
    gate_margin: float = 0.1
    jerk_per_step: float = JERK_MPS3 * DT_S
    max_deceleration: float = MAX_DECELERATION_MPS2

    def rounded(self) -> Constants:
        """Each rounded once to binary32."""
        return Constants(*(np.float32(value) for value in self))


# Reaction time before the first braking step.
DELAY_STEPS = {"Reg157": delay_steps(0.35), "FSM": delay_steps(0.75)}


@dataclass(frozen=True)
class Ours:
    """What the CPU backend made of the lanes of one model."""

    verdicts: NDArray[np.uint8]
    end_step: NDArray[np.uint32]
    lane_steps_per_s: float
    # Name of each lane.
    keys: list[str]


@dataclass(frozen=True)
class Cutters:
    """The vehicles between ego and leader that leave the ego's lane."""

    # Per lane: gap at step 0; halves of the sums of the lengths and of the widths; width of the ego, m.
    gap: Floats
    half_lengths: Floats
    half_widths: Floats
    ego_width: Floats
    # Speed, m/s; distance from the middle of the ego's lane, m; lateral speed towards the ego, m/s: cases × steps.
    speed: Floats
    lateral: Floats
    towards: Floats

    def every(self, stride: int) -> Cutters:
        """Every so many lanes."""
        per_lane = (self.gap, self.half_lengths, self.half_widths, self.ego_width)
        return Cutters(*(numbers[::stride] for numbers in per_lane), self.speed, self.lateral, self.towards)


    def repeated(self, copies: int) -> Cutters:
        """Every lane so many times in a row."""
        per_lane = (self.gap, self.half_lengths, self.half_widths, self.ego_width)
        return Cutters(*(np.repeat(numbers, copies) for numbers in per_lane), self.speed, self.lateral, self.towards)


@dataclass(frozen=True)
class Lanes:
    """Lanes, one entry each, and the cases they share."""

    # Index of the case.
    case: NDArray[np.int32]
    # Gap to the leader at step 0, m.
    gap: Floats
    # Speed of the ego at step 0, m/s.
    ego_speed: Floats
    # The run goes on at least to this step.
    horizon: NDArray[np.int32]
    # Speed of the leader, m/s: cases × steps; the last one is held.
    leader_speed: Floats
    # None in leader decelerations.
    cutters: Cutters | None

    def __len__(self) -> int:
        return len(self.case)

    def every(self, stride: int) -> Lanes:
        """Every so many lanes; a stride prime to the number of headways takes all headways alike."""
        return Lanes(
            self.case[::stride],
            self.gap[::stride],
            self.ego_speed[::stride],
            self.horizon[::stride],
            self.leader_speed,
            None if self.cutters is None else self.cutters.every(stride),
        )


    def repeated(self, copies: int) -> Lanes:
        """Every lane so many times in a row, with the cases as they are: what keeps a GPU busy."""
        return Lanes(
            np.repeat(self.case, copies),
            np.repeat(self.gap, copies),
            np.repeat(self.ego_speed, copies),
            np.repeat(self.horizon, copies),
            self.leader_speed,
            None if self.cutters is None else self.cutters.repeated(copies),
        )


@dataclass(frozen=True)
class Result:
    """What a peer says of its lanes: verdict bits and the last evaluated step."""

    verdicts: NDArray[np.uint8]
    end_step: NDArray[np.uint32]


# Puts lanes of a model into the peer's own form; what comes back computes them.
Prepare = Callable[[Lanes, str], Callable[[], Result]]


def read(folder: Path) -> tuple[Lanes, dict[str, Ours]]:
    """Reads what `cargo bench --bench peers` wrote.

    Raises `ValueError` where the lanes are of another time step than the constants here.
    """
    manifest = json.loads((folder / "lanes.json").read_text())
    if (manifest["dt_s"], manifest["step_cap"]) != (DT_S, STEP_CAP):
        raise ValueError("the lanes have another time step or cap than benches/peers/lanes.py")
    headways = np.array(manifest["headways_s"], "<f4")
    case = np.repeat(np.arange(manifest["cases"], dtype=np.int32), len(headways))

    def per_lane(name: str) -> Floats:
        return np.fromfile(folder / f"{name}.f32", "<f4")[case]

    def series(name: str) -> Floats:
        return np.fromfile(folder / f"{name}.f32", "<f4").reshape(-1, manifest["width"])

    ego_speed = per_lane("ego_speed")
    gap = np.tile(headways, manifest["cases"]) * ego_speed
    cutters = None
    if manifest["category"] == "cut_out":
        cutters = Cutters(
            gap=gap,
            half_lengths=per_lane("cutter_half_lengths"),
            half_widths=per_lane("cutter_half_widths"),
            ego_width=per_lane("ego_width"),
            speed=series("cutter_speed"),
            lateral=np.abs(series("cutter_lateral")),
            towards=series("cutter_towards"),
        )
    lanes = Lanes(
        case=case,
        gap=gap + per_lane("leader_gap_offset"),
        ego_speed=ego_speed,
        horizon=np.fromfile(folder / "horizon.u32", "<u4").astype(np.int32)[case],
        leader_speed=series("leader_speed"),
        cutters=cutters,
    )
    ours = {
        model["name"]: Ours(
            verdicts=np.fromfile(folder / f"verdicts_{model['name']}.u8", np.uint8),
            end_step=np.fromfile(folder / f"end_step_{model['name']}.u32", "<u4"),
            lane_steps_per_s=model["lane_steps_per_s"],
            keys=(folder / f"keys_{model['name']}.txt").read_text().splitlines(),
        )
        for model in manifest["models"]
    }
    return lanes, ours
