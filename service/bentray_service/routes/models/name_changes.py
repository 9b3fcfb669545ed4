"""Changes of names and notes of the user."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

# PostgreSQL stores no NUL in a text.
TEXT = r"^[^\u0000]*$"
Name = Annotated[str, Field(max_length=200, pattern=TEXT)]
Notes = Annotated[str, Field(max_length=4000, pattern=TEXT, description="Notes of the user.")]


class DatasetChanges(BaseModel):
    """Name and notes of a scan; what is absent or null stays."""

    model_config = ConfigDict(extra="forbid")

    title: Name | None = Field(None, description="Name of the scan; empty: the title in the file.")
    notes: Notes | None = None


class JobChanges(BaseModel):
    """Name and notes of a job; what is absent or null stays."""

    model_config = ConfigDict(extra="forbid")

    name: Name | None = Field(None, description="Name of the job; empty: none.")
    notes: Notes | None = None
