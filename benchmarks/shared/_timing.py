"""Least times of runs: of some in turns, and of one again and again."""

import time
from collections.abc import Callable

REPEATS = 5

# One run is timed until so many seconds have passed, and twice at least: the first of a size may be late.
MIN_SECONDS = 0.5


def alternate(
    runs: dict[str, Callable[[], object]],
    repeats: int = REPEATS,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, float]:
    """Least time of each, s, in the order A B A B …, after one warm-up call each.

    ``time.process_time`` as the clock is for runs of this process that differ by a few percent.
    """
    for run in runs.values():
        run()
    least = dict.fromkeys(runs, float("inf"))
    for _ in range(repeats):
        for name, run in runs.items():
            start = clock()
            run()
            least[name] = min(least[name], clock() - start)
    return least


def least_seconds(run: Callable[[], object], clock: Callable[[], float] = time.perf_counter) -> float:
    """Least time of one run, s, after one that is not counted."""
    run()
    taken: list[float] = []
    while len(taken) < 2 or sum(taken) < MIN_SECONDS:
        start = clock()
        run()
        taken.append(clock() - start)
    return min(taken)
