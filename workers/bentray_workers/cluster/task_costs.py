"""Memory and CPU time of tasks, from coefficients that ``benchmarks/tasks/sizing.py`` measured.

A kind of task takes ``fixed + a * pairs + b * nodes + ...``; the coefficients of each kind are in
``task_costs.json``. Memory is that of a worker above an idle one: working arrays, arguments, results, data
that a process caches, and freed memory that it keeps. It is an upper envelope, with a margin over the
measured peaks. Seconds are those of one core of the processor that the table names.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

# Present in every task; its coefficient is a constant.
FIXED = "fixed"


class TaskSize(NamedTuple):
    """A kind of task in the table, and the counts that its cost grows with, by their names there.

    Raises:
        KeyError: when the cost is computed, for a kind or a count that the table does not have.
    """

    kind: str
    counts: Mapping[str, float]

    @property
    def bytes(self) -> int:
        """Memory of the task."""
        return sum(self.parts.values())

    @property
    def parts(self) -> dict[str, int]:
        """Memory of the task by the count that it grows with, bytes."""
        return {name: math.ceil(size) for name, size in self._products("bytes").items()}

    @property
    def seconds(self) -> float:
        """CPU time of the task."""
        return math.fsum(self.parts_s.values())

    @property
    def parts_s(self) -> dict[str, float]:
        """CPU time of the task by the count that it grows with, s."""
        return self._products("seconds")

    def _products(self, quantity: str) -> dict[str, float]:
        known = {FIXED: 1.0, **self.counts}
        return {name: each * known[name] for name, each in table()[quantity][self.kind].items()}


@cache
def table() -> dict[str, Any]:
    """The content of ``task_costs.json``."""
    content: dict[str, Any] = json.loads(files(__package__).joinpath("task_costs.json").read_text())
    return content
