"""What the REST interface answers of uploads that come in pieces."""

from __future__ import annotations

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, Field

from ...rows.records import UploadRow
from ...web.errors import Problem

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


def upload_record(row: UploadRow, offset: int) -> UploadRecord:
    links = {"self": f"/v1/uploads/{row['id']}"}
    done = row["state"] == "done"
    if done:
        links["result"] = result_link(row)
    result = row["result_id"] if done else None
    more = {"kind": row["what"], "offset": offset, "result": result, "links": links}
    return UploadRecord.model_validate({**row, **more})


def result_link(row: UploadRow) -> str:
    """The address of what an upload became."""
    return f"{PLACES[row['what']]}/{row['result_id']}"
