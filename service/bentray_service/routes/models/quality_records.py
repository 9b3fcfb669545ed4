"""What the REST interface answers of the quality of a scan."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field


class FindingRecord(BaseModel):
    """One thing that is wrong with a scan."""

    check: str = Field(description="Which check found it.")
    found: str
    accepted: str
    action: Literal["left out", "corrected", "refused", "reported"] = Field(
        description="What is done about it."
    )
    slice: int
    elements: list[int] = Field(description="Those at fault.")
    role: Literal["emission", "reception", ""] = Field(description="In which they are, if in one of the two.")
    value: float | None = Field(description="The figure that decided.")
    unit: str
    pair_count: int | None = Field(None, description="How many pairs are at fault.")
    first_pairs: list[tuple[int, int]] = Field([], description="The first of them, as (emission, reception).")


class QualityRecord(BaseModel):
    """The quality of a scan: what was checked and found."""

    verdict: Literal["clean", "usable", "refused"]
    pairs: int = Field(description="Pairs of different elements, over all slices.")
    usable_pairs: int = Field(description="Those that go on; 0 of a refused scan.")
    picker: str = Field(description="What read the times; empty where they came with the scan.")
    checked: list[str] = Field(description="The checks that could be made.")
    findings: list[FindingRecord]
