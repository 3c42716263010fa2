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

    lane: NDArray[np.intp]
    case: NDArray[np.intp]
    horizon: NDArray[np.int32]
    speed: Floats
    before: Floats
    gap: Floats
    deceleration: Floats
    delay: NDArray[np.int32]
    verdicts: NDArray[np.uint8]
    running: NDArray[np.bool_]
    # Of the vehicles that cut out; empty where there are none.
    cutter_gap: Floats
    half_lengths: Floats
    half_widths: Floats
    ego_width: Floats

    def compact(self) -> None:
        """Takes the lanes out that have ended."""
        keep = self.running
        for field in fields(self):
            numbers = getattr(self, field.name)
            if len(numbers) > 0:
                setattr(self, field.name, numbers[keep])


class Reg157:
    """UN R157, 5.2.5.2: full braking once the TTC falls below what 6 m/s² and 0.35 s need."""

    delay = DELAY_STEPS["Reg157"]

    def demand(self, s: State, other: Floats, gap: Floats) -> Floats:
        """How hard each lane's driver would brake for a vehicle; 0 is safe."""
        dv = s.speed - other
        threshold = np.abs(dv) * (dv * C.reg157_half_inverse + C.reg157_constant)
        unsafe = (dv != C.zero) & (np.abs(gap) <= threshold)
        return unsafe * C.reg157_deceleration

    def looks_at(self, lateral_gap: Floats, towards: Floats, closing: Floats, passing: Floats) -> NDArray[np.bool_]:
        """Is a vehicle near enough across the road?"""
        return lateral_gap <= C.reg157_gate

    def limited(self, s: State, demand: Floats) -> Floats:
        """The deceleration of this step."""
        return demand


class Fsm:
    """Fuzzy Safety Model: proactive and critical surrogate tell how hard to brake."""

    delay = DELAY_STEPS["FSM"]

    def demand(self, s: State, other: Floats, gap: Floats) -> Floats:
        """How hard each lane's driver would brake for a vehicle; 0 is safe."""
        pfs = proactive(s.speed, other, gap)
        cfs = critical(s.speed, other, gap, (s.speed - s.before) * C.inverse_dt)
        return np.where(cfs > C.zero, cfs * C.b_span + C.b_comf, pfs * C.b_comf)

    def looks_at(self, lateral_gap: Floats, towards: Floats, closing: Floats, passing: Floats) -> NDArray[np.bool_]:
        """Is a vehicle in the way, or will it be before the ego has passed it?"""
        soon = lateral_gap * closing <= towards * (passing + C.gate_margin * closing)
        comes = (towards > C.zero) & (closing >= C.zero) & ((closing == C.zero) | soon)
        return (lateral_gap <= C.zero) | comes

    def limited(self, s: State, demand: Floats) -> Floats:
        """The deceleration of this step: more only with the jerk, less at once."""
        return np.minimum(np.minimum(s.deceleration + C.jerk_per_step, C.max_deceleration), demand)


def fuzzy(distance: Floats, safe: Floats, dangerous: Floats) -> Floats:
    """0 beyond the safe distance, 1 below the unsafe one, linear between."""
    between = (distance - safe) / (dangerous - safe)
    return np.where(distance >= safe, C.zero, np.where(distance <= dangerous, C.one, between))


def proactive(speed: Floats, other: Floats, gap: Floats) -> Floats:
    """PFS: the other vehicle's possible braking."""
    reaction = speed * C.tau
    lead_stop = other * other * C.half_inverse_lead
    speed_squared = speed * speed
    safe = reaction + speed_squared * C.half_inverse_comf - lead_stop + C.margin
    dangerous = reaction + speed_squared * C.half_inverse_max - lead_stop
    return fuzzy(gap - C.margin, safe, dangerous)


def critical(speed: Floats, other: Floats, gap: Floats, acceleration: Floats) -> Floats:
    """CFS: the present closing."""
    limited = np.maximum(acceleration, -C.b_comf)
    new_speed = speed + C.tau * limited
    dv = speed - other
    new_dv = new_speed - other
    new_distance = (speed + limited * C.half_tau - other) * C.tau
    new_dv_squared = new_dv * new_dv
    safe = new_distance + new_dv_squared * C.half_inverse_comf
    dangerous = new_distance + new_dv_squared * C.half_inverse_max
    stops = ((gap + gap) * np.abs(acceleration) < dv * dv).astype(np.float32)
    closing = np.where(new_speed < other, stops, fuzzy(gap, safe, dangerous))
    return np.where(speed <= other, C.zero, closing)


DRIVERS = {"Reg157": Reg157, "FSM": Fsm}


def judge(counts: NDArray[np.bool_], closing: Floats, gap: Floats) -> NDArray[np.uint8]:
    """Bits of TTC and BTN at one step, where a vehicle counts."""
    ttc = counts & (np.maximum(gap, C.zero) < C.ttc_threshold * closing)
    room = gap - closing * C.btn_ramp_delay
    btn = counts & ((room <= C.zero) | (closing * closing > C.btn_two_a_limit * room))
    return ttc * np.uint8(TTC) | btn * np.uint8(BTN)


def look_at_cutters(
    s: State, driver: Reg157 | Fsm, cutter: Floats, lateral: Floats, towards: Floats, demand: Floats
) -> tuple[Floats, NDArray[np.bool_], NDArray[np.bool_]]:
    """Takes the vehicles that cut out into account: demand of the nearest unsafe vehicle; whether they touch the ego;
    whether nothing can happen with them any more."""
    closing = s.speed - cutter
    lateral_gap = lateral - s.half_widths
    overlaps = lateral_gap < C.zero
    centres = s.cutter_gap + s.half_lengths
    passing = centres + s.half_lengths
    in_front = centres >= C.zero
    judged = in_front & (lateral <= s.ego_width)
    approached = closing > C.zero
    s.verdicts |= judge(judged & approached, closing, s.cutter_gap)
    seen = in_front & driver.looks_at(lateral_gap, towards, closing, passing)
    of_cutter = np.where(seen, driver.demand(s, cutter, s.cutter_gap), C.zero)
    leader_is_nearer = (demand > C.zero) & (s.gap < s.cutter_gap)
    demand = np.where((of_cutter > C.zero) & ~leader_is_nearer, of_cutter, demand)
    touched = overlaps & (s.cutter_gap < C.zero) & (passing > C.zero)
    return demand, touched, ~((judged | (in_front & overlaps)) & approached)


def sweep(lanes: Lanes, driver: Reg157 | Fsm, leaders: Floats, cutters: tuple[Floats, Floats, Floats] | None) -> Result:
    """Runs all lanes to their ends. Series are steps × cases."""
    count = len(lanes)
    result = Result(np.zeros(count, np.uint8), np.zeros(count, np.uint32))
    s = initial(lanes, driver.delay)
    last = len(leaders) - 1
    leader = leaders[0][s.case]
    for step in range(STEP_CAP):
        closing = s.speed - leader
        approached = closing > C.zero
        s.verdicts |= judge(approached, closing, s.gap)
        demand = driver.demand(s, leader, s.gap)
        contact = s.gap < C.zero
        settled = ~approached
        if cutters is not None:
            cutter, lateral, towards = (table[min(step, last)][s.case] for table in cutters)
            if step > 0:
                s.cutter_gap = s.cutter_gap + (cutter - s.speed) * C.dt
            demand, touched, calm = look_at_cutters(s, driver, cutter, lateral, towards, demand)
            contact |= touched
            settled &= calm
        over = contact | ((step >= s.horizon) & ((s.speed <= C.zero) | settled))
        capped = (~over & (step + 1 >= STEP_CAP)).astype(np.uint8)
        s.verdicts |= contact * np.uint8(COLLISION | BTN) | capped * np.uint8(CAPPED)
        ends = s.running & (over | (step + 1 >= STEP_CAP))
        if ends.any():
            result.verdicts[s.lane[ends]] = s.verdicts[ends]
            result.end_step[s.lane[ends]] = step
            s.running &= ~ends
        unsafe = demand > C.zero
        waiting = s.delay > 0
        brakes = unsafe & ~waiting
        braking = driver.limited(s, demand)
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


def initial(lanes: Lanes, delay: int) -> State:
    """All lanes before their first step."""
    count, cutters = len(lanes), lanes.cutters
    nothing = np.zeros(0, np.float32)
    return State(
        lane=np.arange(count),
        case=lanes.case.astype(np.intp),
        horizon=lanes.horizon,
        speed=lanes.ego_speed,
        before=lanes.ego_speed,
        gap=lanes.gap,
        deceleration=np.zeros(count, np.float32),
        delay=np.full(count, delay, np.int32),
        verdicts=np.zeros(count, np.uint8),
        running=np.ones(count, np.bool_),
        cutter_gap=nothing if cutters is None else cutters.gap,
        half_lengths=nothing if cutters is None else cutters.half_lengths,
        half_widths=nothing if cutters is None else cutters.half_widths,
        ego_width=nothing if cutters is None else cutters.ego_width,
    )


def prepare(lanes: Lanes, model: str) -> Callable[[], Result]:
    """Series as steps × cases, so that one step's numbers lie together."""
    leaders = np.ascontiguousarray(lanes.leader_speed.T)
    cutters = lanes.cutters
    tables = (cutters.speed, cutters.lateral, cutters.towards) if cutters is not None else ()
    series = tuple(np.ascontiguousarray(table.T) for table in tables) or None

    def work() -> Result:
        with np.errstate(divide="ignore", invalid="ignore"):
            return sweep(lanes, DRIVERS[model](), leaders, series)

    return work
