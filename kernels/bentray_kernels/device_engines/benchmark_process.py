"""DeviceBenchmark of a device, run as a child process, because drivers may abort or hang.

``python -m bentray_kernels.device_engines.benchmark_process INDEX LABEL ENGINE`` prints one line of JSON,
``{"engine", "fault", "timings"}``: see ``opencl.device_benchmark``. A device that ends the process omits it.
"""

import json
import os
import sys
from typing import Any

from ..opencl.device_selection import select_device
from ..opencl.devices import WISH
from .comparison import measured
from .problems import benchmark_problems

REPEATS = 2


def answer(engine: str) -> dict[str, Any]:
    """Times of a small and a large problem, or why the device may not compute this engine."""
    timings: list[tuple[float, float, float]] = []
    for problem in benchmark_problems(engine):
        comparison = measured(problem, None, REPEATS)
        if comparison.compiled_s is None or comparison.device_s is None:
            return _fault(engine, "it computes wrong results")
        if not comparison.right:
            reason = f"{problem.name} differs by {comparison.difference:.3g} {problem.error.unit}"
            return _fault(engine, f"{reason}, {problem.bound:g} is allowed")
        timings.append((problem.size, comparison.compiled_s, comparison.device_s))
    return {"engine": engine, "fault": "", "timings": timings}


def _fault(engine: str, fault: str) -> dict[str, Any]:
    return {"engine": engine, "fault": fault, "timings": []}


def main(arguments: list[str]) -> None:
    """Try the engine named on the command line on one device."""
    index, label, engine = arguments
    os.environ[WISH] = index
    choice = select_device()
    if choice.device is None or choice.device.label != label:
        raise SystemExit(choice.reason or f"{label} is no longer OpenCL device {index}")
    sys.stdout.write(json.dumps(answer(engine)) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
