"""Drivers as machine code: `python compiled_driver.py`. Needs the package `numba`.

Both have the same driver in NumPy beside it, with which the engine compares them once.
"""

from __future__ import annotations

import time
from typing import Any

import lanesweep
import numpy as np
import numpy.typing as npt
from lanesweep.drivers import AHEAD, ATTENDED, EGO_SPEED, GAP, HALF_LENGTHS, IDM, LATERAL_GAP, OTHER, SPEED

f32 = np.float32


class FastIDM(IDM):
    """The IDM of `lanesweep.drivers`."""

    state_rows = 1  # the desired speed

    def __init__(self, **values: Any) -> None:
        super().__init__(**values)
        a, b = self.max_acceleration_mps2, self.comfortable_deceleration_mps2
        desired = np.nan if self.desired_speed_mps is None else self.desired_speed_mps
        self.parameters = desired, self.headway_s, a, 0.5 / np.sqrt(a * b), self.jam_distance_m, self.max_deceleration_mps2

    @staticmethod
    def compiled(lanes, stride, step, dt_s, view, state, parameters, acceleration):  # type: ignore[no-untyped-def]
        desired, headway, a, slowing = parameters[0], parameters[1], parameters[2], parameters[3]
        jam, limit, zero, least = parameters[4], parameters[5], f32(0), f32(0.1)
        if step == 0:
            for i in range(lanes):
                state[i] = view[EGO_SPEED * stride + i] if np.isnan(desired) else desired
        for i in range(lanes):
            v = view[EGO_SPEED * stride + i]
            ratio = v / max(state[i], least)
            free = f32(1) - ratio * ratio * ratio * ratio
            interaction = zero
            for vehicle in (OTHER, AHEAD):
                gap = view[(vehicle + GAP) * stride + i]
                wanted = jam + max(zero, v * headway + v * (v - view[(vehicle + SPEED) * stride + i]) * slowing)
                ratio = wanted / max(gap, least)
                beside = view[(vehicle + LATERAL_GAP) * stride + i] >= zero
                behind = gap + view[(vehicle + HALF_LENGTHS) * stride + i] <= zero
                counts = view[(vehicle + ATTENDED) * stride + i] * (f32(1) - f32(beside)) * (f32(1) - f32(behind))
                interaction = max(interaction, ratio * ratio * counts)
            acceleration[i] = min(max(a * (free - interaction), -limit), a)


class Network(lanesweep.Driver):
    """A policy with one hidden layer: braking, of speeds, gap and lateral gap."""

    may_accelerate = False

    def __init__(self, hidden: npt.NDArray[Any], output: npt.NDArray[Any]) -> None:
        # A row per unit: weights of the four inputs, then the constant.
        self.hidden, self.output = hidden.astype(f32), output.astype(f32)
        self.parameters = np.concatenate([[len(output)], self.hidden.ravel(), self.output])

    def acceleration(self, view: lanesweep.View, state: Any) -> npt.NDArray[np.float32]:
        other = view.other
        inputs = np.stack([view.ego_speed, other.speed, other.gap, other.lateral_gap, np.ones(len(view), f32)])
        found = self.output @ np.maximum(self.hidden @ inputs, 0)
        return np.where(other.attended, -np.clip(found, 0, 9), f32(0))

    @staticmethod
    def compiled(lanes, stride, step, dt_s, view, state, parameters, acceleration):  # type: ignore[no-untyped-def]
        units, zero = int(parameters[0]), f32(0)
        for i in range(lanes):
            acceleration[i] = zero
        for unit in range(units):
            first, output = 1 + 5 * unit, parameters[1 + 5 * units + unit]
            for i in range(lanes):
                sum = parameters[first] * view[EGO_SPEED * stride + i] + parameters[first + 4]
                sum += parameters[first + 1] * view[(OTHER + SPEED) * stride + i]
                sum += parameters[first + 2] * view[(OTHER + GAP) * stride + i]
                sum += parameters[first + 3] * view[(OTHER + LATERAL_GAP) * stride + i]
                acceleration[i] += output * max(sum, zero)
        for i in range(lanes):
            found = min(max(acceleration[i], zero), f32(9))
            acceleration[i] = -found * view[(OTHER + ATTENDED) * stride + i]


def policy() -> Network:
    """Weights by hand, and 30 units of noise: it brakes for what is slower, near and in the lane."""
    noise = 0.01 * np.random.default_rng(1).standard_normal((30, 6))
    brakes = np.array([[0.5, -0.5, -0.1, -2.0, 0.0]])
    return Network(np.concatenate([brakes, noise[:, :5]]), np.concatenate([[1.0], noise[:, 5]]))


def main() -> None:
    """Compare drivers on cut-ins, and count their steps."""
    rng = np.random.default_rng(1)
    cases = {
        "ego_speed_mps": rng.uniform(15, 40, 20_000),
        "speed_mps": rng.uniform(10, 35, 20_000),
        "gap": rng.uniform(2, 80, 20_000),
        "lateral_speed": rng.uniform(0.3, 2.5, 20_000),
    }
    in_numpy = policy()
    in_numpy.compiled = None
    for name, driver in (("IDM, NumPy", IDM()), ("IDM", FastIDM()), ("network, NumPy", in_numpy), ("network", policy())):
        lanesweep.simulate({key: values[:10] for key, values in cases.items()}, category="cut-in", models=[driver])
        start = time.process_time()
        frame = lanesweep.simulate(cases, category="cut-in", models=[driver], backend="cpu")
        seconds = time.process_time() - start
        steps = (np.asarray(frame["end_s"]) / lanesweep.profile("paper")["frame"]["dt_s"] + 1).sum()
        print(f"{name}: {frame['collision'].mean():.3f} of the cases collide; {steps / seconds / 1e6:.1f} million lane-steps per CPU second")


if __name__ == "__main__":
    main()
