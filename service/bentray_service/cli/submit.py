"""`bentray submit`: reconstruct a scan on a service, or a folder of scans on a cluster."""

from __future__ import annotations

from pathlib import Path
from tempfile import gettempdir
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bentray_kernels.errors import InvalidInput

from .options.option_tables import settings_from, with_settings_options
from .options.paths import output_folder
from .options.scan_options import checked_dataset, dataset_file, input_scan, metadata_of, with_scan_options
from .output.batch_view import report
from .output.exit_codes import AcceptDoubtful, client_errors, end_doubtful
from .output.results import show_results, write_results
from .output.terminal import AsJson, Step, phase_note, print_result, progress_bar, remark
from .worker import Tls

if TYPE_CHECKING:
    from bentray_kernels.tomography import Settings

    from ..routes.models.job_records import JobRecord


@with_scan_options
@with_settings_options
def submit(
    *,
    file: Annotated[
        Path | None,
        typer.Argument(help="Dataset file, or a scan of another program.", show_default="with --batch, none"),
    ] = None,
    options: dict[str, Any],
    scan_options: dict[str, Any],
    url: Annotated[str, typer.Option(help="Address of the service.")] = "http://127.0.0.1:8000",
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "--out",
            "-o",
            help="Folder for the results.",
            show_default="no download; with --batch, DIR/results",
        ),
    ] = None,
    webhook: Annotated[
        str | None,
        typer.Option(
            show_default=False,
            help="https address that the service calls when the job ends; needs --no-wait.",
        ),
    ] = None,
    wait: Annotated[
        bool, typer.Option("--wait/--no-wait", help="Wait for the job, or return at once.")
    ] = True,
    batch: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            show_default=False,
            help="Reconstruct every scan in DIR, instead of FILE.",
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            show_default=False,
            help="Dask cluster for a batch, in place of a service, e.g. tcp://head:8786; it must see DIR.",
        ),
    ] = None,
    at_once: Annotated[
        int | None,
        typer.Option(
            min=1, show_default="workers + 1", help="Datasets of a batch processed at the same time."
        ),
    ] = None,
    tls: Tls = None,
    accept_doubtful: AcceptDoubtful = False,
    as_json: AsJson = False,
) -> None:
    """Upload a scan, reconstruct it on a service and download the result.

    If the service or its database restarts in the meantime, requests are retried for up to five minutes; the
    job is started only once.

    With --batch, reconstruct a folder of scans with one progress: on the service, or with --scheduler on a
    Dask cluster without one. Scans with a valid result for the same file and settings are skipped, so an
    interrupted batch can be repeated. Other scans continue after a failure; then the exit code is 1.

    Of a doubtful result the first line says why, and the exit code is 3.

    Example:  bentray submit scan.h5 --url http://127.0.0.1:8000 -o result

    Example:  bentray submit --batch scans -o results
    """
    if (file is None) == (batch is None):
        raise InvalidInput(
            "file", "nothing" if file is None else f"{file} with --batch", "FILE or --batch DIR"
        )
    if batch is None and scheduler is not None:
        raise InvalidInput(
            "scheduler", f"{scheduler} without --batch", "--url of a service, which has its own scheduler"
        )
    if batch is not None and scheduler is not None and not wait:
        raise InvalidInput("scheduler", f"{scheduler} with --no-wait", "one of the two")
    if batch is not None and scheduler is None and at_once is not None:
        accepted = "no --at-once without --scheduler: BENTRAY_JOBS_AT_ONCE of the service limits its jobs"
        raise InvalidInput("at_once", at_once, accepted)
    if output is not None and not wait:
        raise InvalidInput(
            "output", f"{output} with --no-wait", "one of the two: there is no result to download yet"
        )
    if webhook is not None and (batch is not None or wait):
        shown = "an address with --batch" if batch is not None else "an address without --no-wait"
        raise InvalidInput("webhook", shown, "FILE with --no-wait")
    settings = settings_from(options)
    given = metadata_of(scan_options)
    if file is not None:
        source = input_scan(file)
        folder = None if output is None else output_folder(output)
        with dataset_file(source, given, folder or Path(gettempdir())) as scan:
            job = _submit(source, scan, settings, url, folder, wait=wait, webhook=webhook, as_json=as_json)
        end_doubtful(job.doubtful, 1, accepted=accept_doubtful)
    elif batch is not None:
        from .batch import Batch, run_on_cluster, run_on_service

        results = (output or batch / "results").resolve()
        scans = Batch(batch, results, settings, given)
        entries, finished = scans.entries, True
        output_folder(results)
        if scheduler is None:
            finished = run_on_service(scans, url, wait=wait, as_json=as_json)
        else:
            run_on_cluster(scans, scheduler, at_once, tls)
        if finished:
            report(batch, results, entries, as_json=as_json)
        end_doubtful(sum(bool(entry.doubt) for entry in entries), len(entries), accepted=accept_doubtful)


def _submit(
    source: Path,
    scan: Path,
    settings: Settings,
    url: str,
    folder: Path | None,
    *,
    wait: bool,
    webhook: str | None,
    as_json: bool,
) -> JobRecord:
    """Submit ``scan``, the dataset file made of ``source``; the last record of its job."""
    from ..client import Client

    # The ground truth is in the local file only.
    dataset = checked_dataset(scan, settings)
    with client_errors(), Client(url, on_wait=remark) as client:
        with progress_bar("Uploading") as step:
            stored = client.upload(scan, step, filename=source.name)
        job = client.submit(stored.id, settings.to_dict(), webhook=webhook)
        if job.plan is not None:
            remark(job.plan.why)
        if wait:
            with progress_bar("Reconstructing") as step:
                job = client.wait(job.id, lambda record: show_job(record, step))
        if folder is not None:
            volume = client.download(job.volume or "", "hdf5", folder / "reconstruction.h5")
    if folder is not None:
        from bentray_workers.files.reconstruction import read_reconstruction

        result, seconds = read_reconstruction(volume), job.seconds or 0.0
        record = write_results(folder, result, dataset, seconds, file=str(source), job=job.id)
        show_results(f"Reconstruction of {source.name}", record, as_json=as_json)
    else:
        # Without a download, the doubts about the result and its notes are those of the job.
        lines = filter(None, [job.advice, f"{job.id} {job.state}", f"{client.url}{job.links['self']}"])
        print_result(job.model_dump(mode="json"), lines, as_json=as_json)
    return job


def show_job(record: JobRecord, step: Step) -> None:
    """Show the progress of a job on a progress bar."""
    progress, history = record.progress, record.history
    note = phase_note(progress.phase, history[-1].residual_rms_s if history else None)
    step(progress.done, progress.total, note or record.state)
