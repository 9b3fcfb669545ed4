"""Directivity of the elements: pairs whose path lies within the opening angle at both ends."""

import math

import numpy as np

from ..acquisition.dataset import Dataset
from ..arrays import Flags
from ..errors import InvalidInput

NORMAL = "geometry/element_normal"


def check_normals(opening_angle_deg: float | None, *, normals: bool) -> None:
    """Check that a scan states the directions of its elements, if an opening angle is given.

    Raises:
        InvalidInput: without them.
    """
    if opening_angle_deg is not None and not normals:
        raise InvalidInput(
            "opening_angle_deg",
            f"{opening_angle_deg:g} for a scan without directions of its elements",
            f"null, or the directions in the file ({NORMAL})",
        )


def within_opening(dataset: Dataset, opening_angle_deg: float) -> Flags:
    """Pairs of which each element lies in the cone around the direction of the other, (ntx, nrx).

    Args:
        dataset: with directions of the elements, of any length > 0.
        opening_angle_deg: full angle of the cone, degrees.

    Raises:
        InvalidInput: without directions, for one of length 0, and where no pair is left.
    """
    normal = dataset.element_normal
    check_normals(opening_angle_deg, normals=normal is not None)
    assert normal is not None
    length = np.linalg.norm(normal, axis=1)
    if (length == 0.0).any():
        element = int(np.argmin(length))
        raise InvalidInput(NORMAL, f"{normal[element].tolist()} for element {element}", "a length > 0")
    unit = normal / length[:, None]
    path = dataset.element_position_m[dataset.rx][None] - dataset.element_position_m[dataset.tx][:, None]
    along = np.linalg.norm(path, axis=-1)
    # Half a thousandth of a degree for elements on the edge of the cone.
    least = along * math.cos(math.radians(min(0.5 * opening_angle_deg + 5e-4, 90.0)))
    sent = np.einsum("erd,ed->er", path, unit[dataset.tx]) >= least
    received = np.einsum("erd,rd->er", path, -unit[dataset.rx]) >= least
    inside = sent & received & (along > 0.0)
    if not inside.any():
        raise InvalidInput(
            "opening_angle_deg",
            f"{opening_angle_deg:g}, within which no pair lies",
            f"a larger angle, or directions that point towards the object ({NORMAL})",
        )
    return np.asarray(inside)
