"""Self-test of a device, run as a child process, because drivers may abort, hang or compute wrong results.

``python -m bentray_kernels.opencl.self_test INDEX LABEL STAGE…`` prints one line of JSON for each stage,
``{"stage", "fault"}``, with an empty fault if the device is correct. A device that ends the process omits
the line.
"""

import json
import math
import sys

import numpy as np

from ..arrays import Floats
from .blocks import travel_times
from .devices import find_devices
from .session import WIDTHS, Session, probe

# Stages that the kernels need; they use no vectors. Each other width has its own stage.
NEEDED = ("double1", "solve")
STAGES = (*NEEDED, *(f"double{width}" for width in WIDTHS[1:]))


def fault_of(session: Session, stage: str) -> str:
    """The fault of the device in a stage; empty if it is correct."""
    return _fault_of_solve(session) if stage == "solve" else _fault_of_width(session, int(stage[6:]))


def _fault_of_width(session: Session, width: int) -> str:
    rng = np.random.default_rng(width)
    a, b = rng.uniform(0.0, 1e6, (2, 256))
    a[::7], b[::5] = math.inf, 0.0
    root, lower = probe(session, width, a, b)
    # Correctly rounded on all known devices, although OpenCL allows more.
    if not np.allclose(root, np.sqrt(a), rtol=1e-15, atol=0.0):
        return "wrong sqrt"
    return "" if np.array_equal(lower, np.minimum(a, b)) else "wrong fmin"


def _fault_of_solve(session: Session) -> str:
    for shape in ((19, 13), (7, 6, 9)):
        rng = np.random.default_rng(len(shape))
        crossings = rng.uniform(0.2, 5.0, (2, *shape))
        source = np.ravel_multi_index((4,) * len(shape), shape)
        seeds = [(np.array([source]), np.zeros(1))] * 2
        for times, crossing in zip(travel_times(session, crossings, seeds), crossings, strict=True):
            if not np.allclose(times, reference(crossing, (4,) * len(shape)), rtol=1e-10, atol=0.0):
                return f"wrong travel times in {len(shape)}-D"
    return ""


def reference(crossing: Floats, source: tuple[int, ...]) -> Floats:
    """First-order travel time in NumPy, by updates of all nodes until no time decreases.

    T with Σ max(T − t, 0)² = crossing², from the earlier neighbour's time t along each axis.
    """
    time: Floats = np.full(crossing.shape, math.inf)
    time[source] = 0.0
    while True:
        padded = np.pad(time, 1, constant_values=math.inf)
        beside = [
            np.minimum(np.roll(padded, 1, axis), np.roll(padded, -1, axis)) for axis in range(time.ndim)
        ]
        earliest = np.sort([times[(slice(1, -1),) * time.ndim] for times in beside], axis=0)
        new = earliest[0] + crossing
        with np.errstate(invalid="ignore"):
            for count in range(2, time.ndim + 1):
                mean = earliest[:count].mean(axis=0)
                spread = ((earliest[:count] - mean) ** 2).sum(axis=0)
                joint = mean + np.sqrt((crossing**2 - spread) / count)
                new = np.where(new > earliest[count - 1], joint, new)
        if not (new < time).any():
            return time
        time = np.where(new < time, new, time)


def main(arguments: list[str]) -> None:
    """Run the stages named on the command line, one line on stdout each."""
    index, label, *stages = arguments
    device = next((device for device in find_devices() if device.index == int(index)), None)
    if device is None or device.label != label:
        raise SystemExit(f"{label} is no longer OpenCL device {index}")
    session = Session(device)
    for stage in stages:
        fault = fault_of(session, stage)
        sys.stdout.write(json.dumps({"stage": stage, "fault": fault}) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1:])
