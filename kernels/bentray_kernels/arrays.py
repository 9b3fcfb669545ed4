"""Array types of signatures, and the refusal of masked arrays."""

import numpy as np
from numpy.typing import NDArray

from .errors import InvalidInput

Floats = NDArray[np.float64]
Float32s = NDArray[np.float32]
Ints = NDArray[np.int64]
Int32s = NDArray[np.int32]
Flags = NDArray[np.bool_]
# One point or direction in a kernel, (x, y, z).
Vector = tuple[float, float, float]


def refuse_mask(field: str, array: object) -> None:
    """Refuse an array with masked values, which computation would take as if they were not masked.

    Args:
        field: name for the message.
        array: any object; a masked array without masked values is taken.

    Raises:
        InvalidInput: with the number of masked values, and the first of them.
    """
    if isinstance(array, np.ma.MaskedArray) and np.ma.is_masked(array):
        mask = np.ma.getmaskarray(array)
        first = [int(i) for i in np.argwhere(mask)[0]]
        raise InvalidInput(
            field,
            f"a masked array, {int(mask.sum())} of {mask.size} values masked, the first at {first}",
            "an array without masked values; fill them: obstacles of a wave with a low speed such as 1 m/s, "
            "unknown values with those around them (array.filled(value))",
        )
