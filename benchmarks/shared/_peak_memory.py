"""Peak memory of one Eikonal solve, in processes of their own: prints bytes for each grid as JSON.

Called as ``_peak_memory.py METHOD NODES…``, a grid as ``64x64``. The allocator's own counters miss what
compiled code takes, and the peak of a process never falls; so each grid gets two forks of a warm process,
one that only makes the speed and one that solves too, and the kernel's peaks of the two are subtracted.
The difference holds the working arrays and the result, not the speed; a page counts once it is touched.
"""

import json
import os
import sys
from collections.abc import Callable

import numpy as np

from bentray_kernels import eikonal


def ramp(shape: tuple[int, ...]) -> np.ndarray:
    """Speed 1 to 5 along x, made without a second array of its size."""
    speed = np.empty(shape)
    speed[...] = (1.0 + 4.0 * np.arange(shape[0]) / (shape[0] - 1)).reshape(-1, *[1] * (len(shape) - 1))
    return speed


def solve(method: str, shape: tuple[int, ...]) -> None:
    """One solve, the source off the middle."""
    n = shape[0] - 1
    source = (round(0.1 * n),) + (round(0.5 * n),) * (len(shape) - 1)
    eikonal.solve(ramp(shape), 1.0 / n, np.array(source) / n, method)


def peak(run: Callable[[], object]) -> int:
    """Peak resident bytes of a fork that runs ``run``.

    Raises:
        ChildProcessError: when the fork fails, as it does where memory is short.
    """
    process = os.fork()
    if process == 0:
        # Leave at once: what the parent registered for its own end is none of the fork's business.
        try:
            run()
        except BaseException:
            os._exit(1)
        os._exit(0)
    _, status, usage = os.wait4(process, 0)
    if status != 0:
        raise ChildProcessError(f"the measured process ended with status {status}")
    # Linux counts in KiB, macOS in bytes.
    return usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def main(method: str, grids: list[str]) -> None:
    shapes = [tuple(int(n) for n in grid.split("x")) for grid in grids]
    for ndim in {len(shape) for shape in shapes}:
        # Loading compiled code takes memory too, here and not in the forks.
        solve(method, (16,) * ndim)
    print(
        json.dumps(
            [
                peak(lambda shape=shape: solve(method, shape)) - peak(lambda shape=shape: ramp(shape))
                for shape in shapes
            ]
        )
    )


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
