"""Reference lookup of the dissertation: an outer field of (u, v) that points into the geometry image.

Sections 5.2.2 and 5.3.4. An entry has the texture coordinates of the first hit and nothing else; position and
normal are read from the geometry image there. Averaged (u, v) are meaningless where the entries around a ray
lie on both sides of a seam or silhouette, so the lookups of ``OuterField`` are more accurate.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays import Flags, Float32s, Int32s
from ...compilation.compiled import kernel
from ...compilation.float32 import real, whole
from ...errors import InvalidInput
from ...meshes.surface import Surface
from ...requests.rendering_limits import MAX_REFERENCE_SAMPLES
from .cube import samples
from .inner_field import InnerField
from .outer_field import OuterField
from .quadrilinear import Corner, lerp4
from .reference_inner_field import inner_uv_table, uv_at_ends

# Numbers of a pixel: position and normal.
CHANNELS = 6


class ReferenceField(NamedTuple):
    """The table and the image that it points into.

    Attributes:
        samples: n along an edge of the cube.
        uv: (6n², 6n², 2) float32 by entry and exit; NaN where the ray meets nothing.
        image: (pixels, pixels, 6) float32, axes (u, v): position in the unit cube and unit normal; NaN where
            a pixel represents no point of the surface.
        inner_uv: (points, 6m², 2) float32 by point and exit, see ``inner_uv_table``; None where rays that
            leave the surface are to be found by ``InnerField`` or exactly, and then read from the image.
    """

    samples: int
    uv: Float32s
    image: Float32s
    inner_uv: Float32s | None = None


def reference_field(
    surface: Surface,
    field: OuterField,
    positions: NDArray[np.floating],
    normals: NDArray[np.floating],
    valid: Flags,
    inner: tuple[InnerField, Int32s] | None = None,
) -> ReferenceField:
    """The published tables of a surface.

    Args:
        surface: ``surface_of``.
        field: its outer field.
        positions, normals, valid: (pixels, pixels, 3), the same and (pixels, pixels), of the geometry image
            of the same chart.
        inner: its inner field, and the points of ``spread_points`` from which its rays start; None for a
            reference field without ``inner_uv``.

    Raises:
        InvalidInput: for a field of more than 24 samples, an image that is not square, and from
            ``inner_uv_table``.
    """
    if field.samples > MAX_REFERENCE_SAMPLES:
        accepted = f"at most {MAX_REFERENCE_SAMPLES}, for lookups of (u, v)"
        raise InvalidInput("samples", field.samples, accepted)
    pixels = len(valid)
    if not (positions.shape == normals.shape == (pixels, pixels, 3) and valid.shape == (pixels, pixels)):
        raise InvalidInput("positions", f"shape {positions.shape}", "(pixels, pixels, 3)")
    image = np.concatenate([positions, normals], axis=2, dtype=np.float32)
    image[~valid] = np.nan
    inner_uv = inner_uv_table(surface, *inner) if inner else None
    return ReferenceField(field.samples, uv_table(surface, field), image, inner_uv)


def uv_table(surface: Surface, field: OuterField) -> Float32s:
    """The (u, v) of every entry, (6n², 6n², 2) float32; NaN where its ray meets nothing.

    Args:
        surface: ``surface_of``.
        field: its outer field, whose entries are the faces of the same hits.
    """
    places = samples(field.samples).astype(np.float32)
    return uv_at_ends(surface, field.faces, places, places)


@kernel(inline="always")
def linear_uv_at(entries: Float32s, n: int, corner: Corner, nearest: int) -> tuple[float, float]:
    """The (u, v) averaged over the 16 entries about a ray, with the published weights.

    Entries that meet nothing are left out; where the nearest one meets nothing, the result is NaN.

    Args:
        entries: ``uv_table`` in one dimension.
        n: samples along an edge of the cube.
        corner: ``corner_of`` the ray.
        nearest: ``nearest_of`` it.
    """
    u, v = entries[2 * nearest], entries[2 * nearest + 1]
    # NaN is not equal to itself.
    if u == u:
        u, v = lerp4(entries, n, corner, 2, 0), lerp4(entries, n, corner, 2, 1)
        if u != u:
            u, v = _mean_of_hits(entries, n, corner)
    return u, v


@kernel
def _mean_of_hits(entries: Float32s, n: int, corner: Corner) -> tuple[float, float]:
    """Mean (u, v) of the entries that meet something, of which there is one."""
    at, a0, a1, a2, a3 = corner
    one, u, v, total = real(1.0), real(0.0), real(0.0), real(0.0)
    for k in range(16):
        i, j, m, p = k & 1, k >> 1 & 1, k >> 2 & 1, k >> 3
        weight = (a0 if i else one - a0) * (a1 if j else one - a1)
        weight *= (a2 if m else one - a2) * (a3 if p else one - a3)
        place = 2 * (at + (6 * n * j + i) * (6 * n * n) + 6 * n * p + m)
        if entries[place] == entries[place]:
            u, v = u + weight * entries[place], v + weight * entries[place + 1]
            total += weight
    return u / total, v / total


@kernel(inline="always")
def image_at(
    images: Float32s, start: int, pixels: int, u: float, v: float, channel: int
) -> tuple[float, float, float]:
    """Three channels of a geometry image at (u, v), bilinear; NaN beside the chart.

    Args:
        images: images in one dimension.
        start: of the first number of this one.
        pixels: along each of its sides.
        u, v: 0 to 1.
        channel: 0 for the position, 3 for the normal, which is not of length 1 between pixels.
    """
    x, y = u * (pixels - 1), v * (pixels - 1)
    i, j = min(max(whole(x), 0), pixels - 2), min(max(whole(y), 0), pixels - 2)
    s, t = x - i, y - j
    a = start + CHANNELS * (i * pixels + j) + channel
    b, c = a + CHANNELS, a + CHANNELS * pixels
    d = c + CHANNELS
    return (
        (1 - s) * ((1 - t) * images[a] + t * images[b]) + s * ((1 - t) * images[c] + t * images[d]),
        (1 - s) * ((1 - t) * images[a + 1] + t * images[b + 1])
        + s * ((1 - t) * images[c + 1] + t * images[d + 1]),
        (1 - s) * ((1 - t) * images[a + 2] + t * images[b + 2])
        + s * ((1 - t) * images[c + 2] + t * images[d + 2]),
    )
