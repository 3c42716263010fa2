"""JAX on the CPU: a scan over the steps of one lane, mapped over lanes, compiled by XLA.

A scan has a fixed length, so a sweep is made of short ones: after each, the host takes out the lanes that ended
once fewer than half are left. Numbers of lanes are powers of two: XLA compiles once per number.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from lanes import BTN, CAPPED, COLLISION, DELAY_STEPS, STEP_CAP, TTC, Constants, Lanes, Result

C = Constants().rounded()
# Steps of one scan. 64 and 128 were as fast or slower; so was unrolling.
SCAN_STEPS = 32
# Fewer lanes than this are not taken apart any more.
FEWEST = 256


class State(NamedTuple):
    """A lane between two steps."""

    step: jax.Array
    horizon: jax.Array
    speed: jax.Array
    before: jax.Array
    gap: jax.Array
    deceleration: jax.Array
    delay: jax.Array
    verdicts: jax.Array
    ended: jax.Array
    # Of the vehicle that cuts out; None where there is none.
    cutter_gap: jax.Array | None
    half_lengths: jax.Array | None
    half_widths: jax.Array | None
    ego_width: jax.Array | None


class Row(NamedTuple):
    """The other vehicles at one step."""

    leader: jax.Array
    # Of the vehicle that cuts out: speed, distance from the middle of the lane, speed towards the ego.
    cutter: jax.Array | None = None
    lateral: jax.Array | None = None
    towards: jax.Array | None = None


def fuzzy(distance: jax.Array, safe: jax.Array, dangerous: jax.Array) -> jax.Array:
    """0 beyond the safe distance, 1 below the unsafe one, linear between."""
    between = (distance - safe) / (dangerous - safe)
    return jnp.where(distance >= safe, C.zero, jnp.where(distance <= dangerous, C.one, between))


def proactive(speed: jax.Array, other: jax.Array, gap: jax.Array) -> jax.Array:
    """PFS: the other vehicle's possible braking."""
    reaction = speed * C.tau
    lead_stop = other * other * C.half_inverse_lead
    safe = reaction + speed * speed * C.half_inverse_comf - lead_stop + C.margin
    dangerous = reaction + speed * speed * C.half_inverse_max - lead_stop
    return fuzzy(gap - C.margin, safe, dangerous)


def critical(speed: jax.Array, other: jax.Array, gap: jax.Array, acceleration: jax.Array) -> jax.Array:
    """CFS: the present closing."""
    limited = jnp.maximum(acceleration, -C.b_comf)
    new_speed = speed + C.tau * limited
    dv = speed - other
    new_dv = new_speed - other
    new_distance = (speed + limited * C.half_tau - other) * C.tau
    safe = new_distance + new_dv * new_dv * C.half_inverse_comf
    dangerous = new_distance + new_dv * new_dv * C.half_inverse_max
    stops = jnp.where((gap + gap) * jnp.abs(acceleration) < dv * dv, C.one, C.zero)
    closing = jnp.where(new_speed < other, stops, fuzzy(gap, safe, dangerous))
    return jnp.where(speed <= other, C.zero, closing)


class Reg157:
    """UN R157, 5.2.5.2: full braking once the TTC falls below what 6 m/s² and 0.35 s need."""

    delay = DELAY_STEPS["Reg157"]

    def demand(self, s: State, other: jax.Array, gap: jax.Array) -> jax.Array:
        """How hard to brake for a vehicle; 0 is safe."""
        dv = s.speed - other
        threshold = jnp.abs(dv) * (dv * C.reg157_half_inverse + C.reg157_constant)
        return jnp.where((dv != C.zero) & (jnp.abs(gap) <= threshold), C.reg157_deceleration, C.zero)

    def looks_at(self, lateral_gap: jax.Array, towards: jax.Array, dv: jax.Array, passing: jax.Array) -> jax.Array:
        """Is a vehicle near enough across the road?"""
        return lateral_gap <= C.reg157_gate

    def limited(self, s: State, demand: jax.Array) -> jax.Array:
        """The deceleration of this step."""
        return demand


class Fsm:
    """Fuzzy Safety Model: proactive and critical surrogate tell how hard to brake."""

    delay = DELAY_STEPS["FSM"]

    def demand(self, s: State, other: jax.Array, gap: jax.Array) -> jax.Array:
        """How hard to brake for a vehicle; 0 is safe."""
        pfs = proactive(s.speed, other, gap)
        cfs = critical(s.speed, other, gap, (s.speed - s.before) * C.inverse_dt)
        return jnp.where(cfs > C.zero, cfs * C.b_span + C.b_comf, pfs * C.b_comf)

    def looks_at(self, lateral_gap: jax.Array, towards: jax.Array, dv: jax.Array, passing: jax.Array) -> jax.Array:
        """Is a vehicle in the way, or will it be before the ego has passed it?"""
        soon = lateral_gap * dv <= towards * (passing + C.gate_margin * dv)
        comes = (towards > C.zero) & (dv >= C.zero) & ((dv == C.zero) | soon)
        return (lateral_gap <= C.zero) | comes

    def limited(self, s: State, demand: jax.Array) -> jax.Array:
        """The deceleration of this step: more only with the jerk, less at once."""
        return jnp.minimum(jnp.minimum(s.deceleration + C.jerk_per_step, C.max_deceleration), demand)


DRIVERS = {"Reg157": Reg157, "FSM": Fsm}


def judge(counts: jax.Array, closing: jax.Array, gap: jax.Array) -> jax.Array:
    """Bits of TTC and BTN at one step, where a vehicle counts."""
    ttc = counts & (jnp.maximum(gap, C.zero) < C.ttc_threshold * closing)
    room = gap - closing * C.btn_ramp_delay
    btn = counts & ((room <= C.zero) | (closing * closing > C.btn_two_a_limit * room))
    return jnp.where(ttc, TTC, 0) | jnp.where(btn, BTN, 0)


def advance(driver: Reg157 | Fsm, s: State, row: Row) -> tuple[State, None]:
    """One step of one lane; a lane that ended keeps its step and verdicts."""
    moves = s.step > 0
    gap = jnp.where(moves, s.gap + (row.leader - s.speed) * C.dt, s.gap)
    closing = s.speed - row.leader
    approached = closing > C.zero
    verdicts = s.verdicts | judge(approached, closing, gap)
    demand = driver.demand(s, row.leader, gap)
    contact = gap < C.zero
    settled = ~approached
    cutter_gap = s.cutter_gap
    if cutter_gap is not None:
        cutter_gap = jnp.where(moves, cutter_gap + (row.cutter - s.speed) * C.dt, cutter_gap)
        closing = s.speed - row.cutter
        approached = closing > C.zero
        lateral_gap = row.lateral - s.half_widths
        overlaps = lateral_gap < C.zero
        centres = cutter_gap + s.half_lengths
        passing = centres + s.half_lengths
        in_front = centres >= C.zero
        judged = in_front & (row.lateral <= s.ego_width)
        verdicts |= judge(judged & approached, closing, cutter_gap)
        seen = in_front & driver.looks_at(lateral_gap, row.towards, closing, passing)
        of_cutter = jnp.where(seen, driver.demand(s, row.cutter, cutter_gap), C.zero)
        # The nearest unsafe vehicle counts.
        leader_is_nearer = (demand > C.zero) & (gap < cutter_gap)
        demand = jnp.where((of_cutter > C.zero) & ~leader_is_nearer, of_cutter, demand)
        contact |= overlaps & (cutter_gap < C.zero) & (passing > C.zero)
        settled &= ~((judged | (in_front & overlaps)) & approached)
    unsafe = demand > C.zero
    waiting = s.delay > 0
    brakes = unsafe & ~waiting
    braking = driver.limited(s, demand)
    over = contact | ((s.step >= s.horizon) & ((s.speed <= C.zero) | settled))
    at_cap = s.step + 1 >= STEP_CAP
    verdicts |= jnp.where(contact, COLLISION | BTN, 0) | jnp.where(at_cap & ~over, CAPPED, 0)
    ended = s.ended | over | at_cap
    following = s._replace(
        step=jnp.where(ended, s.step, s.step + 1),
        speed=jnp.where(brakes, jnp.maximum(s.speed - braking * C.dt, C.zero), s.speed),
        before=s.speed,
        gap=gap,
        deceleration=jnp.where(brakes, braking, s.deceleration),
        delay=s.delay - (unsafe & waiting),
        verdicts=jnp.where(s.ended, s.verdicts, verdicts),
        ended=ended,
        cutter_gap=cutter_gap,
    )
    return following, None


def make_scan(driver: Reg157 | Fsm) -> Callable[[State, Row, np.ndarray, int], State]:
    """Some steps of many lanes; series are steps × cases, `case` tells the column of each lane."""

    def scan_lane(state: State, rows: Row) -> State:
        return jax.lax.scan(lambda s, row: advance(driver, s, row), state, rows)[0]

    def scan_lanes(state: State, series: Row, case: jax.Array, first_step: jax.Array) -> State:
        steps = jnp.minimum(first_step + jnp.arange(SCAN_STEPS), len(series.leader) - 1)
        rows = jax.tree.map(lambda table: table[steps][:, case], series)
        return jax.vmap(scan_lane, in_axes=(0, 1))(state, rows)

    return jax.jit(scan_lanes)


def initial(lanes: Lanes, delay: int) -> State:
    """All lanes before their first step."""
    count, cutters = len(lanes), lanes.cutters
    return State(
        step=np.zeros(count, np.int32),
        horizon=lanes.horizon,
        speed=lanes.ego_speed,
        before=lanes.ego_speed,
        gap=lanes.gap,
        deceleration=np.zeros(count, np.float32),
        delay=np.full(count, delay, np.int32),
        verdicts=np.zeros(count, np.int32),
        ended=np.zeros(count, np.bool_),
        cutter_gap=None if cutters is None else cutters.gap,
        half_lengths=None if cutters is None else cutters.half_lengths,
        half_widths=None if cutters is None else cutters.half_widths,
        ego_width=None if cutters is None else cutters.ego_width,
    )


def take(state: State, case: np.ndarray, which: np.ndarray) -> tuple[State, np.ndarray]:
    """Those lanes, filled up with ended ones to a power of two."""
    count = max(FEWEST, 1 << (len(which) - 1).bit_length())
    filled = np.concatenate([which, np.zeros(count - len(which), which.dtype)])
    taken = jax.tree.map(lambda part: np.asarray(part)[filled], state)
    taken.ended[len(which) :] = True
    return taken, case[filled]


def prepare(lanes: Lanes, model: str) -> Callable[[], Result]:
    """The series on the device; the first call compiles."""
    driver = DRIVERS[model]()
    scan = make_scan(driver)
    cutters = lanes.cutters
    tables = () if cutters is None else (cutters.speed, cutters.lateral, cutters.towards)
    series = Row(*(jnp.asarray(table.T) for table in (lanes.leader_speed, *tables)))

    def work() -> Result:
        result = Result(np.zeros(len(lanes), np.uint8), np.zeros(len(lanes), np.uint32))
        lane = np.arange(len(lanes))
        state, case = take(initial(lanes, driver.delay), lanes.case, lane)
        for first_step in range(0, STEP_CAP, SCAN_STEPS):
            state = scan(state, series, case, first_step)
            running = np.flatnonzero(~np.asarray(state.ended))
            if len(running) > len(case) // 2:
                continue
            if len(running) > 0 and len(case) == FEWEST:
                continue
            # Ended lanes are written out when they are dropped.
            result.verdicts[lane] = np.asarray(state.verdicts)[: len(lane)]
            result.end_step[lane] = np.asarray(state.step)[: len(lane)]
            if len(running) == 0:
                break
            lane = lane[running]
            state, case = take(state, case, running)
        return result

    return work
