"""What the REST interface answers: one model a resource, and how it is made of a row."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field

from ...web.problem import Problem

State = Literal["queued", "running", "cancelling", "succeeded", "failed", "cancelled"]
# A list in the description, and no tuple: some generators of clients know none.
Pair = Annotated[list[float], Field(min_length=2, max_length=2)]


class DatasetRecord(BaseModel):
    """One scan: an upload, or what a simulation made."""

    id: str
    title: str
    source: str
    license: str
    dimension: int = Field(description="Coordinates of an element: 2 or 3.")
    elements: int = Field(description="Transducer elements.")
    ntx: int = Field(description="Emitters.")
    nrx: int = Field(description="Receivers.")
    slices: int = Field(description="Axial slices; 1 for a plain 2-D scan.")
    has_traces: bool
    has_travel_times: bool
    has_truth: bool = Field(
        description="Whether the file tells what the object really is, as a phantom does."
    )
    water_speed_mps: float
    job: str | None = Field(description="The simulation that made it.")
    bytes: int = Field(description="Size of the file that was uploaded, or made.")
    sha256: str = Field(description="SHA-256 of that.")
    created: datetime
    links: dict[str, str]


class DatasetList(BaseModel):
    """Datasets, newest first."""

    datasets: list[DatasetRecord]


class ProgressRecord(BaseModel):
    """Emitter passes done and to do, over all slices and sweeps, pictures, or tasks; 0 of 0 at first."""

    done: int
    total: int
    phase: str = Field(
        description="What they are of: of a reconstruction examining, picking, or reconstructing, each of "
        "which counts anew; else empty."
    )


class SweepRecord(BaseModel):
    """One pass over all emitters of one slice, or of the volume."""

    slice: int
    sweep: int = Field(description="Number of the pass, from 1.")
    residual_rms_s: float | None = Field(description="Rms of measured minus predicted travel time, s.")
    emitters: int = Field(description="Emitters that had data.")
    stage: int = Field(0, description="From 0: coarser grids and straight rays that come first.")
    given: bool = Field(True, description="Whether the misfit is that of the image which the stage gave.")
    band_hz: Pair | None = Field(
        None, description="Of an image refined by waveforms; its residual is the shift that its misfit means."
    )
    misfit: float | None = Field(None, description="Of these waveforms: 0 where they agree.")
    held_out_misfit: float | None = Field(None, description="The same of emitters that only judge.")
    of_attenuation: bool = Field(False, description="Whether waveforms refined that, not the speed.")


class PlanRecord(BaseModel):
    """How a job was to be cut into tasks when it was asked for."""

    decomposition: str = Field(description="slices or emitters side by side, or a volume.")
    lane: str = Field(description="Which workers take the tasks: recon, or opencl for those with a device.")
    tasks: int = Field(description="About how many there will be.")
    workers: int = Field(description="Workers that could hold each of them.")
    call_bytes: dict[str, int] = Field(description="Memory of each kind of task.")
    largest_bytes: int = Field(description="The most of these.")
    field_bytes: int | None = Field(
        None, description="Of a travel time while it is made, in a reconstruction."
    )
    rows_bytes: int | None = Field(None, description="Of the rays of all emitters, in a reconstruction.")
    state_bytes: int | None = Field(None, description="Of what comes back from a task of it.")
    stored_bytes: int | None = Field(
        None, description="The most that a reconstruction stores, its checkpoints among it."
    )
    result_bytes: int | None = Field(None, description="The most that the file of a simulation takes.")
    minutes: float | None = Field(
        None, description="About how long a simulation takes these workers, with nothing else to do."
    )
    why: str = Field(description="All of it in a sentence.")


class JobRecord(BaseModel):
    """One job."""

    id: str
    kind: str
    state: State
    dataset: str | None = Field(
        description="Id of the scan that a reconstruction reads, or that a simulation has made."
    )
    settings: dict[str, Any]
    plan: PlanRecord | None = Field(
        description="Of a reconstruction or a simulation; none of one from before plans were made."
    )
    advice: str | None = Field(description="What method auto chose and why, once it has.")
    progress: ProgressRecord
    history: list[SweepRecord] = Field(
        description="Sweeps so far; of very many an even choice with the first and the last."
    )
    volume: str | None = Field(
        description="Of a reconstruction its result, once there is one; of a refraction what it shows."
    )
    mesh: str | None = Field(description="Id of the mesh that a geometry field is made of.")
    field: str | None = Field(description="Id of that geometry field, once it is made.")
    error: Problem | None = Field(description="Why it failed.")
    created: datetime
    started: datetime | None
    finished: datetime | None
    seconds: float | None = Field(description="How long it has run.")
    links: dict[str, str]


class JobList(BaseModel):
    """Jobs, newest first."""

    jobs: list[JobRecord]
    next: str | None = Field(description="Address of the older ones; null where there are none.")


class VolumeRecord(BaseModel):
    """One volume: the result of a reconstruction, or an upload."""

    id: str
    source: Literal["reconstruction", "upload"]
    title: str = Field(description="Of the scan, or of the upload.")
    job: str | None = Field(description="The reconstruction that made it.")
    dataset: str | None = Field(description="The scan that it was made of.")
    axes: str = Field(description="Names of the axes, in order.")
    shape: list[int] = Field(description="Nodes along each axis.")
    spacing_m: list[float | None] = Field(description="Node spacing; null where it is not even.")
    origin_m: list[float | None] = Field(description="Position of node 0.")
    value_range: Pair = Field(description="Least and greatest value.")
    unit: str = Field(description="Of the values: m/s of a reconstruction; empty where it is not known.")
    speed_range_mps: Pair | None = Field(description="The range of a reconstruction.")
    water_speed_mps: float | None
    provenance: dict[str, str]
    bytes: int = Field(description="Size of the file of a reconstruction, or of what was uploaded.")
    sha256: str | None = Field(description="SHA-256 of what was uploaded.")
    created: datetime
    links: dict[str, str] = Field(description="refraction is there for volumes in space with even spacing.")


class VolumeList(BaseModel):
    """Volumes, newest first."""

    volumes: list[VolumeRecord]
