"""How a volume is looked at as glass: surfaces, camera, backdrop and picture, checked once for every door."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any, Literal

from bentray_kernels.errors import InvalidInput
from bentray_kernels.isosurface.octree import MOST_ISOS
from bentray_kernels.ranges import Range
from bentray_kernels.refraction import Layers
from bentray_kernels.request_fields import MOST_PIXELS, MOST_RAYS, asked, check
from bentray_kernels.splines import FILTERS
from bentray_kernels.splines.prefilter import MOST_SMOOTHING

INDEX = Range(0.01, 100.0)

CHOICES = {
    "filter": tuple(FILTERS),
    "camera": ("orthographic", "perspective"),
    "backdrop": ("checkerboard", "picture"),
    "supersampling": ("none", "prss", "real"),
    "mode": ("refract", "shaded"),
}


@dataclass(frozen=True)
class RefractionView:
    """A picture of a volume through its iso-surfaces.

    What each field means is its metadata ``description``; query parameters and options are made of them.

    Raises:
        InvalidInput: naming the first field that is wrong.
    """

    iso: tuple[float, ...] = asked(
        (),
        "Rising iso-values, unit of the volume; without any, the middle of its range after smoothing.",
        schema={"maxItems": MOST_ISOS},
    )
    index: tuple[float, ...] = asked(
        (1.5,),
        "Refractive index above each iso-value: as many as there are of these, or one.",
        schema={"items": {"type": "number", **INDEX.schema}, "minItems": 1, "maxItems": MOST_ISOS},
    )
    outside: float = asked(1.0, "Refractive index below the first iso-value.", INDEX)
    surroundings: int = asked(
        0,
        "Which layer goes on around the volume: 0 the one below the first iso-value, 1 the next, ...",
        schema={"minimum": 0, "maximum": MOST_ISOS},
    )
    filter: str = asked(
        "bspline3",
        "Filter between the nodes: " + ", ".join(FILTERS) + ".",
        schema={"enum": list(FILTERS)},
    )
    smoothing: float = asked(
        0.0,
        "How much a B-spline smooths away; 0 passes through the nodes, 10 to 100 takes off steps of 8 bits.",
        Range(0.0, MOST_SMOOTHING),
    )
    camera: Literal["orthographic", "perspective"] = asked("orthographic", "Kind of camera.")
    azimuth_deg: float = asked(
        30.0, "Where the camera stands: angle about the z axis, degrees.", Range(-36000.0, 36000.0)
    )
    elevation_deg: float = asked(20.0, "Its height above the x-y plane, degrees.", Range(-90.0, 90.0))
    zoom: float = asked(1.0, "1 shows the whole volume, 2 half of it.", Range(0.05, 50.0))
    backdrop: Literal["checkerboard", "picture"] = asked("checkerboard", "What is seen through the volume.")
    squares: int = asked(
        16, "Squares of the checkerboard across the shorter side of the picture.", Range(1, 512)
    )
    backdrop_distance: float = asked(
        1.0, "From the middle of the volume, in its diagonals.", Range(0.5, 100.0)
    )
    supersampling: Literal["none", "prss", "real"] = asked(
        "prss",
        "prss: more samples of the backdrop after refraction; real: more rays.",
    )
    degree: int = asked(
        1, "Samples beside each pixel for prss; rays along each side of it for real.", Range(1, 8)
    )
    fresnel: bool = asked(False, "Whether light is weakened by what each surface mirrors away.")
    mode: Literal["refract", "shaded"] = asked("refract", "refract, or shaded: the first surface, lit.")
    width: int = asked(512, "Pixels.", Range(1, MOST_PIXELS))
    height: int = asked(512, "Pixels.", Range(1, MOST_PIXELS))
    depth: int = asked(
        16,
        "Most surfaces that a ray may meet; where it would meet more, the picture is dark grey.",
        Range(1, 256),
    )

    def __post_init__(self) -> None:
        check(self, CHOICES)
        if len(self.iso) > MOST_ISOS:
            raise InvalidInput("iso", f"{len(self.iso)} iso-values", f"at most {MOST_ISOS}")
        if len(self.index) != max(len(self.iso), 1):
            raise InvalidInput("index", self.index, f"{max(len(self.iso), 1)}: one for each iso-value")
        for index in self.index:
            INDEX.check("index", index)
        if not 0 <= self.surroundings <= len(self.index):
            raise InvalidInput("surroundings", self.surroundings, f"a layer, 0 to {len(self.index)}")
        if self.iso:
            self.layers()
        if self.smoothing and not self.filter.startswith("bspline"):
            raise InvalidInput("smoothing", self.smoothing, "0, unless the filter is a B-spline")
        rays = self.width * self.height * self.times**2
        if rays > MOST_RAYS:
            raise InvalidInput("width, height, degree", f"{rays} rays", f"at most {MOST_RAYS}")

    @property
    def times(self) -> int:
        """Rays along each side of a pixel."""
        return self.degree if self.supersampling == "real" else 1

    def layers(self) -> Layers:
        """Iso-values and indices as the ray caster takes them; raises InvalidInput unless the values rise."""
        return Layers(self.iso, (self.outside, *self.index), self.surroundings)

    def within(self, low: float, high: float) -> RefractionView:
        """The same for a volume with values from ``low`` to ``high``: with an iso-value, if it has none.

        With smoothing it gets none yet: that changes the range, and ``filtered_within`` takes the middle of
        the new one.

        Raises:
            InvalidInput: for an iso-value out of that range, or a volume that has one value only.
        """
        self._check_range(low, high, "the range of the volume")
        return self if self.iso or self.smoothing else self._at_middle(low, high)

    def filtered_within(self, low: float, high: float) -> RefractionView:
        """The same for a volume whose nodes lie from ``low`` to ``high`` behind the filter, as ``within``.

        Raises:
            InvalidInput: as ``within``.
        """
        words = "the range of the volume after smoothing" if self.smoothing else "the range of the volume"
        self._check_range(low, high, words)
        return self if self.iso else self._at_middle(low, high)

    def _check_range(self, low: float, high: float, words: str) -> None:
        if not low < high:
            raise InvalidInput("volume", f"{low:.6g} everywhere", "a volume whose values differ")
        for iso in self.iso:
            if not low <= iso <= high:
                raise InvalidInput("iso", f"{iso:g}", f"{low:.6g} to {high:.6g}, {words}")

    def _at_middle(self, low: float, high: float) -> RefractionView:
        return replace(self, iso=(0.5 * (low + high),))

    def plain(self) -> dict[str, Any]:
        """Its fields as JSON has them."""
        found = {one.name: getattr(self, one.name) for one in fields(self)}
        return {name: list(value) if isinstance(value, tuple) else value for name, value in found.items()}


def check_even(shape: tuple[int, ...], spacing_m: tuple[float | None, ...]) -> None:
    """Refuse what is not a volume in space on an even grid, as the slices of a ring at odd heights are.

    Raises:
        InvalidInput: naming ``volume``.
    """
    accepted = "a volume in space, two nodes or more along each axis, with even spacing"
    if len(shape) != 3 or min(shape) < 2:
        raise InvalidInput("volume", f"shape {tuple(shape)}", accepted)
    if not all(step is not None and math.isfinite(step) for step in spacing_m):
        raise InvalidInput("volume", f"uneven slices (spacing {list(spacing_m)} m)", accepted)
