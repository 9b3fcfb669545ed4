"""The table of a run: what was tried, what must come of it, what came, and whether the service held."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rich.console import Console
from rich.table import Table


@dataclass(frozen=True)
class Attack:
    """One row to be.

    Attributes:
        name: what is tried; expected: what must come of it.
        attempt: does it and returns what came, in words; raises when the service did not hold.
    """

    name: str
    expected: str
    attempt: Callable[[], str]


@dataclass(frozen=True)
class Outcome:
    """One row."""

    attack: Attack
    seen: str
    held: bool
    seconds: float


def run(attacks: Sequence[Attack], say: Callable[[str], None]) -> list[Outcome]:
    """Try each attack; one that does not hold ends no other."""
    outcomes = []
    for attack in attacks:
        begun = time.monotonic()
        try:
            seen, held = attack.attempt(), True
        except Exception as error:
            seen, held = f"{type(error).__name__}: {error}".strip()[:600], False
        outcomes.append(Outcome(attack, seen, held, time.monotonic() - begun))
        say(f"{'held' if held else 'FELL'} {attack.name}: {seen} ({outcomes[-1].seconds:.0f} s)")
    return outcomes


def show(outcomes: Sequence[Outcome], console: Console) -> None:
    """Print the table."""
    table = Table("attack", "expected", "seen", "held", "s", show_lines=True)
    for one in outcomes:
        held = "yes" if one.held else "NO"
        table.add_row(one.attack.name, one.attack.expected, one.seen, held, f"{one.seconds:.0f}")
    console.print(table)
