"""The compiled time step: one field forward in place, sources spread, receivers read."""

from __future__ import annotations

from typing import Any

from ..compiled import kernel
from .points import REACH
from .stencil import HALO

TAPS = 2 * REACH

# Fields are of the order of 1; this times the rounding of their type is as good as nothing.
QUIET = 1e-20


@kernel(inline="always")
def advance(now: Any, old: Any, keep: Any, fade: Any, drive: Any, weights: Any) -> None:
    """Turn the field before ``now`` into the one after it, in place; the halo stays zero.

    Nine rows of the field are read at a time, which the first cache holds up to a thousand nodes a row.

    Args:
        now, old, keep, fade, drive: (nx, ny), of one type.
        weights: (5,), of the Laplacian, of the same type.
    """
    # Rows cut so that an index from 0 reaches every neighbour: no index can be negative, and the loop over
    # a row becomes vector instructions.
    nx, ny = now.shape
    inner = ny - 2 * HALO
    w0 = weights[0] + weights[0]
    w1, w2, w3, w4 = weights[1], weights[2], weights[3], weights[4]
    quiet = now.dtype.type(QUIET)
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
            # Values that nobody will hear become 0: below a type's normal range arithmetic is far slower.
            into[j] = (k[j] * here - f[j] * into[j] + d[j] * laplacian + quiet) - quiet


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
def braked(now: Any, old: Any, turn: Any, margin: int, into: Any) -> None:
    """The part of what a change of the damping radiates, sign reversed, that is known before a step.

    Args:
        now, old: padded fields.
        turn: (nx, ny), damping times time step.
        margin: nodes of padding.
        into: of the image's shape; filled. The next field is added to it after the step, see ``released``.
    """
    for i in range(into.shape[0]):
        here, before, turned, out = now[i + margin, margin:], old[i + margin, margin:], turn[i], into[i]
        for j in range(out.shape[0]):
            out[j] = (turned[j] + turned[j]) * here[j] - before[j]


@kernel(inline="always")
def released(new: Any, margin: int, into: Any) -> None:
    """The other part of ``braked``, from the field after the step."""
    for i in range(into.shape[0]):
        after, out = new[i + margin, margin:], into[i]
        for j in range(out.shape[0]):
            out[j] += after[j]


@kernel(inline="always")
def inject(field: Any, drive: Any, first: Any, along: Any, value: Any) -> None:
    """Add a source of one element, as the scheme drives it."""
    for i in range(TAPS):
        for j in range(TAPS):
            x, y = first[0] + i, first[1] + j
            field[x, y] += drive[x, y] * (along[0, i] * along[1, j] * value)


@kernel(inline="always")
def spread(image: Any, margin: int, first: Any, along: Any, value: Any) -> None:
    """Add a source of one element to an image without padding, where it falls inside."""
    for i in range(TAPS):
        for j in range(TAPS):
            x, y = first[0] + i - margin, first[1] + j - margin
            if 0 <= x < image.shape[0] and 0 <= y < image.shape[1]:
                image[x, y] += along[0, i] * along[1, j] * value


@kernel(inline="always")
def read(field: Any, first: Any, along: Any) -> Any:
    """The field at one element."""
    found = field.dtype.type(0)
    for i in range(TAPS):
        for j in range(TAPS):
            found += along[0, i] * along[1, j] * field[first[0] + i, first[1] + j]
    return found
