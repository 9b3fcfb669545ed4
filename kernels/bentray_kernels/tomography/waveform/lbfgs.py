"""Search direction of limited-memory BFGS."""

from collections.abc import Callable

import numpy as np

from ...arrays import Floats

# Most pairs of changes.
MEMORY = 8

# Pairs of changes of image and gradient with less relative curvature than this are left out.
FLAT = 1e-10


def search_direction(
    gradient: Floats, steps: Floats, changes: Floats, prior: Callable[[Floats], Floats]
) -> Floats:
    """The inverse Hessian times the gradient, to be subtracted (Nocedal & Wright 2006, algorithm 7.4).

    Args:
        gradient: (nx, ny).
        steps: (pairs, nx, ny), changes of the image, oldest first.
        changes: (pairs, nx, ny), of the gradient.
        prior: symmetric positive estimate of the inverse Hessian, scaled by the last pair if there is one.
    """
    rest = gradient.copy()
    shares = []
    for s, y in zip(steps[::-1], changes[::-1], strict=True):
        share = float((s * rest).sum() / (s * y).sum())
        shares.append(share)
        rest -= share * y
    direction = prior(rest)
    if len(steps):
        s, y = steps[-1], changes[-1]
        direction = direction * float((s * y).sum() / (y * prior(y)).sum())
    for s, y, share in zip(steps, changes, shares[::-1], strict=True):
        direction = direction + s * (share - float((y * direction).sum() / (s * y).sum()))
    return np.asarray(direction)


def append_pair(steps: Floats, changes: Floats, step: Floats, change: Floats) -> tuple[Floats, Floats]:
    """Append a pair and drop the oldest beyond ``MEMORY`` pairs; unchanged if the curvature is not positive.

    Args:
        steps, changes: (pairs, nx, ny).
        step, change: (nx, ny).
    """
    along = float((step * change).sum())
    if not along > FLAT * float(np.sqrt((step**2).sum() * (change**2).sum())):
        return steps, changes
    return (
        np.concatenate((steps, step[None]))[-MEMORY:],
        np.concatenate((changes, change[None]))[-MEMORY:],
    )
