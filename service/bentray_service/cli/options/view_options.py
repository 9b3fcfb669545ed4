"""The options of the refractive rendering of a volume."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bentray_kernels.request_fields import check_used, choices_of
from bentray_workers.rendering.refraction_view import RefractionView

from .option_tables import options_of, with_options

# By field, in the order of the help.
OPTIONS = options_of(RefractionView, {"backdrop_distance": "distance"}, {"backdrop": "Or an image file."})


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
