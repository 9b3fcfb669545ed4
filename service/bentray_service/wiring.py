"""Three records of what a running service consists of, and the context that gives them to routes."""

from dataclasses import dataclass
from typing import Annotated, cast

from fastapi import Depends, Request
from starlette.concurrency import run_in_threadpool
from starlette.types import Scope

from .access.audit import Audit
from .access.caller import Caller
from .access.quota import Quota
from .access.sign_in import SignIn
from .files.data_folder import Files
from .files.deletion import Deletion
from .housekeeping import Housekeeper
from .ingest.upload_ingest import UploadIngest
from .jobs.feed import EventFeed
from .jobs.kind import Sources
from .jobs.runner import Runner
from .pictures import Pictures
from .readiness import Readiness
from .rows.ages import StoredItem
from .rows.batches import Batches
from .rows.database import Database
from .rows.ids import Tenant
from .rows.jobs import Jobs, Submission
from .rows.stored_tables import GeometryFields
from .rows.tables import DatasetRow, FieldRow, MeshRow, VolumeRow
from .settings import ServiceSettings
from .webhooks.sender import Webhooks


class StoreParts(Sources):
    """Rows and files, with what limits and deletes them."""

    def __init__(self, database: Database, files: Files, quota: Quota) -> None:
        super().__init__(database, files)
        self.database = database
        self.quota = quota
        self.deletion = Deletion(database, files)
        self.geometry_fields = GeometryFields(database)
        self.jobs = Jobs(database)
        self.batches = Batches(database)


@dataclass(frozen=True)
class BackgroundParts:
    """Parts that work beside the requests: jobs, pictures, uploads, messages and clean-up."""

    runner: Runner
    pictures: Pictures
    ingest: UploadIngest
    housekeeper: Housekeeper
    webhooks: Webhooks
    feed: EventFeed
    readiness: Readiness


@dataclass(frozen=True)
class AccessParts:
    """Parts that decide on requests, and note them."""

    settings: ServiceSettings
    sign_in: SignIn
    audit: Audit


def access_of(scope: Scope) -> AccessParts:
    """The parts that decide on a request."""
    return cast(AccessParts, scope["app"].state.access)


@dataclass(frozen=True)
class RequestContext:
    """What a route works with: its request, the caller, and the parts of the service."""

    request: Request
    caller: Caller
    stores: StoreParts
    background: BackgroundParts
    access: AccessParts

    @property
    def tenant(self) -> Tenant:
        """The tenant of the caller, for queries."""
        return self.caller.tenant

    # Routes find items themselves, so that wrong parameters are named before an unknown id.
    async def dataset(self, dataset_id: str) -> DatasetRow:
        """Find the scan that a path names."""
        return await run_in_threadpool(self.stores.datasets.get, self.tenant, dataset_id)

    async def volume(self, volume_id: str) -> VolumeRow:
        """Find the volume that a path names."""
        return await run_in_threadpool(self.stores.volumes.get, self.tenant, volume_id)

    async def mesh(self, mesh_id: str) -> MeshRow:
        """Find the mesh that a path names."""
        return await run_in_threadpool(self.stores.meshes.get, self.tenant, mesh_id)

    async def field(self, field_id: str) -> FieldRow:
        """Find the geometry field that a path names."""
        return await run_in_threadpool(self.stores.geometry_fields.get, self.tenant, field_id)

    def check_render(self, share: float = 1.0) -> None:
        """Check the rate limit of the caller, see ``SignIn.check_render``."""
        self.access.sign_in.check_render(self.caller, share)

    def delete(self, what: str, item: str) -> None:
        """Delete an item of the caller, see ``Deletion.delete``."""
        self.stores.deletion.delete(StoredItem(self.tenant, what, item))

    def submission(self, idempotency_key: str | None, webhook: str | None) -> Submission:
        """Properties of the jobs that the request starts."""
        limits = self.stores.quota.most_bytes, self.access.settings.max_queued_jobs
        return Submission(*limits, idempotency_key, self.caller.who, webhook)


# A coroutine, since FastAPI runs plain functions in the thread pool.
async def _context(request: Request) -> RequestContext:
    state = request.app.state
    return RequestContext(request, request.state.caller, state.stores, state.background, state.access)


Context = Annotated[RequestContext, Depends(_context)]
