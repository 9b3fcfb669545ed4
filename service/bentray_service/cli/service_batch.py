"""`bentray submit --batch` without a scheduler: reconstruct a folder of scans on a service, as one batch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from bentray_kernels.errors import InvalidInput

from .batch import entries_of, request_of
from .options.paths import output_folder
from .options.scan_options import dataset_file
from .output.batch_view import report
from .output.exit_codes import client_errors
from .output.results import write_results
from .output.terminal import print_result, progress_bar, remark

if TYPE_CHECKING:
    from bentray_kernels.tomography import Settings
    from bentray_workers.foreign_scans import ScanMetadata
    from bentray_workers.reconstruction.batch import Entry

    from ..client import Client
    from ..routes.models.batch_records import BatchJobRecord, BatchRecord

# Scans on the service among which those of the folder are looked for.
KNOWN = 1000


def submit_service_batch(
    folder: Path,
    url: str,
    settings: Settings,
    given: ScanMetadata,
    output: Path | None,
    *,
    wait: bool,
    as_json: bool,
) -> list[Entry]:
    """Upload every scan of a folder, reconstruct all as one batch, and download the results to OUTPUT/NAME/.

    Scans with a result in OUTPUT are skipped, and those that are on the service are not uploaded again. If an
    unfinished batch of the same scans and settings exists, it is waited for.

    Args:
        folder: of the scans.
        url: of the service.
        settings: of every reconstruction.
        given: values of the options, the same for every scan.
        output: None: ``results`` in the folder.
        wait: whether to wait for the results.
        as_json: print one JSON object at the end.

    Returns:
        The state of each scan.

    Raises:
        InvalidInput: for an invalid folder or setting.
        WorkFailed: when a scan failed; the others are completed.
    """
    from ..client import Client

    results = (output or folder / "results").resolve()
    entries = entries_of(folder, results, settings, given)
    output_folder(results)
    with client_errors(), Client(url, on_wait=remark) as client:
        waiting = _upload_all(client, entries, settings, given)
        batch = _start(client, folder.resolve().name, list(waiting), settings) if waiting else None
        if batch is not None and not wait:
            lines = [f"{batch.id} {batch.state}", f"{client.url}{batch.links['self']}"]
            print_result(batch.model_dump(mode="json"), lines, as_json=as_json)
            return entries
        if batch is not None:
            remark(
                f"{batch.id}: it goes on if this command is interrupted, and the same command finds it again"
            )
            batch = client.wait_batch(batch, progress=True)
            for job in batch.jobs:
                if job.dataset in waiting:
                    for entry in waiting[job.dataset]:
                        with _ending(entry):
                            _download(client, job, entry, results, settings, given)
    report(folder, results, entries, as_json=as_json)
    return entries


def _upload_all(
    client: Client, entries: Sequence[Entry], settings: Settings, given: ScanMetadata
) -> dict[str, list[Entry]]:
    """Upload the waiting scans; entries by dataset id. Equal files are one dataset."""
    from bentray_kernels.tomography.requirements import check_scan
    from bentray_workers.files.dataset import read_dataset
    from bentray_workers.files.dataset.traces import trace_samples

    from ..files.disk import sha256_of

    known = {one.sha256: one.id for one in client.datasets(KNOWN) if one.job is None}
    uploaded: dict[str, list[Entry]] = {}
    left = [entry for entry in entries if entry.state == "waiting"]
    with progress_bar("Uploading") as step:
        for place, entry in enumerate(left):
            step(place, len(left), entry.name)
            entry.begin()
            try:
                with _dataset(entry, given) as scan:
                    check_scan(read_dataset(scan, traces=False), settings, trace_samples(scan))
                    digest = sha256_of(scan)
                    if digest not in known:
                        known[digest] = client.upload(scan).id
            except InvalidInput as error:
                # The other scans do not depend on it.
                entry.end("failed", str(error))
            else:
                uploaded.setdefault(known[digest], []).append(entry)
        step(len(left), len(left), "")
    return uploaded


def _start(client: Client, name: str, datasets: list[str], settings: Settings) -> BatchRecord:
    """Start a batch, or find the unfinished one of the same scans and settings."""
    asked = settings.to_dict()
    for one in client.batches():
        same = {job.dataset for job in one.jobs} == set(datasets) and one.settings == asked
        if same and one.state in ("queued", "running"):
            return one
    return client.submit_batch(datasets, asked, name=name)


@contextmanager
def _ending(entry: Entry) -> Iterator[None]:
    """End an entry: failed with the reason if the block raises an error."""
    from ..client import ClientError

    try:
        yield
    except (ClientError, InvalidInput, OSError) as error:
        entry.end("failed", str(error).splitlines()[0])
    else:
        entry.end("succeeded")


def _download(
    client: Client,
    job: BatchJobRecord,
    entry: Entry,
    results: Path,
    settings: Settings,
    given: ScanMetadata,
) -> None:
    """Download the result of one job, and write the files of a result."""
    from bentray_workers.files.dataset import read_dataset
    from bentray_workers.files.reconstruction import read_reconstruction

    record = client.wait(job.id)
    folder = output_folder(results / entry.name)
    volume = client.download(record.volume or "", "hdf5", folder / "reconstruction.h5")
    result = read_reconstruction(volume)
    entry.doubt = result.doubt
    with _dataset(entry, given) as scan:
        # The ground truth is in the local file only.
        dataset = read_dataset(scan, traces=False)
    request = request_of(entry.source, settings, given)
    write_results(folder, result, dataset, record.seconds or 0.0, file=str(entry.source), request=request)
    if result.history:
        entry.residual_rms_s = result.history[-1].residual_rms_s


@contextmanager
def _dataset(entry: Entry, given: ScanMetadata) -> Iterator[Path]:
    with TemporaryDirectory() as folder, dataset_file(entry.source, given, Path(folder)) as scan:
        yield scan
