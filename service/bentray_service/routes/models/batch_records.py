"""Models of batches of reconstructions."""

from datetime import datetime
from typing import Annotated, Any, ClassVar

from pydantic import BaseModel, Field

from bentray_kernels.tomography.settings import Settings

from ...html_tables import ShownRecord
from ...settings_request import DEFAULTS, SettingsRequest
from .job_records import State

# Scans of one batch.
MOST = 1000


class BatchRequest(SettingsRequest):
    """Reconstruct many datasets with the same settings."""

    datasets: Annotated[list[str], Field(min_length=1, max_length=MOST)] = Field(
        description="Ids of datasets, each once."
    )
    name: str = Field("", max_length=200, description="Name of the batch.")
    settings: Settings = Field(default_factory=Settings, description=DEFAULTS)
    webhook: str | None = Field(
        None,
        max_length=2000,
        description="https address to which a signed message is sent when each job ends.",
    )


class BatchJobRecord(ShownRecord):
    """One job of a batch."""

    columns: ClassVar = ("id", "dataset", "state", "volume")

    id: str
    dataset: str | None
    state: State
    volume: str | None = Field(description="Id of the result; null until the job has succeeded.")


class BatchRecord(ShownRecord):
    """A batch of reconstructions with one progress."""

    columns: ClassVar = ("id", "name", "state", "progress", "size", "created")

    id: str
    name: str
    started_by: str = Field(description="Id of the key, or the user, that started it; else empty.")
    state: State = Field(
        description="queued until the first job starts, running until the last has ended; then failed if one "
        "failed, else cancelled if one was, else succeeded."
    )
    progress: float = Field(description="Mean of its jobs, 0 to 1; an ended job counts as 1.")
    counts: dict[str, int] = Field(description="Jobs in each state.")
    size: int = Field(description="Number of jobs when it was started; jobs may be deleted since.")
    jobs: list[BatchJobRecord] = Field(description="In the order of the datasets of the request.")
    settings: dict[str, Any]
    created: datetime
    started: datetime | None = Field(description="Start of the first job.")
    finished: datetime | None = Field(description="End of the last job.")
    seconds: float | None = Field(description="Time since the first job started, until the last ended, s.")
    links: dict[str, str]


class BatchList(BaseModel):
    """Batches, newest first."""

    batches: list[BatchRecord]
