"""Peak memory of the tasks of simulated scans, each in a process; see ``ray_task_memory``.

Parts are made up for the task that writes the file.
"""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.shared._peak_memory import peak

from bentray_workers.simulation.assembly import write_scan
from bentray_workers.simulation.kinds import Simulated
from bentray_workers.simulation.parts import Part, make_part, parts_of
from bentray_workers.simulation.request import PhantomScan
from bentray_workers.simulation.waves import WaveSimulationSettings

TINY: list[dict[str, Any]] = [
    {"nodes": 16, "elements": 8, "attenuation": True},
    {"nodes": 16, "elements": 8, "phantom": "table7", "three_d": True, "refinement": 2, "slices": 2},
    {"nodes": 16, "elements": 8, "waveform": True, "emissions": 2, "side_m": 0.01, "snr": 3.0},
]


def made_up(settings: Simulated, part: Part) -> list[np.ndarray]:
    if isinstance(settings, WaveSimulationSettings):
        return [np.ones((settings.elements, settings.samples), np.float32)] * 2
    return [np.ones((part.last - part.first, settings.emitters))] * (1 + settings.attenuation)


def bytes_of(settings: Simulated, folder: Path) -> dict[str, int]:
    parts, nothing = parts_of(settings), peak(lambda: None)
    found = {"make_part": peak(lambda: make_part(settings, Part(0, 0, 1), folder)) - nothing}
    for part in parts:
        arrays = made_up(settings, part)
        np.savez(part.path(folder), **{str(k): array for k, array in enumerate(arrays)})
    found["write_scan"] = peak(lambda: write_scan(settings, folder, folder / "scan.h5")) - nothing
    return found


def main(scans: list[dict[str, Any]]) -> list[dict[str, int]]:
    """Bytes by task for each of the settings."""
    with tempfile.TemporaryDirectory() as outer:
        found = []
        for k, scan in enumerate([*TINY, *scans]):
            settings, folder = PhantomScan(**scan).chosen(), Path(outer) / str(k)
            folder.mkdir()
            if k < len(TINY):
                # Loading compiled code takes memory too, here and not in the forks.
                for part in parts_of(settings):
                    make_part(settings, part, folder)
                write_scan(settings, folder, folder / "scan.h5")
            else:
                found.append(bytes_of(settings, folder))
        return found
