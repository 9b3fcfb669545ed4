"""The body of an error: problem+json of RFC 9457, with the field, the value found and the values accepted."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field


class Fault(BaseModel):
    """One wrong value."""

    field: str = Field(description="The name of what is wrong.")
    found: str = Field(description="What was there.")
    accepted: str = Field(description="What would have been taken.")


class Problem(BaseModel):
    """An error in the form of RFC 9457."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "type": "/problems/invalid-input",
                    "title": "A value cannot be used",
                    "status": 422,
                    "detail": "index: found 99; accepted: 0 to 29",
                    "instance": "/v1/volumes/vol-0123456789abcdef0123/slice.png",
                    "field": "index",
                    "found": "99",
                    "accepted": "0 to 29",
                }
            ]
        }
    )

    type: str = Field(description="Relative address that names the kind of problem.")
    title: str
    status: int
    detail: str = Field(description="What went wrong, in words.")
    instance: str | None = Field(None, description="The path that was asked for.")
    field: str | None = None
    found: str | None = None
    accepted: str | None = None
    errors: list[Fault] | None = Field(None, description="Every wrong value, where there may be several.")
    correlation_id: str | None = Field(None, description="Quote it to find the error in the log.")
