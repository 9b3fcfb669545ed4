"""The options of the refractive rendering of a volume."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .option_tables import Option, with_options

if TYPE_CHECKING:
    from bentray_workers.rendering.refraction_view import RefractionView

# By field, in the order of the help. A test compares the defaults with those of the dataclass.
OPTIONS = {
    "iso": Option("--iso", list[float], "the middle of the range", "Increasing iso-values; repeatable."),
    "index": Option("--index", list[float], "1.5", "Refractive index above each iso-value; repeatable."),
    "outside": Option("--outside", float, "1.0", "Refractive index below the first iso-value."),
    "surroundings": Option(
        "--surroundings", int, "0", "Layer that surrounds the volume; 0 is below the first iso-value."
    ),
    "filter": Option(
        "--filter",
        str,
        "bspline3",
        "Reconstruction filter: central, trilinear, catmull-rom, bspline2 to bspline6.",
    ),
    "smoothing": Option(
        "--smoothing",
        float,
        "30 for 8-bit volumes, else 0",
        "Smoothing of a B-spline; 10 to 100 removes 8-bit quantisation steps.",
    ),
    "camera": Option("--camera", str, "orthographic", "Projection: orthographic or perspective."),
    "azimuth_deg": Option("--azimuth", float, "30.0", "Azimuth of the camera about the z axis, degrees."),
    "elevation_deg": Option(
        "--elevation", float, "20.0", "Elevation of the camera above the x-y plane, degrees."
    ),
    "zoom": Option("--zoom", float, "1.0", "Zoom factor; 1 shows the whole volume."),
    "backdrop": Option(
        "--backdrop",
        str,
        "checkerboard",
        "Backdrop: checkerboard, picture (a test image), warped-checkerboard or warped-picture (on a wavy "
        "surface), or an image file.",
    ),
    "squares": Option("--squares", int, "16", "Squares of the checkerboard across the shorter side."),
    "backdrop_distance": Option(
        "--distance", float, "1.0", "Distance of the backdrop, in diagonals of the volume."
    ),
    "supersampling": Option(
        "--supersampling", str, "prss", "Supersampling: none, prss (after refraction), or real (more rays)."
    ),
    "degree": Option("--degree", int, "1", "Degree of supersampling."),
    "ray_spacing": Option("--ray-spacing", int, "1", "Pixels between rays, for a preview."),
    "fresnel": Option("--fresnel", bool, "False", "Attenuate light by Fresnel reflection at each surface."),
    "mode": Option("--mode", str, "refract", "refract, or shaded: the first surface, lit."),
    "width": Option("--width", int, "512", "Image width, pixels."),
    "height": Option("--height", int, "512", "Image height, pixels."),
    "depth": Option("--depth", int, "16", "Maximum number of surfaces that a ray intersects."),
    "device": Option("--device", str, "auto", "auto, cpu or opencl; see bentray devices."),
}


@dataclass(frozen=True)
class ViewOptions:
    """Values of the given options, by field."""

    given: dict[str, Any]

    def view(self) -> tuple[RefractionView, Path | None]:
        """The view, and the image file of its backdrop, if any; raises InvalidInput for an invalid field."""
        from bentray_kernels.request_fields import check_used
        from bentray_workers.rendering.refraction_view import CHOICES, RefractionView

        given: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in self.given.items()}
        backdrop, file = given.get("backdrop"), None
        if backdrop is not None and backdrop not in CHOICES["backdrop"]:
            given["backdrop"], file = "picture", Path(backdrop)
        return check_used(RefractionView(**given)), file


with_view_options = with_options(OPTIONS, ViewOptions)
