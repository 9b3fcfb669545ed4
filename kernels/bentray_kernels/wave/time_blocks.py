"""Time steps of a simulation in strips, between which it may be told that nobody waits for the rest."""

from __future__ import annotations

from collections.abc import Callable, Iterator

# Nodes times steps of a strip: a part of a second, so that what is done between two of them costs nothing.
STRIP = 200_000_000

# Called between strips; what it raises ends the simulation.
Poll = Callable[[], None]


def unheeded() -> None:
    """The poll of a simulation that runs to its end."""


def strips(steps: int, nodes: int, poll: Poll) -> Iterator[tuple[int, int]]:
    """The steps as (first, one past the last) of each strip; ``poll`` is called before each.

    Every strip but the last has an even number of steps, after which the two fields of a simulation have
    their old places.

    Args:
        steps: of all strips.
        nodes: that each step moves.
        poll: see ``Poll``.
    """
    length = 2 * max(1, STRIP // (2 * nodes))
    for first in range(0, steps, length):
        poll()
        yield first, min(first + length, steps)
