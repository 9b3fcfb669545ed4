"""Time steps of a simulation in blocks, between which it can be cancelled."""

from collections.abc import Callable, Iterator

# Nodes times steps of a block: a fraction of a second, so that the cost of a poll is negligible.
BLOCK = 200_000_000

# Called between blocks; an exception that it raises ends the simulation.
Poll = Callable[[], None]


def no_poll() -> None:
    """The poll of a simulation that is never cancelled."""


def split_steps(steps: int, nodes: int, poll: Poll) -> Iterator[tuple[int, int]]:
    """Yield (first, one past the last) step of each block; ``poll`` is called before each.

    Every block except the last has an even number of steps, so that the two fields of a simulation keep their
    roles.

    Args:
        steps: of all blocks.
        nodes: updated by each step.
        poll: see ``Poll``.
    """
    length = 2 * max(1, BLOCK // (2 * nodes))
    for first in range(0, steps, length):
        poll()
        yield first, min(first + length, steps)
