"""`bentray simulate`: simulate the scan of a breast phantom."""

from __future__ import annotations

import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bentray_workers.simulation.request import PhantomScan

from .options.option_tables import options_of, with_options
from .options.paths import output_file
from .output.terminal import AsJson, print_json, print_lines, print_table, progress_bar

if TYPE_CHECKING:
    from bentray_kernels.acquisition import Dataset
    from bentray_workers.simulation.kinds import Simulated
    from bentray_workers.simulation.waves import WaveSimulationSettings


OPTIONS = options_of(PhantomScan)
# A person types nanoseconds.
del OPTIONS["noise_s"]


@with_options(OPTIONS)
def simulate(
    output: Annotated[Path, typer.Option("--output", "-o", help="Dataset file to write (HDF5).")],
    options: dict[str, Any],
    noise_ns: Annotated[
        float | None,
        typer.Option(show_default="0", help="2-D phantoms: standard deviation of the travel-time noise, ns."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace OUTPUT if it exists.")] = False,
    as_json: AsJson = False,
) -> None:
    """Simulate travel times or traces of a breast phantom; the dataset includes the ground truth.

    Example:  bentray simulate -o phantom.h5 --coupling 1375 --noise-ns 20
    """
    path = output_file(output, force=force)

    if noise_ns is not None:
        options["noise_s"] = noise_ns * 1e-9
    settings = PhantomScan(**options).chosen()
    started = time.perf_counter()
    with progress_bar("Simulating") as step:
        from bentray_workers.files.dataset import read_dataset
        from bentray_workers.simulation.simulation_run import simulate_to_file
        from bentray_workers.simulation.waves import WaveSimulationSettings

        simulate_to_file(None, settings, path, on_progress=lambda now: step(now.done, now.total, "tasks"))
    seconds = time.perf_counter() - started
    dataset = read_dataset(path, traces=False)
    waves = settings if isinstance(settings, WaveSimulationSettings) else None
    if as_json:
        found = {"output": str(path), "seconds": round(seconds, 3), "settings": asdict(settings)}
        if waves is not None:
            found["phase_speed_error"] = dict(zip(("centre", "highest"), waves.dispersion, strict=True))
        print_json(found)
        return
    rows = _rows(settings) if waves is None else _wave_rows(waves, dataset)
    radius = ("ring", f"{1e3 * (dataset.radius_m or 0.0):.1f} mm radius")
    coupled = ("coupling", f"{settings.coupling_mps:g} m/s")
    print_table(dataset.title, ("figure", "value"), [radius, coupled, *rows, ("time", f"{seconds:.1f} s")])
    print_lines([str(path)])


def _rows(settings: Simulated) -> list[tuple[str, str]]:
    from bentray_workers.simulation.plane import SimulationSettings
    from bentray_workers.simulation.volume import VolumeSimulationSettings

    rows = [("elements", str(settings.elements))]
    noise = "none" if settings.snr is None else f"1/{settings.snr:g} of the signal"
    if isinstance(settings, VolumeSimulationSettings):
        array = "rings at all heights" if settings.array == "rings" else "one moving ring"
        fronts = "3-D wave fronts" if settings.three_d else "2-D wave fronts"
        rows.append(("slices", f"{settings.slices}, {array}, {fronts}"))
    elif isinstance(settings, SimulationSettings) and settings.noise_s:
        noise = f"{settings.noise_s * 1e9:g} ns"
    return [*rows, ("noise", noise)]


def _wave_rows(settings: WaveSimulationSettings, dataset: Dataset) -> list[tuple[str, str]]:
    centre, highest = settings.dispersion
    return [
        ("elements", f"{settings.elements}, {settings.emissions} of them emit"),
        ("pulse", f"{1e-3 * settings.frequency_hz:g} kHz"),
        ("traces", f"{settings.samples} samples at {1e-6 * (dataset.sampling_rate_hz or 0.0):.3g} MHz"),
        ("grid", f"{settings.grid_text} nodes of {1e3 * settings.spacing_m:.3g} mm"),
        ("time step", f"{1e9 * settings.step_s:.3g} ns"),
        ("dispersion", f"phase speed error {centre:.1e} at the centre, {highest:.1e} at the upper end"),
        ("noise", "none" if settings.snr is None else f"1/{settings.snr:g} of the pulse in water"),
    ]
