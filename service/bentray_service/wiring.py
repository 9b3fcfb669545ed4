"""The parts of one running service, and how a route gets at them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, cast

from fastapi import Depends, Request

from .compute import Compute
from .housekeeping import Housekeeper
from .ingest.append import Hold
from .ingest.reader import UploadReader
from .jobs.runner import Runner
from .settings import ServiceSettings
from .storage.database import Database
from .storage.datasets import Datasets
from .storage.deletion import Deletion
from .storage.files import Files
from .storage.geometry_fields import GeometryFields
from .storage.jobs import Jobs
from .storage.meshes import Meshes
from .storage.queue import Queue
from .storage.tenants import LOCAL, Tenant
from .storage.uploads import Uploads
from .storage.volumes import Volumes


@dataclass(frozen=True)
class Parts:
    """What the lifespan of the application made."""

    settings: ServiceSettings
    database: Database
    files: Files
    datasets: Datasets
    jobs: Jobs
    queue: Queue
    volumes: Volumes
    meshes: Meshes
    geometry_fields: GeometryFields
    uploads: Uploads
    deletion: Deletion
    hold: Hold
    reader: UploadReader
    housekeeper: Housekeeper
    compute: Compute
    runner: Runner


def _parts(request: Request) -> Parts:
    return cast(Parts, request.app.state.parts)


def _tenant() -> Tenant:
    return LOCAL


Service = Annotated[Parts, Depends(_parts)]
# Whose request it is; every query takes it.
CallerTenant = Annotated[Tenant, Depends(_tenant)]
