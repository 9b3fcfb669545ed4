"""Memory that calls and modules of the tests take, and what a plan states wrongly."""

import json
import os
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]


def measured(module: str, *arguments: object) -> Any:
    """What ``main`` of a module returns in a new process, in which freed arrays go back at once: a fork's
    peak is its own.
    """
    environment = {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "MALLOC_MMAP_THRESHOLD_": "65536",
        "MALLOC_TRIM_THRESHOLD_": "65536",
    }
    code = f"import json, sys, {module} as module; print(json.dumps(module.main(*json.loads(sys.argv[1]))))"
    command = [sys.executable, "-c", code, json.dumps(arguments)]
    return json.loads(subprocess.run(command, env=environment, capture_output=True, check=True).stdout)


def wrong(told: dict[str, int], taken: dict[str, int], factor: float, spare: int) -> list[str]:
    """Tasks that take more than planned, or whose plan exceeds ``factor`` times that and ``spare`` bytes."""
    assert set(told) == set(taken)
    bounds = {name: (most, factor * most + spare) for name, most in taken.items()}
    return [f"{n}: {told[n]}" for n, (least, most) in bounds.items() if not least <= told[n] <= most]


def peak_of(work: Callable[[], object]) -> int:
    """Most bytes of Python and NumPy during a call."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
