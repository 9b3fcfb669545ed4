"""The range of a number, declared once with its field and checked once where the number enters."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from ..errors import InvalidInput

# Under this key a field's metadata holds its ``Range``.
RANGE = "range"


@dataclass(frozen=True)
class Range:
    """All numbers between two bounds, the bounds included unless stated otherwise.

    Attributes:
        least, most: the bounds.
        above, below: whether the number must lie above ``least``, and below ``most``.
        unit: of the bounds; empty for a count or a ratio.
    """

    least: float
    most: float
    above: bool = False
    below: bool = False
    unit: str = ""

    def holds(self, value: float) -> bool:
        """Whether a number of any size lies in it; NaN lies in no range."""
        # Python compares an integer of 400 digits with a float exactly, where float() of it overflows.
        low = self.least < value if self.above else self.least <= value
        return bool(low and (value < self.most if self.below else value <= self.most))

    def check(self, name: str, value: float) -> None:
        """Reject a number outside the range.

        Raises:
            InvalidInput: naming ``name``.
        """
        if not self.holds(value):
            raise InvalidInput(name, value, self.words)

    @property
    def words(self) -> str:
        """The range in words, for errors and descriptions."""
        unit = f" {self.unit}" if self.unit else ""
        # Whole numbers in full: 9.0072e+15 is above the highest seed.
        least, most = (str(end) if isinstance(end, int) else f"{end:g}" for end in (self.least, self.most))
        if self.above or self.below:
            low, high = "above" if self.above else "from", "below" if self.below else "at most"
            return f"a number {low} {least} and {high} {most}{unit}"
        return f"a number from {least} to {most}{unit}"

    @property
    def schema(self) -> dict[str, float]:
        """This range in JSON Schema."""
        low = "exclusiveMinimum" if self.above else "minimum"
        return {low: self.least, "exclusiveMaximum" if self.below else "maximum": self.most}


# Of random numbers: the integers that every reader of JSON keeps exactly.
SEED = Range(0, 2**53 - 1)


def ranged(default: Any, within: Range, **metadata: Any) -> Any:
    """A field of a dataclass that takes numbers of one range, or None.

    Args:
        default: of the field.
        within: the range; also in the JSON schema of the field.
        metadata: of the field, beside.
    """
    return field(default=default, metadata={RANGE: within, "json_schema_extra": within.schema, **metadata})


def ranges_of(kind: Any) -> Mapping[str, Range]:
    """The ranges of a dataclass by its fields."""
    return {setting.name: setting.metadata[RANGE] for setting in fields(kind) if RANGE in setting.metadata}


def check_ranges(record: Any, before: str = "") -> None:
    """Check every number of a dataclass against the range of its field; None is accepted.

    Args:
        record: the dataclass.
        before: put before the name of a field in the error.

    Raises:
        InvalidInput: naming the first field that is wrong, or the ``place`` in its metadata.
    """
    for setting in fields(record):
        within = setting.metadata.get(RANGE)
        value = getattr(record, setting.name)
        if within is not None and value is not None:
            within.check(before + setting.metadata.get("place", setting.name), value)
