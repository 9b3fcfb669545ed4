"""The parts of a running service, and the dependencies that give routes access to them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, cast

from fastapi import Depends, Request

from .access.audit import Audit
from .access.caller import Caller
from .access.key_watch import KeyWatch
from .access.quota import Quota
from .access.sign_in import SignIn
from .compute import Compute
from .files.data_folder import Files
from .files.deletion import Deletion
from .files.direct_uploads import DirectUploads
from .housekeeping import Housekeeper
from .ingest.append import UploadLocks
from .ingest.fair_queue import FairQueue
from .ingest.upload_ingest import UploadIngest
from .ingest.upload_limits import UploadLimits
from .jobs.feed import EventFeed
from .jobs.runner import Runner
from .pictures import Pictures
from .readiness import Readiness, Threaded
from .rows.batches import Batches
from .rows.database import Database
from .rows.deliveries import Deliveries
from .rows.job_queue import Queue
from .rows.jobs import Jobs
from .rows.projects import Projects
from .rows.stored_tables import Datasets, GeometryFields, Meshes, Volumes
from .rows.tenants import Tenant
from .rows.uploads import Uploads
from .settings import ServiceSettings
from .webhooks.sender import Webhooks


@dataclass(frozen=True)
class Parts:
    """All parts of a running service; ``threads`` are those with threads, by name."""

    settings: ServiceSettings
    database: Database
    files: Files
    datasets: Datasets
    jobs: Jobs
    batches: Batches
    projects: Projects
    queue: Queue
    volumes: Volumes
    meshes: Meshes
    geometry_fields: GeometryFields
    uploads: Uploads
    direct_uploads: DirectUploads | None
    quota: Quota
    upload_limits: UploadLimits
    ingest_queue: FairQueue
    deletion: Deletion
    hold: UploadLocks
    upload_ingest: UploadIngest
    housekeeper: Housekeeper
    compute: Compute
    pictures: Pictures
    runner: Runner
    sign_in: SignIn
    key_watch: KeyWatch
    feed: EventFeed
    audit: Audit
    readiness: Readiness
    threads: Mapping[str, Threaded]
    webhooks: Webhooks
    deliveries: Deliveries


def parts_of(request: Request) -> Parts:
    """The parts of the service of a request."""
    return cast(Parts, request.app.state.parts)


def caller_of(request: Request) -> Caller:
    """The authenticated caller of a request."""
    return cast(Caller, request.state.caller)


# Coroutines, since FastAPI runs plain functions in the thread pool.
async def _service(request: Request) -> Parts:
    return parts_of(request)


async def _caller(request: Request) -> Caller:
    return caller_of(request)


async def _tenant(request: Request) -> Tenant:
    return caller_of(request).tenant


Service = Annotated[Parts, Depends(_service)]
CurrentCaller = Annotated[Caller, Depends(_caller)]
# The tenant of the caller, for queries.
CallerTenant = Annotated[Tenant, Depends(_tenant)]
