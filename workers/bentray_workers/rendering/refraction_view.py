"""Settings of refractive rendering: iso-surfaces, camera, backdrop and picture, with their checks."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, Literal

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.names import DESCRIPTION, DeviceRequest, UpAxis
from bentray_kernels.requests.ranges import Range
from bentray_kernels.requests.rendering_limits import MAX_ISOS, MAX_SMOOTHING
from bentray_kernels.requests.request_fields import MAX_PIXELS, MAX_RAYS, Uses, check, setting

if TYPE_CHECKING:
    import numpy as np

    from bentray_kernels.refraction import Layers

INDEX = Range(0.01, 100.0)

# When settings of glass have an effect.
GLASS: Uses = ({"mode": ("refract",)},)

# Of a B-spline through 8-bit integers: their steps, at every node, would scatter refracted rays.
SMOOTHING_8_BIT = 30.0

# A test compares them with those of the splines, which load compiled code.
FILTERS = ("central", "trilinear", "catmull-rom", "bspline2", "bspline3", "bspline4", "bspline5", "bspline6")


def up_setting() -> Any:
    """The field of a view for the axis that is up."""
    return setting(
        "auto",
        "Axis of the object that is up; auto: z, unless it stands on a larger base on another side.",
        label="Up axis",
        words={"auto": "automatic"},
    )


@dataclass(frozen=True)
class RefractionView:
    """A refractive rendering of the iso-surfaces of a volume.

    The meaning of each field is its metadata ``description``, used by query parameters and options too.

    Raises:
        InvalidInput: naming the first field that is wrong.
    """

    iso: tuple[float, ...] = setting(
        (),
        "Increasing iso-values, unit of the volume; by default the middle of its range after smoothing.",
        schema={"maxItems": MAX_ISOS},
    )
    index: tuple[float, ...] = setting(
        (1.5,),
        "Refractive index above each iso-value: one for each, or one.",
        schema={"items": {"type": "number", **INDEX.schema}, "minItems": 1, "maxItems": MAX_ISOS},
        label="Refractive index",
        used_when=GLASS,
    )
    outside: float = setting(1.0, "Refractive index below the first iso-value.", INDEX, used_when=GLASS)
    surroundings: int = setting(
        0,
        "Layer that surrounds the volume: 0 the one below the first iso-value, 1 the next, ...",
        schema={"minimum": 0, "maximum": MAX_ISOS},
        used_when=GLASS,
    )
    filter: str = setting(
        "bspline3",
        "Filter between the nodes: " + ", ".join(FILTERS) + ".",
        schema={"enum": list(FILTERS)},
        words={
            **{f"bspline{order}": f"B-spline {order}" for order in range(2, 7)},
            "catmull-rom": "Catmull-Rom",
            "central": "central differences",
        },
    )
    smoothing: float | None = setting(
        None,
        "Smoothing of a B-spline; 0 interpolates the nodes, 10 to 100 removes the steps of 8-bit data. By "
        f"default {SMOOTHING_8_BIT:g} for volumes of 8-bit integers, else 0.",
        Range(0.0, MAX_SMOOTHING),
        unset=f"{SMOOTHING_8_BIT:g} for 8-bit volumes, else 0",
    )
    camera: Literal["orthographic", "perspective"] = setting("orthographic", "Kind of camera.")
    azimuth_deg: float = setting(
        30.0,
        "Azimuth of the camera about the vertical, degrees.",
        Range(-36000.0, 36000.0),
        label="Azimuth, degrees",
    )
    elevation_deg: float = setting(
        20.0,
        "Elevation of the camera above the horizon, degrees.",
        Range(-90.0, 90.0),
        label="Elevation, degrees",
    )
    zoom: float = setting(1.0, "Zoom factor: 1 shows the whole volume, 2 half of it.", Range(0.05, 50.0))
    up: UpAxis = up_setting()  # noqa: RUF009 - a field, by its function
    backdrop: Literal["checkerboard", "picture", "warped-checkerboard", "warped-picture"] = setting(
        "checkerboard",
        "What is behind the volume: a plane with a checkerboard or a picture, or the same on a wavy surface.",
        words={"warped-checkerboard": "warped checkerboard", "warped-picture": "warped picture"},
        used_when=GLASS,
    )
    squares: int = setting(
        16,
        "Squares of the checkerboard across the shorter side of the picture.",
        Range(1, 512),
        used_when=({"mode": ("refract",), "backdrop": ("checkerboard", "warped-checkerboard")},),
    )
    backdrop_distance: float = setting(
        1.0, "Distance from the centre of the volume, in its diagonals.", Range(0.5, 100.0), used_when=GLASS
    )
    supersampling: Literal["none", "prss", "real"] = setting(
        "prss",
        "prss: more samples of the backdrop after refraction, smoothed where neighbouring rays take other "
        "paths; real: more rays.",
        words={"prss": "PRSS", "real": "more rays"},
    )
    degree: int = setting(
        1,
        "prss: samples between pixels; real: rays along each side of a pixel.",
        Range(1, 8),
        used_when=({"supersampling": ("real",)}, {"mode": ("refract",), "supersampling": ("prss",)}),
    )
    ray_spacing: int = setting(
        1,
        "Pixels between rays along both sides, for a preview: where rays end is interpolated between them.",
        Range(1, 8),
        used_when=({"mode": ("refract",), "supersampling": ("none", "prss")},),
    )
    fresnel: bool = setting(
        False, "Attenuate light by the Fresnel reflection at each surface.", used_when=GLASS
    )
    mode: Literal["refract", "shaded"] = setting("refract", "refract, or shaded: the first surface, lit.")
    width: int = setting(512, "Width of the picture, pixels.", Range(1, MAX_PIXELS))
    height: int = setting(512, "Height of the picture, pixels.", Range(1, MAX_PIXELS))
    depth: int = setting(
        16,
        "Largest number of surfaces on a ray; beyond it the picture is dark grey.",
        Range(1, 256),
        used_when=GLASS,
    )
    device: DeviceRequest = setting("auto", DESCRIPTION)  # noqa: RUF009 - a string, by its alias

    def __post_init__(self) -> None:
        check(self)
        if len(self.iso) > MAX_ISOS:
            raise InvalidInput("iso", f"{len(self.iso)} iso-values", f"at most {MAX_ISOS}")
        if len(self.index) not in (1, max(len(self.iso), 1)):
            raise InvalidInput(
                "index", self.index, f"{max(len(self.iso), 1)}: one for each iso-value, or one"
            )
        for index in self.index:
            INDEX.check("index", index)
        layers = max(len(self.iso), 1)
        if not 0 <= self.surroundings <= layers:
            raise InvalidInput("surroundings", self.surroundings, f"a layer, 0 to {layers}")
        if self.iso:
            self.layers()
        if self.smoothing and not self._smooths:
            raise InvalidInput("smoothing", self.smoothing, "0, unless the filter is a B-spline")
        rays = self.width * self.height * self.times**2
        if rays > MAX_RAYS:
            raise InvalidInput("width, height, degree", f"{rays} rays", f"at most {MAX_RAYS}")

    @property
    def times(self) -> int:
        """Rays along each side of a pixel."""
        return self.degree if self.supersampling == "real" else 1

    def layers(self) -> Layers:
        """Iso-values and indices for the ray caster; raises InvalidInput unless the values increase."""
        from bentray_kernels.refraction import Layers

        return Layers(self.iso, (self.outside, *self.indices), self.surroundings)

    @property
    def indices(self) -> tuple[float, ...]:
        """The refractive index above each iso-value."""
        return self.index * len(self.iso) if len(self.index) == 1 else self.index

    def within(self, low: float, high: float) -> RefractionView:
        """The view for a volume with values from ``low`` to ``high``, with the default iso-value filled in.

        With smoothing, or while the type of the values decides on it, it is not filled in yet: smoothing
        changes the range, see ``filtered_within``.

        Raises:
            InvalidInput: for an iso-value out of that range, or a constant volume.
        """
        self._check_range(low, high, "the range of the volume")
        unsmoothed = self.smoothing == 0.0 or not self._smooths
        return self._at_middle(low, high) if unsmoothed and not self.iso else self

    def smoothing_for(self, dtype: np.dtype[Any]) -> float:
        """The smoothing of a volume of this type, with the default filled in."""
        if self.smoothing is not None:
            return self.smoothing
        return SMOOTHING_8_BIT if self._smooths and dtype == "uint8" else 0.0

    def filtered_within(self, low: float, high: float) -> RefractionView:
        """Check by ``within`` a filtered volume with values from ``low`` to ``high`` at the nodes.

        Raises:
            InvalidInput: as ``within``.
        """
        smooth = self._smooths and self.smoothing != 0.0
        self._check_range(low, high, "the range of the volume" + (" after smoothing" if smooth else ""))
        return self if self.iso else self._at_middle(low, high)

    @property
    def _smooths(self) -> bool:
        """Whether the filter takes smoothing."""
        return self.filter.startswith("bspline")

    def _check_range(self, low: float, high: float, words: str) -> None:
        if not low < high:
            raise InvalidInput("volume", f"{low:.6g} everywhere", "a volume whose values differ")
        for iso in self.iso:
            if not low <= iso <= high:
                raise InvalidInput("iso", f"{iso:g}", f"{low:.6g} to {high:.6g}, {words}")

    def _at_middle(self, low: float, high: float) -> RefractionView:
        return replace(self, iso=(0.5 * (low + high),))

    def plain(self) -> dict[str, Any]:
        """The fields as JSON values."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}


def check_even(shape: tuple[int, ...], spacing_m: tuple[float | None, ...]) -> None:
    """Reject images and volumes with uneven spacing, such as slices at uneven heights.

    Raises:
        InvalidInput: naming ``volume``.
    """
    accepted = "a 3-D volume with two nodes or more along each axis and even spacing"
    if len(shape) != 3 or min(shape) < 2:
        raise InvalidInput("volume", f"shape {tuple(shape)}", accepted)
    if not all(step is not None and math.isfinite(step) for step in spacing_m):
        raise InvalidInput("volume", f"uneven slices (spacing {list(spacing_m)} m)", accepted)
