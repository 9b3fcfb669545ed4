"""`bentray submit`: send a scan to a running service, wait for the image and fetch it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from bentray_kernels.errors import InvalidInput

from .endings import service_answers
from .paths import input_file, output_folder
from .results import show_results, write_results
from .settings_options import Asked, settings_from, with_settings_options
from .terminal import AsJson, Step, print_json, print_lines, progress_bar, residual_note


@with_settings_options
def submit(
    file: Annotated[Path, typer.Argument(help="Dataset file (HDF5, format uct-transmission).")],
    asked: Asked,
    url: Annotated[str, typer.Option(help="Address of the service.")] = "http://127.0.0.1:8000",
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder for the results.", show_default="do not fetch them"),
    ] = None,
    wait: Annotated[
        bool, typer.Option("--wait/--no-wait", help="Wait for the end, or return at once.")
    ] = True,
    as_json: AsJson = False,
) -> None:
    """Upload a scan, reconstruct it on the service and download the result.

    Example:  bentray submit scan.h5 --url http://127.0.0.1:8000 -o result
    """
    if output is not None and not wait:
        raise InvalidInput(
            "output", f"{output} with --no-wait", "one of the two: there is no result to fetch yet"
        )
    source = input_file(file)
    folder = None if output is None else output_folder(output)
    settings = settings_from(asked)

    from ..client import Client

    with service_answers(), Client(url) as client:
        with progress_bar("Uploading") as step:
            dataset = client.upload(source, step)
        job = client.submit(dataset["id"], settings.to_dict())
        if wait:
            with progress_bar("Reconstructing") as step:
                job = client.wait(job["id"], lambda record: show_job(record, step))
        if folder is not None:
            volume = client.download(job["volume"], "hdf5", folder / "reconstruction.h5")
    if folder is not None:
        _report(source, folder, volume, job, as_json)
    elif as_json:
        print_json(job)
    else:
        print_lines([f"{job['id']} {job['state']}", f"{url.rstrip('/')}{job['links']['self']}"])


def show_job(record: dict[str, Any], step: Step) -> None:
    """One record of a job on a progress bar."""
    progress, history = record["progress"], record["history"]
    note = residual_note(history[-1]["residual_rms_s"] if history else None)
    step(progress["done"], progress["total"], note or record["state"])


def _report(source: Path, folder: Path, volume: Path, job: dict[str, Any], as_json: bool) -> None:
    from bentray_workers.dataset_file import read_dataset
    from bentray_workers.reconstruction_file import read_reconstruction

    # The truth, where there is one, is in the file that was sent; the service keeps only the scan.
    dataset = read_dataset(source, traces=False)
    result = read_reconstruction(volume)
    found = write_results(folder, result, dataset, job["seconds"], file=str(source), job=job["id"])
    show_results(f"Reconstruction of {source.name}", found, as_json=as_json)
