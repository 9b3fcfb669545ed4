"""/v1/datasets: upload, list and look at scans."""

from __future__ import annotations

from typing import Annotated, Any

import anyio
from fastapi import APIRouter, Depends, Query, Request, Response, status
from starlette.concurrency import run_in_threadpool

from ..errors import described
from ..ingest.receive import Received, receive
from ..ingest.sandbox import ingest
from ..refusals import EmptyBody
from ..storage.ids import new_id
from ..wiring import Parts, Service
from .bodies import only
from .records import DatasetList, DatasetRecord, dataset_record

MEDIA_TYPES = ("application/x-hdf5", "application/octet-stream")
BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "description": "An HDF5 file in the format uct-transmission.",
        "content": {media: {"schema": {"type": "string", "format": "binary"}} for media in MEDIA_TYPES},
    }
}
# Each ingest process may take the whole of its memory limit.
INGESTS_AT_ONCE = 2

router = APIRouter(prefix="/v1/datasets", tags=["datasets"])


@router.post(
    "",
    status_code=status.HTTP_201_CREATED,
    dependencies=[Depends(only(*MEDIA_TYPES))],
    openapi_extra=BODY,
    responses=described(413, 415, 422, 507),
)
async def upload_dataset(request: Request, response: Response, service: Service) -> DatasetRecord:
    """Upload a scan. A process of its own reads it and stores it in canonical form, or says why not."""
    dataset_id = new_id("dataset")
    path = service.files.incoming(dataset_id)
    announced = request.headers.get("content-length")
    if announced == "0":
        raise EmptyBody("body", "0 bytes", "an HDF5 file")
    try:
        received = await receive(
            request.stream(),
            int(announced) if announced else None,
            path,
            service.settings.max_upload_bytes,
        )
        limiter: anyio.CapacityLimiter = request.app.state.ingest_limiter
        record = await anyio.to_thread.run_sync(_take_in, service, dataset_id, received, limiter=limiter)
    finally:
        await run_in_threadpool(path.unlink, missing_ok=True)
    response.headers["Location"] = record.links["self"]
    return record


@router.get("")
def list_datasets(service: Service, limit: Annotated[int, Query(ge=1, le=1000)] = 100) -> DatasetList:
    """Datasets, newest first."""
    return DatasetList(datasets=[dataset_record(row) for row in service.datasets.newest(limit)])


@router.get("/{dataset_id}", responses=described(404))
def show_dataset(dataset_id: str, service: Service) -> DatasetRecord:
    """One dataset."""
    return dataset_record(service.datasets.get(dataset_id))


def _take_in(service: Parts, dataset_id: str, received: Received) -> DatasetRecord:
    """From the received file to the stored dataset; nothing is left behind when it is refused."""
    try:
        summary = ingest(
            service.files.incoming(dataset_id),
            service.files.candidate(dataset_id),
            memory_bytes=service.settings.ingest_memory_bytes,
            seconds=service.settings.ingest_seconds,
            scratch=service.files.scratch,
        )
        service.files.adopt(dataset_id)
    finally:
        service.files.discard_candidate(dataset_id)
    return dataset_record(
        service.datasets.add(dataset_id, size=received.size, sha256=received.sha256, summary=summary)
    )
