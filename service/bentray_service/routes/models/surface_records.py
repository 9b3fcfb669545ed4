"""Models of meshes and geometry fields."""

from datetime import datetime
from typing import Any, ClassVar

from pydantic import BaseModel, Field

from ...html_tables import ShownRecord


class Repairs(BaseModel):
    """Repairs of a mesh."""

    merged_vertices: int = Field(
        description="Merged vertices at one position, within the rounding of a file."
    )
    unused_vertices: int = Field(description="Removed vertices without a face.")
    flat_faces: int = Field(0, description="Removed faces without area; the surface stays the same.")
    repeated_faces: int = Field(0, description="Removed faces of the same three vertices as another one.")
    turned_faces: int = Field(description="Faces with reversed orientation.")
    parted_vertices: int = Field(description="Vertices duplicated at non-manifold points.")
    dropped_pieces: int = Field(description="Removed components of an iso-surface, all but the largest.")


class MeshRecord(ShownRecord):
    """One triangle mesh: an upload, or the iso-surface of a volume."""

    columns: ClassVar = ("id", "title", "format", "vertices", "faces", "created")

    id: str
    title: str
    format: str = Field(description="Format of the uploaded file, or isosurface.")
    volume: str | None = Field(description="Id of the volume of an iso-surface.")
    iso: float | None = Field(description="Its iso-value.")
    vertices: int
    faces: int
    genus: int = Field(description="Number of handles: 0 for a sphere, 1 for a torus.")
    closed: bool
    holes: int = Field(description="Number of boundary loops; 0 for a closed mesh.")
    coloured: bool = Field(description="Whether the vertices have colours.")
    repairs: Repairs
    bytes: int = Field(description="Size of the uploaded or generated file.")
    sha256: str = Field(description="SHA-256 of this file.")
    created: datetime
    links: dict[str, str]


class MeshList(BaseModel):
    """Meshes, newest first."""

    meshes: list[MeshRecord]


class FieldSizes(BaseModel):
    """Sizes of a geometry field."""

    faces: int
    vertices: int
    points: int = Field(description="Surface points of the inner field.")
    image_pixels: int = Field(description="Pixels per side of the geometry image.")
    outer_bytes: int = Field(description="Size of the outer field, the table of rays from outside.")
    inner_bytes: int = Field(description="Size of the inner field, the table of rays from the surface.")


class FieldErrors(BaseModel):
    """Errors of a geometry field, in edges of the unit cube; null without any hit."""

    image_rms: float = Field(description="Symmetric rms distance between geometry image and surface.")
    image_greatest: float = Field(description="Symmetric maximum distance between them.")
    conformal: bool = Field(description="Whether the parameterisation is conformal.")
    median_quasi_conformal: float | None = Field(
        description="Median quasi-conformal distortion; 1 preserves angles."
    )
    area_stretch: float = Field(description="Area distortion of the parameterisation; 1 is uniform.")
    lookup_wrong: float | None = Field(
        description="Share of rays with a wrong hit or miss in accurate lookups."
    )
    lookup_median: float | None = Field(
        description="Median distance between accurate lookups and exact intersections."
    )
    lookup_99: float | None = Field(description="99th percentile of this distance.")


class FieldSeconds(BaseModel):
    """Computing times of a geometry field, summed over parallel tasks, s."""

    parameterisation: float
    image: float
    error: float = Field(description="Measuring the error of the image, if not done for a threshold.")
    outer: float
    inner: float
    border: float = Field(description="Marking table entries at the silhouette.")


class FieldRecord(BaseModel):
    """One geometry field, identified by mesh and settings."""

    id: str
    mesh: str = Field(description="Id of its first mesh.")
    job: str = Field(description="Id of the job that created it.")
    settings: dict[str, Any]
    sizes: FieldSizes
    errors: FieldErrors
    seconds: FieldSeconds
    bytes: int = Field(description="Size of all its files.")
    created: datetime
    links: dict[str, str]


class FieldList(BaseModel):
    """Geometry fields, newest first."""

    geometry_fields: list[FieldRecord]
