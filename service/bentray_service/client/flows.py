"""The operations of the clients, written as flows of requests."""

from __future__ import annotations

import os
import re
import tempfile
import uuid
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, Unpack

from bentray_workers.files.export.registry import FormatName

from ..interactive.progress_bar import progress_bar
from ..interactive.result import Result, result_of
from ..routes.models.batch_records import BatchRecord
from ..routes.models.job_records import DatasetRecord, JobRecord, VolumeRecord
from ..routes.models.name_changes import LengthUnit, TimeUnit
from ..routes.models.surface_records import MeshRecord
from ..settings_request import check_setting_names, nested, plain_numbers
from .connection import Connection, DownloadStep, Flow, RequestStep
from .errors import ClientError
from .lists import Answer, BatchId, DatasetId, JobId, StoredId, VolumeId, answer, id_of, volume_of
from .lists import volume as volume_record
from .uploading import PLACES, OnBytes, UploadKind, send_direct, send_file
from .waiting import wait

if TYPE_CHECKING:
    from ..interactive.setting_types import Method, PhantomName, ReconstructionSettings, SimulationSettings

Format = Literal[FormatName, "h5"]

Uploaded: TypeAlias = DatasetRecord | VolumeRecord | MeshRecord

RECORDS: dict[str, type[Uploaded]] = {"dataset": DatasetRecord, "volume": VolumeRecord, "mesh": MeshRecord}
SCAN_ID = re.compile(r"ds-[0-9a-z]+")
PREFIXES = {"ds": "dataset", "vol": "volume", "mesh": "mesh"}


def upload(
    connection: Connection,
    /,
    path: os.PathLike[str] | str,
    on_progress: OnBytes | None = None,
    *,
    kind: UploadKind = "dataset",
    resume: str | None = None,
    direct: bool = False,
    **metadata: str,
) -> Flow[Uploaded]:
    """Upload a file in chunks; interrupted uploads are continued.

    Args:
        path: of the file, or a ``bentray.Scan``.
        on_progress: called with ``(sent, total)``, bytes.
        kind: type of the file.
        resume: id of an interrupted upload, from ``ClientError.upload``.
        direct: send the file straight to the bucket of the service, if its files are in one.
        metadata: ``title`` of a volume or mesh; ``spacing_m``, ``shape`` and ``dtype`` of a volume;
            ``map``, ``unit``, ``temperature_c``, ``sound_speed_mps`` and ``frequency_hz`` of a foreign scan.

    Returns:
        the record of the dataset, volume or mesh.
    """
    # The file of a scan that was read from another format has no name of its own.
    title = "" if isinstance(path, str) else getattr(path, "title", "")
    metadata = {"filename": title or Path(path).name, **metadata}
    if direct:
        response = yield from send_direct(Path(path), on_progress, kind, metadata)
    else:
        response = yield from send_file(Path(path), on_progress, kind, resume, metadata)
    return RECORDS[kind].model_validate_json(response.content)


def correct_dataset(
    connection: Connection,
    dataset: DatasetId,
    *,
    times_in: TimeUnit | None = None,
    times_read_as: TimeUnit = "s",
    positions_in: LengthUnit | None = None,
    positions_read_as: LengthUnit = "m",
    sampling_rate_hz: float | None = None,
    frequency_hz: float | None = None,
    arrangement: str | None = None,
) -> Flow[DatasetRecord]:
    """Make a corrected copy of a scan whose units, frequency or order of elements are wrong; the scan stays.

    Args:
        dataset: id or record of the scan.
        times_in: unit of the times in the original file.
        times_read_as: unit in which they were read, as stated at upload.
        positions_in, positions_read_as: the same of lengths.
        sampling_rate_hz: of the traces; None: follows the unit of times.
        frequency_hz: centre frequency.
        arrangement: fault in the order of the elements or their positions, by ``proposed_corrections``.

    Returns:
        the record of the copy.
    """
    given = {
        "times_in": times_in,
        "times_read_as": times_read_as,
        "positions_in": positions_in,
        "positions_read_as": positions_read_as,
        "sampling_rate_hz": sampling_rate_hz,
        "frequency_hz": frequency_hz,
        "arrangement": arrangement,
    }
    place = f"/v1/datasets/{id_of(dataset)}/corrections"
    return (yield from _post_once(DatasetRecord, place, plain_numbers(given)))


def submit(
    connection: Connection,
    dataset: DatasetId,
    settings: Mapping[str, Any] | None = None,
    *,
    method: Method | None = None,
    webhook: str | None = None,
    **values: Unpack[ReconstructionSettings],
) -> Flow[JobRecord]:
    """Start a reconstruction; omitted settings take their defaults.

    Args:
        dataset: id or record of the scan.
        settings: nested, as the REST interface has them.
        method: as for ``bentray.reconstruct``.
        webhook: address that the service calls when the job ends; see ``bentray.verify_webhook``.
        values: single settings as for ``bentray.reconstruct``, in place of those of ``settings``.

    Raises:
        InvalidInput: for an unknown name in ``values``, with the one that is spelt most like it.
    """
    merged = merged_settings(settings, method, {**values})
    called = {} if webhook is None else {"webhook": webhook}
    request = {"kind": "reconstruction", "dataset": id_of(dataset), "settings": merged, **called}
    return (yield from _post_once(JobRecord, "/v1/jobs", request))


def submit_batch(
    connection: Connection,
    datasets: Sequence[DatasetId],
    settings: Mapping[str, Any] | None = None,
    *,
    name: str = "",
    method: Method | None = None,
    **values: Unpack[ReconstructionSettings],
) -> Flow[BatchRecord]:
    """Start one reconstruction for each dataset, as one batch; omitted settings take their defaults.

    Args:
        datasets: ids or records, at most 1000.
        settings: as the REST interface has them.
        name: of the batch.
        method, values: as for ``bentray.reconstruct``, in place of those of ``settings``.
    """
    merged = merged_settings(settings, method, {**values})
    request = {"datasets": [id_of(dataset) for dataset in datasets], "name": name, "settings": merged}
    return (yield from _post_once(BatchRecord, "/v1/batches", request))


def merged_settings(
    settings: Mapping[str, Any] | None, method: Method | None, values: dict[str, Any]
) -> dict[str, Any]:
    """Settings as the REST interface has them, with those given by name in their place."""
    merged = dict(settings or {})
    given = values if method is None else {"method": method, **values}
    for name, value in nested(plain_numbers(given)).items():
        own = merged.get(name)
        merged[name] = {**own, **value} if isinstance(own, Mapping) and isinstance(value, dict) else value
    return merged


def simulate(
    connection: Connection,
    settings: Mapping[str, Any] | None = None,
    *,
    phantom: PhantomName | None = None,
    **values: Unpack[SimulationSettings],
) -> Flow[JobRecord]:
    """Start the simulation of a scan; ``dataset`` of the successful job is its id.

    Args:
        settings: as the REST interface has them.
        phantom, values: as for ``bentray.simulate``, in place of those of ``settings``.

    Raises:
        InvalidInput: for an unknown name in ``values``, with the one that is spelt most like it.
    """
    from bentray_workers.simulation.request import PhantomScan

    check_setting_names(values, PhantomScan)
    given = {**values} if phantom is None else {"phantom": phantom, **values}
    request = {"kind": "simulation", "settings": {**(settings or {}), **plain_numbers(given)}}
    return (yield from _post_once(JobRecord, "/v1/jobs", request))


def reconstruct(
    connection: Connection,
    scan: os.PathLike[str] | DatasetId,
    method: Method = "auto",
    *,
    progress: bool = True,
    **settings: Unpack[ReconstructionSettings],
) -> Flow[Result]:
    """Upload a scan, reconstruct it on the service and get the result; as ``bentray.reconstruct``.

    Args:
        scan: a ``bentray.Scan``, the path of a scan, or the id or record of one on the service.
        method: as for ``bentray.reconstruct``.
        progress: show progress bars.
        settings: as for ``bentray.reconstruct``.

    Raises:
        InvalidInput: for an unknown setting, with the one that is spelt most like it.
    """
    # An unknown setting is refused before the upload.
    nested({**settings})
    if isinstance(scan, DatasetRecord) or (isinstance(scan, str) and SCAN_ID.fullmatch(scan)):
        stored = id_of(scan)
    else:
        with progress_bar("Uploading", shown=progress) as step:
            stored = (yield from upload(connection, scan, step)).id
    job = yield from submit(connection, stored, method=method, **settings)
    return (yield from result(connection, (yield from wait(connection, job, progress=progress))))


def cancel(connection: Connection, job: JobId) -> Flow[JobRecord]:
    """Cancel a job."""
    return (yield from answer(JobRecord, "POST", f"/v1/jobs/{id_of(job)}/cancel"))


def cancel_batch(connection: Connection, batch: BatchId) -> Flow[BatchRecord]:
    """Cancel the jobs of a batch that have not ended."""
    return (yield from answer(BatchRecord, "POST", f"/v1/batches/{id_of(batch)}/cancel"))


def download(
    connection: Connection,
    volume: VolumeId,
    /,
    format: Format,  # noqa: A002 - the name of the query parameter
    path: os.PathLike[str] | str,
    **how: str | float,
) -> Flow[Path]:
    """Download a volume to ``path``, atomically; ``how``: quantity, attenuation, frequency_hz."""
    place, options = f"/v1/volumes/{volume_of(volume)}/data", {"params": {"format": format, **how}}
    yield DownloadStep(place, options, Path(path))
    return Path(path)


def download_dataset(
    connection: Connection,
    dataset: DatasetId,
    path: os.PathLike[str] | str,
    on_progress: OnBytes | None = None,
) -> Flow[Path]:
    """Download a scan to ``path``; ``on_progress`` as in ``upload``."""
    yield DownloadStep(f"/v1/datasets/{id_of(dataset)}/file", {}, Path(path), on_progress)
    return Path(path)


def result(connection: Connection, volume: VolumeId) -> Flow[Result]:
    """Get a volume, or the result of a job, as a :class:`Result`: arrays with coordinates and units."""
    from bentray_workers.files.volume_export import read_image

    about = yield from volume_record(connection, volume)
    with tempfile.TemporaryDirectory() as folder:
        path = yield from download(connection, about.id, "hdf5", Path(folder) / "volume.h5")
        named = ("id", "title", "job", "dataset", "sha256")
        attributes = {name: str(value) for name in named if (value := getattr(about, name))}
        return result_of(read_image(path), attributes, unit=about.unit)


def delete(connection: Connection, stored: StoredId) -> Flow[None]:
    """Delete a dataset, volume or mesh with everything derived from it."""
    name = id_of(stored)
    kind = PREFIXES.get(name.partition("-")[0])
    if kind is None:
        raise ClientError(f"{name!r} is not the id of a dataset, a volume or a mesh")
    yield RequestStep("DELETE", f"{PLACES[kind]}/{name}")


def _post_once(model: type[Answer], path: str, request: dict[str, Any]) -> Flow[Answer]:
    """Post a request with an idempotency key, so that retries make nothing a second time."""
    options = {"json": request, "headers": {"Idempotency-Key": str(uuid.uuid4())}}
    return (yield from answer(model, "POST", path, options, repeatable=True))
