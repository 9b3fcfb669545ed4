"""Centre frequency and bandwidth from traces."""

import numpy as np
import pytest

from bentray_kernels.acquisition.pulse_spectrum import estimate_spectrum
from bentray_kernels.errors import InvalidInput

from .traces import FREQUENCY_HZ, RATE_HZ, scan

# Of a Ricker pulse: its power is f⁴ exp(−2 f²) in units of the frequency of its maximum.
MEAN, WIDTH = 1.064, 1.155


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_spectrum_matches_the_pulse(noise):
    traces = np.array(scan(noise=noise).waveform.object)
    # A dead emitter, a dead receiver and one without numbers do not matter.
    random = np.random.default_rng(1)
    traces[4] = noise * random.standard_normal(traces[4].shape)
    traces[:, 9] = 0.0
    traces[:, 11] = np.nan
    spectrum = estimate_spectrum(traces, RATE_HZ)
    assert spectrum.center_frequency_hz == pytest.approx(MEAN * FREQUENCY_HZ, rel=0.02)
    assert spectrum.bandwidth_hz == pytest.approx(WIDTH * FREQUENCY_HZ, rel=0.1)
    assert "estimated from the spectra of the traces" in spectrum.summary


def test_noise_alone_has_none():
    noise = np.random.default_rng(2).standard_normal((8, 8, 256))
    with pytest.raises(InvalidInput, match=r"acquisition@center_frequency_hz.*no pulse in the traces"):
        estimate_spectrum(noise, RATE_HZ)
