"""Kept travel times: those of the simulator, read again, and apart for another phantom."""

import numpy as np
from benchmarks.reconstruction import _kept_times

from bentray_kernels.acquisition.simulation.ring_scan import Ring, TravelTimeScan
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6


def test_times_are_those_of_the_simulator_and_kept_for_one_scan(tmp_path, monkeypatch):
    monkeypatch.setattr(_kept_times, "FOLDER", tmp_path)
    ring, emitters, steps = Ring(12, 0.45 * TABLE6_SIDE_M), [7, 0], []
    scan = TravelTimeScan(table6(1375.0), ring, TABLE6_SIDE_M, 24)
    times = _kept_times.travel_times(scan, emitters, lambda *step: steps.append(step), 1)
    np.testing.assert_array_equal(times, scan.delta_tof(np.array(emitters)))
    again = _kept_times.travel_times(scan, emitters[::-1], lambda *step: steps.append(step), 1)
    np.testing.assert_array_equal(again, times[::-1])
    assert len(steps) == len(emitters)
    faster = TravelTimeScan(table6(1400.0), ring, TABLE6_SIDE_M, 24)
    other = _kept_times.travel_times(faster, emitters, lambda *step: None, 1)
    assert np.abs(other - times).max() > 1e-7
