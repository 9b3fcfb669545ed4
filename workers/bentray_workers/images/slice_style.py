"""Style of the picture of a slice: size, colours, bars and frame."""

from dataclasses import dataclass

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.ranges import Range

COLORMAPS = ("viridis", "magma", "inferno", "plasma", "cividis", "gray", "bone", "turbo", "coolwarm")
# Interpolation between nodes, and its name in Matplotlib.
INTERPOLATIONS = {"nearest": "nearest", "linear": "bilinear", "cubic": "bicubic"}
MIN_SIZE, MAX_SIZE = 32, 4096
# With a frame; text is illegible below this.
MIN_FRAMED_SIZE = 200
# Values of the first and the last colour (float32).
COLOUR_VALUE = Range(-3.4e38, 3.4e38)


@dataclass(frozen=True)
class SliceStyle:
    """Style of the picture of a slice.

    Attributes:
        colormap: one of ``COLORMAPS``.
        size: longest side, pixels; None: the default size, or one pixel per node without a frame.
        interpolation: a key of ``INTERPOLATIONS``.
        scale_bar: a bar of a round length in a corner of the image.
        colour_bar: colours with values and unit; with a frame only.
        frame: title, axes in mm and notes; otherwise the image alone.

    Raises:
        InvalidInput: naming the first wrong field.
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
        least = MIN_FRAMED_SIZE if self.frame else MIN_SIZE
        if self.size is not None and not least <= self.size <= MAX_SIZE:
            raise InvalidInput("size", self.size, f"{least} to {MAX_SIZE} pixels")
