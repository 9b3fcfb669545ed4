"""Changes of names, notes and other statements of the user, and corrections of scans."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from bentray_kernels.requests.limits import FREQUENCY_HZ, SAMPLING_HZ, WATER_C

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


TimeUnit = Literal["s", "ms", "us", "ns"]
LengthUnit = Literal["m", "cm", "mm", "um"]


class ScanCorrection(BaseModel):
    """Values of a scan that were stated wrongly; absent or null ones stay."""

    model_config = ConfigDict(extra="forbid")

    times_in: TimeUnit | None = Field(
        None,
        description="Unit of the times in the original file: travel times and their deviations, time "
        "of the first sample, and sample interval.",
    )
    times_read_as: TimeUnit = Field(
        "s", description="Unit in which they were read: as stated at upload, s in the upload format."
    )
    positions_in: LengthUnit | None = Field(
        None,
        description="Unit of the lengths in the original file: positions, radius, heights of slices, "
        "and grid of the truth.",
    )
    positions_read_as: LengthUnit = Field(
        "m", description="Unit in which they were read: as stated at upload, m in the upload format."
    )
    sampling_rate_hz: float | None = Field(
        None,
        ge=SAMPLING_HZ.least,
        le=SAMPLING_HZ.most,
        strict=True,
        description="Sampling rate of the traces, Hz; null: follows the unit of times.",
    )
    frequency_hz: float | None = Field(
        None, ge=FREQUENCY_HZ.least, le=FREQUENCY_HZ.most, strict=True, description="Centre frequency, Hz."
    )
    arrangement: str | None = Field(
        None,
        max_length=80,
        pattern=TEXT,
        description="Fault in the order of the elements or in their positions, as proposed corrections of "
        "the scan name it: `receivers-shifted-by-1`, `elements-grid-yx`, `positions-in-degrees` and others.",
    )


class JobChanges(BaseModel):
    """Name and notes of a job; what is absent or null stays."""

    model_config = ConfigDict(extra="forbid")

    name: Name | None = Field(None, description="Name of the job; empty: none.")
    notes: Notes | None = None
