"""Planted faults change only the values they name."""

import numpy as np
import pytest
from benchmarks.shared._recorded_scans import (
    DEAD_EMISSION,
    DEAD_RECEPTION,
    GAINS,
    LATE_S,
    planted,
    without_water_shot,
)

from ..kernels.acquisition.traces import scan


def test_gains_time_zero_and_dead_elements_are_planted_in_both_shots():
    clean = scan(noise=0.01)
    faulty = planted(clean, 3)
    assert faulty.t0_s - clean.t0_s == pytest.approx(LATE_S)
    for name in ("object", "water"):
        before, after = (np.abs(getattr(d.waveform, name)).max(axis=-1) for d in (clean, faulty))
        gain = after / before
        assert gain[DEAD_EMISSION].max() < 0.2
        assert gain[:, DEAD_RECEPTION].max() < 0.2
        alive = np.delete(np.delete(gain, DEAD_EMISSION, 0), DEAD_RECEPTION, 1)
        assert GAINS[0] ** 2 <= alive.min() < alive.max() <= GAINS[1] ** 2
        # A gain of each emitter and of each receiver.
        np.testing.assert_allclose(alive * alive[0, 0], alive[:, :1] * alive[:1], rtol=1e-4)
    assert without_water_shot(faulty).waveform.water is None
