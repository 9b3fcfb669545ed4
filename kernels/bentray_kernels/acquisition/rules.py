"""Validation rules for the fields of a dataset; each raises InvalidInput with the name in the file format."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInput
from ..requests.ranges import Range


def shape(name: str, array: NDArray[Any], expected: tuple[int, ...]) -> None:
    """The array has exactly this shape."""
    if array.shape != expected:
        raise InvalidInput(name, f"shape {array.shape}", f"shape {expected}")


def no_infinity(name: str, array: NDArray[Any]) -> None:
    """Every value is a number or NaN, which stands for a missing one."""
    _refuse(name, array, np.isinf(array), "finite values, NaN for missing ones")


def finite(name: str, array: NDArray[Any]) -> None:
    """Every value is a number."""
    _refuse(name, array, ~np.isfinite(array), "finite values")


def positive_or_nan(name: str, array: NDArray[Any]) -> None:
    """Every value is above zero, or NaN for a missing one."""
    _refuse(
        name,
        array,
        ~(np.isnan(array) | (array > 0.0) & np.isfinite(array)),
        "values > 0, NaN for missing ones",
    )


def within_or_nan(name: str, array: NDArray[Any], within: Range) -> None:
    """Every value lies in a range, or is NaN for a missing one."""
    if array.size == 0:
        return
    # No array of flags in the valid case: there may be hundreds of millions of pairs.
    if all(
        np.isnan(end) or within.holds(end)
        for end in (np.fmin.reduce(array, None), np.fmax.reduce(array, None))
    ):
        return
    wrong = ~np.isnan(array) & ~((array >= within.least) & (array <= within.most))
    if within.above:
        wrong |= array == within.least
    _refuse(name, array, wrong, f"{within.words}, NaN for missing ones")


def _refuse(name: str, array: NDArray[Any], wrong: NDArray[np.bool_], accepted: str) -> None:
    if wrong.any():
        first = tuple(int(i) for i in np.argwhere(wrong)[0])
        raise InvalidInput(name, f"{array[first]} at {list(first)} ({wrong.sum()} such values)", accepted)
