"""The body of an error: problem+json of RFC 9457, with the field, the value found and the values accepted."""

from pydantic import BaseModel, ConfigDict, Field


class Fault(BaseModel):
    """One wrong value."""

    field: str = Field(description="Name of the invalid value.")
    found: str = Field(description="Value found.")
    accepted: str = Field(description="Values accepted.")


class Problem(BaseModel):
    """An error in the form of RFC 9457."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "type": "/problems/invalid-input",
                    "title": "Invalid value",
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

    type: str = Field(description="Relative address of the type of problem.")
    title: str
    status: int
    detail: str = Field(description="Explanation of this problem.")
    instance: str | None = Field(None, description="Path of the request.")
    field: str | None = None
    found: str | None = None
    accepted: str | None = None
    errors: list[Fault] | None = Field(None, description="All invalid values.")
    correlation_id: str | None = Field(None, description="Identifier of the error in the log.")
