"""The base class of job kinds: request model, inputs, plan, execution and results."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

from fastapi.openapi.models import Example
from pydantic import Field, TypeAdapter

from bentray_workers.cluster.task_pool import JobControl

from ..compute import Compute
from ..files.data_folder import Files
from ..files.tenant_files import TenantFiles
from ..rows.database import Database
from ..rows.ids import Tenant
from ..rows.jobs import NewJob
from ..rows.stored_tables import Datasets, Meshes, Volumes
from ..rows.tables import JobRow, Plain, ResultRow
from ..settings_request import SettingsRequest


class JobRequest(SettingsRequest):
    """The body of a request for a job; each kind has its own subclass."""

    kind: str
    webhook: str | None = Field(
        default=None,
        max_length=2000,
        description="https address to which a signed message is sent when the job ends.",
    )


R = TypeVar("R", bound=JobRequest)


class Sources:
    """The stored inputs of jobs."""

    def __init__(self, database: Database, files: Files) -> None:
        self.files = files
        self.datasets = Datasets(database)
        self.volumes = Volumes(database)
        self.meshes = Meshes(database)


@dataclass(frozen=True)
class JobRun:
    """A job to run.

    Attributes:
        client: of the Dask cluster.
        source: input file, see ``Kind.source``.
        settings: as stored with the job.
        target: output file, see ``Kind.target``; written atomically.
        work_dir: folder of the job, shared with all workers; it keeps checkpoints.
        control: progress, cancellation and share of the workers; after a cancellation ``run`` raises
            ``Cancelled``.
    """

    client: Any
    source: Path
    settings: Plain
    target: Path
    work_dir: Path
    control: JobControl


class Kind(ABC, Generic[R]):
    """A kind of job.

    Attributes:
        request: model of the request.
        example: request for the OpenAPI description.
        settings: parses the settings stored with a job.
        words: the kind, for people.
        table: of its results.
        lane: worker resource of its tasks, a key of ``cluster.resources.OFFERED``.
    """

    request: ClassVar[type[JobRequest]]
    example: ClassVar[Example]
    settings: ClassVar[TypeAdapter[Any]]
    words: ClassVar[str]
    table: ClassVar[type[ResultRow]]
    lane: ClassVar[str]

    @abstractmethod
    def plan(self, request: R, tenant: Tenant, sources: Sources, compute: Compute) -> NewJob:
        """Validate a request against the stored inputs and the connected workers.

        Raises:
            UnknownId: for an input that the tenant does not have.
            InvalidInput: for a job that no connected worker can run.
        """

    @abstractmethod
    def source(self, files: TenantFiles, job: JobRow) -> Path:
        """The input file; the work folder for a job without input."""

    @abstractmethod
    def target(self, files: TenantFiles, job: JobRow) -> Path:
        """The output file; it is fixed, so that a repeated job writes the same file."""

    @abstractmethod
    def run(self, run: JobRun) -> Plain | None:
        """Run the job, write ``run.target`` and return the row of the result, if any."""

    @abstractmethod
    def results(self, job: JobRow) -> tuple[dict[str, str], dict[str, str]]:
        """Ids of the results of a successful job by field of its record, and links."""

    def title(self, job: JobRow) -> str:
        """What a job does, for one without a name."""
        return self.words

    def discard(self, files: TenantFiles, target: Path) -> None:
        """Remove the result of a job that was cancelled after it finished."""
        files.drop(target)
