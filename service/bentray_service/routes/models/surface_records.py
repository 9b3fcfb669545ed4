"""What the REST interface answers of meshes and geometry fields."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from pydantic import BaseModel, Field


class Repairs(BaseModel):
    """What was done to make one sound surface of a mesh."""

    merged_vertices: int = Field(description="Vertices that lay in the place of another one.")
    unused_vertices: int = Field(description="Vertices of no face.")
    turned_faces: int = Field(description="Faces that ran against the others.")
    parted_vertices: int = Field(description="Vertices added where parts of the surface only touched.")
    dropped_pieces: int = Field(description="Of an iso-surface, all pieces but the largest.")


class MeshRecord(BaseModel):
    """One triangle mesh: an upload, or the iso-surface of a volume."""

    id: str
    title: str
    format: str = Field(description="Of the file that was uploaded; isosurface of a volume's.")
    volume: str | None = Field(description="The volume whose iso-surface it is.")
    iso: float | None = Field(description="Its iso-value.")
    vertices: int
    faces: int
    genus: int = Field(description="Handles: 0 of a ball, 1 of a ring.")
    closed: bool
    holes: int = Field(description="Boundaries; 0 where it is closed.")
    coloured: bool = Field(description="Whether its vertices have colours.")
    repairs: Repairs
    bytes: int = Field(description="Size of what was uploaded, or of the file that was made.")
    sha256: str = Field(description="SHA-256 of that.")
    created: datetime
    links: dict[str, str]


class MeshList(BaseModel):
    """Meshes, newest first."""

    meshes: list[MeshRecord]


class FieldSizes(BaseModel):
    """How much there is of each."""

    faces: int
    vertices: int
    points: int = Field(description="Of the surface, from which rays leave it in the inner field.")
    image_pixels: int = Field(description="Along a side of the geometry image.")
    outer_bytes: int = Field(description="Of the table of rays from outside.")
    inner_bytes: int = Field(description="Of the table of rays that leave the surface.")


class FieldErrors(BaseModel):
    """How far things are from what they stand for, in edges of the unit cube; null where nothing was met."""

    image_rms: float = Field(description="Rms distance of the geometry image from the surface, either way.")
    image_greatest: float = Field(description="Its greatest distance.")
    conformal: bool = Field(description="Whether the layout of the geometry image keeps angles.")
    median_quasi_conformal: float | None = Field(
        description="1 where a face keeps its angles; of half the faces less."
    )
    area_stretch: float = Field(description="How unevenly the layout scales areas; 1 is evenly.")
    lookup_wrong: float | None = Field(
        description="Share of rays whose hit or miss accurate lookups tell wrong."
    )
    lookup_median: float | None = Field(
        description="Distance of accurate lookups from the exact place, half of them."
    )
    lookup_99: float | None = Field(description="The same, 99 of 100.")


class FieldSeconds(BaseModel):
    """Seconds of tasks, added up over those that ran side by side."""

    parameterisation: float
    image: float
    error: float = Field(description="Of measuring the image, where no threshold had it measured before.")
    outer: float
    inner: float
    border: float = Field(description="Of marking, in entries without a face, what is met beside them.")


class FieldRecord(BaseModel):
    """One geometry field; the same mesh and settings have the same one."""

    id: str
    mesh: str = Field(description="The mesh that it was first made of.")
    job: str = Field(description="The job that made it.")
    settings: dict[str, Any]
    sizes: FieldSizes
    errors: FieldErrors
    seconds: FieldSeconds
    bytes: int = Field(description="Of all of its files.")
    created: datetime
    links: dict[str, str]


class FieldList(BaseModel):
    """Geometry fields, newest first."""

    geometry_fields: list[FieldRecord]
