"""Models of resumable uploads."""

from datetime import datetime
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from ...web.problem import Problem


class DirectUploadRequest(BaseModel):
    """A file that is sent straight to the bucket of the service."""

    model_config = ConfigDict(extra="forbid")

    kind: Literal["dataset", "volume", "mesh"] = "dataset"
    # What every reader of JSON holds as a whole number.
    length: int = Field(ge=1, le=2**53 - 1, description="Size of the file, bytes.")
    metadata: dict[str, Annotated[str, Field(max_length=1000)]] = Field(
        default_factory=dict,
        max_length=20,
        description="As in `Upload-Metadata` of /v1/uploads, but as text.",
    )


class PartsRequest(BaseModel):
    """Parts of which addresses are asked for."""

    model_config = ConfigDict(extra="forbid")

    numbers: Annotated[list[Annotated[int, Field(ge=1, le=10_000)]], Field(min_length=1, max_length=100)] = (
        Field(description="Numbers of parts, from 1.")
    )


class PartRecord(BaseModel):
    """One part of a direct upload."""

    number: int
    bytes: int = Field(description="Size of the part, which the address is signed for.")
    url: str = Field(description="Address for PUT.")


class PartAddresses(BaseModel):
    """Addresses of parts, and which parts are complete."""

    parts: list[PartRecord]
    received: list[int] = Field(description="Numbers of the parts that are in the bucket.")


class DirectUploadRecord(BaseModel):
    """One direct upload."""

    id: str
    kind: Literal["dataset", "volume", "mesh"] = Field(description="Type of the result.")
    state: Literal["receiving", "reading", "done", "refused"]
    length: int = Field(description="Total size, bytes.")
    parts: int = Field(description="Number of parts.")
    part_bytes: int = Field(description="Size of each part but the last.")
    result: str | None = Field(description="Id of the result of a completed upload.")
    problem: Problem | None = Field(description="Problem of a refused upload.")
    created: datetime
    expires: datetime = Field(description="Expiry without further data; the result is kept.")
    links: dict[str, str]


class UploadRecord(BaseModel):
    """One resumable upload."""

    id: str
    kind: Literal["dataset", "volume", "mesh"] = Field(description="Type of the result.")
    state: Literal["receiving", "reading", "done", "refused"]
    offset: int = Field(description="Bytes received.")
    length: int = Field(description="Total size, bytes.")
    result: str | None = Field(description="Id of the result of a completed upload.")
    problem: Problem | None = Field(description="Problem of a refused upload.")
    created: datetime
    expires: datetime = Field(description="Expiry without further data; the result is kept.")
    links: dict[str, str]
