"""Simulated travel times are right, reciprocal, and made on a finer grid."""

import numpy as np
import pytest

from bentray_kernels.acquisition.simulation.ring_scan import Ring, TravelTimeScan
from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import Ellipse, EllipsePhantom, table6


def disk(coupling, speed, radius=0.04):
    return EllipsePhantom(coupling, (Ellipse((0.0, 0.0), (radius, radius), speed, 0.0, "disk"),))


def test_water_alone_takes_no_longer_than_water():
    scan = TravelTimeScan(disk(1500.0, 1500.0), Ring(16, 0.09), 0.2, nodes=32)
    assert np.abs(scan.delta_tof(np.arange(16))).max() < 1e-12


def test_fast_disk_is_early_by_its_chord():
    """Through the middle of a disk faster than the water the ray is straight: −2r(1/c_w − 1/c)."""
    scan = TravelTimeScan(disk(1500.0, 1540.0), Ring(8, 0.09), 0.2, nodes=64)
    delta = scan.delta_tof(np.array([0]))[0]
    assert delta[4] == pytest.approx(0.08 * (1 / 1540.0 - 1 / 1500.0), rel=0.01)
    assert delta[0] == 0.0
    assert delta[1] == pytest.approx(0.0, abs=2e-9)


def test_travel_times_are_reciprocal():
    scan = TravelTimeScan(table6(1400.0), Ring(12, 0.095), 0.2, nodes=64)
    delta = scan.delta_tof(np.arange(12))
    assert np.abs(delta - delta.T).max() < 1e-7
    assert np.abs(delta).max() > 1e-6


def test_finer_grids_agree():
    coarse = TravelTimeScan(table6(1375.0), Ring(6, 0.095), 0.2, nodes=64, refinement=4)
    fine = TravelTimeScan(table6(1375.0), Ring(6, 0.095), 0.2, nodes=64, refinement=8)
    emitters = np.array([0, 1])
    assert np.abs(coarse.delta_tof(emitters) - fine.delta_tof(emitters)).max() < 6e-8


def test_inverse_crime_is_rejected():
    with pytest.raises(InvalidInput, match="inverse crime"):
        TravelTimeScan(table6(), Ring(8, 0.09), 0.2, refinement=2)


def test_ring_must_fit():
    with pytest.raises(InvalidInput, match="radius_m"):
        TravelTimeScan(table6(), Ring(8, 0.11), 0.2)
    with pytest.raises(InvalidInput, match="elements"):
        Ring(2, 0.1)
