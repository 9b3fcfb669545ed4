"""How a geometry field is made: its samples, and its geometry image."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from typing import Any

from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.tables.cube import MOST_SAMPLES
from bentray_kernels.ranges import Range
from bentray_kernels.request_fields import asked, check

# Of the meshes that are laid out by one task; its time grows a little faster than they do.
MOST_FACES = 300_000

# Of the tables: a face and a fraction; a face.
OUTER_ENTRY_BYTES, INNER_ENTRY_BYTES = 8, 4
# Of the geometry image: a position, a normal, a colour and whether it is valid.
PIXEL_BYTES = 37
# Of the chart: corners and a vertex with its place on the square, each face with vertices of its own at
# worst; and for each face its point.
FACE_BYTES = 3 * (4 + 24 + 16) + 8
HEADER_BYTES = 64 * 2**10

# Changed whenever the same mesh and settings give other tables.
VERSION = 1


@dataclass(frozen=True)
class FieldSettings:
    """What each setting means is its metadata ``description``.

    Raises:
        InvalidInput: naming the first field that is wrong.
    """

    samples: int = asked(
        24,
        "Samples along an edge of the cube for rays from outside, n: the table has 36n⁴ entries.",
        Range(4, MOST_SAMPLES),
    )
    inner_samples: int = asked(16, "The same for rays that leave the surface itself.", Range(4, MOST_SAMPLES))
    divisions: int = asked(
        16,
        "Small cubes along an edge of the cube, in which points of the surface count as one.",
        Range(1, 64),
    )
    image_size: int = asked(
        513,
        "Pixels along a side of the geometry image; the most, where there is a threshold.",
        Range(33, 1025),
    )
    image_threshold: float = asked(
        0.0,
        "Greatest rms distance of the image from the surface, in edges of the unit cube: the image is "
        "halved as long as it keeps it; 0 keeps image_size.",
        Range(0.0, 0.5),
    )

    def __post_init__(self) -> None:
        check(self, {})

    def plain(self) -> dict[str, Any]:
        """Its fields as JSON has them."""
        return asdict(self)

    def largest_bytes(self, faces: int) -> int:
        """Of the files of a field, at most.

        Args:
            faces: of the mesh.
        """
        outer: int = (6 * self.samples**2) ** 2 * OUTER_ENTRY_BYTES
        points = min(faces, 6 * self.divisions**3)
        inner = points * 6 * self.inner_samples**2 * INNER_ENTRY_BYTES
        return outer + inner + self.image_size**2 * PIXEL_BYTES + faces * FACE_BYTES + HEADER_BYTES

    def content(self, mesh: str) -> str:
        """SHA-256 that names the field of a mesh under these settings.

        Args:
            mesh: ``StoredMesh.content``.
        """
        named = json.dumps([VERSION, mesh, self.plain()], sort_keys=True)
        return hashlib.sha256(named.encode()).hexdigest()


def check_faces(faces: int) -> None:
    """Refuse a mesh that is too large for a field.

    Raises:
        InvalidInput: naming ``mesh``.
    """
    if faces > MOST_FACES:
        raise InvalidInput("mesh", f"{faces} faces", f"a mesh of at most {MOST_FACES} faces")
