"""The operations of the clients, written as flows of requests."""

from __future__ import annotations

import tempfile
import uuid
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal, TypeAlias, TypeVar

from pydantic import BaseModel

from ..interactive.result import Result
from ..routes.models.job_records import DatasetRecord, JobRecord, VolumeRecord
from ..routes.models.surface_records import MeshRecord
from .connection import Connection
from .errors import ClientError
from .results import read_result
from .steps import DownloadStep, Flow, RequestStep
from .uploading import PLACES, OnBytes, UploadKind, send_file
from .waiting import wait_for

Format = Literal["hdf5", "h5", "nifti", "metaimage", "nrrd", "mat", "vti", "ome-zarr", "dicom", "npy"]
Record = TypeVar("Record", bound=BaseModel)

Uploaded: TypeAlias = DatasetRecord | VolumeRecord | MeshRecord

RECORDS: dict[str, type[Uploaded]] = {"dataset": DatasetRecord, "volume": VolumeRecord, "mesh": MeshRecord}
PREFIXES = {"ds": "dataset", "vol": "volume", "mesh": "mesh"}


def upload(
    connection: Connection,
    /,
    path: Path | str,
    on_progress: OnBytes | None = None,
    *,
    kind: UploadKind = "dataset",
    resume: str | None = None,
    **metadata: str,
) -> Flow[Uploaded]:
    """Upload a file in chunks; interrupted uploads are continued.

    Args:
        path: of the file.
        on_progress: called with ``(sent, total)``, bytes.
        kind: type of the file.
        resume: id of an interrupted upload, from ``ClientError.upload``.
        metadata: ``title`` of a volume or mesh; ``spacing_m``, ``shape`` and ``dtype`` of a volume;
            ``map``, ``unit``, ``temperature_c``, ``sound_speed_mps`` and ``frequency_hz`` of a foreign scan.

    Returns:
        the record of the dataset, volume or mesh.
    """
    response = yield from send_file(Path(path), on_progress, kind, resume, metadata)
    return RECORDS[kind].model_validate_json(response.content)


def submit(
    connection: Connection, dataset_id: str, settings: Mapping[str, Any] | None = None
) -> Flow[JobRecord]:
    """Start a reconstruction; omitted settings take their defaults."""
    return (
        yield from _start({"kind": "reconstruction", "dataset": dataset_id, "settings": dict(settings or {})})
    )


def simulate(connection: Connection, settings: Mapping[str, Any] | None = None) -> Flow[JobRecord]:
    """Start the simulation of a scan; ``dataset`` of the successful job is its id."""
    return (yield from _start({"kind": "simulation", "settings": dict(settings or {})}))


def job(connection: Connection, job_id: str) -> Flow[JobRecord]:
    """Get the current record of a job."""
    return (yield from _record(JobRecord, "GET", f"/v1/jobs/{job_id}"))


def cancel(connection: Connection, job_id: str) -> Flow[JobRecord]:
    """Cancel a job."""
    return (yield from _record(JobRecord, "POST", f"/v1/jobs/{job_id}/cancel"))


def wait(
    connection: Connection,
    job_id: str,
    on_progress: Callable[[JobRecord], None] | None = None,
    timeout_s: float | None = None,
) -> Flow[JobRecord]:
    """Wait until a job has succeeded and return its record; ``on_progress`` is called with every record.

    Raises:
        ClientError: when the job failed or was cancelled, or after ``timeout_s``.
    """
    return (yield from wait_for(job_id, on_progress, timeout_s, connection.poll_s))


def volume(connection: Connection, volume_id: str) -> Flow[VolumeRecord]:
    """Get the record of a volume."""
    return (yield from _record(VolumeRecord, "GET", f"/v1/volumes/{volume_id}"))


def slice_png(connection: Connection, /, volume_id: str, **how: str | float) -> Flow[bytes]:
    """Get a slice as PNG; ``how``: index, quantity, low, high, colormap."""
    path = f"/v1/volumes/{volume_id}/slice.png"
    return bytes((yield RequestStep("GET", path, {"params": how}, repeatable=True)).content)


def download(
    connection: Connection,
    /,
    volume_id: str,
    format: Format,  # noqa: A002 - the name of the query parameter
    path: Path | str,
    **how: str | float,
) -> Flow[Path]:
    """Download a volume to ``path``, atomically; ``how``: quantity, attenuation, frequency_hz."""
    yield DownloadStep(f"/v1/volumes/{volume_id}/data", {"params": {"format": format, **how}}, Path(path))
    return Path(path)


def download_dataset(
    connection: Connection, dataset_id: str, path: Path | str, on_progress: OnBytes | None = None
) -> Flow[Path]:
    """Download a scan to ``path``; ``on_progress`` as in ``upload``."""
    yield DownloadStep(f"/v1/datasets/{dataset_id}/file", {}, Path(path), on_progress)
    return Path(path)


def result(connection: Connection, volume_id: str) -> Flow[Result]:
    """Get a volume as arrays with coordinates; ``.to_xarray()`` converts it to a dataset of xarray."""
    about = yield from volume(connection, volume_id)
    with tempfile.TemporaryDirectory() as folder:
        path = yield from download(connection, volume_id, "hdf5", Path(folder) / "volume.h5")
        return read_result(path, about)


def delete(connection: Connection, stored_id: str) -> Flow[None]:
    """Delete a dataset, volume or mesh with everything derived from it."""
    kind = PREFIXES.get(stored_id.partition("-")[0])
    if kind is None:
        raise ClientError(f"{stored_id!r} is not the id of a dataset, a volume or a mesh")
    yield RequestStep("DELETE", f"{PLACES[kind]}/{stored_id}")


def _record(model: type[Record], method: str, path: str) -> Flow[Record]:
    response = yield RequestStep(method, path, repeatable=method == "GET")
    return model.model_validate_json(response.content)


def _start(request: dict[str, Any]) -> Flow[JobRecord]:
    """Start a job with an idempotency key, so that retries start no second job."""
    options = {"json": request, "headers": {"Idempotency-Key": str(uuid.uuid4())}}
    response = yield RequestStep("POST", "/v1/jobs", options, repeatable=True)
    return JobRecord.model_validate_json(response.content)
