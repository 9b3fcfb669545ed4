"""Figures of a program of the tests that measures memory, and those that a plan states wrongly."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]


def measured(program: Path, *arguments: object) -> Any:
    """What the program prints as JSON; freed arrays go back at once, so that a fork's peak is its own."""
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join((str(ROOT), str(program.parent))),
        "MALLOC_MMAP_THRESHOLD_": "65536",
        "MALLOC_TRIM_THRESHOLD_": "65536",
    }
    words = [each if isinstance(each, str) else json.dumps(each) for each in arguments]
    command = [sys.executable, program, *words]
    return json.loads(subprocess.run(command, env=environment, capture_output=True, check=True).stdout)


def wrong(told: dict[str, int], taken: dict[str, int], factor: float, spare: int) -> list[str]:
    """Tasks that take more than planned, or whose plan exceeds ``factor`` times that and ``spare`` bytes."""
    assert set(told) == set(taken)
    bounds = {name: (most, factor * most + spare) for name, most in taken.items()}
    return [f"{n}: {told[n]}" for n, (least, most) in bounds.items() if not least <= told[n] <= most]
