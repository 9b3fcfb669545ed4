"""The compiled finite-difference time step, point sources and receivers."""

from typing import Any

from ..compilation.compiled import kernel
from .light_cone import TILE
from .points import REACH
from .stencil import HALO
from .vector_width import use_widest_vectors

TAPS = 2 * REACH

# Fields are of the order of 1; values far below this become 0.
FLUSH = 1e-20


@kernel(inline="always")
def advance(now: Any, old: Any, keep: Any, fade: Any, drive: Any, weights: Any, spans: Any) -> None:
    """Replace the field before ``now`` by the one after it, in place; the halo stays zero.

    Nine rows of the field are read at a time; the first-level cache holds them up to a thousand nodes a row.

    Args:
        now, old, keep, fade, drive: (nx, ny), of one type.
        weights: (5,), of the Laplacian, of the same type.
        spans: (rows of tiles, 2), the nodes that matter, see ``light_cone``.
    """
    use_widest_vectors()
    flush = now.dtype.type(FLUSH)
    for i in range(HALO, now.shape[0] - HALO):
        begin, end = spans[(i - HALO) // TILE, 0], spans[(i - HALO) // TILE, 1]
        rows, into, k, f, d = _rows(now, old, keep, fade, drive, i, begin, end)
        for j in range(into.shape[0]):
            # Negligible values become 0: arithmetic on subnormal numbers is far slower.
            step = k[j] * rows[0][j + HALO] - f[j] * into[j] + d[j] * _laplacian(rows, weights, j)
            into[j] = (step + flush) - flush


@kernel(inline="always")
def advance_storing(
    now: Any,
    old: Any,
    keep: Any,
    fade: Any,
    drive: Any,
    weights: Any,
    spans: Any,
    margin: int,
    scratch: Any,
    stored: Any,
) -> None:
    """Like ``advance``; also stores the Laplacian times spacing squared over the image alone.

    Args:
        now, old, keep, fade, drive, weights, spans: as ``advance`` takes them.
        margin: nodes of padding.
        scratch: (ny,), a row.
        stored: of the image's shape; filled where nodes matter.
    """
    use_widest_vectors()
    flush = now.dtype.type(FLUSH)
    for i in range(HALO, now.shape[0] - HALO):
        begin, end = spans[(i - HALO) // TILE, 0], spans[(i - HALO) // TILE, 1]
        rows, into, k, f, d = _rows(now, old, keep, fade, drive, i, begin, end)
        for j in range(into.shape[0]):
            laplacian = _laplacian(rows, weights, j)
            scratch[j] = laplacian
            into[j] = (k[j] * rows[0][j + HALO] - f[j] * into[j] + d[j] * laplacian + flush) - flush
        if margin <= i < margin + stored.shape[0]:
            left, right = inside(spans[(i - HALO) // TILE], margin, stored.shape[1])
            out, found = stored[i - margin, left:right], scratch[left + margin - begin :]
            for j in range(out.shape[0]):
                out[j] = found[j]


@kernel(inline="always")
def inside(span: Any, margin: int, nodes: int) -> Any:
    """The part of a span of the padded grid that lies in the image; (0, 0) where none does."""
    left, right = max(span[0] - margin, 0), min(span[1] - margin, nodes)
    return (left, right) if left < right else (0, 0)


@kernel(inline="always")
def _rows(now: Any, old: Any, keep: Any, fade: Any, drive: Any, i: int, first: int, last: int) -> Any:
    """Row i of the field with its neighbours at distance 1 to 4, before and after; what a step reads else."""
    # Rows are sliced so that every neighbour has an index from 0: no index is negative, and the loop over a
    # row is vectorised.
    row = now[i, first - HALO : last + HALO]
    a1, b1, a2, b2 = now[i - 1, first:], now[i + 1, first:], now[i - 2, first:], now[i + 2, first:]
    a3, b3, a4, b4 = now[i - 3, first:], now[i + 3, first:], now[i - 4, first:], now[i + 4, first:]
    rows = (row, a1, b1, a2, b2, a3, b3, a4, b4)
    return rows, old[i, first:last], keep[i, first:last], fade[i, first:last], drive[i, first:last]


@kernel(inline="always")
def _laplacian(rows: Any, weights: Any, j: int) -> Any:
    """The Laplacian times spacing squared."""
    row, a1, b1, a2, b2, a3, b3, a4, b4 = rows
    return (
        (weights[0] + weights[0]) * row[j + 4]
        + weights[1] * ((a1[j] + b1[j]) + (row[j + 3] + row[j + 5]))
        + weights[2] * ((a2[j] + b2[j]) + (row[j + 2] + row[j + 6]))
        + weights[3] * ((a3[j] + b3[j]) + (row[j + 1] + row[j + 7]))
        + weights[4] * ((a4[j] + b4[j]) + (row[j] + row[j + 8]))
    )


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
    y = first[1]
    for i in range(TAPS):
        x, part = first[0] + i, along[0, i] * value
        into, factor, across = field[x, y : y + TAPS], drive[x, y : y + TAPS], along[1]
        for j in range(TAPS):
            into[j] += factor[j] * (part * across[j])


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
