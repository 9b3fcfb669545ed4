"""`bentray simulate`: simulate the scan of a breast phantom."""

from __future__ import annotations

import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from ..interactive.setting_types import PhantomName
from .options.paths import output_file
from .output.terminal import AsJson, print_json, print_lines, print_table, progress_bar

if TYPE_CHECKING:
    from bentray_kernels.acquisition import Dataset
    from bentray_workers.simulation.request import Simulated
    from bentray_workers.simulation.waves import WaveSimulationSettings


def simulate(
    output: Annotated[Path, typer.Option("--output", "-o", help="Dataset file to write (HDF5).")],
    phantom: Annotated[
        PhantomName,
        typer.Option(
            help="2-D breast phantom (Li 2008, Table 6), its vertical slice, 2-D with glandular texture, or "
            "3-D (Table 7)."
        ),
    ] = "table6",
    nodes: Annotated[int, typer.Option(help="Nodes per side of the image that the scan is made for.")] = 128,
    elements: Annotated[int, typer.Option(help="Transducers of a ring; each emits and receives.")] = 256,
    coupling: Annotated[float, typer.Option(help="Speed of the water, m/s.")] = 1500.0,
    refinement: Annotated[
        int | None,
        typer.Option(show_default="4", help="Refinement of the simulation grid over the image grid."),
    ] = None,
    slices: Annotated[
        int | None, typer.Option(show_default="40", help="table7: number of ring heights, one node apart.")
    ] = None,
    array: Annotated[
        Literal["moved", "rings"] | None,
        typer.Option(
            show_default="moved",
            help="table7: one moving ring, or rings at all heights that receive each other.",
        ),
    ] = None,
    three_d: Annotated[
        bool, typer.Option("--three-d", help="table7: 3-D wave fronts instead of one slice at a time.")
    ] = False,
    noise_ns: Annotated[
        float | None,
        typer.Option(show_default="0", help="2-D phantoms: standard deviation of the travel-time noise, ns."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the noise.")] = 0,
    attenuation: Annotated[bool, typer.Option("--attenuation", help="Record amplitudes too.")] = False,
    snr: Annotated[
        float | None,
        typer.Option(help="Signal-to-noise ratio of times and amplitudes, e.g. 10; default: no noise."),
    ] = None,
    waveform: Annotated[
        bool,
        typer.Option(
            "--waveform",
            help="Simulate waves and record traces of object and water, not travel times; table7: in 3-D.",
        ),
    ] = False,
    frequency: Annotated[
        float | None,
        typer.Option(show_default="500000, table7 100000", help="--waveform: centre frequency, Hz."),
    ] = None,
    emissions: Annotated[
        int | None, typer.Option(show_default="64", help="--waveform: number of emitting elements.")
    ] = None,
    side: Annotated[
        float | None, typer.Option(show_default="0.12", help="--waveform: side of the square, m.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace OUTPUT if it exists.")] = False,
    as_json: AsJson = False,
) -> None:
    """Simulate travel times or traces of a breast phantom; the dataset includes the ground truth.

    Example:  bentray simulate -o phantom.h5 --coupling 1375 --noise-ns 20
    """
    path = output_file(output, force=force)

    from bentray_workers.compilation.cache_misses import announce
    from bentray_workers.files.dataset import read_dataset
    from bentray_workers.simulation.request import PhantomScan
    from bentray_workers.simulation.simulation_run import simulate_to_file
    from bentray_workers.simulation.waves import WaveSimulationSettings

    request: dict[str, Any] = {
        "nodes": nodes,
        "elements": elements,
        "coupling_mps": coupling,
        "refinement": refinement,
        "slices": slices,
        "array": array,
        "three_d": three_d or None,
        "noise_s": None if noise_ns is None else noise_ns * 1e-9,
        "seed": seed,
        "attenuation": attenuation or None,
        "snr": snr,
        "frequency_hz": frequency,
        "emissions": emissions,
        "side_m": side,
    }
    settings = PhantomScan(phantom=phantom, waveform=waveform, **request).chosen()
    announce()
    started = time.perf_counter()
    with progress_bar("Simulating") as step:
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
