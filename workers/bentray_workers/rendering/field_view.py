"""Settings of a picture of a geometry field, with their checks."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.names import DESCRIPTION, DeviceRequest, UpAxis
from bentray_kernels.requests.ranges import Range
from bentray_kernels.requests.rendering_limits import MAX_REFERENCE_SAMPLES
from bentray_kernels.requests.request_fields import MAX_PIXELS, MAX_RAYS, check, setting

from .refraction_view import up_setting

# Public names, and those of the kernels.
LOOKUPS = {
    "nearest": "nearest",
    "linear": "linear",
    "accurate": "walk",
    "exact": "exact",
    "uv-nearest": "uv-nearest",
    "uv-linear": "uv-linear",
}
# Objects on the ground, by scene; a single object hovers.
OBJECTS = {"object": 0, "mirror-ball": 3, "two-mirrors": 2}
# Of an object from the centre of the ground, which has a radius of 7 m.
POSITION_M = Range(-5.0, 5.0, unit="m")


@dataclass(frozen=True)
class FieldView:
    """A picture of a mesh by its geometry field.

    The meaning of each field is its metadata ``description``, used by query parameters and options too.

    Raises:
        InvalidInput: naming the first field that is wrong.
    """

    scene: Literal["object", "mirror-ball", "two-mirrors"] = setting(
        "object",
        "object: the mesh in a landscape; mirror-ball: two copies and a reflecting ball; two-mirrors: two "
        "copies side by side.",
        words={"object": "object alone", "mirror-ball": "two and a ball", "two-mirrors": "two objects"},
    )
    mode: Literal["reflect", "refract", "refract-single", "self", "self-only", "diffuse"] = setting(
        "reflect",
        "Material of the mesh. reflect: a mirror; self: with self-reflection; self-only: the same before a "
        "dark background; refract: glass; refract-single: glass with a single refraction; diffuse: clay, or "
        "its own colours.",
        label="Material",
        words={
            "reflect": "mirror",
            "refract": "glass",
            "refract-single": "glass, refracted once",
            "self": "mirror with self-reflection",
            "self-only": "self-reflection alone",
            "diffuse": "clay",
        },
    )
    lookup: Literal["nearest", "linear", "accurate", "exact", "uv-nearest", "uv-linear"] = setting(
        "accurate",
        "Field lookup of reflected and refracted rays; exact intersects the mesh itself. uv-nearest and "
        "uv-linear, as published (Li 2008, chapter 5), look (u, v) up in the field, and position and normal "
        "in the geometry image: for comparison, with larger errors, and at most 24 samples.",
        label="Field lookup",
        words={
            "exact": "exact (no field)",
            "uv-nearest": "published, nearest (u, v)",
            "uv-linear": "published, linear (u, v)",
        },
    )
    eye: Literal["nearest", "linear", "accurate", "exact", "uv-nearest", "uv-linear"] = setting(
        "exact", "The same for camera rays."
    )
    index: float = setting(
        1.5,
        "Refractive index of glass.",
        Range(0.1, 10.0),
        label="Refractive index",
        used_when=({"mode": ("refract", "refract-single")},),
    )
    share: float = setting(
        0.85,
        "Share of reflected or refracted light; the rest is the colour of the mesh.",
        Range(0.0, 1.0),
        label="Share of the light",
        used_when=({"mode": ("reflect", "refract", "refract-single", "self", "self-only")},),
    )
    camera: Literal["perspective", "orthographic"] = setting("perspective", "Kind of camera.")
    azimuth_deg: float = setting(
        -60.0,
        "Azimuth of the camera about the vertical, degrees.",
        Range(-36000.0, 36000.0),
        label="Azimuth, degrees",
    )
    elevation_deg: float = setting(
        15.0,
        "Elevation of the camera above the horizon, degrees.",
        Range(-89.0, 89.0),
        label="Elevation, degrees",
    )
    zoom: float = setting(1.0, "Zoom factor: 1 shows the whole scene, 2 half of it.", Range(0.05, 50.0))
    up: UpAxis = up_setting()  # noqa: RUF009 - a field, by its function
    positions_m: tuple[float, ...] = setting(
        (),
        "x and y of each object on the ground, m, as x1, y1, x2, y2 and so on, the ball last; by default "
        "those of the scene. A single object cannot be moved.",
        schema={"items": {"type": "number", **POSITION_M.schema}, "maxItems": 2 * max(OBJECTS.values())},
        unset="those of the scene",
    )
    width: int = setting(512, "Width of the picture, pixels.", Range(1, MAX_PIXELS))
    height: int = setting(512, "Height of the picture, pixels.", Range(1, MAX_PIXELS))
    rays: int = setting(1, "Rays along each side of a pixel.", Range(1, 8))
    depth: int = setting(4, "Largest number of surfaces on a ray.", Range(0, 64))
    device: DeviceRequest = setting("auto", DESCRIPTION)  # noqa: RUF009 - a string, by its alias

    def __post_init__(self) -> None:
        check(self)
        numbers = 2 * OBJECTS[self.scene]
        if len(self.positions_m) not in (0, numbers):
            given = f"{len(self.positions_m)} numbers"
            accepted = (
                f"none, or {numbers}: x and y of each object"
                if numbers
                else "none: this scene has one object"
            )
            raise InvalidInput("positions_m", given, accepted)
        for position in self.positions_m:
            POSITION_M.check("positions_m", position)
        count = self.width * self.height * self.rays**2
        if count > MAX_RAYS:
            raise InvalidInput("width, height, rays", f"{count} rays", f"at most {MAX_RAYS}")

    @property
    def times(self) -> int:
        """Rays along each side of a pixel."""
        return self.rays

    @property
    def reads_image(self) -> bool:
        """Whether hits are read from the geometry image."""
        return self.lookup.startswith("uv-") or self.eye.startswith("uv-")

    def check_samples(self, samples: int) -> None:
        """Reject the published lookups for a field with too many samples.

        Raises:
            InvalidInput: naming ``samples``.
        """
        if self.reads_image and samples > MAX_REFERENCE_SAMPLES:
            raise InvalidInput("samples", samples, f"at most {MAX_REFERENCE_SAMPLES}, for lookups of (u, v)")

    def plain(self) -> dict[str, Any]:
        """The fields as JSON values."""
        return asdict(self) | {"positions_m": list(self.positions_m)}
