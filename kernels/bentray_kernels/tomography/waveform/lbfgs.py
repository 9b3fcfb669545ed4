"""The direction of limited-memory BFGS from the changes of the last steps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...arrays import Floats

# Pairs of changes of image and gradient with less relative curvature than this are left out.
FLAT = 1e-10


def search_direction(
    gradient: Floats, steps: Floats, changes: Floats, prior: Callable[[Floats], Floats]
) -> Floats:
    """The gradient by the inverse curvature, to be subtracted (Nocedal & Wright 2006, algorithm 7.4).

    Args:
        gradient: (nx, ny).
        steps: (pairs, nx, ny), changes of the image, oldest first.
        changes: (pairs, nx, ny), those of the gradient.
        prior: a symmetric positive guess of the inverse curvature, but for its size, which the last pair
            gives; without pairs it is used as it is.
    """
    rest = gradient.copy()
    shares = []
    for s, y in zip(steps[::-1], changes[::-1], strict=True):
        share = float((s * rest).sum() / (s * y).sum())
        shares.append(share)
        rest -= share * y
    found = prior(rest)
    if len(steps):
        s, y = steps[-1], changes[-1]
        found = found * float((s * y).sum() / (y * prior(y)).sum())
    for s, y, share in zip(steps, changes, shares[::-1], strict=True):
        found = found + s * (share - float((y * found).sum() / (s * y).sum()))
    return np.asarray(found)


def append_pair(
    steps: Floats, changes: Floats, step: Floats, change: Floats, memory: int
) -> tuple[Floats, Floats]:
    """The pairs with one more, the oldest forgotten; unchanged where the curvature is not positive.

    Args:
        steps, changes: (pairs, nx, ny).
        step, change: (nx, ny).
        memory: pairs at most.
    """
    along = float((step * change).sum())
    if not along > FLAT * float(np.sqrt((step**2).sum() * (change**2).sum())):
        return steps, changes
    return (
        np.concatenate((steps, step[None]))[-memory:],
        np.concatenate((changes, change[None]))[-memory:],
    )
