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

    def brake(self, demand: float, speed: float) -> float:
        """Speed one step later, if the driver wants to brake that hard."""
        if self.delay > 0:
            self.delay -= 1
            return speed
        self.deceleration = self.limited(demand)
        return max(speed - self.deceleration * C.dt, 0.0)


class Reg157(Driver):
    """UN R157, 5.2.5.2: full braking once the TTC falls below what 6 m/s² and 0.35 s need."""

    def __init__(self) -> None:
        super().__init__(DELAY_STEPS["Reg157"])

    def demand(self, speed: float, before: float, other: float, gap: float) -> float:
        """How hard to brake for a vehicle; 0 is safe."""
        dv = speed - other
        if dv != 0.0 and abs(gap) <= abs(dv) * (dv * C.reg157_half_inverse + C.reg157_constant):
            return C.reg157_deceleration
        return 0.0

    def looks_at(self, lateral_gap: float, towards: float, dv: float, passing: float) -> bool:
        """Is a vehicle near enough across the road?"""
        return lateral_gap <= C.reg157_gate

    def limited(self, demand: float) -> float:
        """The deceleration of this step."""
        return demand


class Fsm(Driver):
    """Fuzzy Safety Model: proactive and critical surrogate tell how hard to brake."""

    def __init__(self) -> None:
        super().__init__(DELAY_STEPS["FSM"])

    def demand(self, speed: float, before: float, other: float, gap: float) -> float:
        """How hard to brake for a vehicle; 0 is safe."""
        cfs = critical(speed, other, gap, (speed - before) * C.inverse_dt)
        if cfs > 0.0:
            return cfs * C.b_span + C.b_comf
        return proactive(speed, other, gap) * C.b_comf

    def looks_at(self, lateral_gap: float, towards: float, dv: float, passing: float) -> bool:
        """Is a vehicle in the way, or will it be before the ego has passed it?"""
        if lateral_gap <= 0.0:
            return True
        if towards <= 0.0 or dv < 0.0:
            return False
        return dv == 0.0 or lateral_gap * dv <= towards * (passing + C.gate_margin * dv)

    def limited(self, demand: float) -> float:
        """The deceleration of this step: more only with the jerk, less at once."""
        return min(self.deceleration + C.jerk_per_step, C.max_deceleration, demand)


def fuzzy(distance: float, safe: float, dangerous: float) -> float:
    """0 beyond the safe distance, 1 below the unsafe one, linear between."""
    if distance >= safe:
        return 0.0
    if distance <= dangerous:
        return 1.0
    return (distance - safe) / (dangerous - safe)


def proactive(speed: float, other: float, gap: float) -> float:
    """PFS: the other vehicle's possible braking."""
    reaction = speed * C.tau
    lead_stop = other * other * C.half_inverse_lead
    safe = reaction + speed * speed * C.half_inverse_comf - lead_stop + C.margin
    dangerous = reaction + speed * speed * C.half_inverse_max - lead_stop
    return fuzzy(gap - C.margin, safe, dangerous)


def critical(speed: float, other: float, gap: float, acceleration: float) -> float:
    """CFS: the present closing."""
    if speed <= other:
        return 0.0
    limited = max(acceleration, -C.b_comf)
    new_speed = speed + C.tau * limited
    if new_speed < other:
        dv = speed - other
        return 1.0 if (gap + gap) * abs(acceleration) < dv * dv else 0.0
    new_dv = new_speed - other
    new_distance = (speed + limited * C.half_tau - other) * C.tau
    safe = new_distance + new_dv * new_dv * C.half_inverse_comf
    dangerous = new_distance + new_dv * new_dv * C.half_inverse_max
    return fuzzy(gap, safe, dangerous)


def deceleration(driver: Reg157 | Fsm, speed: float, gap: float, horizon: int, leaders: list[float]) -> tuple[int, int]:
    """One leader deceleration: verdict bits and last step."""
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
        demand = driver.demand(speed, before, leader, gap)
        if gap < 0.0:
            return verdicts | COLLISION | BTN, step
        if step >= horizon and (speed <= 0.0 or closing <= 0.0):
            return verdicts, step
        if step + 1 >= STEP_CAP:
            return verdicts | CAPPED, step
        before = speed
        if demand > 0.0:
            speed = driver.brake(demand, speed)
        step += 1
        leader = leaders[min(step, last)]
        gap += (leader - speed) * C.dt


# Speed of the leader; of the one that cuts out: speed, distance from the middle of the lane, speed towards the ego.
Step = tuple[float, float, float, float]
# Gap; halves of the sums of lengths and widths; width of the ego.
Sizes = tuple[float, float, float, float]


def cut_out(
    driver: Reg157 | Fsm, speed: float, gap: float, horizon: int, sizes: Sizes, steps: list[Step]
) -> tuple[int, int]:
    """One cut-out: verdict bits and last step."""
    verdicts = 0
    before = speed
    last = len(steps) - 1
    cutter_gap, half_lengths, half_widths, ego_width = sizes
    leader, cutter, lateral, towards = steps[0]
    step = 0
    while True:
        closing = speed - leader
        if closing > 0.0:
            if max(gap, 0.0) < C.ttc_threshold * closing:
                verdicts |= TTC
            room = gap - closing * C.btn_ramp_delay
            if room <= 0.0 or closing * closing > C.btn_two_a_limit * room:
                verdicts |= BTN
        demand = driver.demand(speed, before, leader, gap)
        touched = gap < 0.0
        settled = closing <= 0.0
        # Once the ego has passed the one that cuts out, it looks at it no more.
        if cutter_gap + half_lengths >= 0.0:
            cutter_closing = speed - cutter
            lateral_gap = lateral - half_widths
            if cutter_closing > 0.0 and lateral <= ego_width:
                if max(cutter_gap, 0.0) < C.ttc_threshold * cutter_closing:
                    verdicts |= TTC
                room = cutter_gap - cutter_closing * C.btn_ramp_delay
                if room <= 0.0 or cutter_closing * cutter_closing > C.btn_two_a_limit * room:
                    verdicts |= BTN
            passing = cutter_gap + half_lengths + half_lengths
            if driver.looks_at(lateral_gap, towards, cutter_closing, passing):
                cutter_demand = driver.demand(speed, before, cutter, cutter_gap)
                # The nearest unsafe vehicle counts.
                if cutter_demand > 0.0 and not (demand > 0.0 and gap < cutter_gap):
                    demand = cutter_demand
            if lateral <= ego_width or lateral_gap < 0.0:
                settled = settled and cutter_closing <= 0.0
        if cutter_gap < 0.0 and cutter_gap + half_lengths + half_lengths > 0.0 and lateral < half_widths:
            touched = True
        if touched:
            return verdicts | COLLISION | BTN, step
        if step >= horizon and (speed <= 0.0 or settled):
            return verdicts, step
        if step + 1 >= STEP_CAP:
            return verdicts | CAPPED, step
        before = speed
        if demand > 0.0:
            speed = driver.brake(demand, speed)
        step += 1
        leader, cutter, lateral, towards = steps[min(step, last)]
        gap += (leader - speed) * C.dt
        cutter_gap += (cutter - speed) * C.dt


def prepare(lanes: Lanes, model: str) -> Callable[[], Result]:
    """Series and numbers as Python's own lists and floats."""
    new_driver = {"Reg157": Reg157, "FSM": Fsm}[model]
    columns = (lanes.ego_speed, lanes.gap, lanes.horizon)
    starts = list(zip(*(column.tolist() for column in columns), strict=True))
    cases = lanes.case.tolist()
    cutters = lanes.cutters
    if cutters is None:
        series = lanes.leader_speed.tolist()

        def simulate(lane: int) -> tuple[int, int]:
            return deceleration(new_driver(), *starts[lane], series[cases[lane]])
    else:
        tables = (lanes.leader_speed, cutters.speed, cutters.lateral, cutters.towards)
        # Only cases that have a lane here: a row of Python's floats is long.
        steps = {case: list(zip(*(table[case].tolist() for table in tables), strict=True)) for case in set(cases)}
        columns = (cutters.gap, cutters.half_lengths, cutters.half_widths, cutters.ego_width)
        sizes = list(zip(*(column.tolist() for column in columns), strict=True))

        def simulate(lane: int) -> tuple[int, int]:
            return cut_out(new_driver(), *starts[lane], sizes[lane], steps[cases[lane]])

    def work() -> Result:
        verdicts, ends = zip(*map(simulate, range(len(lanes))), strict=True)
        return Result(np.array(verdicts, np.uint8), np.array(ends, np.uint32))

    return work
