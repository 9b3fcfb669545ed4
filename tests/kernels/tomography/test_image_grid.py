"""Automatic nodes: half a pitch or half a wavelength apart, fewer for noisy times, within limits."""

import pytest

from bentray_kernels.tomography import Settings, reconstruct
from bentray_kernels.tomography.image_grid import MAX_NODES, MAX_NODES_3D, MIN_NODES, automatic_nodes

from ..straight_scans import ring_scan

RING = 0.22, 0.0027  # width and pitch of 256 elements, m


@pytest.mark.parametrize(
    ("side", "pitch", "wavelength", "noise", "volume", "nodes", "why"),
    [
        (*RING, None, 0.0, False, 168, "1.35 mm apart: half the pitch"),
        (*RING, 0.0037, 0.0, False, 120, "1.85 mm apart: half a wavelength"),
        (0.22, 0.0005, 0.002, 0.0, False, 224, "half a wavelength"),
        (0.22, 0.0005, None, 0.0, False, MAX_NODES, "the most"),
        (0.22, 0.0, None, 0.0, False, MAX_NODES, "the most"),
        (*RING, None, 6e-7, False, 120, "noisy times"),
        (0.05, 0.02, None, 0.0, False, MIN_NODES, "the fewest"),
        (0.3, RING[1], None, 0.0, False, 224, "half the pitch"),
        (*RING, None, 0.0, True, MAX_NODES_3D, "the most"),
        (float("inf"), 1.0, None, 0.0, False, MAX_NODES, "the most"),
    ],
)
def test_nodes_follow_the_finest_detail_that_the_data_hold(
    side, pitch, wavelength, noise, volume, nodes, why
):
    found, reason = automatic_nodes(side, pitch, wavelength, noise, 1500.0, 256, volume=volume)
    assert found == nodes
    assert why in reason


def test_the_result_states_the_nodes_that_were_used():
    result = reconstruct(ring_scan(16, 0.05), Settings(method="sart", iterations=1))
    assert result.settings.nodes == len(result.speed) == MIN_NODES
