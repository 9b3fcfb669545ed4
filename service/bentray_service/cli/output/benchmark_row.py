"""One row of a benchmark: measured value, goal, baselines of an image error, and whether the goal is met."""

import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from bentray_kernels.errors import InvalidInput

OPERATORS: dict[str, Callable[[float, float], bool]] = {
    "<=": operator.le,
    "<": operator.lt,
    ">=": operator.ge,
    ">": operator.gt,
    "==": operator.eq,
}

# Names of the baselines of an image error: two images without structure, and two reconstructions.
BEST_CONSTANT, WATER_ALONE = "best constant", "water alone"
STRAIGHT_RAYS, DEFAULT_SETTINGS = "straight rays", "default settings"
CONSTANTS = (BEST_CONSTANT, WATER_ALONE)


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
        error: of an image, the error that ``value`` is about, in the unit of the baselines; None: ``value``.
        baselines: of an image, by name, the errors of other images of the same scan, in one unit: the best
            constant, water alone, straight rays by the same method, penalty and width, and the default
            settings; further ones may be added. Empty if the row is not about an image.
        tuned: whether a setting other than the default was chosen for the scan.
        figures: further figures of the same image by name, such as its SSIM, for tables.

    Raises:
        InvalidInput: for an unknown ``op``, a missing value without a reason, or a tuned row without the
            error of the default settings.
    """

    target: str
    value: float | None
    goal: float
    op: str
    unit: str
    detail: str
    error: float | None = None
    baselines: Mapping[str, float] = field(default_factory=dict)
    tuned: bool = False
    figures: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.op not in OPERATORS:
            raise InvalidInput("op", repr(self.op), "one of " + " ".join(OPERATORS))
        if self.value is None and not self.detail.strip():
            raise InvalidInput("detail", repr(self.detail), f"the reason why {self.target} has no value")
        if self.tuned and DEFAULT_SETTINGS not in self.baselines:
            names = ", ".join(self.baselines) or "none"
            raise InvalidInput("baselines", names, f"also {DEFAULT_SETTINGS!r}: {self.target} is tuned")

    @property
    def met(self) -> bool:
        """Whether the goal is met; never for a missing value, NaN, or an image worse than a constant."""
        if self.value is None or not OPERATORS[self.op](self.value, self.goal):
            return False
        return not self.loses_to_constant

    @property
    def loses_to_constant(self) -> bool:
        """Whether the image has a larger error than one of the images without structure."""
        error = self.value if self.error is None else self.error
        constants = [self.baselines[name] for name in CONSTANTS if name in self.baselines]
        # Not "larger than": an error of NaN loses too.
        return error is not None and not all(error <= constant for constant in constants)

    def to_dict(self) -> dict[str, Any]:
        """The row for JSON; error, baselines and tuned only if it is about an image; figures if any."""
        row: dict[str, Any] = {
            "target": self.target,
            "value": None if self.value is None else float(self.value),
            "goal": self.goal,
            "op": self.op,
            "met": self.met,
            "unit": self.unit,
            "detail": self.detail,
        }
        if self.baselines:
            error = self.value if self.error is None else self.error
            row["error"] = None if error is None else float(error)
            row["baselines"] = {name: float(value) for name, value in self.baselines.items()}
            row["tuned"] = self.tuned
        if self.figures:
            row["figures"] = {name: float(value) for name, value in self.figures.items()}
        return row

    @property
    def explained(self) -> str:
        """The detail, followed by the baselines."""
        if not self.baselines:
            return self.detail
        baselines = ", ".join(f"{name} {error:.3g}" for name, error in self.baselines.items())
        kind = "tuned; " if self.tuned else ""
        lost = "; worse than a constant" if self.loses_to_constant else ""
        return f"{kind}{self.detail}; beside {baselines}{lost}"
