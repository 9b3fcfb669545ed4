"""Log amplitude ratios are line integrals along the bent ray, not the straight one."""

import numpy as np
import pytest

from bentray_kernels.acquisition.simulation.attenuation_line_integrals import log_ratios
from bentray_kernels.acquisition.simulation.ring_scan import Ring, TravelTimeScan
from bentray_kernels.eikonal import solve
from bentray_kernels.phantoms import Ellipse, EllipsePhantom, table6


def disk(speed, attenuation, coupling_np_m=0.0):
    ellipse = Ellipse((0.0, 0.0), (0.04, 0.04), speed, attenuation, "disk")
    return EllipsePhantom(1500.0, (ellipse,), coupling_np_m)


def test_disk_absorbs_over_its_chord():
    scan = TravelTimeScan(disk(1500.0, 25.0, 2.0), Ring(8, 0.09), 0.2, nodes=64)
    ratio = scan.medium(attenuation=True).arrivals(scan.elements(), np.array([0]))[1][0]
    chord = 2.0 * np.sqrt(0.04**2 - (0.09 * np.cos(3 * np.pi / 8)) ** 2)
    assert ratio[[4, 3]] == pytest.approx([0.08 * 23.0, chord * 23.0], rel=0.01)
    assert ratio[[0, 1, 7]] == pytest.approx(0.0, abs=1e-9)


def test_a_slow_absorber_is_gone_round():
    """First arrivals avoid a disk so slow that the way round it is shorter, and keep their amplitude."""
    scan = TravelTimeScan(disk(900.0, 25.0), Ring(8, 0.09), 0.2, nodes=64)
    ratio = scan.medium(attenuation=True).arrivals(scan.elements(), np.array([0]))[1][0]
    assert abs(ratio[4]) < 0.1 * 0.08 * 25.0


def test_amplitudes_are_reciprocal():
    scan = TravelTimeScan(table6(1375.0), Ring(12, 0.085), 0.2, nodes=64)
    ratio = scan.medium(attenuation=True).arrivals(scan.elements(), np.arange(12))[1]
    assert np.abs(ratio - ratio.T).mean() < 0.01 * ratio.max()
    assert ratio.max() > 4.0
    assert (ratio >= 0.0).all()


def test_ratios_are_linear_in_the_attenuation():
    random = np.random.default_rng(3)
    this, two = random.uniform(0.0, 60.0, (2, 41, 41))
    source, receivers = np.array([0.01, 0.05]), np.array([(0.09, 0.02), (0.05, 0.09)])
    tof = solve(random.uniform(1400.0, 1600.0, (41, 41)), 0.0025, source)
    both, first, second = (
        log_ratios(tof, field, 0.0025, receivers, source) for field in (this + 2.0 * two, this, two)
    )
    assert both == pytest.approx(first + 2.0 * second, rel=1e-12)
    assert (first > 0.0).all()
