"""Ids of records, which every method of the clients takes in their place."""

from __future__ import annotations

from typing import TypeAlias

from ..routes.models.batch_records import BatchRecord
from ..routes.models.job_records import DatasetRecord, JobRecord, VolumeRecord
from ..routes.models.surface_records import MeshRecord
from .errors import ClientError

DatasetId: TypeAlias = str | DatasetRecord
JobId: TypeAlias = str | JobRecord
VolumeId: TypeAlias = str | VolumeRecord | JobRecord
BatchId: TypeAlias = str | BatchRecord
StoredId: TypeAlias = str | DatasetRecord | VolumeRecord | MeshRecord


def id_of(stored: StoredId | JobId | BatchId) -> str:
    """The id of a record, or the id itself."""
    return stored if isinstance(stored, str) else stored.id


def volume_of(stored: VolumeId) -> str:
    """The id of a volume: its own, or that of the result of a job.

    Raises:
        ClientError: for a job without a result.
    """
    if not isinstance(stored, JobRecord):
        return id_of(stored)
    if stored.volume is None or stored.state != "succeeded":
        raise ClientError(f"{stored.id} is {stored.state} and has no volume: wait for it with client.wait")
    return stored.volume
