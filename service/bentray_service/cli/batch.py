"""`bentray submit --batch`: reconstruct a folder of scans on a cluster."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bentray_kernels.errors import InvalidInput

from .options.paths import output_folder
from .options.scan_options import dataset_file
from .output.batch_view import report, watching
from .output.results import write_results
from .output.terminal import without_nan

if TYPE_CHECKING:
    from bentray_kernels.tomography import Settings
    from bentray_workers.foreign_scans import ScanMetadata
    from bentray_workers.reconstruction.batch import Entry

# Of files that may hold a scan; their content decides.
SUFFIXES = (".h5", ".hdf5", ".mat", ".npz", ".zip")
ACCEPTED = "a folder of scans, *" + ", *".join(SUFFIXES)


def submit_batch(
    folder: Path,
    scheduler: str,
    settings: Settings,
    given: ScanMetadata,
    output: Path | None,
    at_once: int | None,
    tls: Path | None,
    *,
    as_json: bool,
) -> list[Entry]:
    """Reconstruct every scan of a folder into OUTPUT/NAME/; existing results are skipped.

    Args:
        folder: of the datasets; it and ``output`` must have the same path on every worker.
        scheduler: of the cluster.
        settings: of every reconstruction.
        given: values of the options, the same for every scan.
        output: None: ``results`` in the folder.
        at_once: number of concurrent datasets; None: one more than the number of workers.
        tls: folder of the certificates.
        as_json: print one JSON object at the end.

    Returns:
        The state of each scan.

    Raises:
        InvalidInput: for an invalid folder, scheduler or setting.
        WorkFailed: when a dataset failed; the others are completed.
    """
    results = (output or folder / "results").resolve()
    entries = entries_of(folder, results, settings, given)
    output_folder(results)

    from bentray_workers.cluster.connection import open_cluster
    from bentray_workers.reconstruction import batch

    waiting = [entry for entry in entries if entry.state == "waiting"]
    if waiting:
        with open_cluster(scheduler, tls=tls) as cluster, watching(entries) as watch:
            batch.run(
                waiting,
                lambda entry, stop: reconstruct_one(cluster.client, entry, results, settings, given, stop),
                watch,
                at_once or cluster.describe()["workers"] + 1,
            )
    report(folder, results, entries, as_json=as_json)
    return entries


def entries_of(folder: Path, results: Path, settings: Settings, given: ScanMetadata) -> list[Entry]:
    """An entry for each scan of a folder, by name; those with a result are skipped.

    Raises:
        InvalidInput: when there are none, or two of the same name.
    """
    from bentray_workers.reconstruction.batch import Entry

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
        result = finished(results / entry.name, entry.source, settings, given)
        if result is not None:
            entry.skip(result["seconds"], result["residual_rms_s"], result.get("doubt", ""))
    return entries


def reconstruct_one(
    client: Any,
    entry: Entry,
    results: Path,
    settings: Settings,
    given: ScanMetadata,
    stop: Callable[[], bool],
) -> None:
    """Reconstruct one dataset into its folder of results; the image is rendered on the cluster, too."""
    from bentray_kernels.task_graph import Cancelled
    from bentray_workers.cluster.resources import RENDER
    from bentray_workers.files.dataset import read_dataset
    from bentray_workers.reconstruction.batch import report_of
    from bentray_workers.reconstruction.reconstruction_run import reconstruct

    folder, request = output_folder(results / entry.name), request_of(entry.source, settings, given)

    # Checkpoints are only valid for the same request.
    mark = hashlib.sha256(json.dumps(request).encode()).hexdigest()[:12]
    work_dir = output_folder(folder / f"work-{mark}")
    try:
        with dataset_file(entry.source, given, folder) as scan:

            def draw() -> bytes:
                drawn = client.submit(
                    report_of, folder / "reconstruction.h5", scan, resources=RENDER, pure=False
                )
                return bytes(drawn.result())

            result = reconstruct(client, scan, settings, entry.show, stop, work_dir)
            entry.doubt = result.doubt
            dataset = read_dataset(scan, traces=False)
            write_results(
                folder, result, dataset, entry.seconds, draw, file=str(entry.source), request=request
            )
    except Cancelled:
        raise
    except Exception:
        shutil.rmtree(work_dir, ignore_errors=True)
        raise
    shutil.rmtree(work_dir, ignore_errors=True)


def request_of(source: Path, settings: Settings, given: ScanMetadata) -> dict[str, Any]:
    """The request that a result belongs to: file size, modification time, settings and scan options."""
    there = source.stat()
    request = {"bytes": there.st_size, "mtime_ns": there.st_mtime_ns, "settings": settings.to_dict()}
    if given:
        request["scan"] = asdict(given)
    plain: dict[str, Any] = json.loads(json.dumps(without_nan(request)))
    return plain


def finished(folder: Path, source: Path, settings: Settings, given: ScanMetadata) -> dict[str, Any] | None:
    """The figures of a complete result of this file with these settings, else None."""
    from bentray_workers.files.reconstruction import read_reconstruction

    try:
        stored: dict[str, Any] = json.loads((folder / "reconstruction.json").read_text())
        if (
            stored["request"] != request_of(source, settings, given)
            or not (folder / "reconstruction.png").is_file()
        ):
            return None
        read_reconstruction(folder / "reconstruction.h5")
    except (OSError, ValueError, KeyError, TypeError, RecursionError, InvalidInput):
        return None
    return stored
