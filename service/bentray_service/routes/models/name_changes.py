"""Changes of names, notes and other statements of the user."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from bentray_kernels.limits import WATER_C

# PostgreSQL stores no NUL in a text.
TEXT = r"^[^\u0000]*$"
Name = Annotated[str, Field(max_length=200, pattern=TEXT)]
Notes = Annotated[str, Field(max_length=4000, pattern=TEXT, description="Notes of the user.")]


class DatasetChanges(BaseModel):
    """Name, notes and water of a scan; what is absent stays, and so do a name and notes that are null."""

    model_config = ConfigDict(extra="forbid")

    title: Name | None = Field(None, description="Name of the scan; empty: the title in the file.")
    notes: Notes | None = None
    water_temperature_c: float | None = Field(
        None,
        ge=WATER_C.least,
        le=WATER_C.most,
        # true is no temperature.
        strict=True,
        description="Temperature of the water, °C, for later reconstructions and views, in place of that of "
        "the file, which stays as it is; null: that of the file again.",
    )


class JobChanges(BaseModel):
    """Name and notes of a job; what is absent or null stays."""

    model_config = ConfigDict(extra="forbid")

    name: Name | None = Field(None, description="Name of the job; empty: none.")
    notes: Notes | None = None
