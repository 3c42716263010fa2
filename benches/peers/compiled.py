"""numba: one compiled loop per lane, binary32, one thread."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from lanes import BTN, CAPPED, COLLISION, DELAY_STEPS, STEP_CAP, TTC, Constants, Floats, Lanes, Result

# A number of a lane.
F = np.float32

# Compile-time constants of the functions below. Literals would be binary64 and make a step binary64.
C = Constants().rounded()

# error_model="numpy": no test of every divisor. No fastmath: it would change results. `on_cuda` needs functions of a device.
if "LANES_ON_CUDA" in os.environ:
    from numba import cuda

    inlined = cuda.jit(device=True, inline="always", fastmath=False)
else:
    inlined = numba.njit(error_model="numpy", inline="always")
compiled = numba.njit(error_model="numpy", parallel=False)


@inlined
def fuzzy(distance: F, safe: F, dangerous: F) -> F:
    """0 beyond the safe distance, 1 below the unsafe one, linear between."""
    if distance >= safe:
        return C.zero
    if distance <= dangerous:
        return C.one
    return (distance - safe) / (dangerous - safe)


@inlined
def proactive(speed: F, other: F, gap: F) -> F:
    """PFS: the other vehicle's possible braking."""
    reaction = speed * C.tau
    lead_stop = other * other * C.half_inverse_lead
    safe = reaction + speed * speed * C.half_inverse_comf - lead_stop + C.margin
    dangerous = reaction + speed * speed * C.half_inverse_max - lead_stop
    return fuzzy(gap - C.margin, safe, dangerous)


@inlined
def critical(speed: F, other: F, gap: F, acceleration: F) -> F:
    """CFS: the present closing."""
    if speed <= other:
        return C.zero
    limited = max(acceleration, -C.b_comf)
    new_speed = speed + C.tau * limited
    if new_speed < other:
        dv = speed - other
        return C.one if (gap + gap) * abs(acceleration) < dv * dv else C.zero
    new_dv = new_speed - other
    new_distance = (speed + limited * C.half_tau - other) * C.tau
    safe = new_distance + new_dv * new_dv * C.half_inverse_comf
    dangerous = new_distance + new_dv * new_dv * C.half_inverse_max
    return fuzzy(gap, safe, dangerous)


class Driver(NamedTuple):
    """The functions of a model."""

    # How hard to brake for a vehicle; 0 is safe.
    demand: Callable[[F, F, F, F], F]
    # Is a vehicle looked at, where it is across the road?
    looks_at: Callable[[F, F, F, F], bool]
    # The deceleration of this step.
    limited: Callable[[F, F], F]
    delay_steps: int


@inlined
def reg157_demand(speed: F, before: F, other: F, gap: F) -> F:
    """Full braking once the TTC falls below what 6 m/s² and 0.35 s need."""
    dv = speed - other
    unsafe = dv != C.zero and abs(gap) <= abs(dv) * (dv * C.reg157_half_inverse + C.reg157_constant)
    return C.reg157_deceleration if unsafe else C.zero


@inlined
def reg157_looks_at(lateral_gap: F, towards: F, dv: F, passing: F) -> bool:
    """Near enough across the road?"""
    return lateral_gap <= C.reg157_gate


@inlined
def reg157_limited(deceleration: F, demand: F) -> F:
    """At once."""
    return demand


@inlined
def fsm_demand(speed: F, before: F, other: F, gap: F) -> F:
    """Proactive and critical surrogate tell how hard to brake."""
    cfs = critical(speed, other, gap, (speed - before) * C.inverse_dt)
    if cfs > C.zero:
        return cfs * C.b_span + C.b_comf
    return proactive(speed, other, gap) * C.b_comf


@inlined
def fsm_looks_at(lateral_gap: F, towards: F, dv: F, passing: F) -> bool:
    """In the way, or will it be before the ego has passed it?"""
    if lateral_gap <= C.zero:
        return True
    if towards <= C.zero or dv < C.zero:
        return False
    return dv == C.zero or lateral_gap * dv <= towards * (passing + C.gate_margin * dv)


@inlined
def fsm_limited(deceleration: F, demand: F) -> F:
    """More only with the jerk, less at once."""
    return min(min(deceleration + C.jerk_per_step, C.max_deceleration), demand)


DRIVERS = {
    "Reg157": Driver(reg157_demand, reg157_looks_at, reg157_limited, DELAY_STEPS["Reg157"]),
    "FSM": Driver(fsm_demand, fsm_looks_at, fsm_limited, DELAY_STEPS["FSM"]),
}


@inlined
def judge(closing: F, gap: F) -> int:
    """Bits of TTC and BTN at one step."""
    verdicts = 0
    if closing > C.zero:
        if max(gap, C.zero) < C.ttc_threshold * closing:
            verdicts |= TTC
        room = gap - closing * C.btn_ramp_delay
        if room <= C.zero or closing * closing > C.btn_two_a_limit * room:
            verdicts |= BTN
    return verdicts


def make_lane(driver: Driver, cuts_out: bool) -> Callable[..., tuple[int, int]]:
    """One lane of one model in one category: both are constants of the compiled function."""
    demand_of, looks_at, limited, delay_steps = driver

    @inlined
    def run_lane(
        lane: int,
        case: NDArray[np.int32],
        ego_speed: Floats,
        start_gap: Floats,
        horizon: NDArray[np.int32],
        leader_speed: Floats,
        cutter_start_gap: Floats,
        cutter_half_lengths: Floats,
        cutter_half_widths: Floats,
        width: Floats,
        cutter_speed: Floats,
        cutter_lateral: Floats,
        cutter_towards: Floats,
    ) -> tuple[int, int]:
        """Verdict bits and the last step."""
        last = leader_speed.shape[1] - 1
        of = case[lane]
        speed, before, gap = ego_speed[lane], ego_speed[lane], start_gap[lane]
        if cuts_out:
            cutter_gap, half_lengths = cutter_start_gap[lane], cutter_half_lengths[lane]
            half_widths, ego_width = cutter_half_widths[lane], width[lane]
        verdicts = 0
        deceleration = C.zero
        delay = delay_steps
        step = 0
        while True:
            at = min(step, last)
            leader = leader_speed[of, at]
            if cuts_out:
                cutter = cutter_speed[of, at]
            if step > 0:
                gap += (leader - speed) * C.dt
                if cuts_out:
                    cutter_gap += (cutter - speed) * C.dt
            closing = speed - leader
            verdicts |= judge(closing, gap)
            demand = demand_of(speed, before, leader, gap)
            touched = gap < C.zero
            settled = closing <= C.zero
            if cuts_out:
                lateral = cutter_lateral[of, at]
                lateral_gap = lateral - half_widths
                centres = cutter_gap + half_lengths
                passing = centres + half_lengths
                # Once the ego has passed the one that cuts out, it looks at it no more.
                if centres >= C.zero:
                    cutter_closing = speed - cutter
                    if lateral <= ego_width:
                        verdicts |= judge(cutter_closing, cutter_gap)
                    if looks_at(lateral_gap, cutter_towards[of, at], cutter_closing, passing):
                        cutter_demand = demand_of(speed, before, cutter, cutter_gap)
                        # The nearest unsafe vehicle counts.
                        if cutter_demand > C.zero and not (demand > C.zero and gap < cutter_gap):
                            demand = cutter_demand
                    if lateral <= ego_width or lateral_gap < C.zero:
                        settled = settled and cutter_closing <= C.zero
                touched = touched or (lateral_gap < C.zero and cutter_gap < C.zero and passing > C.zero)
            if touched:
                verdicts |= COLLISION | BTN
                break
            if step >= horizon[lane] and (speed <= C.zero or settled):
                break
            if step + 1 >= STEP_CAP:
                verdicts |= CAPPED
                break
            before = speed
            if demand > C.zero:
                if delay > 0:
                    delay -= 1
                else:
                    deceleration = limited(deceleration, demand)
                    speed = max(speed - deceleration * C.dt, C.zero)
            step += 1
        return verdicts, step

    return run_lane


def make_sweep(driver: Driver, cuts_out: bool) -> Callable[..., None]:
    """The sweep of one model in one category, lane by lane."""
    run_lane = make_lane(driver, cuts_out)

    # numba inlines no call with *arguments.
    @compiled
    def sweep(
        all_verdicts: NDArray[np.uint8],
        end_step: NDArray[np.uint32],
        case: NDArray[np.int32],
        ego_speed: Floats,
        start_gap: Floats,
        horizon: NDArray[np.int32],
        leader_speed: Floats,
        cutter_start_gap: Floats,
        cutter_half_lengths: Floats,
        cutter_half_widths: Floats,
        width: Floats,
        cutter_speed: Floats,
        cutter_lateral: Floats,
        cutter_towards: Floats,
    ) -> None:
        """All lanes; the first two arrays take the results."""
        for lane in range(len(all_verdicts)):
            all_verdicts[lane], end_step[lane] = run_lane(
                lane, case, ego_speed, start_gap, horizon, leader_speed, cutter_start_gap, cutter_half_lengths,
                cutter_half_widths, width, cutter_speed, cutter_lateral, cutter_towards,
            )

    return sweep


def arrays_of(lanes: Lanes) -> tuple[NDArray[np.generic], ...]:
    """The arguments of a lane. Where nothing cuts out, arrays that nobody looks at."""
    cutters = lanes.cutters
    unused = (lanes.gap,) * 4 + (lanes.leader_speed,) * 3
    of_cutters = unused if cutters is None else (
        cutters.gap,
        cutters.half_lengths,
        cutters.half_widths,
        cutters.ego_width,
        cutters.speed,
        cutters.lateral,
        cutters.towards,
    )
    return (lanes.case, lanes.ego_speed, lanes.gap, lanes.horizon, lanes.leader_speed, *of_cutters)


def prepare(lanes: Lanes, model: str) -> Callable[[], Result]:
    """The arrays as they are; the first call compiles."""
    sweep = make_sweep(DRIVERS[model], lanes.cutters is not None)
    arrays = arrays_of(lanes)

    def work() -> Result:
        result = Result(np.zeros(len(lanes), np.uint8), np.zeros(len(lanes), np.uint32))
        sweep(result.verdicts, result.end_step, *arrays)
        return result

    return work
