"""Three records of what a running service consists of, and the dependencies that give them to routes."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, TypeVar, cast

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
from .jobs.runner import Runner
from .pictures import Pictures
from .readiness import Readiness
from .rows.batches import Batches
from .rows.database import Database
from .rows.ids import Tenant
from .rows.jobs import Jobs
from .rows.stored_tables import Datasets, GeometryFields, Meshes, Volumes
from .rows.tables import DatasetRow, FieldRow, VolumeRow
from .settings import ServiceSettings
from .webhooks.sender import Webhooks


@dataclass(frozen=True)
class StoreParts:
    """Rows and files, with what limits and deletes them."""

    database: Database
    files: Files
    quota: Quota
    deletion: Deletion
    datasets: Datasets
    volumes: Volumes
    meshes: Meshes
    geometry_fields: GeometryFields
    jobs: Jobs
    batches: Batches


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


def background_of(request: Request) -> BackgroundParts:
    """Make the parts that work beside the requests."""
    return cast(BackgroundParts, request.app.state.background)


def access_of(scope: Scope) -> AccessParts:
    """Make the parts that decide on a request."""
    return cast(AccessParts, scope["app"].state.access)


def caller_of(request: Request) -> Caller:
    """The authenticated caller of a request."""
    return cast(Caller, request.state.caller)


# Coroutines, since FastAPI runs plain functions in the thread pool.
async def _stores(request: Request) -> StoreParts:
    return cast(StoreParts, request.app.state.stores)


async def _background(request: Request) -> BackgroundParts:
    return background_of(request)


async def _access(request: Request) -> AccessParts:
    return access_of(request.scope)


async def _caller(request: Request) -> Caller:
    return caller_of(request)


async def _tenant(request: Request) -> Tenant:
    return caller_of(request).tenant


Stores = Annotated[StoreParts, Depends(_stores)]
Background = Annotated[BackgroundParts, Depends(_background)]
Access = Annotated[AccessParts, Depends(_access)]
CurrentCaller = Annotated[Caller, Depends(_caller)]
# The tenant of the caller, for queries.
CallerTenant = Annotated[Tenant, Depends(_tenant)]


Row = TypeVar("Row", DatasetRow, FieldRow, VolumeRow)
# Finds the item that a path names; routes await it, so that wrong parameters are named before an unknown id.
Find = Callable[[], Awaitable[Row]]


async def _dataset(dataset_id: str, stores: Stores, tenant: CallerTenant) -> Find[DatasetRow]:
    return partial(run_in_threadpool, stores.datasets.get, tenant, dataset_id)


async def _volume(volume_id: str, stores: Stores, tenant: CallerTenant) -> Find[VolumeRow]:
    return partial(run_in_threadpool, stores.volumes.get, tenant, volume_id)


async def _field(field_id: str, stores: Stores, tenant: CallerTenant) -> Find[FieldRow]:
    return partial(run_in_threadpool, stores.geometry_fields.get, tenant, field_id)


FindDataset = Annotated[Find[DatasetRow], Depends(_dataset)]
FindVolume = Annotated[Find[VolumeRow], Depends(_volume)]
FindField = Annotated[Find[FieldRow], Depends(_field)]
