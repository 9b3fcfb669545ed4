"""Packed texels: an interpolated picture with the three channels of a texel in one number."""

import numpy as np
from numpy.typing import NDArray

from ..compilation.compiled import kernel

Texels = NDArray[np.uint64]

# Bits between two channels. The weights of four texels sum to 2^12, so that a channel fills 20 bits.
LANE = 21
# Steps of a place between two texels.
STEP_BITS = 6
STEPS = 1 << STEP_BITS
# Of a reduced colour, a channel has 8 bits and 8 more behind the point.
WHOLE = 256
ONE, FULL, SHIFT = np.uint64(1), np.uint64(STEPS), np.uint64(4)
# Of two colours: a bit more.
PAIR = np.uint64(sum(0x1FFFF << (LANE * channel) for channel in range(3)))
CHANNEL = np.uint64((1 << LANE) - 1)
SECOND, THIRD = np.uint64(LANE), np.uint64(2 * LANE)


def packed(picture: NDArray[np.uint8], repeated: bool) -> Texels:
    """The texels of a picture with a frame of one texel, so that every place lies between four.

    Args:
        picture: (rows, columns, 3).
        repeated: whether the frame shows the opposite edge; else the own edge.

    Returns:
        (rows + 2, columns + 2).
    """
    framed = np.pad(picture, ((1, 1), (1, 1), (0, 0)), mode="wrap" if repeated else "edge").astype(np.uint64)
    return np.asarray(framed[..., 0] | framed[..., 1] << SECOND | framed[..., 2] << THIRD)


@kernel(inline="always")
def between_texels(
    texels: Texels, first: np.uint64, stride: np.uint64, right: np.uint64, lower: np.uint64
) -> np.uint64:
    """Colour between four texels, bilinear.

    Args:
        texels: as ``packed`` returns them, in one dimension.
        first: place of the upper left texel.
        stride: texels in a row, with the frame.
        right, lower: steps from there, below ``STEPS``.

    Returns:
        three channels of 0 to 255 · ``STEPS``², ``LANE`` bits apart; two of them have a sum without overflow.
    """
    second = first + stride
    # Differences of channels may be negative; the weighted sums are not, and whole numbers wrap around.
    a, b = texels[first], texels[second]
    a = a * FULL + right * (texels[first + ONE] - a)
    b = b * FULL + right * (texels[second + ONE] - b)
    colour: np.uint64 = a * FULL + lower * (b - a)
    return colour


@kernel(inline="always")
def reduced(colours: np.uint64) -> np.uint64:
    """One colour of ``between_texels``, or a sum of two, in ``WHOLE``; 32 colours then have a sum."""
    return colours >> SHIFT & PAIR


@kernel(inline="always")
def unpacked(total: np.uint64) -> tuple[np.int64, np.int64, np.int64]:
    """The three channels of a sum of colours."""
    return np.int64(total & CHANNEL), np.int64((total >> SECOND) & CHANNEL), np.int64(total >> THIRD)
