"""Conversion of database rows to records of the REST interface."""

import time
from contextlib import suppress
from typing import Any, TypeVar

from pydantic import BaseModel

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography.result import DOUBTFUL
from bentray_workers.rendering.refraction_view import check_even

from ..jobs.kinds import KINDS, field_links
from ..rows.ids import volume_of
from ..rows.tables import (
    Base,
    BatchRow,
    DatasetRow,
    DeliveryRow,
    FieldRow,
    JobRow,
    MeshRow,
    UploadRow,
    VolumeRow,
)
from .models.batch_records import BatchRecord
from .models.job_records import DatasetRecord, JobRecord, VolumeRecord, WebhookRecord
from .models.surface_records import FieldRecord, FieldSeconds, MeshRecord
from .models.upload_records import UploadRecord

# Inputs of jobs, and the resources in which they are listed.
READ = ("dataset", "volume", "mesh")
LISTED = {"dataset": "datasets", "volume": "volumes", "mesh": "meshes"}


Record = TypeVar("Record", bound=BaseModel)


def record_of(model: type[Record], row: Base, **given: Any) -> Record:
    """A record from the attributes of a row with the names of its fields, except for those that are given."""
    fields = {name: getattr(row, name) for name in model.model_fields if name not in given}
    return model.model_validate(fields | given)


def dataset_record(row: DatasetRow) -> DatasetRecord:
    here, job = f"/v1/datasets/{row.id}", row.job_id
    links = {"self": here, "file": f"{here}/file", "thumbnail": f"{here}/thumbnail.png"}
    if job is not None:
        links["job"] = f"/v1/jobs/{job}"
    return record_of(DatasetRecord, row, title=row.name or row.title, job=job, links=links)


def job_record(
    row: JobRow,
    ahead: int | None = None,
    minutes: float | None = None,
    delivery: DeliveryRow | None = None,
) -> JobRecord:
    """The record of a job.

    Args:
        row: the job.
        ahead, minutes: place in the queue and estimate, of a queued job.
        delivery: the message to its webhook, of a job that has ended.
    """
    here = f"/v1/jobs/{row.id}"
    reads = {what: getattr(row, f"{what}_id") for what in READ}
    links = {"self": here} | {what: f"/v1/{LISTED[what]}/{name}" for what, name in reads.items() if name}
    made: dict[str, str] = {}
    if row.state == "succeeded":
        made, more = KINDS[row.kind].results(row)
        links |= more
    if row.kind == "reconstruction" and row.state in ("running", "cancelling"):
        links["preview"] = f"{here}/preview"
    if row.state in ("queued", "running"):
        links["cancel"] = f"{here}/cancel"
    if row.batch_id is not None:
        links["batch"] = f"/v1/batches/{row.batch_id}"
    return record_of(
        JobRecord,
        row,
        **{**reads, "field": None, **made},
        progress={"done": row.done, "total": row.total, "phase": row.phase or ""},
        seconds=_seconds(row),
        links=links,
        ahead=ahead,
        minutes=minutes,
        batch=row.batch_id,
        title=row.name or KINDS[row.kind].title(row),
        doubtful=(row.advice or "").startswith(DOUBTFUL),
        webhook=_webhook_record(row.webhook, delivery),
    )


def _seconds(row: JobRow | BatchRow) -> float | None:
    """Running time so far, s."""
    return None if row.started is None else (row.finished or time.time()) - row.started


def batch_record(row: BatchRow) -> BatchRecord:
    here = f"/v1/batches/{row.id}"
    links = {"self": here, "jobs": f"/v1/jobs?batch={row.id}"}
    if any(row.counts.get(state) for state in ("queued", "running")):
        links["cancel"] = f"{here}/cancel"
    jobs = [
        {
            "id": job.id,
            "dataset": job.dataset_id,
            "state": job.state,
            "volume": volume_of(job.id) if job.state == "succeeded" else None,
        }
        for job in row.jobs
    ]
    return record_of(BatchRecord, row, progress=row.fraction, jobs=jobs, seconds=_seconds(row), links=links)


def _webhook_record(url: str | None, delivery: DeliveryRow | None) -> WebhookRecord | None:
    if url is None:
        return None
    if delivery is None:
        return WebhookRecord(url=url, state="pending", message=None, attempts=[], due=None)
    return WebhookRecord.model_validate(
        {
            "url": url,
            "state": delivery.state,
            "message": delivery.id,
            "attempts": delivery.log,
            "due": delivery.due if delivery.state == "waiting" else None,
        }
    )


def volume_record(row: VolumeRow) -> VolumeRecord:
    here = f"/v1/volumes/{row.id}"
    links = {
        "self": here,
        "image": f"{here}/slice.png",
        "data": f"{here}/data",
        "histogram": f"{here}/histogram",
    }
    with suppress(InvalidInput):
        check_even(tuple(row.shape), tuple(row.spacing_m))
        links["refraction"] = f"{here}/refraction.png"
        links["coefficients"] = f"{here}/coefficients"
    if row.job_id is not None:
        links["job"] = f"/v1/jobs/{row.job_id}"
    source = "upload" if row.job_id is None else "reconstruction"
    return record_of(VolumeRecord, row, source=source, job=row.job_id, dataset=row.dataset_id, links=links)


def mesh_record(row: MeshRow) -> MeshRecord:
    here = f"/v1/meshes/{row.id}"
    links = {"self": here, "image": f"{here}/image.png"}
    if row.volume_id is not None:
        links["volume"] = f"/v1/volumes/{row.volume_id}"
    return record_of(MeshRecord, row, volume=row.volume_id, closed=row.holes == 0, links=links)


def field_record(row: FieldRow) -> FieldRecord:
    links, figures = field_links(row.id), row.figures
    seconds = {name: figures[f"{name}_seconds"] for name in FieldSeconds.model_fields}
    links["self"] = links.pop("field")
    links |= {"mesh": f"/v1/meshes/{row.mesh_id}", "job": f"/v1/jobs/{row.job_id}"}
    given = {"mesh": row.mesh_id, "job": row.job_id, "links": links}
    return record_of(FieldRecord, row, **given, sizes=figures, errors=figures, seconds=seconds)


def upload_record(row: UploadRow, offset: int) -> UploadRecord:
    links = {"self": f"/v1/uploads/{row.id}"}
    done = row.state == "done"
    if done:
        links["result"] = result_link(row)
    result = row.result_id if done else None
    return record_of(UploadRecord, row, kind=row.what, offset=offset, result=result, links=links)


def result_link(row: UploadRow) -> str:
    """The address of the result of an upload."""
    return f"/v1/{LISTED[row.what]}/{row.result_id}"
