"""`bentray submit --batch`: reconstruct a folder of scans on a cluster, or as one batch on a service."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from bentray_kernels.errors import InvalidInput

from .options.paths import output_folder
from .options.scan_options import checked_dataset, dataset_file
from .output.batch_view import watching
from .output.exit_codes import client_errors
from .output.results import write_results
from .output.terminal import print_result, progress_bar, remark, without_nan

if TYPE_CHECKING:
    from bentray_kernels.tomography import Reconstruction, Settings
    from bentray_workers.foreign_scans import ScanMetadata
    from bentray_workers.reconstruction.batch import Entry

    from ..client import Client
    from ..routes.models.batch_records import BatchJobRecord, BatchRecord

# Of files that may hold a scan; their content decides.
SUFFIXES = (".h5", ".hdf5", ".mat", ".npz", ".zip")
ACCEPTED = "a folder of scans, *" + ", *".join(SUFFIXES)
# Scans on the service among which those of the folder are looked for.
KNOWN = 1000


@dataclass(frozen=True)
class Batch:
    """A folder of scans to reconstruct; existing results are skipped.

    Attributes:
        folder: of the scans.
        results: with a folder for each scan, by its name.
        settings: of every reconstruction.
        given: values of the options, the same for every scan.
    """

    folder: Path
    results: Path
    settings: Settings
    given: ScanMetadata

    @cached_property
    def entries(self) -> list[Entry]:
        """An entry for each scan, by name; those with a result are skipped.

        Raises:
            InvalidInput: when there are none, or two of the same name.
        """
        from bentray_workers.reconstruction.batch import Entry

        folder = self.folder
        if not folder.is_dir():
            raise InvalidInput("--batch", f"{folder} (no such folder)", ACCEPTED)
        paths = sorted(
            path
            for path in folder.resolve().iterdir()
            if path.suffix.lower() in SUFFIXES and path.is_file() and not path.name.startswith(".")
        )
        if not paths:
            raise InvalidInput("--batch", f"{folder} (without any scan)", ACCEPTED)
        for path, other in pairwise(sorted(paths, key=lambda path: path.stem)):
            if path.stem == other.stem:
                raise InvalidInput(
                    "--batch", f"{path.name} and {other.name}", "names that differ without their endings"
                )
        entries = [Entry(path) for path in paths]
        for entry in entries:
            result = self._finished(entry)
            if result is not None:
                entry.skip(result["seconds"], result["residual_rms_s"], result.get("doubt", ""))
        return entries

    @property
    def waiting(self) -> list[Entry]:
        """The entries without a result."""
        return [entry for entry in self.entries if entry.state == "waiting"]

    def request(self, source: Path) -> dict[str, Any]:
        """The request that a result belongs to: file size, modification time, settings and scan options."""
        there = source.stat()
        request = {
            "bytes": there.st_size,
            "mtime_ns": there.st_mtime_ns,
            "settings": self.settings.to_dict(),
        }
        if self.given:
            request["scan"] = asdict(self.given)
        plain: dict[str, Any] = json.loads(json.dumps(without_nan(request)))
        return plain

    def write(
        self,
        entry: Entry,
        scan: Path,
        result: Reconstruction,
        seconds: float,
        request: dict[str, Any],
        draw: Callable[[], bytes] | None = None,
    ) -> None:
        """Write the files of a result, with the truth of its scan."""
        from bentray_workers.files.dataset import read_dataset

        entry.doubt = result.doubt
        dataset, file = read_dataset(scan, traces=False), str(entry.source)
        write_results(self.results / entry.name, result, dataset, seconds, draw, file=file, request=request)

    def _finished(self, entry: Entry) -> dict[str, Any] | None:
        """The figures of a complete result of this file with these settings, else None."""
        from bentray_workers.files.reconstruction import read_reconstruction

        folder = self.results / entry.name
        try:
            stored: dict[str, Any] = json.loads((folder / "reconstruction.json").read_text())
            if (
                stored["request"] != self.request(entry.source)
                or not (folder / "reconstruction.png").is_file()
            ):
                return None
            read_reconstruction(folder / "reconstruction.h5")
        except (OSError, ValueError, KeyError, TypeError, RecursionError, InvalidInput):
            return None
        return stored


def run_on_cluster(batch: Batch, scheduler: str, at_once: int | None, tls: Path | None) -> None:
    """Reconstruct the waiting scans on a cluster.

    Args:
        batch: its folders must have the same path on every worker.
        scheduler: of the cluster.
        at_once: number of concurrent datasets; None: one more than the number of workers.
        tls: folder of the certificates.

    Raises:
        InvalidInput: for an invalid scheduler or setting.
    """
    from bentray_workers.cluster.connection import open_cluster
    from bentray_workers.reconstruction.batch import run

    if batch.waiting:
        with open_cluster(scheduler, tls=tls) as cluster, watching(batch.entries) as watch:
            run(
                batch.waiting,
                lambda entry, stop: _reconstruct(cluster.client, batch, entry, stop),
                watch,
                at_once or cluster.describe()["workers"] + 1,
            )


def _reconstruct(client: Any, batch: Batch, entry: Entry, stop: Callable[[], bool]) -> None:
    """Reconstruct one dataset into its folder of results; the image is rendered on the cluster, too."""
    from bentray_kernels.task_graph import Cancelled
    from bentray_workers.cluster.resources import RENDER
    from bentray_workers.reconstruction.batch import report_of
    from bentray_workers.reconstruction.reconstruction_run import reconstruct

    folder, request = output_folder(batch.results / entry.name), batch.request(entry.source)

    # Checkpoints are only valid for the same request.
    mark = hashlib.sha256(json.dumps(request).encode()).hexdigest()[:12]
    work_dir = output_folder(folder / f"work-{mark}")
    try:
        with dataset_file(entry.source, batch.given, folder) as scan:

            def draw() -> bytes:
                drawn = client.submit(
                    report_of, folder / "reconstruction.h5", scan, resources=RENDER, pure=False
                )
                return bytes(drawn.result())

            result = reconstruct(client, scan, batch.settings, entry.show, stop, work_dir)
            batch.write(entry, scan, result, entry.seconds, request, draw)
    except Cancelled:
        raise
    except Exception:
        shutil.rmtree(work_dir, ignore_errors=True)
        raise
    shutil.rmtree(work_dir, ignore_errors=True)


def run_on_service(batch: Batch, url: str, *, wait: bool, as_json: bool) -> bool:
    """Upload the waiting scans, reconstruct all as one batch on a service, and download the results.

    Scans that are on the service are not uploaded again. If an unfinished batch of the same scans and
    settings exists, it is waited for.

    Args:
        batch: the scans.
        url: of the service.
        wait: whether to wait for the results; else the batch is printed.
        as_json: print one JSON object.

    Returns:
        Whether all results are there.

    Raises:
        InvalidInput: for an invalid setting.
    """
    from ..client import Client, ClientError

    with client_errors(), Client(url, on_wait=remark) as client:
        waiting = _upload_all(client, batch)
        if not waiting:
            return True
        record = _start(client, batch, list(waiting))
        if not wait:
            lines = [f"{record.id} {record.state}", f"{client.url}{record.links['self']}"]
            print_result(record.model_dump(mode="json"), lines, as_json=as_json)
            return False
        remark(f"{record.id}: it goes on if this command is interrupted, and the same command finds it again")
        for job in client.wait_batch(record, progress=True).jobs:
            for entry in waiting.get(job.dataset or "", ()):
                try:
                    _download(client, job, batch, entry)
                except (ClientError, InvalidInput, OSError) as error:
                    entry.end("failed", str(error).splitlines()[0])
                else:
                    entry.end("succeeded")
    return True


def _upload_all(client: Client, batch: Batch) -> dict[str, list[Entry]]:
    """Upload the waiting scans; entries by dataset id. Equal files are one dataset."""
    from ..files.disk import sha256_of

    known = {dataset.sha256: dataset.id for dataset in client.datasets(KNOWN) if dataset.job is None}
    uploaded: dict[str, list[Entry]] = {}
    left = batch.waiting
    with progress_bar("Uploading") as step:
        for number, entry in enumerate(left):
            step(number, len(left), entry.name)
            entry.begin()
            try:
                with _dataset(batch, entry) as scan:
                    checked_dataset(scan, batch.settings)
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


def _start(client: Client, batch: Batch, datasets: list[str]) -> BatchRecord:
    """Start a batch, or find the unfinished one of the same scans and settings."""
    asked = batch.settings.to_dict()
    for record in client.batches():
        same = {job.dataset for job in record.jobs} == set(datasets) and record.settings == asked
        if same and record.state in ("queued", "running"):
            return record
    return client.submit_batch(datasets, asked, name=batch.folder.resolve().name)


def _download(client: Client, job: BatchJobRecord, batch: Batch, entry: Entry) -> None:
    """Download the result of one job, and write the files of a result."""
    from bentray_workers.files.reconstruction import read_reconstruction

    record = client.wait(job.id)
    folder = output_folder(batch.results / entry.name)
    result = read_reconstruction(client.download(record.volume or "", "hdf5", folder / "reconstruction.h5"))
    with _dataset(batch, entry) as scan:
        batch.write(entry, scan, result, record.seconds or 0.0, batch.request(entry.source))
    if result.history:
        entry.residual_rms_s = result.history[-1].residual_rms_s


@contextmanager
def _dataset(batch: Batch, entry: Entry) -> Iterator[Path]:
    with TemporaryDirectory() as folder, dataset_file(entry.source, batch.given, Path(folder)) as scan:
        yield scan
