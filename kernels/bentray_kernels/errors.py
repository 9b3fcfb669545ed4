"""The one error that bad input raises: it names the field, the value found and what is accepted."""

from __future__ import annotations

# Of a name and of a value, characters that a message repeats: both may come from a stranger's file.
LONGEST_FIELD, LONGEST_VALUE = 160, 400


class InvalidInput(ValueError):  # noqa: N818 - it is a ValueError with three fields, and reads as one
    """A value from outside cannot be used.

    Attributes:
        field: what was wrong, as the user spells it (``"speed"``, ``"geometry/element_position_m"``).
        value: what was found, in words, cut to ``LONGEST_VALUE`` printable characters.
        accepted: what would have been taken.
    """

    def __init__(self, field: str, value: object, accepted: str) -> None:
        self.field = _line(field, LONGEST_FIELD)
        self.value = _line(_text(value), LONGEST_VALUE)
        self.accepted = accepted
        super().__init__(f"{self.field}: found {self.value}; accepted: {accepted}")

    def __reduce__(self) -> tuple[type[InvalidInput], tuple[str, str, str]]:
        # An exception with its own __init__ must say how to rebuild itself to cross a process border.
        return type(self), (self.field, self.value, self.accepted)


def _text(value: object) -> str:
    try:
        return str(value)
    except ValueError:
        # Python writes no integer of more than 4300 digits.
        return "an integer of thousands of digits"


def _line(text: str, most: int) -> str:
    shown = "".join(c if c.isprintable() else "?" for c in text[: most + 1])
    return shown if len(shown) <= most else shown[: most - 1] + "…"
