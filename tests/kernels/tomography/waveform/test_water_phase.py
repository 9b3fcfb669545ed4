"""The water's phase: a planted error of speed and a planted dispersion are found."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography.waveform.trace_resampling import Water
from bentray_kernels.tomography.waveform.water_phase import fit_water

STEP, STEPS = 2.5e-7, 600
DISTANCE = np.linspace(0.04, 0.16, 40)


def traces(water):
    """Pulses after a path in such a water."""
    frequency = np.fft.rfftfreq(STEPS, STEP)
    number = 2.0 * np.pi * frequency / water.speed * (1.0 - water.lead - water.bend * frequency**2)
    pulse = np.exp(-(((frequency - 3e5) / 1e5) ** 2)) * np.exp(-2j * np.pi * frequency * 1e-5)
    return np.fft.irfft(pulse * np.exp(-1j * np.outer(DISTANCE, number)), STEPS, axis=1)


@given(lead=st.floats(-0.01, 0.01), bend=st.floats(-3e-14, 3e-14))
@settings(max_examples=20, deadline=None)
def test_lead_and_bend_are_found(lead, bend):
    plain, true = Water(1500.0), Water(1500.0, lead, bend)
    fitted = fit_water(plain, DISTANCE, traces(plain), traces(true), STEP)
    assert fitted.lead == pytest.approx(lead, abs=2e-4)
    assert fitted.bend == pytest.approx(bend, abs=2e-15)


def test_few_pairs_are_rejected():
    with pytest.raises(InvalidInput, match="8 pairs"):
        fit_water(Water(1500.0), DISTANCE[:5], np.ones((5, 20)), np.ones((5, 20)), STEP)
