"""numba.cuda: the lane of `compiled`, one thread per lane."""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np
from numba import cuda

from lanes import Lanes, Result

# Read by `compiled`; each peer has a process of its own.
os.environ["LANES_ON_CUDA"] = "yes"
from compiled import DRIVERS, arrays_of, make_lane  # noqa: E402

THREADS = 128


def prepare(lanes: Lanes, model: str) -> Callable[[], Result]:
    """Arrays on the device; the first call compiles. A call is timed with the copy of its results."""
    run_lane = make_lane(DRIVERS[model], lanes.cutters is not None)

    # numba infers the types.
    @cuda.jit(fastmath=False)
    def sweep(  # noqa: ANN202
        all_verdicts, end_step, case, ego_speed, start_gap, horizon, leader_speed, cutter_start_gap, cutter_half_lengths,  # noqa: ANN001
        cutter_half_widths, width, cutter_speed, cutter_lateral, cutter_towards,  # noqa: ANN001
    ):
        lane = cuda.grid(1)
        if lane < all_verdicts.shape[0]:
            all_verdicts[lane], end_step[lane] = run_lane(
                lane, case, ego_speed, start_gap, horizon, leader_speed, cutter_start_gap, cutter_half_lengths,
                cutter_half_widths, width, cutter_speed, cutter_lateral, cutter_towards,
            )

    arrays = [cuda.to_device(np.ascontiguousarray(array)) for array in arrays_of(lanes)]
    verdicts = cuda.device_array(len(lanes), np.uint8)
    end_step = cuda.device_array(len(lanes), np.uint32)
    blocks = -(-len(lanes) // THREADS)

    def work() -> Result:
        sweep[blocks, THREADS](verdicts, end_step, *arrays)
        return Result(verdicts.copy_to_host(), end_step.copy_to_host())

    return work
