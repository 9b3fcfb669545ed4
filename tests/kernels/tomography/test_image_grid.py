"""Automatic nodes: half a pitch or half a wavelength apart, fewer for noisy times, within limits."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.tomography import Settings, reconstruct
from bentray_kernels.tomography.image_grid import MAX_NODES, MAX_NODES_3D, MIN_NODES, automatic_nodes

ANY = Settings()
RING = 0.22, 0.0027  # width and pitch of 256 elements, m


@pytest.mark.parametrize(
    ("settings", "width", "pitch", "wavelength", "noise", "nodes"),
    [
        (ANY, *RING, None, 0.0, 168),
        (ANY, *RING, 0.0037, 0.0, 120),
        (ANY, 0.22, 0.0005, 0.002, 0.0, 224),
        (ANY, 0.22, 0.0005, None, 0.0, MAX_NODES),
        (ANY, 0.22, 0.0, None, 0.0, MAX_NODES),
        (ANY, *RING, None, 6e-7, 120),
        (ANY, 0.05, 0.02, None, 0.0, MIN_NODES),
        (replace(ANY, side_m=0.3), *RING, None, 0.0, 224),
        (replace(ANY, decomposition="volume"), *RING, None, 0.0, MAX_NODES_3D),
        (ANY, float("inf"), 1.0, None, 0.0, MAX_NODES),
    ],
)
def test_nodes_follow_the_finest_detail_that_the_data_hold(settings, width, pitch, wavelength, noise, nodes):
    assert automatic_nodes(settings, width, pitch, wavelength, noise, 1500.0, 256) == nodes


def test_the_result_states_the_nodes_that_were_used():
    everyone = np.arange(16)
    water = Dataset(Ring(16, 0.05).positions(), everyone, everyone, 1500.0, delta_tof_s=np.zeros((16, 16)))
    result = reconstruct(water, Settings(method="sart", iterations=1))
    assert result.settings.nodes == len(result.speed) == MIN_NODES
