"""Repeated options with several values in a row: `--spacing 1 2 3`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from typer.core import TyperCommand

# Maximum number of values, one per axis.
AXES = 3


class RepeatedSpacing(TyperCommand):
    """A command whose ``--spacing`` takes one or several numbers."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        return super().parse_args(ctx, list(repeat_option("--spacing", args)))


def repeat_option(option: str, words: Sequence[str]) -> Iterator[str]:
    """``words`` with ``option`` repeated before each following number."""
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
