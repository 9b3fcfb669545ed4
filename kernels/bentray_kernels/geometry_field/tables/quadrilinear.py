"""Linear interpolation in four dimensions between the 16 entries of a table around a line.

Dissertation, section 5.3.4. Its weights are ⌈x⌉ − x and x − ⌊x⌋, which lose every x that is a whole number;
so the first of them is 1 − (x − ⌊x⌋) here.
"""

from ...arrays import Float32s
from ...compilation.compiled import kernel
from ...compilation.float32 import higher, lower, real, whole

# The entry with the lower samples; the way from there to the next sample in x₀, x₁, x₂, x₃.
Corner = tuple[int, float, float, float, float]


@kernel(inline="always")
def corner_of(n: int, s: int, sx: float, sy: float, t: int, tx: float, ty: float) -> Corner:
    """The 16 entries about a line, given where it enters and leaves as ``tables.cube.line_of`` does."""
    x0, a0 = _between(sx, n)
    x1, a1 = _between(sy, n)
    x2, a2 = _between(tx, n)
    x3, a3 = _between(ty, n)
    # In floats, as in ``tables.cube.number_at``.
    entry = whole(real(6 * n) * x1 + x0 + real(s) * real(n))
    exit_ = whole(real(6 * n) * x3 + x2 + real(t) * real(n))
    return entry * (6 * n * n) + exit_, a0, a1, a2, a3


@kernel(inline="always")
def nearest_of(n: int, corner: Corner) -> int:
    """The entry with the largest weight."""
    at, a0, a1, a2, a3 = corner
    half = real(0.5)
    exit_ = 6 * n * whole(a3 >= half) + whole(a2 >= half)
    entry = 6 * n * whole(a1 >= half) + whole(a0 >= half)
    nearest: int = at + entry * (6 * n * n) + exit_
    return nearest


@kernel(inline="always")
def _between(x: float, n: int) -> tuple[float, float]:
    """The sample before a coordinate in [0, 1] of a face, and how far to the next one; never over an edge."""
    place = lower(higher(x * real(n) - real(0.5), real(0.0)), real(n - 1))
    before = real(whole(lower(place, real(n - 2))))
    return before, place - before


@kernel(inline="always")
def lerp4(entries: Float32s, n: int, corner: Corner, channels: int, channel: int) -> float:
    """One channel of a table, interpolated linearly in four dimensions; NaN where one of the 16 is.

    Args:
        entries: the table in one dimension.
        n: samples along an edge of the cube.
        corner: ``corner_of``.
        channels, channel: numbers of an entry, and which.
    """
    at, a0, a1, a2, a3 = corner
    row = 6 * n * n
    first = _lerp2(entries, n, at, a2, a3, channels, channel)
    first += a0 * (_lerp2(entries, n, at + row, a2, a3, channels, channel) - first)
    at += 6 * n * row
    second = _lerp2(entries, n, at, a2, a3, channels, channel)
    second += a0 * (_lerp2(entries, n, at + row, a2, a3, channels, channel) - second)
    return first + a1 * (second - first)


@kernel(inline="always")
def _lerp2(entries: Float32s, n: int, at: int, a2: float, a3: float, channels: int, channel: int) -> float:
    here, above = channels * at + channel, channels * (at + 6 * n) + channel
    first = entries[here] + a2 * (entries[here + channels] - entries[here])
    second = entries[above] + a2 * (entries[above + channels] - entries[above])
    mean: float = first + a3 * (second - first)
    return mean
