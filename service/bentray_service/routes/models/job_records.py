"""Models of datasets, jobs and volumes."""

from datetime import datetime
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BaseModel, Field

from ...html_tables import ShownRecord
from ...web.problem import Problem

State = Literal["queued", "running", "cancelling", "succeeded", "failed", "cancelled"]
# Described as a list, since some client generators do not support tuples.
Pair = Annotated[list[float], Field(min_length=2, max_length=2)]


class DatasetRecord(ShownRecord):
    """One scan, uploaded or simulated."""

    columns: ClassVar = ("id", "title", "elements", "slices", "has_traces", "created")

    id: str
    title: str = Field(
        description="The name given to it, else the title in the file, else the name of the file."
    )
    notes: str = Field(description="Notes of the user.")
    source: str
    license: str
    dimension: int = Field(description="Dimension of the element coordinates, 2 or 3.")
    elements: int = Field(description="Transducer elements.")
    ntx: int = Field(description="Emitters.")
    nrx: int = Field(description="Receivers.")
    slices: int = Field(description="Number of axial slices; 1 for a 2-D scan.")
    has_traces: bool
    has_travel_times: bool
    has_truth: bool = Field(description="Whether the file contains the ground truth, as for a phantom.")
    water_speed_mps: float = Field(description="As in the file, m/s.")
    water_temperature_c: float | None = Field(
        description="Temperature of the water, °C, that the user states in place of that of the file. "
        "Reconstructions take it where their settings state none."
    )
    job: str | None = Field(description="Id of the simulation that created it.")
    bytes: int = Field(description="Size of the uploaded or simulated file.")
    sha256: str = Field(description="SHA-256 of this file.")
    created: datetime
    links: dict[str, str]


class DatasetList(BaseModel):
    """Datasets, newest first."""

    datasets: list[DatasetRecord]
    next: str | None = Field(None, description="Address of the next page; null on the last page.")


class ProgressRecord(BaseModel):
    """Completed and total number of tasks, e.g. emitters over all iterations; 0 of 0 at first."""

    done: int
    total: int
    phase: str = Field(
        description="Current phase, each counted separately: examining, picking or reconstructing a scan; "
        "cutting, parameterising or sampling a mesh; compiling, while workers compile kernels for this "
        "processor; else empty."
    )


class SweepRecord(BaseModel):
    """One iteration over all emitters of a slice, or of the volume."""

    slice: int
    sweep: int = Field(description="Number of the iteration, from 1.")
    residual_rms_s: float | None = Field(description="Rms of measured minus predicted travel time, s.")
    emitters: int = Field(description="Number of emitters with valid data.")
    stage: int = Field(0, description="Stage, from 0: coarser grids and straight rays come first.")
    given: bool = Field(True, description="Whether the misfit is that of the initial image of the stage.")
    band_hz: Pair | None = Field(
        None,
        description="Frequency band of full-waveform inversion; the residual is the equivalent time shift.",
    )
    misfit: float | None = Field(None, description="Waveform misfit in this band; 0 is a perfect match.")
    held_out_misfit: float | None = Field(None, description="Waveform misfit of held-out emitters.")
    of_attenuation: bool = Field(False, description="Whether the attenuation was updated, not the speed.")


class PlanRecord(BaseModel):
    """The planned decomposition of a job into tasks."""

    decomposition: str = Field(description="Parallel slices, emitters or frames, or a volume.")
    lane: str = Field(
        description="Worker resource of the tasks: recon, opencl for workers with a device, or drawing."
    )
    tasks: int = Field(description="Approximate number of tasks.")
    workers: int = Field(description="Number of workers with enough memory for each task.")
    call_bytes: dict[str, int] = Field(description="Memory of each kind of task.")
    largest_bytes: int = Field(description="Largest of these values.")
    field_bytes: int | None = Field(None, description="Memory of a travel-time field of a reconstruction.")
    rows_bytes: int | None = Field(
        None, description="Memory of the rays of all emitters of a reconstruction."
    )
    state_bytes: int | None = Field(None, description="Size of the result of a task of a reconstruction.")
    stored_bytes: int | None = Field(
        None, description="Maximum storage of a reconstruction, including checkpoints."
    )
    result_bytes: int | None = Field(None, description="Maximum size of the file of a simulation.")
    minutes: float | None = Field(
        None, description="Estimated time of a simulation on these workers, without other jobs."
    )
    blocks: int | None = Field(
        None,
        description="Blocks of planes, into which a reconstructed volume is cut because its arrays fit no "
        "worker; 1: it is whole.",
    )
    nodes: int | None = Field(None, description="Nodes along each side of the image of a reconstruction.")
    methods: list[str] | None = Field(
        None, description="Method and rays of a reconstruction; with method auto, its candidates."
    )
    work_class: str | None = Field(
        None, description="Reconstructions or turntables of one class take times in proportion to `work_s`."
    )
    work_s: float | None = Field(
        None, description="Time of the counted work on as many cores of a known machine, s."
    )
    speed_known: bool | None = Field(
        None,
        description="Whether the speed of this class was measured on that core; else `work_s` only counts.",
    )
    why: str = Field(description="Summary of the plan in one sentence.")


class EstimateRecord(BaseModel):
    """Estimate of a job, if it were started now."""

    plan: PlanRecord | None = Field(description="Null for kinds of job that are not planned.")
    minutes: float | None = Field(
        description="Estimated time from its start to its end, without other jobs; null if there is no sound "
        "estimate yet."
    )
    rough: bool = Field(
        description="Whether fewer than three jobs of the tenant support it: an order of magnitude."
    )
    compared: int = Field(description="Finished jobs of the tenant, of the same class, that it is based on.")
    basis: str = Field(description="Where the estimate comes from, in words.")
    ahead: int = Field(description="Queued jobs that would start before it if jobs run one at a time.")


class AttemptRecord(BaseModel):
    """One attempt to send a message to a webhook."""

    time: datetime
    status: int | None = Field(description="Status of the response; null without a response.")
    error: str = Field(description="Why it was not accepted; empty if it was.")
    seconds: float


class WebhookRecord(BaseModel):
    """The webhook of a job, and the message that the job has ended."""

    url: str
    state: Literal["pending", "waiting", "delivered", "failed"] = Field(
        description="pending until the job has ended, and in lists; waiting for the next attempt; delivered; "
        "failed after the last attempt."
    )
    message: str | None = Field(description="Id of the message, its `webhook-id`.")
    attempts: list[AttemptRecord]
    due: datetime | None = Field(description="Time of the next attempt.")


class JobRecord(ShownRecord):
    """One job."""

    columns: ClassVar = ("id", "title", "kind", "state", "dataset", "volume", "seconds", "created")

    id: str
    kind: str
    name: str = Field(description="The name given to it; empty without one.")
    title: str = Field(
        description="This name, else what it does, such as `Best: full waveform to 450 kHz`; what made the "
        "image is known at the end."
    )
    notes: str = Field(description="Notes of the user.")
    started_by: str = Field(description="Id of the key, or user of the proxy, that started it; else empty.")
    state: State
    ahead: int | None = Field(
        description="Queued jobs that start before this queued job if jobs run one at a time; null in lists."
    )
    batch: str | None = Field(description="Id of the batch that it belongs to.")
    minutes: float | None = Field(
        description="Estimated time of this queued job from its start to its end, without other jobs; null "
        "in lists, and without a sound estimate."
    )
    webhook: WebhookRecord | None
    dataset: str | None = Field(
        description="Id of the input of a reconstruction, or of the result of a simulation."
    )
    settings: dict[str, Any]
    plan: PlanRecord | None = Field(description="Null for geometry fields, and for jobs of earlier versions.")
    advice: str | None = Field(
        description="Why the result is doubtful; whether the water was assumed; method chosen by auto, why."
    )
    doubtful: bool = Field(
        description="Whether the result calls its image into question: cut off by the speed bounds, or not "
        "explaining the times. advice says why; the summary of the volume lists its cautions."
    )
    progress: ProgressRecord
    history: list[SweepRecord] = Field(description="Iterations so far; a long history is thinned evenly.")
    volume: str | None = Field(
        description="Id of the result of a reconstruction, or of the input of a refraction."
    )
    mesh: str | None = Field(description="Id of the mesh of a geometry field.")
    field: str | None = Field(description="Id of the resulting geometry field.")
    error: Problem | None = Field(description="Problem of a failed job.")
    created: datetime
    started: datetime | None
    finished: datetime | None
    seconds: float | None = Field(description="Running time so far, s.")
    links: dict[str, str]


class JobList(BaseModel):
    """Jobs, newest first."""

    jobs: list[JobRecord]
    next: str | None = Field(description="Address of the next page; null on the last page.")


class VolumeRecord(ShownRecord):
    """One volume: the result of a reconstruction, or an upload."""

    columns: ClassVar = ("id", "title", "source", "shape", "unit", "created")

    id: str
    source: Literal["reconstruction", "upload"]
    title: str = Field(description="Title of the scan, or of the upload.")
    job: str | None = Field(description="Id of the reconstruction that created it.")
    dataset: str | None = Field(description="Id of the reconstructed scan.")
    axes: str = Field(description="Names of the axes, in order.")
    shape: list[int] = Field(description="Nodes along each axis.")
    spacing_m: list[float | None] = Field(description="Node spacing; null if not uniform.")
    origin_m: list[float | None] = Field(description="Position of node 0.")
    value_range: Pair = Field(description="Minimum and maximum.")
    unit: str = Field(description="Unit of the values: m/s for reconstructions; empty if unknown.")
    speed_range_mps: Pair | None = Field(description="Speed range of a reconstruction.")
    water_speed_mps: float | None
    provenance: dict[str, str]
    bytes: int = Field(description="Size of the result file, or of the uploaded file.")
    sha256: str | None = Field(description="SHA-256 of the uploaded file.")
    created: datetime
    links: dict[str, str] = Field(description="refraction is present for 3-D volumes with uniform spacing.")


class HistogramRecord(BaseModel):
    """How often each value of a quantity occurs in a volume."""

    quantity: str
    unit: str = Field(description="Unit of the quantity; empty for uploads and ratios.")
    counts: list[int] = Field(description="Nodes in each bin.")
    edges: list[float] = Field(description="Limits of the bins, one more than bins.")
    minimum: float
    maximum: float
    mean: float
    deviation: float = Field(description="Standard deviation.")
    iso: float | None = Field(
        description="Iso-value of a rendering for which none is requested; null if the volume cannot be "
        "rendered, and for other quantities."
    )
    smoothing: float | None = Field(description="Smoothing of this rendering.")
    up: str | None = Field(description="Axis that is up in this rendering.")


class VolumeList(BaseModel):
    """Volumes, newest first."""

    volumes: list[VolumeRecord]


class PreviewRecord(BaseModel):
    """The sound speed that a running reconstruction has reached, of its last checkpoint."""

    shape: Annotated[list[int], Field(min_length=2, max_length=2)] = Field(
        description="Nodes in x and y, at most 256 each."
    )
    every: int = Field(description="Each of this many nodes of the grid along a side is in the image.")
    speed: str = Field(description="Base64 of float32, little endian, (x, y) in C order, m/s.")
    range_mps: Pair = Field(description="Minimum and maximum, m/s.")
    spacing_m: Pair = Field(description="Spacing of the nodes of the image in x and y, m.")
    origin_m: Pair = Field(description="Position (x, y) of the first node, m.")
    reconstruction: int = Field(
        description="Number of the reconstruction, from 1; auto tries several methods, one after another."
    )
    part: int = Field(description="Number of the slice, or of the method that auto tries, from 1.")
    parts: int = Field(description="How many of them there are.")
    stage: int = Field(description="Stage, or frequency band of full-waveform inversion, from 1.")
    iteration: int = Field(description="Finished iterations in this stage.")
