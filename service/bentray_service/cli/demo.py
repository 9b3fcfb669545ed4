"""`bentray demo`: compare straight and bent rays on a simulated scan with a local service."""

from __future__ import annotations

import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bentray_workers.files.atomic import write_bytes

from .options.paths import output_folder
from .output.exit_codes import WorkFailed, client_errors
from .output.terminal import AsJson, print_json, print_lines, print_table, progress_bar, remark
from .service_process import running_service
from .submit import show_job

if TYPE_CHECKING:
    from bentray_kernels.tomography import Reconstruction

    from ..client import Client

# Settings of the two jobs; all others have their defaults.
JOBS: dict[str, dict[str, Any]] = {
    "straight": {"method": "sart", "rays": "straight"},
    "bent": {"method": "sart", "rays": "curved"},
}


def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for scan and image.")] = Path(
        "demo-output"
    ),
    nodes: Annotated[int, typer.Option(help="Nodes per side of the image.")] = 128,
    elements: Annotated[int, typer.Option(help="Transducers of the ring.")] = 256,
    coupling: Annotated[float, typer.Option(help="Speed of the water, m/s.")] = 1375.0,
    as_json: AsJson = False,
) -> None:
    """Start a service, simulate a scan, reconstruct it and compare straight with bent rays.

    Needs no data, and stops the service at the end. Fails if bent rays are not more accurate than straight
    ones.

    Example:  bentray demo --coupling 1375 -o demo-output
    """
    folder = output_folder(output)

    started = time.perf_counter()
    with ExitStack() as running:
        with progress_bar("Starting a service"):
            from bentray_workers.files.dataset import write_dataset
            from bentray_workers.images.comparison import comparison_png
            from bentray_workers.simulation.plane import SimulationSettings
            from bentray_workers.simulation.simulation_run import simulate

            from ..client import Client
            from .output.figures import figures

            settings = SimulationSettings(nodes=nodes, elements=elements, coupling_mps=coupling)
            data = running.enter_context(tempfile.TemporaryDirectory(prefix="bentray-demo-"))
            url = running.enter_context(running_service(Path(data), folder / "service.log"))
        running.enter_context(client_errors())
        client = running.enter_context(Client(url))
        remark(f"The service runs at {url}. Simulating a scan: {elements} transducers, {nodes}² nodes.")
        with progress_bar("Simulating") as step:
            dataset = simulate(settings, lambda progress: step(progress.done, progress.total, "emitters"))
        scan = folder / "phantom.h5"
        write_dataset(scan, dataset)
        with progress_bar("Uploading") as step:
            sent = client.upload(scan, step)
        results, seconds = {}, {}
        for name, options in JOBS.items():
            results[name], seconds[name] = _reconstruct(
                client, sent.id, name, {**options, "nodes": nodes}, folder
            )
    assert dataset.truth is not None
    picture = folder / "comparison.png"
    with progress_bar("Comparing and drawing"):
        record = {name: figures(result, dataset, seconds[name]) for name, result in results.items()}
        write_bytes(picture, comparison_png(dataset.truth, results, dataset.roi))
    _show(record, picture, time.perf_counter() - started, as_json)
    straight, bent = (record[name]["truth"]["mean_absolute_error_of_range"] for name in JOBS)
    if not bent < straight:
        raise WorkFailed(
            f"bent rays ({100 * bent:.1f} %) are not better than straight rays ({100 * straight:.1f} %)"
        )


def _reconstruct(
    client: Client, dataset: str, name: str, settings: dict[str, Any], folder: Path
) -> tuple[Reconstruction, float]:
    from bentray_workers.files.reconstruction import read_reconstruction

    with progress_bar(f"Reconstructing, {name} rays") as step:
        job = client.wait(client.submit(dataset, settings).id, lambda record: show_job(record, step))
    path = client.download(job.volume or "", "hdf5", folder / f"{name}.h5")
    return read_reconstruction(path), job.seconds or 0.0


def _show(record: dict[str, dict[str, Any]], picture: Path, seconds: float, as_json: bool) -> None:
    if as_json:
        print_json({"jobs": record, "picture": str(picture), "seconds": round(seconds, 3)})
        return
    rows = [
        (
            name,
            f"{100 * figures['truth']['mean_absolute_error_of_range']:.1f} %",
            f"{figures['truth']['rmse_mps']:.1f} m/s",
            f"{figures['residual_rms_s'] * 1e9:.0f} ns",
            f"{figures['seconds']:.1f} s",
        )
        for name, figures in record.items()
    ]
    columns = ("rays", "mean abs. error of range", "rms error", "residual", "time")
    print_table("2-D breast phantom (Li 2008, Table 6), inside the breast", columns, rows, columns[1:])
    print_lines([f"Total time {seconds:.0f} s. Comparison image:", str(picture)])
