"""How the picture of a slice looks: its size, its bars, with a frame or as the bare image."""

from __future__ import annotations

from dataclasses import dataclass

from bentray_kernels.errors import InvalidInput
from bentray_kernels.ranges import Range

COLORMAPS = ("viridis", "magma", "inferno", "plasma", "cividis", "gray", "bone", "turbo", "coolwarm")
# Between the values of nodes, and what Matplotlib calls it.
INTERPOLATIONS = {"nearest": "nearest", "cubic": "bicubic"}
LEAST_SIZE, MOST_SIZE = 32, 4096
# With a frame; below this nobody can read its text.
LEAST_FRAMED = 200
# The values of the darkest and the brightest colour: those that a volume may have (float32).
COLOUR_VALUE = Range(-3.4e38, 3.4e38)


@dataclass(frozen=True)
class Look:
    """What a picture shows beside the values themselves.

    Attributes:
        colormap: one of ``COLORMAPS``.
        size: longest side, pixels; None: as large as text of the usual size makes it, or, of the bare image,
            a pixel a node.
        interpolation: a key of ``INTERPOLATIONS``.
        scale_bar: a bar of a round length in a corner of the image.
        colour_bar: the colours with their values and unit; in a frame only.
        frame: title, axes in mm and notes about the image; without it there is nothing but the image.

    Raises:
        InvalidInput: naming the first that is wrong.
    """

    colormap: str = "viridis"
    size: int | None = None
    interpolation: str = "nearest"
    scale_bar: bool = False
    colour_bar: bool = True
    frame: bool = True

    def __post_init__(self) -> None:
        for name, value, choices in (
            ("colormap", self.colormap, COLORMAPS),
            ("interpolation", self.interpolation, tuple(INTERPOLATIONS)),
        ):
            if value not in choices:
                raise InvalidInput(name, repr(value), "one of " + ", ".join(choices))
        least = LEAST_FRAMED if self.frame else LEAST_SIZE
        if self.size is not None and not least <= self.size <= MOST_SIZE:
            raise InvalidInput("size", self.size, f"{least} to {MOST_SIZE} pixels")
