"""A driver in JAX: `python driver_in_jax.py`. Needs `jax` and `pandas`.

A jitted function is compiled for one shape, and the number of running lanes shrinks. So the arrays are padded to the size of
the batch; what is computed for lanes that have ended is left out.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import lanesweep
import numpy as np
import numpy.typing as npt


@jax.jit
def decide(ego_speed: jax.Array, speed: jax.Array, gap: jax.Array, is_ahead: jax.Array) -> jax.Array:
    """Brake as hard as it takes to reach the other vehicle's speed 2 m before it, from 1 m/s² on; harder within 3 m."""
    closing = jnp.maximum(ego_speed - speed, 0.0)
    needed = closing**2 / (2 * jnp.maximum(gap - 2.0, 0.1))
    needed = jnp.where((gap < 3.0) & (closing > 0), jnp.maximum(needed, 3.0), needed)
    return jnp.where(is_ahead & (needed > 1.0), -jnp.minimum(needed, 9.0), 0.0)


class JaxDriver(lanesweep.Driver):
    """A driver whose decision is a compiled function."""

    may_accelerate = False

    def start(self, lanes: int, dt_s: float) -> int:
        return lanes

    def acceleration(self, view: lanesweep.View, state: int) -> npt.NDArray[np.float32]:
        def padded(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
            full = np.zeros(state, dtype=values.dtype)
            full[view.lane] = values
            return full

        wished = np.zeros(len(view), dtype=np.float32)
        for vehicle in (view.other, view.ahead):
            is_ahead = vehicle.attended & (vehicle.lateral_gap < 0.3) & (vehicle.gap > 0)
            found = decide(padded(view.ego_speed), padded(vehicle.speed), padded(vehicle.gap), padded(is_ahead))
            wished = np.minimum(wished, np.asarray(found)[view.lane])
        return wished


def main() -> None:
    """Compare it with two built-in drivers on cut-ins."""
    rng = np.random.default_rng(1)
    cases = {
        "ego_speed_mps": rng.uniform(20, 35, 2000),
        "speed_mps": rng.uniform(15, 30, 2000),
        "gap": rng.uniform(5, 60, 2000),
        "lateral_speed": rng.uniform(0.5, 2.0, 2000),
    }
    frame = lanesweep.simulate(cases, category="cut-in", models=["CCHDM", "FSM", JaxDriver()])
    print(frame.to_pandas().groupby("model")["collision"].mean())


if __name__ == "__main__":
    main()
