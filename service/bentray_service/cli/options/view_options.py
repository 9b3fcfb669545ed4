"""The options of the refractive rendering of a volume, and repeated ones: `--spacing 1 2 3`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from typer.core import TyperCommand

from bentray_kernels.requests.request_fields import check_used, choices_of
from bentray_workers.rendering.refraction_view import RefractionView

from .option_tables import options_of, with_options

# By field, in the order of the help.
OPTIONS = options_of(RefractionView, {"backdrop_distance": "distance"}, {"backdrop": "Or an image file."})
# Maximum number of values, one per axis.
AXES = 3


@dataclass(frozen=True)
class ViewOptions:
    """Values of the given options, by field."""

    given: dict[str, Any]

    def view(self) -> tuple[RefractionView, Path | None]:
        """The view, and the image file of its backdrop, if any; raises InvalidInput for an invalid field."""
        given: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in self.given.items()}
        backdrop, file = given.get("backdrop"), None
        if backdrop is not None and backdrop not in choices_of(RefractionView)["backdrop"]:
            given["backdrop"], file = "picture", Path(backdrop)
        return check_used(RefractionView(**given)), file


with_view_options = with_options(OPTIONS, ViewOptions)


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
