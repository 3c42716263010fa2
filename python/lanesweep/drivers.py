"""Drivers in NumPy, to start from; and what compiled ones need.

Rows that a compiled driver sees: `EGO_SPEED`, `EGO_ACCELERATION`, and of each vehicle ``OTHER + r`` and ``AHEAD + r``, r one
of `PRESENT`, `ATTENDED` (1 or 0), `SPEED`, `GAP`, `LATERAL_GAP`, `LATERAL_SPEED`, `HALF_LENGTHS`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ._core import profile
from ._driver import SIGNATURE as SIGNATURE
from ._driver import Driver, View

EGO_SPEED, EGO_ACCELERATION, OTHER, AHEAD = 0, 1, 2, 9
PRESENT, ATTENDED, SPEED, GAP, LATERAL_GAP, LATERAL_SPEED, HALF_LENGTHS = range(7)

f32 = np.float32


class Reg157(Driver):
    """The performance model of UN R157, 5.2.5.2, with the verdicts, minima and ends of the built-in `Reg157`, to the bit.

    `reaction_s` differs: here it is the first braking, there the first unsafe step, which the reaction time precedes.

    It brakes at 6 m/s² after 0.35 s once ``|gap / dv| <= dv / (2 * 6) + 0.35 s + margin`` for a vehicle beside or in its
    lane. Once it holds, the deceleration ends with the condition; the reaction time passes once.
    """

    name = "Reg157-numpy"
    may_accelerate = False
    attention = "Reg157"

    def __init__(self, profile_name: str = "paper") -> None:
        numbers = profile(profile_name)["reg157"]
        if numbers["always_unsafe"] or numbers["margin_steps"]:
            raise ValueError(f"{profile_name}: a rule of its Reg157 is not written here")
        self.numbers = numbers

    def start(self, lanes: int, dt_s: float) -> dict[str, Any]:
        delay_s = self.numbers["reaction_time_s"]
        return {
            "delay_steps": np.full(lanes, max(np.ceil(delay_s / dt_s - 1e-9), 0), dtype=np.int64),
            "half_inverse": f32(1.0 / (2.0 * self.numbers["deceleration_mps2"])),
            "constant": f32(delay_s + self.numbers["margin_s"]),
            "gate": f32(self.numbers["lateral_gate_m"]),
            "deceleration": f32(self.numbers["deceleration_mps2"]),
        }

    def acceleration(self, view: View, state: dict[str, Any]) -> npt.NDArray[np.float32]:
        is_unsafe = np.zeros(len(view), dtype=bool)
        for vehicle in (view.other, view.ahead):
            dv = view.ego_speed - vehicle.speed
            threshold = np.abs(dv) * (dv * state["half_inverse"] + state["constant"])
            is_close = (vehicle.lateral_gap <= state["gate"]) & (dv != 0) & (np.abs(vehicle.gap) <= threshold)
            is_ahead = vehicle.gap + vehicle.half_lengths >= 0
            is_unsafe |= vehicle.attended & is_close & is_ahead
        delay = state["delay_steps"]
        waits = is_unsafe & (delay[view.lane] >= 1)
        delay[view.lane[waits]] -= 1
        return np.where(is_unsafe & ~waits, -state["deceleration"], f32(0))


@dataclass(kw_only=True, eq=False)
class IDM(Driver):
    """The Intelligent Driver Model of Treiber, Hennecke and Helbing (2000).

    Parameters
    ----------
    desired_speed_mps : float, optional
        Speed on a free road, m/s; by default the initial speed of each lane.
    headway_s : float
        Desired time headway, s.
    max_acceleration_mps2, comfortable_deceleration_mps2 : float
        m/s².
    jam_distance_m : float
        Gap at rest, m.
    max_deceleration_mps2 : float
        Limit of the brakes, m/s².
    """

    desired_speed_mps: float | None = None
    headway_s: float = 1.5
    max_acceleration_mps2: float = 1.0
    comfortable_deceleration_mps2: float = 2.0
    jam_distance_m: float = 2.0
    max_deceleration_mps2: float = 8.0

    def start(self, lanes: int, dt_s: float) -> dict[str, Any]:
        return {"desired": np.full(lanes, np.nan, dtype=f32)}

    def acceleration(self, view: View, state: dict[str, Any]) -> npt.NDArray[np.float32]:
        desired = state["desired"]
        if view.step == 0:
            desired[view.lane] = view.ego_speed if self.desired_speed_mps is None else self.desired_speed_mps
        a, b = self.max_acceleration_mps2, self.comfortable_deceleration_mps2
        v = view.ego_speed
        free = 1 - (v / np.maximum(desired[view.lane], 0.1)) ** 4
        interaction = np.zeros(len(view), dtype=f32)
        for vehicle in (view.other, view.ahead):
            wanted = self.jam_distance_m + np.maximum(
                0, v * self.headway_s + v * (v - vehicle.speed) / (2 * np.sqrt(a * b))
            )
            in_lane = vehicle.attended & (vehicle.lateral_gap < 0) & (vehicle.gap + vehicle.half_lengths > 0)
            ratio = wanted / np.maximum(vehicle.gap, 0.1)
            interaction = np.where(in_lane, np.maximum(interaction, ratio**2), interaction)
        wished = np.clip(a * (free - interaction), -self.max_deceleration_mps2, a)
        return np.asarray(wished, dtype=f32)
