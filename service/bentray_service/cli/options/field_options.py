"""The options of a geometry field: its settings and its view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .option_tables import Option, with_options

if TYPE_CHECKING:
    from bentray_workers.rendering.field_settings import FieldSettings
    from bentray_workers.rendering.field_view import FieldView

# By field, in the order of the help. A test compares the defaults with those of the dataclasses.
SETTINGS = {
    "samples": Option("--samples", int, "24", "Samples per edge of the cube in the outer field, 4 to 48."),
    "inner_samples": Option("--inner-samples", int, "16", "Samples per edge of the cube in the inner field."),
    "divisions": Option("--divisions", int, "16", "Cells per edge of the cube that share a surface point."),
    "image_size": Option("--image-size", int, "513", "Pixels per side of the geometry image, 33 to 1025."),
    "image_threshold": Option(
        "--image-threshold", float, "0.0", "Halve the geometry image while its rms error is below; 0: never."
    ),
}
VIEW = {
    "scene": Option("--scene", str, "object", "Scene: object, mirror-ball or two-mirrors."),
    "mode": Option(
        "--mode", str, "reflect", "Material: reflect, refract, refract-single, self, self-only or diffuse."
    ),
    "lookup": Option(
        "--lookup",
        str,
        "accurate",
        "Lookup of secondary rays: nearest, linear, accurate, exact (no field), or as published uv-nearest "
        "or uv-linear.",
    ),
    "eye": Option("--eye", str, "exact", "Lookup of primary rays."),
    "index": Option("--index", float, "1.5", "Refractive index of the object."),
    "share": Option("--share", float, "0.85", "Share of reflected or refracted light."),
    "camera": Option("--camera", str, "perspective", "Projection: perspective or orthographic."),
    "azimuth_deg": Option("--azimuth", float, "-60.0", "Azimuth of the camera, degrees."),
    "elevation_deg": Option("--elevation", float, "15.0", "Elevation of the camera, degrees."),
    "zoom": Option("--zoom", float, "1.0", "Zoom factor; 1 shows the whole scene."),
    "up": Option("--up", str, "z", "Upward axis of the mesh: z or y."),
    "positions_m": Option(
        "--position",
        list[float],
        "those of the scene",
        "x and y of each object on the ground, m, in turn; repeatable.",
    ),
    "width": Option("--width", int, "512", "Image width, pixels."),
    "height": Option("--height", int, "512", "Image height, pixels."),
    "rays": Option("--rays", int, "1", "Rays per side of a pixel."),
    "depth": Option("--depth", int, "4", "Maximum number of reflections and refractions of a ray."),
    "device": Option("--device", str, "auto", "auto, cpu or opencl; see bentray devices."),
}
OPTIONS = {**SETTINGS, **VIEW}


@dataclass(frozen=True)
class FieldOptions:
    """Values of the given options, by field."""

    given: dict[str, Any]

    def settings(self) -> FieldSettings:
        """The settings; raises InvalidInput naming the first invalid one."""
        from bentray_workers.rendering.field_settings import FieldSettings

        return FieldSettings(**{name: value for name, value in self.given.items() if name in SETTINGS})

    def view(self) -> FieldView:
        """The view; raises InvalidInput naming the first invalid field."""
        from bentray_kernels.request_fields import check_used
        from bentray_workers.rendering.field_view import FieldView

        given: dict[str, Any] = {name: value for name, value in self.given.items() if name in VIEW}
        if "positions_m" in given:
            given["positions_m"] = tuple(given["positions_m"])
        view: FieldView = check_used(FieldView(**given))
        return view


with_field_options = with_options(OPTIONS, FieldOptions)
