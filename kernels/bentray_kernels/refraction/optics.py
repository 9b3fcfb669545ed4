"""Refraction and reflection at smooth interfaces: Snell's law, total reflection and Fresnel weights."""

import math

from ..arrays import Vector
from ..compilation.compiled import kernel


@kernel(inline="always")
def refracted(direction: Vector, normal: Vector, ratio: float) -> tuple[Vector, float, bool]:
    """Refracted direction, or the reflected one at total reflection (dissertation, equation 10).

    Args:
        direction: unit vector along which the ray arrives.
        normal: unit vector of the interface, either way.
        ratio: refractive index before the interface over the one behind it.

    Returns:
        The new unit direction, the share of unpolarised energy that goes there, and whether it passed. The
        share is 1 at total reflection; what an interface mirrors besides is not followed.
    """
    along = direction[0] * normal[0] + direction[1] * normal[1] + direction[2] * normal[2]
    cosine = abs(along)
    passed = 1.0 - ratio * ratio * (1.0 - cosine * cosine)
    if passed < 0.0:
        # The mirrored direction, for either sense of the normal.
        turn = -2.0 * along
        share, goes = 1.0, False
        bent = (
            direction[0] + turn * normal[0],
            direction[1] + turn * normal[1],
            direction[2] + turn * normal[2],
        )
    else:
        behind = math.sqrt(passed)
        turn = (behind - ratio * cosine) * math.copysign(1.0, along)
        s, p = reflectances(cosine, behind, ratio)
        share, goes = 1.0 - 0.5 * (s + p), True
        bent = (
            ratio * direction[0] + turn * normal[0],
            ratio * direction[1] + turn * normal[1],
            ratio * direction[2] + turn * normal[2],
        )
    # A unit vector but for rounding; one step of Newton's method for 1/√ keeps it one.
    longer = 1.5 - 0.5 * (bent[0] * bent[0] + bent[1] * bent[1] + bent[2] * bent[2])
    return (longer * bent[0], longer * bent[1], longer * bent[2]), share, goes


@kernel(inline="always")
def reflectances(cosine: float, behind: float, ratio: float) -> tuple[float, float]:
    """Fresnel's share of reflected energy, polarised across (s) and in (p) the plane of incidence.

    Args:
        cosine: of the angle of incidence.
        behind: of the angle of refraction.
        ratio: refractive index before the interface over the one behind it.
    """
    s = (ratio * cosine - behind) / (ratio * cosine + behind)
    p = (ratio * behind - cosine) / (ratio * behind + cosine)
    return s * s, p * p
