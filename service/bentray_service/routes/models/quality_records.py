"""Models of the quality report of a scan."""

from typing import ClassVar, Literal

from pydantic import BaseModel, Field

from ...html_tables import ShownRecord


class FindingRecord(ShownRecord):
    """One finding about a scan."""

    columns: ClassVar = ("check", "found", "accepted", "action", "elements")

    check: str = Field(description="Name of the check.")
    found: str
    accepted: str
    action: Literal["left out", "corrected", "refused", "reported"] = Field(
        description="Action taken, in a reconstruction too, unless its setting `examine` is false; "
        "`reported`: the data are used as they are."
    )
    slice: int
    elements: list[int] = Field(description="Faulty elements.")
    role: Literal["emission", "reception", ""] = Field(
        description="Role of these elements, if only one is affected."
    )
    value: float | None = Field(description="The value compared with the threshold.")
    unit: str
    water_temperature_c: float | None = Field(
        None,
        description="Temperature at which water has the speed that the times say, where this is only "
        "reported, °C; `PATCH /v1/datasets/{dataset_id}` with it uses it.",
    )
    pair_count: int | None = Field(None, description="Number of affected pairs.")
    first_pairs: list[tuple[int, int]] = Field(
        [], description="First affected pairs, as (emission, reception)."
    )


class QualityRecord(ShownRecord):
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


class ProposedCorrection(BaseModel):
    """A correction that the numbers of a scan suggest."""

    what: Literal["times", "positions", "frequency", "arrangement"]
    unit: str = Field(description="Likely unit in the original file; empty for other corrections.")
    read_as: str = Field(description="Unit in which it was then read; empty for other corrections.")
    frequency_hz: float | None = Field(description="Centre frequency of the traces; null otherwise.")
    arrangement: str | None = Field(
        None, description="Fault in the order of the elements or their positions; null otherwise."
    )
    reason: str


class GeometryRecord(BaseModel):
    """Elements, acquisition and water of a scan."""

    array_type: str
    radius_m: float | None
    every: int = Field(description="1: all elements are listed; n: every n-th.")
    position_m: list[list[float]] = Field(description="Positions of the listed elements, m.")
    emits: list[bool] = Field(description="Whether each of them emits.")
    receives: list[bool] = Field(description="Whether each of them receives.")
    slice_z_m: list[float] = Field(description="Heights of the ring, m; empty for a plain scan.")
    center_frequency_hz: float | None
    frequency_estimated: bool = Field(description="Whether it was estimated from the traces.")
    sampling_rate_hz: float | None
    t0_s: float = Field(description="Time of the first sample after the emission, s.")
    samples: int = Field(description="Samples of each trace; 0 without traces.")
    water_shot: bool = Field(description="Whether there are traces of the water alone.")
    water_speed_mps: float = Field(description="Of the water that reconstructions use, m/s.")
    water_temperature_c: float | None = Field(description="Of the same water, °C; null for another medium.")
    water_assumed: bool = Field(description="Whether nobody stated the water.")
    water_in_file: str = Field(description="What the file states of the water, in words.")
    pairs: int = Field(description="Pairs of different elements, over all slices.")
    timed_pairs: int | None = Field(
        description="Pairs with a valid travel time in the file; null for a scan with traces alone."
    )
    impossible_times: dict[str, int] = Field(
        {}, description="Travel times that no sound can have and that are missing, by their kind."
    )
    proposed_corrections: list[ProposedCorrection] = Field(
        description="Units, frequency and order of the elements that the numbers of the scan suggest in "
        "place of its own; see `POST /v1/datasets/{dataset_id}/corrections`."
    )


class EmissionRecord(BaseModel):
    """Traces of one emission, reduced to the size of a screen, and arrival times."""

    emission: int
    element: int = Field(description="Index of its element.")
    slice: int
    quantity: Literal["object", "water"]
    receivers: int = Field(description="Traces, of evenly chosen receivers.")
    samples: int = Field(description="Samples of each trace; each is the largest of a block.")
    receiver_element: list[int] = Field(description="Indices of the elements of these receivers.")
    first_s: float = Field(description="Time of the first sample, s.")
    step_s: float = Field(description="Time between samples, s.")
    traces: str = Field(
        description="Base64 of float32, little endian, (receivers, samples); each trace divided by its peak."
    )
    straight_s: list[float] = Field(description="Arrivals along a straight line in water, s.")
    pick_s: list[float | None] | None = Field(
        description="Arrivals with the object, s; null without an arrival, or without a water shot."
    )
    picker: str = Field(description="Picker of these arrivals; empty for times of the file.")
