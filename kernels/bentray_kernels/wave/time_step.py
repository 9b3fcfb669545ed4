"""The compiled finite-difference time step, point sources and receivers."""

from __future__ import annotations

from typing import Any

from ..compiled import kernel
from .points import REACH
from .stencil import HALO

TAPS = 2 * REACH

# Fields are of the order of 1; values far below this become 0.
FLUSH = 1e-20


@kernel(inline="always")
def advance(now: Any, old: Any, keep: Any, fade: Any, drive: Any, weights: Any) -> None:
    """Replace the field before ``now`` by the one after it, in place; the halo stays zero.

    Nine rows of the field are read at a time; the first-level cache holds them up to a thousand nodes a row.

    Args:
        now, old, keep, fade, drive: (nx, ny), of one type.
        weights: (5,), of the Laplacian, of the same type.
    """
    # Rows are sliced so that every neighbour has an index from 0: no index is negative, and the loop over a
    # row is vectorised.
    nx, ny = now.shape
    inner = ny - 2 * HALO
    w0 = weights[0] + weights[0]
    w1, w2, w3, w4 = weights[1], weights[2], weights[3], weights[4]
    flush = now.dtype.type(FLUSH)
    for i in range(HALO, nx - HALO):
        row = now[i]
        into = old[i, HALO : HALO + inner]
        k, f, d = (
            keep[i, HALO : HALO + inner],
            fade[i, HALO : HALO + inner],
            drive[i, HALO : HALO + inner],
        )
        a1, b1 = now[i - 1, HALO:], now[i + 1, HALO:]
        a2, b2 = now[i - 2, HALO:], now[i + 2, HALO:]
        a3, b3 = now[i - 3, HALO:], now[i + 3, HALO:]
        a4, b4 = now[i - 4, HALO:], now[i + 4, HALO:]
        for j in range(inner):
            here = row[j + 4]
            laplacian = (
                w0 * here
                + w1 * ((a1[j] + b1[j]) + (row[j + 3] + row[j + 5]))
                + w2 * ((a2[j] + b2[j]) + (row[j + 2] + row[j + 6]))
                + w3 * ((a3[j] + b3[j]) + (row[j + 1] + row[j + 7]))
                + w4 * ((a4[j] + b4[j]) + (row[j] + row[j + 8]))
            )
            # Negligible values become 0: arithmetic on subnormal numbers is far slower.
            into[j] = (k[j] * here - f[j] * into[j] + d[j] * laplacian + flush) - flush


@kernel(inline="always")
def curvature(now: Any, weights: Any, margin: int, into: Any) -> None:
    """The Laplacian times spacing squared over the image alone.

    Args:
        now: the padded field.
        weights: (5,).
        margin: nodes of padding.
        into: of the image's shape; filled.
    """
    w0 = weights[0] + weights[0]
    for i in range(into.shape[0]):
        row = now[i + margin, margin - HALO :]
        out = into[i]
        for k in range(HALO):
            above, below = now[i + margin - k - 1, margin:], now[i + margin + k + 1, margin:]
            w = weights[k + 1]
            if k == 0:
                for j in range(out.shape[0]):
                    out[j] = w0 * row[j + HALO]
            left, right = row[HALO - 1 - k :], row[HALO + 1 + k :]
            for j in range(out.shape[0]):
                out[j] += w * ((above[j] + below[j]) + (left[j] + right[j]))


@kernel(inline="always")
def begin_loss_scattering(now: Any, old: Any, turn: Any, margin: int, into: Any) -> None:
    """Source scattered by a change of the damping, sign reversed: the part that is known before a step.

    Args:
        now, old: padded fields.
        turn: (nx, ny), damping times time step.
        margin: nodes of padding.
        into: of the image's shape; filled. ``end_loss_scattering`` adds the next field after the step.
    """
    for i in range(into.shape[0]):
        here, before, turned, out = now[i + margin, margin:], old[i + margin, margin:], turn[i], into[i]
        for j in range(out.shape[0]):
            out[j] = (turned[j] + turned[j]) * here[j] - before[j]


@kernel(inline="always")
def end_loss_scattering(new: Any, margin: int, into: Any) -> None:
    """The remaining part of ``begin_loss_scattering``, from the field after the step."""
    for i in range(into.shape[0]):
        after, out = new[i + margin, margin:], into[i]
        for j in range(out.shape[0]):
            out[j] += after[j]


@kernel(inline="always")
def inject(field: Any, drive: Any, first: Any, along: Any, value: Any) -> None:
    """Add the source of one element, with the factors of the scheme."""
    for i in range(TAPS):
        for j in range(TAPS):
            x, y = first[0] + i, first[1] + j
            field[x, y] += drive[x, y] * (along[0, i] * along[1, j] * value)


@kernel(inline="always")
def spread(image: Any, margin: int, first: Any, along: Any, value: Any) -> None:
    """Add the source of one element to an image without padding, where it lies inside."""
    for i in range(TAPS):
        for j in range(TAPS):
            x, y = first[0] + i - margin, first[1] + j - margin
            if 0 <= x < image.shape[0] and 0 <= y < image.shape[1]:
                image[x, y] += along[0, i] * along[1, j] * value


@kernel(inline="always")
def read(field: Any, first: Any, along: Any) -> Any:
    """The field at one element."""
    value = field.dtype.type(0)
    for i in range(TAPS):
        for j in range(TAPS):
            value += along[0, i] * along[1, j] * field[first[0] + i, first[1] + j]
    return value
