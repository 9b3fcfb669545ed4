"""Options that may be given once for each value take their values in a row too: `--spacing 1 2 3`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from typer.core import TyperCommand

# In a row at most, one an axis.
AXES = 3


class RepeatedSpacing(TyperCommand):
    """A command whose ``--spacing`` takes one number or a row of them."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        return super().parse_args(ctx, list(repeat_option("--spacing", args)))


def repeat_option(option: str, words: Sequence[str]) -> Iterator[str]:
    """``words`` with ``option`` before each number of the row that follows it."""
    left = 0
    for word in words:
        if word == option:
            left = AXES
        elif left == AXES:
            left -= 1
        elif left and _number(word):
            yield option
            left -= 1
        else:
            left = 0
        yield word


def _number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
