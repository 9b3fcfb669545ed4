"""One row of a benchmark: measured value, goal, and whether the goal is met."""

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
    """A measured value and its goal.

    Attributes:
        target: label of the target, e.g. ``R3 curved``.
        value: measured value; None if it could not be measured, with the reason in ``detail``.
        goal: to compare with.
        op: comparison: ``value op goal`` must hold.
        unit: of value and goal; empty for a ratio.
        detail: how it was measured, in a few words.

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
        """Whether the goal is met; never for a missing value or NaN."""
        return self.value is not None and bool(OPERATORS[self.op](self.value, self.goal))

    def to_dict(self) -> dict[str, Any]:
        """The row for JSON."""
        return {
            "target": self.target,
            "value": None if self.value is None else float(self.value),
            "goal": self.goal,
            "op": self.op,
            "met": self.met,
            "unit": self.unit,
            "detail": self.detail,
        }
