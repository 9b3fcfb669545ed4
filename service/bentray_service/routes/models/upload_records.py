"""What the REST interface answers of uploads that come in pieces."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any, Literal

from pydantic import BaseModel, Field

from ...web.errors import Problem

Row = dict[str, Any]

# Where each kind is listed.
PLACES = {"dataset": "/v1/datasets", "volume": "/v1/volumes", "mesh": "/v1/meshes"}


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


def upload_record(row: Row, offset: int) -> UploadRecord:
    links = {"self": f"/v1/uploads/{row['id']}"}
    done = row["state"] == "done"
    if done:
        links["result"] = result_link(row)
    return UploadRecord(
        id=row["id"],
        kind=row["what"],
        state=row["state"],
        offset=offset,
        length=row["length"],
        result=row["result_id"] if done else None,
        problem=row["problem"],
        created=datetime.fromtimestamp(row["created"], UTC),
        expires=datetime.fromtimestamp(row["expires"], UTC),
        links=links,
    )


def result_link(row: Row) -> str:
    """The address of what an upload became."""
    return f"{PLACES[row['what']]}/{row['result_id']}"
