"""`bentray simulate`: the scan of a known phantom as a dataset file."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bentray_kernels.errors import InvalidInput

from .options.paths import output_file
from .output.terminal import AsJson, print_json, print_lines, print_table, progress_bar

if TYPE_CHECKING:
    from bentray_workers.simulation.plane import SimulationSettings
    from bentray_workers.simulation.volume import VolumeSimulationSettings


class Phantom(StrEnum):
    """The phantoms by the tables of the dissertation."""

    TABLE6 = "table6"
    TABLE7 = "table7"


class Array(StrEnum):
    """How the rings of a scan in space lie."""

    MOVED = "moved"
    RINGS = "rings"


def simulate(
    output: Annotated[Path, typer.Option("--output", "-o", help="Dataset file to write (HDF5).")],
    phantom: Annotated[
        Phantom, typer.Option(help="2-D breast phantom (Li 2008, Table 6) or 3-D breast phantom (Table 7).")
    ] = Phantom.TABLE6,
    nodes: Annotated[int, typer.Option(help="Nodes per side of the image that the scan is made for.")] = 128,
    elements: Annotated[int, typer.Option(help="Transducers of a ring; each sends and receives.")] = 256,
    coupling: Annotated[float, typer.Option(help="Speed of the water, m/s.")] = 1500.0,
    refinement: Annotated[
        int, typer.Option(help="Refinement of the simulation grid over the image grid.")
    ] = 4,
    slices: Annotated[
        int | None, typer.Option(show_default="40", help="table7: number of ring heights, one node apart.")
    ] = None,
    array: Annotated[
        Array | None,
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
        typer.Option(show_default="0", help="table6: standard deviation of the travel-time noise, ns."),
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
    """Simulate the travel times of a breast phantom, or its traces, and keep its truth beside them.

    Example:  bentray simulate -o phantom.h5 --coupling 1375 --noise-ns 20
    """
    path = output_file(output, force=force)

    from bentray_workers.files.dataset import read_dataset
    from bentray_workers.simulation.plane import SimulationSettings
    from bentray_workers.simulation.simulation_run import simulate_to_file
    from bentray_workers.simulation.volume import VolumeSimulationSettings

    own_of_waves = {"--frequency": frequency, "--emissions": emissions, "--side": side}
    if waveform:
        times = {"--slices": slices, "--array": array, "--three-d": three_d or None, "--noise-ns": noise_ns}
        _refuse("without --waveform", {**times, "--attenuation": attenuation or None})
        from .wave_simulation import simulate_to

        asked = {
            "frequency_hz": frequency,
            "emissions": emissions,
            "side_m": side,
            "nodes": nodes,
            "snr": snr,
        }
        asked |= {"elements": elements, "coupling_mps": coupling, "seed": seed}
        given = {name: value for name, value in asked.items() if value is not None}
        simulate_to(path, given, in_space=phantom is Phantom.TABLE7, as_json=as_json)
        return
    _refuse("with --waveform", own_of_waves)
    both: dict[str, Any] = {
        "nodes": nodes,
        "elements": elements,
        "coupling_mps": coupling,
        "refinement": refinement,
        "attenuation": attenuation,
        "snr": snr,
        "seed": seed,
    }
    settings: SimulationSettings | VolumeSimulationSettings
    started = time.perf_counter()
    with progress_bar("Simulating") as step:
        if phantom is Phantom.TABLE7:
            _refuse("--phantom is table6", {"--noise-ns": noise_ns})
            own: dict[str, Any] = {"slices": slices, "array": array and array.value}
            own = {name: value for name, value in own.items() if value is not None}
            settings = VolumeSimulationSettings(**both, **own, three_d=three_d)
        else:
            _refuse(
                "--phantom is table7", {"--slices": slices, "--array": array, "--three-d": three_d or None}
            )
            settings = SimulationSettings(**both, noise_s=(noise_ns or 0.0) * 1e-9)
        simulate_to_file(None, settings, path, on_progress=lambda now: step(now.done, now.total, "tasks"))
    seconds = time.perf_counter() - started
    dataset = read_dataset(path, traces=False)
    if as_json:
        print_json({"output": str(path), "seconds": round(seconds, 3), "settings": asdict(settings)})
        return
    rows = [*_rows(settings, dataset.radius_m or 0.0), ("time", f"{seconds:.1f} s")]
    print_table(dataset.title, ("figure", "value"), rows)
    print_lines([str(path)])


def _refuse(unless: str, given: Mapping[str, object]) -> None:
    for option, value in given.items():
        if value is not None:
            raise InvalidInput(option, value, f"nothing, unless {unless}")


def _rows(settings: SimulationSettings | VolumeSimulationSettings, radius_m: float) -> list[tuple[str, str]]:
    from bentray_workers.simulation.volume import VolumeSimulationSettings

    rows = [("elements", f"{settings.elements} on a ring of {radius_m * 1e3:.1f} mm radius")]
    noise = "none" if settings.snr is None else f"1/{settings.snr:g} of the signal"
    if isinstance(settings, VolumeSimulationSettings):
        how = "rings at all heights at once" if settings.array == "rings" else "the ring at each in turn"
        fronts = "wave fronts in space" if settings.three_d else "each slice by itself"
        rows.append(("slices", f"{settings.slices}, {how}, {fronts}"))
    elif settings.noise_s:
        noise = f"{settings.noise_s * 1e9:g} ns"
    return [*rows, ("coupling", f"{settings.coupling_mps:g} m/s"), ("noise", noise)]
