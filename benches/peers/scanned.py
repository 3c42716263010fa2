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
    leader: jax.Array
    deceleration: jax.Array
    delay: jax.Array
    verdicts: jax.Array
    ended: jax.Array


def fuzzy(distance: jax.Array, safe: jax.Array, dangerous: jax.Array) -> jax.Array:
    """0 beyond the safe distance, 1 below the unsafe one, linear between."""
    between = (distance - safe) / (dangerous - safe)
    return jnp.where(distance >= safe, C.zero, jnp.where(distance <= dangerous, C.one, between))


def proactive(speed: jax.Array, leader: jax.Array, gap: jax.Array) -> jax.Array:
    """PFS: the leader's possible braking."""
    reaction = speed * C.tau
    lead_stop = leader * leader * C.half_inverse_lead
    safe = reaction + speed * speed * C.half_inverse_comf - lead_stop + C.margin
    dangerous = reaction + speed * speed * C.half_inverse_max - lead_stop
    return fuzzy(gap - C.margin, safe, dangerous)


def critical(speed: jax.Array, leader: jax.Array, gap: jax.Array, acceleration: jax.Array) -> jax.Array:
    """CFS: the present closing."""
    limited = jnp.maximum(acceleration, -C.b_comf)
    new_speed = speed + C.tau * limited
    dv = speed - leader
    new_dv = new_speed - leader
    new_distance = (speed + limited * C.half_tau - leader) * C.tau
    safe = new_distance + new_dv * new_dv * C.half_inverse_comf
    dangerous = new_distance + new_dv * new_dv * C.half_inverse_max
    stops = jnp.where((gap + gap) * jnp.abs(acceleration) < dv * dv, C.one, C.zero)
    closing = jnp.where(new_speed < leader, stops, fuzzy(gap, safe, dangerous))
    return jnp.where(speed <= leader, C.zero, closing)


def reg157(s: State) -> tuple[jax.Array, jax.Array | np.float32]:
    """Is this step unsafe, and how hard would the driver brake?"""
    dv = s.speed - s.leader
    threshold = jnp.abs(dv) * (dv * C.reg157_half_inverse + C.reg157_constant)
    return (dv != C.zero) & (jnp.abs(s.gap) <= threshold), C.reg157_deceleration


def fsm(s: State) -> tuple[jax.Array, jax.Array]:
    """Is this step unsafe, and how hard would the driver brake?"""
    pfs = proactive(s.speed, s.leader, s.gap)
    cfs = critical(s.speed, s.leader, s.gap, (s.speed - s.before) * C.inverse_dt)
    demand = jnp.where(cfs > C.zero, cfs * C.b_span + C.b_comf, pfs * C.b_comf)
    ramp = jnp.minimum(s.deceleration + C.jerk_per_step, C.max_deceleration)
    return (pfs > C.zero) | (cfs > C.zero), jnp.minimum(ramp, demand)


def judge(closing: jax.Array, gap: jax.Array) -> jax.Array:
    """Bits of TTC and BTN at one step."""
    counts = closing > C.zero
    ttc = counts & (jnp.maximum(gap, C.zero) < C.ttc_threshold * closing)
    room = gap - closing * C.btn_ramp_delay
    btn = counts & ((room <= C.zero) | (closing * closing > C.btn_two_a_limit * room))
    return jnp.where(ttc, TTC, 0) | jnp.where(btn, BTN, 0)


def advance(check: Callable[[State], tuple], s: State, next_leader: jax.Array) -> tuple[State, None]:
    """One step of one lane; a lane that ended stays as it is."""
    closing = s.speed - s.leader
    unsafe, braking = check(s)
    waiting = s.delay > 0
    brakes = unsafe & ~waiting
    speed = jnp.where(brakes, jnp.maximum(s.speed - braking * C.dt, C.zero), s.speed)
    contact = s.gap < C.zero
    over = contact | ((s.step >= s.horizon) & ((s.speed <= C.zero) | (closing <= C.zero)))
    at_cap = s.step + 1 >= STEP_CAP
    verdicts = s.verdicts | judge(closing, s.gap)
    verdicts |= jnp.where(contact, COLLISION | BTN, 0) | jnp.where(at_cap & ~over, CAPPED, 0)
    ended = s.ended | over | at_cap
    following = State(
        step=jnp.where(ended, s.step, s.step + 1),
        horizon=s.horizon,
        speed=speed,
        before=s.speed,
        gap=s.gap + (next_leader - speed) * C.dt,
        leader=next_leader,
        deceleration=jnp.where(brakes, braking, s.deceleration),
        delay=s.delay - (unsafe & waiting),
        verdicts=jnp.where(s.ended, s.verdicts, verdicts),
        ended=ended,
    )
    return following, None


CHECKS = {"Reg157": reg157, "FSM": fsm}


def make_scan(model: str) -> Callable[[State, jax.Array, np.ndarray, int], State]:
    """Some steps of many lanes; `leaders` is steps × cases, `case` tells the column of each lane."""
    check = CHECKS[model]

    def scan_lane(state: State, next_leaders: jax.Array) -> State:
        return jax.lax.scan(lambda s, leader: advance(check, s, leader), state, next_leaders)[0]

    def scan_lanes(state: State, leaders: jax.Array, case: jax.Array, first_step: jax.Array) -> State:
        rows = jax.lax.dynamic_slice_in_dim(leaders, first_step + 1, SCAN_STEPS)
        return jax.vmap(scan_lane, in_axes=(0, 1))(state, rows[:, case])

    return jax.jit(scan_lanes)


def initial(lanes: Lanes, model: str) -> State:
    """All lanes before their first step."""
    count = len(lanes)
    return State(
        step=np.zeros(count, np.int32),
        horizon=lanes.horizon,
        speed=lanes.ego_speed,
        before=lanes.ego_speed,
        gap=lanes.gap,
        leader=lanes.leader_speed[lanes.case, 0],
        deceleration=np.zeros(count, np.float32),
        delay=np.full(count, DELAY_STEPS[model], np.int32),
        verdicts=np.zeros(count, np.int32),
        ended=np.zeros(count, np.bool_),
    )


def take(state: State, case: np.ndarray, which: np.ndarray) -> tuple[State, np.ndarray]:
    """Those lanes, filled up with ended ones to a power of two."""
    count = max(FEWEST, 1 << (len(which) - 1).bit_length())
    filled = np.concatenate([which, np.zeros(count - len(which), which.dtype)])
    taken = State(*(np.asarray(part)[filled] for part in state))
    taken.ended[len(which) :] = True
    return taken, case[filled]


def prepare(lanes: Lanes, model: str) -> Callable[[], Result]:
    """The leaders on the device, long enough for every scan; the first call compiles."""
    scan = make_scan(model)
    steps = STEP_CAP + SCAN_STEPS + 1
    held = np.repeat(lanes.leader_speed[:, -1:], steps - lanes.leader_speed.shape[1], axis=1)
    leaders = jnp.asarray(np.concatenate([lanes.leader_speed, held], axis=1).T)

    def work() -> Result:
        result = Result(np.zeros(len(lanes), np.uint8), np.zeros(len(lanes), np.uint32))
        lane = np.arange(len(lanes))
        state, case = take(initial(lanes, model), lanes.case, lane)
        for first_step in range(0, STEP_CAP, SCAN_STEPS):
            state = scan(state, leaders, case, first_step)
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
