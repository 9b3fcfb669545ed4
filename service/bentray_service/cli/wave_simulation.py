"""The part of `bentray simulate` that simulates waves: a ring scan with traces of object and water."""

from __future__ import annotations

import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

from .output.terminal import print_json, print_lines, print_table, progress_bar


def simulate_to(path: Path, asked: dict[str, Any], *, in_space: bool, as_json: bool) -> None:
    """Simulate a scan into a dataset file, and say how.

    Args:
        path: of the file.
        asked: of ``WaveSimulationSettings``, what was given.
        in_space: the phantom of Table 7, else that of Table 6 in a plane.
        as_json: for machines.
    """
    from bentray_workers.files.dataset import read_dataset
    from bentray_workers.simulation.simulation_run import simulate_to_file
    from bentray_workers.simulation.volume_waves import VolumeWaveSettings
    from bentray_workers.simulation.waves import WaveSimulationSettings

    settings = VolumeWaveSettings(**asked) if in_space else WaveSimulationSettings(**asked)
    started = time.perf_counter()
    with progress_bar("Simulating") as step:
        simulate_to_file(None, settings, path, on_progress=lambda now: step(now.done, now.total, "tasks"))
    seconds = time.perf_counter() - started
    dataset = read_dataset(path, traces=False)
    centre, highest = settings.dispersion
    if as_json:
        found = {"output": str(path), "seconds": round(seconds, 3), "settings": asdict(settings)}
        print_json({**found, "phase_speed_error": {"centre": centre, "highest": highest}})
        return
    grid = f"{settings.grid_text} nodes of {1e3 * settings.spacing_m:.3g} mm"
    rows = [
        ("elements", f"{settings.elements}, {settings.emissions} of them send"),
        ("ring", f"{1e3 * (dataset.radius_m or 0.0):.1f} mm radius"),
        ("coupling", f"{settings.coupling_mps:g} m/s"),
        ("pulse", f"{1e-3 * settings.frequency_hz:g} kHz"),
        ("traces", f"{settings.samples} samples at {1e-6 * (dataset.sampling_rate_hz or 0.0):.3g} MHz"),
        ("simulated on", f"{grid}, steps of {1e9 * settings.step_s:.3g} ns"),
        ("dispersion", f"phase speed wrong by {centre:.1e} at the centre, {highest:.1e} at the upper end"),
        ("noise", "none" if settings.snr is None else f"1/{settings.snr:g} of the pulse in water"),
        ("time", f"{seconds:.1f} s"),
    ]
    print_table(dataset.title, ("figure", "value"), rows)
    print_lines([str(path)])
