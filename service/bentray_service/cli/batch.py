"""`bentray submit --batch`: reconstruct a folder of scans on a cluster."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bentray_kernels.errors import InvalidInput

from .options.paths import output_folder
from .output.batch_view import report, watching
from .output.results import write_results
from .output.terminal import without_nan

if TYPE_CHECKING:
    from bentray_kernels.tomography import Settings
    from bentray_workers.reconstruction.batch import Entry


def submit_batch(
    folder: Path,
    scheduler: str,
    settings: Settings,
    output: Path | None,
    at_once: int | None,
    tls: Path | None,
    *,
    as_json: bool,
) -> None:
    """Reconstruct every ``*.h5`` of a folder into OUTPUT/NAME/; existing results are skipped.

    Args:
        folder: of the datasets; it and ``output`` must have the same path on every worker.
        scheduler: of the cluster.
        settings: of every reconstruction.
        output: None: ``results`` in the folder.
        at_once: number of concurrent datasets; None: one more than the number of workers.
        tls: folder of the certificates.
        as_json: print one JSON object at the end.

    Raises:
        InvalidInput: for an invalid folder, scheduler or setting.
        WorkFailed: when a dataset failed; the others are completed.
    """
    entries = entries_of(folder)
    results = output_folder((output or folder / "results").resolve())

    from bentray_workers.cluster.connection import open_cluster
    from bentray_workers.reconstruction import batch

    for entry in entries:
        found = finished(results / entry.name, entry.source, settings)
        if found is not None:
            entry.skip(found["seconds"], found["residual_rms_s"])
    waiting = [entry for entry in entries if entry.state == "waiting"]
    if waiting:
        with open_cluster(scheduler, tls=tls) as cluster, watching(entries) as watch:
            batch.run(
                waiting,
                lambda entry, stop: reconstruct_one(cluster.client, entry, results, settings, stop),
                watch,
                at_once or cluster.describe()["workers"] + 1,
            )
    report(folder, results, entries, as_json=as_json)


def entries_of(folder: Path) -> list[Entry]:
    """An entry for each dataset of a folder, by name.

    Raises:
        InvalidInput: when there are none.
    """
    from bentray_workers.reconstruction.batch import Entry

    if not folder.is_dir():
        raise InvalidInput("--batch", f"{folder} (no such folder)", "a folder of datasets, *.h5")
    found = sorted(folder.resolve().glob("*.h5"))
    if not found:
        raise InvalidInput("--batch", f"{folder} (without any *.h5)", "a folder of datasets, *.h5")
    return [Entry(path) for path in found]


def reconstruct_one(
    client: Any, entry: Entry, results: Path, settings: Settings, stop: Callable[[], bool]
) -> None:
    """Reconstruct one dataset into its folder of results; the image is rendered on the cluster, too."""
    from bentray_kernels.task_graph import Cancelled
    from bentray_workers.cluster.resources import RENDER
    from bentray_workers.files.dataset import read_dataset
    from bentray_workers.reconstruction.batch import report_of
    from bentray_workers.reconstruction.reconstruction_run import reconstruct

    folder, request = output_folder(results / entry.name), request_of(entry.source, settings)

    def draw() -> bytes:
        drawn = client.submit(
            report_of, folder / "reconstruction.h5", entry.source, resources=RENDER, pure=False
        )
        return bytes(drawn.result())

    # Checkpoints are only valid for the same request.
    mark = hashlib.sha256(json.dumps(request).encode()).hexdigest()[:12]
    work_dir = output_folder(folder / f"work-{mark}")
    try:
        result = reconstruct(client, entry.source, settings, entry.show, stop, work_dir)
        dataset = read_dataset(entry.source, traces=False)
        write_results(folder, result, dataset, entry.seconds, draw, file=str(entry.source), request=request)
    except Cancelled:
        raise
    except Exception:
        shutil.rmtree(work_dir, ignore_errors=True)
        raise
    shutil.rmtree(work_dir, ignore_errors=True)


def request_of(source: Path, settings: Settings) -> dict[str, Any]:
    """The request that a result belongs to: file size, modification time and settings."""
    there = source.stat()
    request = {"bytes": there.st_size, "mtime_ns": there.st_mtime_ns, "settings": settings.to_dict()}
    found: dict[str, Any] = json.loads(json.dumps(without_nan(request)))
    return found


def finished(folder: Path, source: Path, settings: Settings) -> dict[str, Any] | None:
    """The figures of a complete result of this file with these settings, else None."""
    from bentray_workers.files.reconstruction import read_reconstruction

    try:
        found: dict[str, Any] = json.loads((folder / "reconstruction.json").read_text())
        if found["request"] != request_of(source, settings) or not (folder / "reconstruction.png").is_file():
            return None
        read_reconstruction(folder / "reconstruction.h5")
    except (OSError, ValueError, KeyError, TypeError, RecursionError, InvalidInput):
        return None
    return found
