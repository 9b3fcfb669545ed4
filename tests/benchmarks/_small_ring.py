"""A ring of 24 elements round a disc, its travel times those of straight rays, exactly."""

import numpy as np
from benchmarks.reconstruction._travel_times import TravelTimes

from bentray_kernels.acquisition import Dataset

WATER_MPS, DISC_MPS, DISC_M = 1500.0, 1470.0, 0.04
ELEMENTS, NODES, SIDE_M = 24, 32, 0.2


def dataset() -> Dataset:
    """The disc lies in the middle; chords of it give the differences."""
    angle = 2.0 * np.pi * np.arange(ELEMENTS) / ELEMENTS
    position = 0.085 * np.column_stack((np.cos(angle), np.sin(angle)))
    a, b = position[:, None], position[None]
    length = np.linalg.norm(a - b, axis=-1) + np.eye(ELEMENTS)
    distance = np.abs(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]) / length
    chord = 2.0 * np.sqrt(np.maximum(DISC_M**2 - distance**2, 0.0))
    delta = chord * (1.0 / DISC_MPS - 1.0 / WATER_MPS)
    np.fill_diagonal(delta, np.nan)
    return Dataset(
        element_position_m=position,
        tx=np.arange(ELEMENTS),
        rx=np.arange(ELEMENTS),
        water_speed_mps=WATER_MPS,
        delta_tof_s=delta,
    )


def ring() -> TravelTimes:
    """The ring in the form that a peer gets."""
    return TravelTimes.from_dataset(dataset(), NODES, SIDE_M)


def disc(times: TravelTimes, part: float) -> np.ndarray:
    """Nodes within a part of the disc's radius."""
    axis = np.arange(len(times.region)) * times.spacing - 0.5 * times.side_m
    return np.asarray(np.hypot(axis[:, None], axis[None, :]) <= part * DISC_M)
