"""The last task of a simulated scan: the dataset file of all parts."""

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.acquisition import Dataset, Waveform

from ..files.dataset.counts import record_of
from ..files.dataset.write import Piece, write_dataset
from . import plane, volume, waves
from .cost import Timed
from .kinds import Simulated
from .parts import parts_of, read_part
from .waves import Noise, WaveSimulationSettings


def write_scan(settings: Simulated, folder: Path, target: Path) -> dict[str, Any]:
    """Task: write the dataset of all parts.

    Args:
        settings: of the scan.
        folder: with a file of each part.
        target: replaced whole or not touched.

    Returns:
        ``dataset.counts.record_of``, and ``bytes`` and ``sha256`` of the file.
    """
    if isinstance(settings, WaveSimulationSettings):
        dataset = _write_waves(settings, folder, target)
    else:
        dataset = _timed(settings, folder)
        write_dataset(target, dataset)
    with target.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return {**record_of(dataset), "bytes": target.stat().st_size, "sha256": digest}


def _timed(settings: Timed, folder: Path) -> Dataset:
    shape = settings.scans, settings.emitters, settings.emitters
    delta = np.empty(shape)
    ratio = np.empty(shape) if settings.attenuation else None
    for part in parts_of(settings):
        arrays = read_part(part, folder)
        delta[part.scan, part.first : part.last] = arrays[0]
        if ratio is not None:
            ratio[part.scan, part.first : part.last] = arrays[1]
    if isinstance(settings, volume.VolumeSimulationSettings):
        return volume.scan_of(settings, delta, ratio)
    return plane.scan_of(settings, delta[0], None if ratio is None else ratio[0])


def _write_waves(settings: WaveSimulationSettings, folder: Path, target: Path) -> Dataset:
    """Write one emission after the other: all traces may exceed the memory."""
    parts = parts_of(settings)
    shape = len(parts), settings.elements, settings.samples
    placeholder = np.broadcast_to(np.zeros((), np.float32), shape)
    dataset = waves.scan_of(settings, Waveform(placeholder, placeholder))
    noise = None
    if settings.snr is not None:
        peaks = [np.abs(read_part(part, folder)[1]).max(axis=-1) for part in parts]
        noise = Noise(settings, np.stack(peaks))

    def pieces(name: str, chunk: tuple[int, ...]) -> Iterator[Piece]:
        for k, part in enumerate(parts):
            traces: NDArray[Any] = read_part(part, folder)[("object", "water").index(name)]
            if noise is not None:
                traces = traces + noise.drawn()
            yield (slice(k, k + 1), slice(None), slice(None)), traces[None]

    write_dataset(target, dataset, pieces)
    return dataset
