"""numba.cuda: the lane of `compiled`, one thread per lane."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from compiled import DRIVERS, arrays_of, make_lane
from numba import cuda

from lanes import Lanes, Result

THREADS = 128


def prepare(lanes: Lanes, model: str) -> Callable[[], Result]:
    """Arrays on the device; the first call compiles. A call is timed with the copy of its results."""
    run_lane = make_lane(DRIVERS[model], lanes.cutters is not None)

    @cuda.jit
    def sweep(all_verdicts, end_step, *arrays):  # noqa: ANN001, ANN002, ANN202 (numba infers them)
        lane = cuda.grid(1)
        if lane < all_verdicts.shape[0]:
            verdicts, step = run_lane(lane, *arrays)
            all_verdicts[lane], end_step[lane] = verdicts, step

    arrays = [cuda.to_device(np.ascontiguousarray(array)) for array in arrays_of(lanes)]
    verdicts = cuda.device_array(len(lanes), np.uint8)
    end_step = cuda.device_array(len(lanes), np.uint32)
    blocks = -(-len(lanes) // THREADS)

    def work() -> Result:
        sweep[blocks, THREADS](verdicts, end_step, *arrays)
        return Result(verdicts.copy_to_host(), end_step.copy_to_host())

    return work
