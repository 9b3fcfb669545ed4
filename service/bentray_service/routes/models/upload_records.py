"""What the REST interface answers of uploads that come in pieces."""

from __future__ import annotations

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, Field

from ...web.problem import Problem


class UploadRecord(BaseModel):
    """One upload that comes in pieces."""

    id: str
    kind: Literal["dataset", "volume", "mesh"] = Field(description="What it becomes.")
    state: Literal["receiving", "reading", "done", "refused"]
    offset: int = Field(description="Bytes that are there.")
    length: int = Field(description="Bytes of all of it.")
    result: str | None = Field(description="Id of what it became, once it is done.")
    problem: Problem | None = Field(description="Why it was refused.")
    created: datetime
    expires: datetime = Field(description="When it goes, unless something comes; what it became stays.")
    links: dict[str, str]
