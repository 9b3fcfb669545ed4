"""Memory of tasks by what they work on: coefficients fitted to measured peaks, in ``task_costs.json``.

``tests/workers/cluster/fitted_costs.py`` measures tasks of several sizes and writes the table: an upper
envelope of the peaks. The sizes that it is judged by are others, see ``bentray bench task_memory``.
"""

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

TABLE = Path(__file__).with_suffix(".json")

# Term of every task: Python's own part.
OVERHEAD = "overhead"


class TaskSize(NamedTuple):
    """What determines the memory of a task.

    Attributes:
        kind: in the table.
        counts: by the name of a term: nodes, rays, samples and the like.
    """

    kind: str
    counts: Mapping[str, float]

    @property
    def terms(self) -> dict[str, int]:
        """Memory beyond that of a warm worker by term, bytes."""
        each, counts = coefficients()[self.kind], {OVERHEAD: 1.0, **self.counts}
        return {term: math.ceil(each[term] * count) for term, count in counts.items() if count}

    @property
    def bytes(self) -> int:
        """Memory beyond that of a warm worker, bytes."""
        return sum(self.terms.values())


Sizes = dict[str, TaskSize]


def largest_sizes(sizes: Iterable[Sizes]) -> Sizes:
    """The size with the largest memory of each name."""
    largest: Sizes = {}
    for name, size in chain.from_iterable(part.items() for part in sizes):
        if name not in largest or size.bytes > largest[name].bytes:
            largest[name] = size
    return largest


@dataclass(frozen=True, kw_only=True)
class TaskPlan:
    """Tasks of a job and their memory.

    Attributes:
        decomposition: what the tasks are of.
        lane: resource of the workers.
        tasks: their number.
        workers: connected workers that can run each of them.
        call_bytes: memory of one task by its name: working arrays, arguments and cached values.
        why: summary in a sentence.
    """

    decomposition: str
    lane: str
    tasks: int
    workers: int
    call_bytes: Mapping[str, int]
    why: str

    @property
    def largest(self) -> tuple[str, int]:
        """The task with the largest memory, and this memory, bytes."""
        return largest_of(self.call_bytes)

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {**asdict(self), "largest_bytes": self.largest[1]}


def largest_of(call_bytes: Mapping[str, int]) -> tuple[str, int]:
    """The task with the largest memory, and this memory, bytes."""
    return max(call_bytes.items(), key=lambda item: item[1])


def bytes_of(sizes: Sizes) -> dict[str, int]:
    """Memory of tasks by name."""
    return {name: size.bytes for name, size in sizes.items()}


@cache
def coefficients() -> Mapping[str, Mapping[str, float]]:
    """Bytes for each count of a term, by kind of task and term."""
    table: dict[str, dict[str, float]] = json.loads(TABLE.read_text(encoding="utf-8"))["bytes"]
    return table
