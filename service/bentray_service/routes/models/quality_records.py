"""Models of the quality report of a scan."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field


class FindingRecord(BaseModel):
    """One finding about a scan."""

    check: str = Field(description="Name of the check.")
    found: str
    accepted: str
    action: Literal["left out", "corrected", "refused", "reported"] = Field(description="Action taken.")
    slice: int
    elements: list[int] = Field(description="Faulty elements.")
    role: Literal["emission", "reception", ""] = Field(
        description="Role of these elements, if only one is affected."
    )
    value: float | None = Field(description="The value compared with the threshold.")
    unit: str
    pair_count: int | None = Field(None, description="Number of affected pairs.")
    first_pairs: list[tuple[int, int]] = Field(
        [], description="First affected pairs, as (emission, reception)."
    )


class QualityRecord(BaseModel):
    """The quality report of a scan: checks and findings."""

    verdict: Literal["clean", "usable", "refused"]
    pairs: int = Field(description="Pairs of different elements, over all slices.")
    usable_pairs: int = Field(description="Pairs used for a reconstruction; 0 for a refused scan.")
    picker: str = Field(description="Picker of first arrivals; empty for scans with travel times.")
    checked: list[str] = Field(description="Names of the applicable checks.")
    not_checked: dict[str, str] = Field(
        {}, description="Checks that do not apply to the array, and the reason of each."
    )
    findings: list[FindingRecord]
