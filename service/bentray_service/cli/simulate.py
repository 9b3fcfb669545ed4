"""`bentray simulate`: the scan of a known phantom as a dataset file."""

from __future__ import annotations

import time
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from .paths import output_file
from .terminal import AsJson, print_json, print_lines, print_table, progress_bar


def simulate(
    output: Annotated[Path, typer.Option("--output", "-o", help="Dataset file to write (HDF5).")],
    nodes: Annotated[int, typer.Option(help="Nodes along a side of the image it is meant for.")] = 128,
    elements: Annotated[int, typer.Option(help="Transducers of the ring; each sends and receives.")] = 256,
    coupling: Annotated[float, typer.Option(help="Speed of the water, m/s.")] = 1500.0,
    refinement: Annotated[int, typer.Option(help="How many times finer the grid of the times is.")] = 4,
    noise_ns: Annotated[float, typer.Option(help="Standard deviation of the noise on the times, ns.")] = 0.0,
    seed: Annotated[int, typer.Option(help="Seed of the noise.")] = 0,
    attenuation: Annotated[bool, typer.Option("--attenuation", help="Record amplitudes too.")] = False,
    snr: Annotated[
        float | None, typer.Option(help="Signal over noise of times and amplitudes, as 10; none without it.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace OUTPUT if it exists.")] = False,
    as_json: AsJson = False,
) -> None:
    """Simulate the travel times of the breast phantom of Table 6 and keep its truth beside them.

    Example:  bentray simulate -o phantom.h5 --coupling 1375 --noise-ns 20
    """
    path = output_file(output, force=force)

    from bentray_workers import simulation
    from bentray_workers.dataset_file import write_dataset

    settings = simulation.SimulationSettings(
        nodes, elements, coupling, refinement, noise_ns * 1e-9, seed, attenuation, snr
    )
    started = time.perf_counter()
    with progress_bar("Simulating") as step:
        dataset = simulation.simulate(
            None, settings, lambda progress: step(progress.done, progress.total, "emitters")
        )
    seconds = time.perf_counter() - started
    write_dataset(path, dataset)
    if as_json:
        print_json({"output": str(path), "seconds": round(seconds, 3), "settings": asdict(settings)})
        return
    rows = [
        ("elements", f"{elements} on a ring of {(dataset.radius_m or 0.0) * 1e3:.1f} mm radius"),
        ("coupling", f"{coupling:g} m/s"),
        ("noise", f"{noise_ns:g} ns" if snr is None else f"{noise_ns:g} ns, and 1/{snr:g} of the signal"),
        ("time", f"{seconds:.1f} s"),
    ]
    print_table(dataset.title, ("figure", "value"), rows)
    print_lines([str(path)])
