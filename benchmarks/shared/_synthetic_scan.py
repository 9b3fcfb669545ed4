"""A synthetic ring scan of smooth delays without a simulation, written to a file for workers."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_workers.files.dataset import write_dataset

RADIUS_M = 0.08


def made_up_scan(path: Path, elements: int, slices: int) -> Path:
    """Delays of 1 µs through the middle, none along the rim, weaker from slice to slice."""
    every = np.arange(elements)
    angle = every * 2 * np.pi / elements
    chord = np.sin(0.5 * (angle[:, None] - angle[None, :])) ** 2
    delta = -1e-6 * chord * np.linspace(1.0, 0.5, slices)[:, None, None]
    several = slices > 1
    dataset = Dataset(
        Ring(elements, RADIUS_M).positions(),
        every,
        every,
        1500.0,
        delta_tof_s=delta if several else delta[0],
        slice_z_m=0.003 * np.arange(slices) if several else None,
    )
    write_dataset(path, dataset)
    return path
