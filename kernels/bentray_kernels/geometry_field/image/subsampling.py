"""Subsampling of geometry images: the resolution is halved until the geometric error is too large."""

from dataclasses import dataclass

from ...errors import InvalidInput
from ...meshes.geometric_error import SAMPLES, GeometricError, geometric_error
from ...meshes.mesh import Chart
from .geometry_image import GeometryImage, geometry_image

# Pixels along a side. With one more than a power of two, every second pixel of one image is one of the next.
FINEST, COARSEST = 1025, 33


@dataclass(frozen=True)
class FittedImage:
    """A geometry image and how well it keeps the surface.

    Attributes:
        image: the smallest one that is good enough.
        error: its own, in units of the cube.
        tried: (size, error) of every image that was measured, the finest first.
    """

    image: GeometryImage
    error: GeometricError
    tried: tuple[tuple[int, GeometricError], ...]


def fitted_image(
    chart: Chart, threshold: float, finest: int = FINEST, coarsest: int = COARSEST, samples: int = SAMPLES
) -> FittedImage:
    """The smallest geometry image within an error: dissertation, 5.2.1, steps 3 to 5.

    Args:
        chart: what is sampled.
        threshold: greatest rms distance, in units of the cube.
        finest: pixels along a side that it begins with; what follows has (n + 1) // 2.
        coarsest: the least that is tried.
        samples: of ``geometric_error``.

    Raises:
        InvalidInput: where even the finest image is worse than the threshold.
    """
    best: FittedImage | None = None
    tried: list[tuple[int, GeometricError]] = []
    size = finest
    while size >= coarsest:
        image = geometry_image(chart, size)
        error = geometric_error(chart.mesh, image.mesh(), samples)
        tried.append((size, error))
        if error.rms > threshold:
            break
        best = FittedImage(image, error, ())
        size = (size + 1) // 2
    if best is None:
        value = f"{threshold:g}, where {finest}² pixels have {tried[0][1].rms:.2g}" if tried else finest
        raise InvalidInput("threshold", value, "an error that the finest image reaches")
    return FittedImage(best.image, best.error, tuple(tried))
