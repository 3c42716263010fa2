"""Plain Python: one lane after the other, Python's own floats (binary64)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lanes import BTN, CAPPED, COLLISION, DELAY_STEPS, STEP_CAP, TTC, Constants, Lanes, Result

C = Constants()


class Driver:
    """Latched state of the ego's driver: the reaction time is paid once, the deceleration is kept."""

    def __init__(self, delay: int) -> None:
        self.delay = delay
        self.deceleration = 0.0

    def brake(self, deceleration: float, speed: float) -> float:
        """Next speed after an unsafe step."""
        if self.delay > 0:
            self.delay -= 1
            return speed
        self.deceleration = deceleration
        return max(speed - deceleration * C.dt, 0.0)


class Reg157(Driver):
    """UN R157, 5.2.5.2: full braking once the TTC falls below what 6 m/s² and 0.35 s need."""

    def __init__(self) -> None:
        super().__init__(DELAY_STEPS["Reg157"])

    def next_speed(self, speed: float, before: float, leader: float, gap: float) -> float:
        """One step of the ego."""
        dv = speed - leader
        if dv != 0.0 and abs(gap) <= abs(dv) * (dv * C.reg157_half_inverse + C.reg157_constant):
            return self.brake(C.reg157_deceleration, speed)
        return speed


class Fsm(Driver):
    """Fuzzy Safety Model: proactive and critical surrogate tell how hard to brake."""

    def __init__(self) -> None:
        super().__init__(DELAY_STEPS["FSM"])

    def next_speed(self, speed: float, before: float, leader: float, gap: float) -> float:
        """One step of the ego."""
        pfs = proactive(speed, leader, gap)
        cfs = critical(speed, leader, gap, (speed - before) * C.inverse_dt)
        if pfs <= 0.0 and cfs <= 0.0:
            return speed
        demand = cfs * C.b_span + C.b_comf if cfs > 0.0 else pfs * C.b_comf
        ramp = min(self.deceleration + C.jerk_per_step, C.max_deceleration)
        return self.brake(min(ramp, demand), speed)


def fuzzy(distance: float, safe: float, dangerous: float) -> float:
    """0 beyond the safe distance, 1 below the unsafe one, linear between."""
    if distance >= safe:
        return 0.0
    if distance <= dangerous:
        return 1.0
    return (distance - safe) / (dangerous - safe)


def proactive(speed: float, leader: float, gap: float) -> float:
    """PFS: the leader's possible braking."""
    reaction = speed * C.tau
    lead_stop = leader * leader * C.half_inverse_lead
    safe = reaction + speed * speed * C.half_inverse_comf - lead_stop + C.margin
    dangerous = reaction + speed * speed * C.half_inverse_max - lead_stop
    return fuzzy(gap - C.margin, safe, dangerous)


def critical(speed: float, leader: float, gap: float, acceleration: float) -> float:
    """CFS: the present closing."""
    if speed <= leader:
        return 0.0
    limited = max(acceleration, -C.b_comf)
    new_speed = speed + C.tau * limited
    if new_speed < leader:
        dv = speed - leader
        return 1.0 if (gap + gap) * abs(acceleration) < dv * dv else 0.0
    new_dv = new_speed - leader
    new_distance = (speed + limited * C.half_tau - leader) * C.tau
    safe = new_distance + new_dv * new_dv * C.half_inverse_comf
    dangerous = new_distance + new_dv * new_dv * C.half_inverse_max
    return fuzzy(gap, safe, dangerous)


def simulate(driver: Reg157 | Fsm, speed: float, gap: float, leaders: list[float], horizon: int) -> tuple[int, int]:
    """One lane: verdict bits and last step."""
    verdicts = 0
    before = speed
    last = len(leaders) - 1
    leader = leaders[0]
    step = 0
    while True:
        closing = speed - leader
        if closing > 0.0:
            if max(gap, 0.0) < C.ttc_threshold * closing:
                verdicts |= TTC
            room = gap - closing * C.btn_ramp_delay
            if room <= 0.0 or closing * closing > C.btn_two_a_limit * room:
                verdicts |= BTN
        next_speed = driver.next_speed(speed, before, leader, gap)
        if gap < 0.0:
            return verdicts | COLLISION | BTN, step
        if step >= horizon and (speed <= 0.0 or closing <= 0.0):
            return verdicts, step
        if step + 1 >= STEP_CAP:
            return verdicts | CAPPED, step
        step += 1
        before, speed = speed, next_speed
        leader = leaders[min(step, last)]
        gap += (leader - speed) * C.dt


def prepare(lanes: Lanes, model: str) -> Callable[[], Result]:
    """Series and numbers as Python's own lists and floats."""
    series = lanes.leader_speed.tolist()
    columns = (lanes.case, lanes.ego_speed, lanes.gap, lanes.horizon)
    numbers = list(zip(*(column.tolist() for column in columns), strict=True))
    new_driver = {"Reg157": Reg157, "FSM": Fsm}[model]

    def work() -> Result:
        ends = [simulate(new_driver(), speed, gap, series[case], horizon) for case, speed, gap, horizon in numbers]
        verdicts, steps = zip(*ends, strict=True)
        return Result(np.array(verdicts, np.uint8), np.array(steps, np.uint32))

    return work
