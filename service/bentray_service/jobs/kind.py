"""What a kind of job declares: its request, what it reads, its plan, how it runs and what it makes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Generic, Protocol, TypeVar

from fastapi.openapi.models import Example
from pydantic import BaseModel, ConfigDict, TypeAdapter

from bentray_kernels.tomography.result import Progress
from bentray_workers.cluster.fair_shares import Share

from ..compute import Compute
from ..files.data_folder import Files
from ..files.tenant_files import TenantFiles
from ..rows.records import JobRow, Plain
from ..rows.stored_tables import Datasets, Meshes, Volumes
from ..rows.tenants import Tenant


class JobRequest(BaseModel):
    """The body of a request for a job; each kind has one, with its name as ``kind``."""

    model_config = ConfigDict(extra="forbid")

    kind: str


R = TypeVar("R", bound=JobRequest)


class Sources(Protocol):
    """What plans are made of: the stored things and the workers."""

    @property
    def datasets(self) -> Datasets: ...

    @property
    def volumes(self) -> Volumes: ...

    @property
    def meshes(self) -> Meshes: ...

    @property
    def files(self) -> Files: ...

    @property
    def compute(self) -> Compute: ...


@dataclass(frozen=True)
class Order:
    """A checked request.

    Attributes:
        settings: as they are stored with the job.
        largest_bytes: the most that it stores while it runs.
        references: the ids of what it reads, by column of the table of jobs.
        plan: how it is cut into tasks, if that is planned before.
    """

    settings: Plain
    largest_bytes: int
    references: dict[str, str] = field(default_factory=dict)
    plan: Plain | None = None


@dataclass(frozen=True)
class Task:
    """One job that runs.

    Attributes:
        client: the ``distributed.Client`` of the worker pool.
        source: what it reads, as ``Kind.source`` says.
        settings: as stored with the job.
        target: the file to write, atomically, as ``Kind.target`` says.
        work_dir: a folder of its own, which every worker can read and write; it keeps the checkpoints of an
            unfinished run.
        on_progress: called with the progress, often.
        on_saved: called after each checkpoint.
        stop: whether to give up, by raising ``Cancelled``.
        share: of the workers; how many tasks the job may have in flight.
    """

    client: Any
    source: Path
    settings: Plain
    target: Path
    work_dir: Path
    on_progress: Callable[[Progress], None]
    on_saved: Callable[[], None]
    stop: Callable[[], bool]
    share: Share


class Kind(ABC, Generic[R]):
    """A kind of job.

    Attributes:
        request: the model of its request.
        example: of a request, for the OpenAPI description.
        settings: reads the settings that are stored with a job.
        table: the name of the table that its results are in.
        lane: the resource of a worker that its tasks need, a key of ``cluster.resources.OFFERED``.
    """

    request: ClassVar[type[JobRequest]]
    example: ClassVar[Example]
    settings: ClassVar[TypeAdapter[Any]]
    table: ClassVar[str]
    lane: ClassVar[str]

    @abstractmethod
    def plan(self, request: R, tenant: Tenant, sources: Sources) -> Order:
        """Check a request against what is stored and what the workers can do.

        Raises:
            UnknownId: for a thing that the tenant does not have.
            InvalidInput: for a job that no connected worker can run.
        """

    @abstractmethod
    def source(self, files: TenantFiles, job: JobRow) -> Path:
        """The file that the job reads; its work folder where it reads nothing."""

    @abstractmethod
    def target(self, files: TenantFiles, job: JobRow) -> Path:
        """The file that it writes; fixed, so that a job which is run again writes the same one."""

    @abstractmethod
    def run(self, task: Task) -> Plain | None:
        """Do the work, write ``task.target``, and return the row of the result, if it has one."""

    @abstractmethod
    def results(self, job: JobRow) -> tuple[dict[str, str], dict[str, str]]:
        """What a job that has succeeded made: fields of its record, and links."""

    def discard(self, files: TenantFiles, target: Path) -> None:
        """Remove the result of a job that was cancelled at its very end."""
        files.drop(target)
