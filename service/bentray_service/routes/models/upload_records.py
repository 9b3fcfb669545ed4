"""Models of resumable uploads."""

from __future__ import annotations

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, Field

from ...web.problem import Problem


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
