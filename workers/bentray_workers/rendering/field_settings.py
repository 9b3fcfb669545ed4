"""Settings of a geometry field: samples and geometry image."""

import hashlib
import json
from dataclasses import asdict, dataclass
from typing import Any

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.ranges import Range
from bentray_kernels.requests.rendering_limits import MAX_SAMPLES
from bentray_kernels.requests.request_fields import check, setting

# Largest mesh for the layout in one task; the time grows slightly faster than linearly.
MAX_FACES = 300_000

# Table entries: a face and a fraction; a face.
OUTER_ENTRY_BYTES, INNER_ENTRY_BYTES = 8, 4
# Pixel of the geometry image: position, normal, colour and validity.
PIXEL_BYTES = 37
# Chart, per face: corners and vertices with their positions on the square, at most three new vertices per
# face; and one point.
FACE_BYTES = 3 * (4 + 24 + 16) + 8
HEADER_BYTES = 64 * 2**10

# To be changed when the same mesh and settings give other tables.
VERSION = 1


@dataclass(frozen=True)
class FieldSettings:
    """The meaning of each setting is its metadata ``description``.

    Raises:
        InvalidInput: naming the first field that is wrong.
    """

    samples: int = setting(
        24,
        "Samples along an edge of the cube for rays from outside, n: the table has 36n⁴ entries.",
        Range(4, MAX_SAMPLES),
        label="Samples per edge",
    )
    inner_samples: int = setting(16, "The same for rays that start on the surface.", Range(4, MAX_SAMPLES))
    divisions: int = setting(
        16,
        "Cells along an edge of the cube, in each of which points of the surface are merged.",
        Range(1, 64),
    )
    image_size: int = setting(
        513,
        "Pixels along a side of the geometry image; with a threshold, the largest number.",
        Range(33, 1025),
    )
    image_threshold: float = setting(
        0.0,
        "Largest rms distance of the image from the surface, in edges of the unit cube: the image is halved "
        "as long as it stays below; 0: use image_size.",
        Range(0.0, 0.5),
    )

    def __post_init__(self) -> None:
        check(self, {})

    def plain(self) -> dict[str, Any]:
        """The fields as JSON values."""
        return asdict(self)

    def largest_bytes(self, faces: int) -> int:
        """Largest size of the files of a field, bytes.

        Args:
            faces: of the mesh.
        """
        outer: int = (6 * self.samples**2) ** 2 * OUTER_ENTRY_BYTES
        points = min(faces, 6 * self.divisions**3)
        inner = points * 6 * self.inner_samples**2 * INNER_ENTRY_BYTES
        return outer + inner + self.image_size**2 * PIXEL_BYTES + faces * FACE_BYTES + HEADER_BYTES

    def content(self, mesh: str) -> str:
        """SHA-256 that identifies the field of a mesh with these settings.

        Args:
            mesh: ``StoredMesh.content``.
        """
        named = json.dumps([VERSION, mesh, self.plain()], sort_keys=True)
        return hashlib.sha256(named.encode()).hexdigest()


def check_faces(faces: int) -> None:
    """Reject a mesh that is too large for a field.

    Raises:
        InvalidInput: naming ``mesh``.
    """
    if faces > MAX_FACES:
        raise InvalidInput("mesh", f"{faces} faces", f"a mesh of at most {MAX_FACES} faces")
