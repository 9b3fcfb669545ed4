"""Run the hostile list and print its table: ``python -m tests.hostile [service | edge]``."""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

from rich.console import Console

from .attack_table import Outcome, show
from .hostile_list import LISTS, run_list

if __name__ == "__main__":
    console = Console(width=140)
    chosen = sys.argv[1:] or list(LISTS)
    begun, outcomes = time.monotonic(), list[Outcome]()
    with tempfile.TemporaryDirectory() as name:
        for number, one in enumerate(chosen):
            folder = Path(name) / str(number)
            folder.mkdir()
            outcomes += run_list(one, folder, console.print)
    show(outcomes, console)
    held = sum(outcome.held for outcome in outcomes)
    console.print(f"{held} of {len(outcomes)} held, {time.monotonic() - begun:.0f} s")
    sys.exit(0 if held == len(outcomes) else 1)
