"""One row of a benchmark: what was measured, the goal, and whether it is met."""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bentray_kernels.errors import InvalidInput

OPERATORS: dict[str, Callable[[float, float], bool]] = {
    "<=": operator.le,
    "<": operator.lt,
    ">=": operator.ge,
    ">": operator.gt,
    "==": operator.eq,
}


@dataclass(frozen=True)
class Row:
    """A figure measured in this run beside the goal it is held to.

    Attributes:
        target: the label of the target, as ``R3 curved``.
        value: what was measured; None where it could not be, and then ``detail`` says why.
        goal: what it is compared with.
        op: how: ``value op goal`` must hold.
        unit: of value and goal; empty for a ratio.
        detail: how it was measured, short enough for a table.

    Raises:
        InvalidInput: for an unknown ``op``, or a missing value without a reason.
    """

    target: str
    value: float | None
    goal: float
    op: str
    unit: str
    detail: str

    def __post_init__(self) -> None:
        if self.op not in OPERATORS:
            raise InvalidInput("op", repr(self.op), "one of " + " ".join(OPERATORS))
        if self.value is None and not self.detail.strip():
            raise InvalidInput("detail", repr(self.detail), f"the reason why {self.target} has no value")

    @property
    def met(self) -> bool:
        """Whether the goal is reached; a missing value or NaN never is."""
        return self.value is not None and bool(OPERATORS[self.op](self.value, self.goal))

    def to_dict(self) -> dict[str, Any]:
        """The row for JSON, keys in the order of a sentence."""
        return {
            "target": self.target,
            "value": None if self.value is None else float(self.value),
            "goal": self.goal,
            "op": self.op,
            "met": self.met,
            "unit": self.unit,
            "detail": self.detail,
        }
