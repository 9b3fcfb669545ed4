"""The compiled finite-difference time step along three axes, point sources and receivers."""

from typing import Any

from ..compilation.compiled import kernel
from .stencil import HALO
from .time_step import FLUSH, TAPS


@kernel(inline="always")
def advance_3d(now: Any, old: Any, keep: Any, fade: Any, drive: Any, weights: Any) -> None:
    """Like ``time_step.advance``, for (nx, ny, nz)."""
    nx, ny, nz = now.shape
    inner = nz - 2 * HALO
    w0 = weights[0] + weights[0] + weights[0]
    w1, w2, w3, w4 = weights[1], weights[2], weights[3], weights[4]
    flush = now.dtype.type(FLUSH)
    for i in range(HALO, nx - HALO):
        for j in range(HALO, ny - HALO):
            row = now[i, j]
            into = old[i, j, HALO : HALO + inner]
            k, f, d = (
                keep[i, j, HALO : HALO + inner],
                fade[i, j, HALO : HALO + inner],
                drive[i, j, HALO : HALO + inner],
            )
            a1, b1 = now[i - 1, j, HALO:], now[i + 1, j, HALO:]
            l1, r1 = now[i, j - 1, HALO:], now[i, j + 1, HALO:]
            a2, b2 = now[i - 2, j, HALO:], now[i + 2, j, HALO:]
            l2, r2 = now[i, j - 2, HALO:], now[i, j + 2, HALO:]
            a3, b3 = now[i - 3, j, HALO:], now[i + 3, j, HALO:]
            l3, r3 = now[i, j - 3, HALO:], now[i, j + 3, HALO:]
            a4, b4 = now[i - 4, j, HALO:], now[i + 4, j, HALO:]
            l4, r4 = now[i, j - 4, HALO:], now[i, j + 4, HALO:]
            for m in range(inner):
                here = row[m + 4]
                laplacian = (
                    w0 * here
                    + w1 * (((a1[m] + b1[m]) + (l1[m] + r1[m])) + (row[m + 3] + row[m + 5]))
                    + w2 * (((a2[m] + b2[m]) + (l2[m] + r2[m])) + (row[m + 2] + row[m + 6]))
                    + w3 * (((a3[m] + b3[m]) + (l3[m] + r3[m])) + (row[m + 1] + row[m + 7]))
                    + w4 * (((a4[m] + b4[m]) + (l4[m] + r4[m])) + (row[m] + row[m + 8]))
                )
                into[m] = (k[m] * here - f[m] * into[m] + d[m] * laplacian + flush) - flush


@kernel(inline="always")
def inject_3d(field: Any, drive: Any, first: Any, along: Any, value: Any) -> None:
    """Add the source of one element, with the factors of the scheme."""
    for i in range(TAPS):
        for j in range(TAPS):
            for k in range(TAPS):
                x, y, z = first[0] + i, first[1] + j, first[2] + k
                field[x, y, z] += drive[x, y, z] * (along[0, i] * along[1, j] * along[2, k] * value)


@kernel(inline="always")
def read_3d(field: Any, first: Any, along: Any) -> Any:
    """The field at one element."""
    value = field.dtype.type(0)
    for i in range(TAPS):
        for j in range(TAPS):
            line = field.dtype.type(0)
            for k in range(TAPS):
                line += along[2, k] * field[first[0] + i, first[1] + j, first[2] + k]
            value += along[0, i] * along[1, j] * line
    return value
