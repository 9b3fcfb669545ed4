"""The options of views: of a volume, and of a geometry field with its settings; repeated ones."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from typer.core import TyperCommand

from bentray_kernels.requests.request_fields import check_used, choices_of
from bentray_workers.rendering.field_settings import FieldSettings
from bentray_workers.rendering.field_view import FieldView
from bentray_workers.rendering.refraction_view import RefractionView

from .option_tables import options_of

# By field, in the order of the help.
VIEW = options_of(RefractionView, {"backdrop_distance": "distance"}, {"backdrop": "Or an image file."})
FIELD_SETTINGS, FIELD_VIEW = options_of(FieldSettings), options_of(FieldView, {"positions_m": "position_m"})
# Maximum number of values, one per axis.
AXES = 3


def view_of(options: dict[str, Any]) -> tuple[RefractionView, Path | None]:
    """The view of a volume, and the image file of its backdrop, if any.

    Args:
        options: values of the given options, by field.

    Raises:
        InvalidInput: naming the first invalid field.
    """
    given: dict[str, Any] = _with_tuples(options)
    backdrop, file = given.get("backdrop"), None
    if backdrop is not None and backdrop not in choices_of(RefractionView)["backdrop"]:
        given["backdrop"], file = "picture", Path(backdrop)
    return check_used(RefractionView(**given)), file


def field_of(options: dict[str, Any]) -> tuple[FieldSettings, FieldView]:
    """The settings and the view of a geometry field; as ``view_of``."""
    given = _with_tuples(options)
    settings = FieldSettings(**{name: value for name, value in given.items() if name in FIELD_SETTINGS})
    view = FieldView(**{name: value for name, value in given.items() if name in FIELD_VIEW})
    return settings, check_used(view)


def _with_tuples(options: dict[str, Any]) -> dict[str, Any]:
    return {name: tuple(value) if isinstance(value, list) else value for name, value in options.items()}


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
