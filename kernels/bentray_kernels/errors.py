"""The one error that bad input raises: it names the field, the value found and what is accepted."""

from __future__ import annotations


class InvalidInput(ValueError):  # noqa: N818 - it is a ValueError with three fields, and reads as one
    """A value from outside cannot be used.

    Attributes:
        field: what was wrong, as the user spells it (``"speed"``, ``"geometry/element_position_m"``).
        value: what was found, already in words short enough to print.
        accepted: what would have been taken.
    """

    def __init__(self, field: str, value: object, accepted: str) -> None:
        self.field = field
        self.value = str(value)
        self.accepted = accepted
        super().__init__(f"{field}: found {self.value}; accepted: {accepted}")

    def __reduce__(self) -> tuple[type[InvalidInput], tuple[str, str, str]]:
        # An exception with its own __init__ must say how to rebuild itself to cross a process border.
        return type(self), (self.field, self.value, self.accepted)
