"""numba: one compiled loop per lane, binary32, one thread."""

from __future__ import annotations

from collections.abc import Callable

import numba
import numpy as np
from numpy.typing import NDArray

from lanes import BTN, CAPPED, COLLISION, DELAY_STEPS, STEP_CAP, TTC, Constants, Floats, Lanes, Result

# A number of a lane.
F = np.float32

# Compile-time constants of the functions below. Literals would be binary64 and make a step binary64.
C = Constants().rounded()

# error_model="numpy": no test of every divisor. No fastmath: it would change results.
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
def proactive(speed: F, leader: F, gap: F) -> F:
    """PFS: the leader's possible braking."""
    reaction = speed * C.tau
    lead_stop = leader * leader * C.half_inverse_lead
    safe = reaction + speed * speed * C.half_inverse_comf - lead_stop + C.margin
    dangerous = reaction + speed * speed * C.half_inverse_max - lead_stop
    return fuzzy(gap - C.margin, safe, dangerous)


@inlined
def critical(speed: F, leader: F, gap: F, acceleration: F) -> F:
    """CFS: the present closing."""
    if speed <= leader:
        return C.zero
    limited = max(acceleration, -C.b_comf)
    new_speed = speed + C.tau * limited
    if new_speed < leader:
        dv = speed - leader
        return C.one if (gap + gap) * abs(acceleration) < dv * dv else C.zero
    new_dv = new_speed - leader
    new_distance = (speed + limited * C.half_tau - leader) * C.tau
    safe = new_distance + new_dv * new_dv * C.half_inverse_comf
    dangerous = new_distance + new_dv * new_dv * C.half_inverse_max
    return fuzzy(gap, safe, dangerous)


@inlined
def reg157(speed: F, before: F, leader: F, gap: F, deceleration: F) -> tuple[bool, F]:
    """Is this step unsafe, and how hard would the driver brake?"""
    dv = speed - leader
    unsafe = dv != C.zero and abs(gap) <= abs(dv) * (dv * C.reg157_half_inverse + C.reg157_constant)
    return unsafe, C.reg157_deceleration


@inlined
def fsm(speed: F, before: F, leader: F, gap: F, deceleration: F) -> tuple[bool, F]:
    """Is this step unsafe, and how hard would the driver brake?"""
    pfs = proactive(speed, leader, gap)
    cfs = critical(speed, leader, gap, (speed - before) * C.inverse_dt)
    demand = cfs * C.b_span + C.b_comf if cfs > C.zero else pfs * C.b_comf
    ramp = min(deceleration + C.jerk_per_step, C.max_deceleration)
    return pfs > C.zero or cfs > C.zero, min(ramp, demand)


def make_sweep(check: Callable[..., tuple[bool, F]], delay_steps: int) -> Callable[..., None]:
    """The sweep of one model: a driver's check is a constant of the compiled function."""

    @inlined
    def simulate(speed: F, gap: F, leaders: Floats, horizon: int) -> tuple[int, int]:
        """One lane: verdict bits and last step."""
        verdicts = 0
        before = speed
        deceleration = C.zero
        delay = delay_steps
        last = len(leaders) - 1
        leader = leaders[0]
        step = 0
        while True:
            closing = speed - leader
            if closing > C.zero:
                if max(gap, C.zero) < C.ttc_threshold * closing:
                    verdicts |= TTC
                room = gap - closing * C.btn_ramp_delay
                if room <= C.zero or closing * closing > C.btn_two_a_limit * room:
                    verdicts |= BTN
            unsafe, braking = check(speed, before, leader, gap, deceleration)
            next_speed = speed
            if unsafe:
                if delay > 0:
                    delay -= 1
                else:
                    deceleration = braking
                    next_speed = max(speed - braking * C.dt, C.zero)
            if gap < C.zero:
                verdicts |= COLLISION | BTN
                break
            if step >= horizon and (speed <= C.zero or closing <= C.zero):
                break
            if step + 1 >= STEP_CAP:
                verdicts |= CAPPED
                break
            step += 1
            before = speed
            speed = next_speed
            leader = leaders[min(step, last)]
            gap += (leader - speed) * C.dt
        return verdicts, step

    @compiled
    def sweep(
        case: NDArray[np.int32],
        speed: Floats,
        gap: Floats,
        horizon: NDArray[np.int32],
        leader_speed: Floats,
        verdicts: NDArray[np.uint8],
        end_step: NDArray[np.uint32],
    ) -> None:
        """All lanes; the last two arrays take the results."""
        for lane in range(len(case)):
            leaders = leader_speed[case[lane]]
            verdicts[lane], end_step[lane] = simulate(speed[lane], gap[lane], leaders, horizon[lane])

    return sweep


CHECKS = {"Reg157": reg157, "FSM": fsm}


def prepare(lanes: Lanes, model: str) -> Callable[[], Result]:
    """The arrays as they are; the first call compiles."""
    sweep = make_sweep(CHECKS[model], DELAY_STEPS[model])

    def work() -> Result:
        result = Result(np.zeros(len(lanes), np.uint8), np.zeros(len(lanes), np.uint32))
        sweep(
            lanes.case,
            lanes.ego_speed,
            lanes.gap,
            lanes.horizon,
            lanes.leader_speed,
            result.verdicts,
            result.end_step,
        )
        return result

    return work
