"""Ideal travel times: Eikonal solutions through the true image."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, zoom

from bentray_kernels.acquisition import Dataset
from bentray_kernels.eikonal import solve

# Fewest nodes along a side of the true image, and width of the water around it for the ring.
MIN_NODES = 400


def ideal(dataset: Dataset) -> NDArray[np.float64]:
    """(ntx, nrx), s, object minus water; both by the same solver, so that most of its error cancels."""
    assert dataset.truth is not None
    speed, spacing = dataset.truth.sound_speed_mps, dataset.truth.spacing_m[0]
    factor = max(1, -(-MIN_NODES // len(speed)))
    speed = zoom(speed, factor, order=1, grid_mode=False)
    spacing *= (len(dataset.truth.sound_speed_mps) - 1) / (len(speed) - 1)
    origin = np.array(dataset.truth.origin_m)
    reach = np.abs(dataset.element_position_m).max()
    room = max(0, int(np.ceil((reach - np.abs(origin).min()) / spacing))) + 4
    speed = np.pad(speed, room, constant_values=dataset.water_speed_mps)
    positions = dataset.element_position_m - (origin - room * spacing)
    water = np.full_like(speed, dataset.water_speed_mps)
    heard = positions[dataset.rx].T / spacing
    delta = np.empty((len(dataset.tx), len(dataset.rx)))
    for k, emitter in enumerate(dataset.tx):
        times = [
            map_coordinates(solve(medium, spacing, positions[emitter]), heard, order=1)
            for medium in (speed, water)
        ]
        delta[k] = times[0] - times[1]
    return delta
