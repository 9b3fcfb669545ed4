"""`bentray demo`: simulate the sample scan on a local service, and compare rays with full waveforms."""

from __future__ import annotations

import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bentray_workers.files.atomic import write_bytes
from bentray_workers.simulation.request import SAMPLE

from .options.paths import output_folder
from .output.exit_codes import WorkFailed, client_errors
from .output.terminal import AsJson, print_json, print_lines, print_table, progress_bar, remark
from .service_process import running_service
from .submit import show_job

if TYPE_CHECKING:
    from bentray_kernels.tomography import Reconstruction

    from ..client import Client

# Settings of the jobs; all others have their defaults.
JOBS: dict[str, dict[str, Any]] = {
    "straight rays": {"method": "sart", "rays": "straight"},
    "bent rays": {"method": "sart", "rays": "curved"},
    "auto": {"method": "auto"},
    "full waveform": {"method": "waveform"},
}


def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for scan and images.")] = Path(
        "demo-output"
    ),
    as_json: AsJson = False,
) -> None:
    """Start a service, simulate the sample scan, and reconstruct it by rays and by full waveforms.

    Needs no data, and stops the service at the end. Fails if full waveforms are not more accurate than all
    others, the best constant speed included.

    Example:  bentray demo -o demo-output
    """
    folder = output_folder(output)
    started = time.perf_counter()
    with ExitStack() as running:
        with progress_bar("Starting a service"):
            from bentray_workers.files.dataset import read_dataset
            from bentray_workers.images.comparison import comparison_png

            from ..client import Client
            from .output.figures import figures

            data = running.enter_context(tempfile.TemporaryDirectory(prefix="bentray-demo-"))
            url = running.enter_context(running_service(Path(data), folder / "service.log"))
        running.enter_context(client_errors())
        client = running.enter_context(Client(url))
        remark(f"The service runs at {url}. The first run compiles kernels, which takes about a minute.")
        with progress_bar("Simulating the sample scan") as step:
            made = client.wait(client.simulate(SAMPLE).id, lambda record: show_job(record, step))
        assert made.dataset is not None
        scan = client.download_dataset(made.dataset, folder / "scan.h5")
        results, seconds = {}, {}
        for name, options in JOBS.items():
            results[name], seconds[name] = _reconstruct(client, made.dataset, name, options, folder)
            remark(f"Reconstructed, {name}, in {seconds[name]:.1f} s.")
    picture = folder / "comparison.png"
    with progress_bar("Comparing and drawing"):
        dataset = read_dataset(scan, traces=False)
        assert dataset.truth is not None
        record = {name: figures(result, dataset, seconds[name]) for name, result in results.items()}
        write_bytes(picture, comparison_png(dataset.truth, results, dataset.roi))
    errors = {name: row["truth"]["rmse_mps"] for name, row in record.items()}
    finest = max(results, key=lambda name: results[name].speed.size)
    errors["best constant"] = record[finest]["truth"]["statistics"]["truth"]["spread"]
    took = time.perf_counter() - started
    if as_json:
        print_json({"jobs": record, "rmse_mps": errors, "picture": str(picture), "seconds": round(took, 3)})
    else:
        _show(record, errors)
        print_lines([f"Total time {took:.0f} s; the first run compiles kernels. Picture:", str(picture)])
    if min(errors, key=lambda name: errors[name]) != "full waveform":
        every = ", ".join(f"{name} {error:.1f} m/s" for name, error in errors.items())
        raise WorkFailed(f"full waveforms are not the most accurate: {every}")


def _reconstruct(
    client: Client, dataset: str, name: str, settings: dict[str, Any], folder: Path
) -> tuple[Reconstruction, float]:
    from bentray_workers.files.reconstruction import read_reconstruction

    with progress_bar(f"Reconstructing, {name}") as step:
        job = client.wait(client.submit(dataset, settings).id, lambda record: show_job(record, step))
    path = client.download(job.volume or "", "hdf5", folder / f"{name.replace(' ', '-')}.h5")
    return read_reconstruction(path), job.seconds or 0.0


def _show(record: dict[str, dict[str, Any]], errors: dict[str, float]) -> None:
    rows = []
    for name, error in errors.items():
        job = record.get(name)
        others = (f"{job['truth']['ssim']:.2f}", f"{job['seconds']:.1f} s") if job else ("-", "-")
        rows.append((name, f"{error:.1f} m/s", *others))
    columns = ("image", "rms error", "SSIM", "time")
    print_table("Sample scan, errors inside the breast", columns, rows, columns[1:])
