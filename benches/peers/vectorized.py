"""NumPy: all lanes advance together, step by step; lanes that ended are taken out now and then."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from lanes import BTN, CAPPED, COLLISION, DELAY_STEPS, STEP_CAP, TTC, Constants, Floats, Lanes, Result

C = Constants().rounded()
# Steps between two looks at how many lanes have ended. Blocks of lanes that fit a cache were slower: every block
# has its own last lanes, for which a step costs as much as for thousands.
COMPACT_EVERY = 16


@dataclass
class State:
    """One entry per lane that still runs."""

    lane: NDArray[np.int64]
    case: NDArray[np.int32]
    horizon: NDArray[np.int32]
    speed: Floats
    before: Floats
    gap: Floats
    deceleration: Floats
    delay: NDArray[np.int32]
    verdicts: NDArray[np.uint8]
    running: NDArray[np.bool_]

    def compact(self) -> None:
        """Takes the lanes out that have ended."""
        keep = self.running
        for field in fields(self):
            setattr(self, field.name, getattr(self, field.name)[keep])


def reg157(s: State, leader: Floats) -> tuple[NDArray[np.bool_], Floats]:
    """Which lanes are unsafe, and how hard they brake: 6 m/s² below the TTC that 6 m/s² and 0.35 s need."""
    dv = s.speed - leader
    threshold = np.abs(dv) * (dv * C.reg157_half_inverse + C.reg157_constant)
    unsafe = (dv != C.zero) & (np.abs(s.gap) <= threshold)
    return unsafe, np.full_like(dv, C.reg157_deceleration)


def fsm(s: State, leader: Floats) -> tuple[NDArray[np.bool_], Floats]:
    """Which lanes are unsafe, and how hard they brake: proactive and critical surrogate."""
    pfs = proactive(s.speed, leader, s.gap)
    cfs = critical(s.speed, leader, s.gap, (s.speed - s.before) * C.inverse_dt)
    demand = np.where(cfs > C.zero, cfs * C.b_span + C.b_comf, pfs * C.b_comf)
    ramp = np.minimum(s.deceleration + C.jerk_per_step, C.max_deceleration)
    return (pfs > C.zero) | (cfs > C.zero), np.minimum(ramp, demand)


def fuzzy(distance: Floats, safe: Floats, dangerous: Floats) -> Floats:
    """0 beyond the safe distance, 1 below the unsafe one, linear between."""
    between = (distance - safe) / (dangerous - safe)
    return np.where(distance >= safe, C.zero, np.where(distance <= dangerous, C.one, between))


def proactive(speed: Floats, leader: Floats, gap: Floats) -> Floats:
    """PFS: the leader's possible braking."""
    reaction = speed * C.tau
    lead_stop = leader * leader * C.half_inverse_lead
    speed_squared = speed * speed
    safe = reaction + speed_squared * C.half_inverse_comf - lead_stop + C.margin
    dangerous = reaction + speed_squared * C.half_inverse_max - lead_stop
    return fuzzy(gap - C.margin, safe, dangerous)


def critical(speed: Floats, leader: Floats, gap: Floats, acceleration: Floats) -> Floats:
    """CFS: the present closing."""
    limited = np.maximum(acceleration, -C.b_comf)
    new_speed = speed + C.tau * limited
    dv = speed - leader
    new_dv = new_speed - leader
    new_distance = (speed + limited * C.half_tau - leader) * C.tau
    new_dv_squared = new_dv * new_dv
    safe = new_distance + new_dv_squared * C.half_inverse_comf
    dangerous = new_distance + new_dv_squared * C.half_inverse_max
    stops = ((gap + gap) * np.abs(acceleration) < dv * dv).astype(np.float32)
    closing = np.where(new_speed < leader, stops, fuzzy(gap, safe, dangerous))
    return np.where(speed <= leader, C.zero, closing)


CHECKS = {"Reg157": reg157, "FSM": fsm}


def judge(closing: Floats, gap: Floats) -> NDArray[np.uint8]:
    """Bits of TTC and BTN at one step."""
    counts = closing > C.zero
    ttc = counts & (np.maximum(gap, C.zero) < C.ttc_threshold * closing)
    room = gap - closing * C.btn_ramp_delay
    btn = counts & ((room <= C.zero) | (closing * closing > C.btn_two_a_limit * room))
    return ttc * np.uint8(TTC) | btn * np.uint8(BTN)


def sweep(lanes: Lanes, model: str, leaders: Floats) -> Result:
    """Runs all lanes to their ends. `leaders` is steps × cases."""
    check = CHECKS[model]
    count = len(lanes)
    result = Result(np.zeros(count, np.uint8), np.zeros(count, np.uint32))
    s = State(
        lane=np.arange(count),
        case=lanes.case,
        horizon=lanes.horizon,
        speed=lanes.ego_speed,
        before=lanes.ego_speed,
        gap=lanes.gap,
        deceleration=np.zeros(count, np.float32),
        delay=np.full(count, DELAY_STEPS[model], np.int32),
        verdicts=np.zeros(count, np.uint8),
        running=np.ones(count, np.bool_),
    )
    last = len(leaders) - 1
    leader = leaders[0][s.case]
    for step in range(STEP_CAP):
        closing = s.speed - leader
        s.verdicts |= judge(closing, s.gap)
        unsafe, braking = check(s, leader)
        contact = s.gap < C.zero
        over = contact | ((step >= s.horizon) & ((s.speed <= C.zero) | (closing <= C.zero)))
        capped = (~over & (step + 1 >= STEP_CAP)).astype(np.uint8)
        s.verdicts |= contact * np.uint8(COLLISION | BTN) | capped * np.uint8(CAPPED)
        ends = s.running & (over | (step + 1 >= STEP_CAP))
        if ends.any():
            result.verdicts[s.lane[ends]] = s.verdicts[ends]
            result.end_step[s.lane[ends]] = step
            s.running &= ~ends
        waiting = s.delay > 0
        brakes = unsafe & ~waiting
        s.before = s.speed
        s.speed = np.where(brakes, np.maximum(s.speed - braking * C.dt, C.zero), s.speed)
        s.deceleration = np.where(brakes, braking, s.deceleration)
        s.delay = s.delay - (unsafe & waiting)
        if step % COMPACT_EVERY == COMPACT_EVERY - 1:
            left = np.count_nonzero(s.running)
            if left == 0:
                break
            if left < 0.9 * len(s.running):
                s.compact()
        leader = leaders[min(step + 1, last)][s.case]
        s.gap = s.gap + (leader - s.speed) * C.dt
    return result


def prepare(lanes: Lanes, model: str) -> Callable[[], Result]:
    """Leaders as steps × cases, so that one step's speeds lie together."""
    leaders = np.ascontiguousarray(lanes.leader_speed.T)

    def work() -> Result:
        with np.errstate(divide="ignore", invalid="ignore"):
            return sweep(lanes, model, leaders)

    return work
