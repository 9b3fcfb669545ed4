"""The ASGI application: opens the parts of the service in order, and closes them in reverse order."""

import threading
from collections.abc import AsyncIterator
from contextlib import ExitStack, asynccontextmanager
from functools import cache
from typing import Any

from fastapi import APIRouter, Depends, FastAPI
from fastapi.security import HTTPBearer
from fastapi.staticfiles import StaticFiles
from starlette.concurrency import run_in_threadpool
from starlette.routing import BaseRoute

from bentray_workers.cluster.connection import Cluster, open_cluster

from . import __version__
from .access.audit import Audit
from .access.quota import Quota
from .access.sign_in import SignIn
from .compute import Compute
from .files.bucket_store import open_store
from .files.checked_store import CheckedStore
from .files.data_folder import Files, check_authentication, installation_of, lock, open_folder_database
from .files.disk import private_files
from .files.orphans import Orphans
from .guard import Guard
from .housekeeping import Housekeeper
from .ingest.fair_queue import FairQueue, readers_at_once
from .ingest.upload_ingest import UploadIngest
from .jobs.feed import EventFeed
from .jobs.kinds import KINDS
from .jobs.runner import Runner
from .jobs.traces import telemetry_from
from .metrics import Metrics
from .pictures import Pictures
from .readiness import Readiness
from .routes import (
    access,
    batches,
    datasets,
    events,
    geometry_fields,
    health,
    jobs,
    meshes,
    pages,
    projects,
    sign_in,
    volumes,
)
from .routes.uploads import direct_uploads, tus
from .rows.accounts import Accounts
from .rows.checksums import Checksums
from .rows.job_queue import Queue
from .settings import ServiceSettings
from .web import errors
from .web.middleware import identify, speak_tus
from .web.reference import OpenApiApp
from .webhooks.sender import Webhooks
from .wiring import AccessParts, BackgroundParts, StoreParts

DESCRIPTION = (
    "Refraction-corrected ultrasound computed tomography: upload a scan, start a reconstruction, "
    "watch it, download the image. Every error is a problem+json with the field, the value found and "
    "the values accepted."
)

# OpenAPI description of protected routes; the guard middleware authenticates every request. Protected routes
# need the database.
CLOSED: Any = {
    "dependencies": [Depends(HTTPBearer(auto_error=False, description="An API key, if required."))],
    "responses": errors.problems(401, 403, 429, 503),
}


def create_app(settings: ServiceSettings, cluster: Cluster | None = None) -> FastAPI:
    """Create the ASGI application.

    Args:
        settings: of the service.
        cluster: an open cluster, which stays open; None: the application opens its own.
    """

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        stack = ExitStack()
        try:
            parts = await run_in_threadpool(_open, settings, cluster, stack, app.state.leaving)
            app.state.stores, app.state.background, app.state.access = parts
            app.state.metrics.watch(*parts)
            app.state.background.pictures.open()
            yield
            await app.state.background.pictures.close()
        finally:
            await run_in_threadpool(stack.close)

    app = OpenApiApp(
        title="Bentray",
        version=__version__,
        description=DESCRIPTION,
        lifespan=lifespan,
        telemetry=telemetry_from(),
        docs_url=None,
        redoc_url=None,
        routes=[*_routes()],
    )
    # Set when the server stops, so that event streams end before it waits for them.
    app.state.leaving = threading.Event()
    errors.install_handlers(app, tuple(KINDS))
    app.add_middleware(speak_tus)
    app.add_middleware(Guard)
    app.add_middleware(identify)
    app.state.metrics = Metrics()
    app.mount("/static", StaticFiles(directory=pages.WEB / "static"), name="static")
    return app


@cache
def _routes() -> tuple[BaseRoute, ...]:
    """The routes, shared by all applications of a process.

    FastAPI reads the signatures of their functions again for every application that includes a router itself.
    """
    router = APIRouter(responses=errors.problems("default"))
    for protected in (
        tus.router,
        direct_uploads.router,
        datasets.router,
        jobs.router,
        batches.router,
        datasets.changes_router,
        events.router,
        volumes.router,
        meshes.router,
        geometry_fields.router,
        access.router,
        projects.router,
        jobs.plans_router,
        health.metrics_router,
        health.cluster_router,
    ):
        router.include_router(protected, **CLOSED)
    for public in (health, pages, sign_in):
        router.include_router(public.router)
    return tuple(router.routes)


def _open(
    settings: ServiceSettings, cluster: Cluster | None, stack: ExitStack, leaving: threading.Event
) -> tuple[StoreParts, BackgroundParts, AccessParts]:
    """Open all parts; ``stack`` closes them, also when a later part fails."""
    stack.enter_context(private_files())
    files = Files(settings.data_dir)
    files.prepare()
    locked = stack.enter_context(lock(files.root))
    files.check_restored()
    files.drop_leftovers()
    database = open_folder_database(files, settings.database)
    stack.callback(database.close)
    store = CheckedStore(
        open_store(
            settings.storage_url,
            files.root,
            database,
            settings.cache_bytes,
            settings.storage_public_endpoint,
        ),
        files.root,
        Checksums(database),
    )
    files = Files(settings.data_dir, store)
    orphans = Orphans(files, database, is_store=settings.storage_url is None)
    orphans.begin()
    quota = Quota(database, settings.max_tenant_bytes)
    quota.begin(files, alone=settings.database_url is None)
    accounts = Accounts(database)
    sign_in = SignIn(settings, database, accounts)
    stack.callback(sign_in.close)
    check_authentication(files.root, required=sign_in.required())
    if cluster is None:
        cluster = stack.enter_context(
            open_cluster(
                settings.dask_scheduler_address,
                settings.workers,
                files.scratch,
                kind=settings.cluster,
                template=settings.cluster_template,
                tls=settings.tls_dir,
            )
        )
    queue, compute = Queue(database, installation_of(locked)), Compute(cluster, store.fetch)
    runner = Runner(queue, accounts, files, compute, settings)
    ingest_queue = FairQueue(readers_at_once(settings.ingest_memory_bytes), accounts)
    ingest = UploadIngest(settings, database, files, ingest_queue, accounts, quota)
    audit = Audit(files.audit)
    housekeeper = Housekeeper(settings, database, files, quota, ingest.locks, orphans, audit)
    pictures = Pictures(cluster, accounts, files)
    stack.callback(pictures.stop)
    ingest.on_stored = pictures.examine
    webhooks = Webhooks(database, settings)
    ingest_queue.start()
    stack.callback(ingest_queue.stop)
    threads = {"runner": runner, "ingest": ingest, "housekeeping": housekeeper, "webhooks": webhooks}
    for part in threads.values():
        part.start()
        stack.callback(part.stop)
    readiness = Readiness(database, files, compute, threads, settings.min_free_bytes)
    stack.callback(readiness.stop)
    stores = StoreParts(database, files, quota)
    feed = EventFeed(stores.jobs, accounts, leaving.is_set)
    background = BackgroundParts(runner, pictures, ingest, housekeeper, webhooks, feed, readiness)
    return stores, background, AccessParts(settings, sign_in, audit)
