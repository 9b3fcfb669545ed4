"""The matched wavelet: recovered from traces, zero without signal, rejected without traces."""

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography.waveform.wavelet import fit_wavelet


def pulses(shift=0.0, width=4.0):
    time = np.arange(200.0)
    return np.exp(-(((time - 40.0 - shift) / width) ** 2))


def test_wavelet_is_recovered():
    rng = np.random.default_rng(0)
    green = rng.standard_normal((5, 60)) * np.exp(-np.arange(60) / 10.0)
    pulse = pulses()
    true = pulses(3.0, 6.0) - 0.5 * pulses(9.0, 6.0)

    def heard(wavelet):
        return np.stack([np.convolve(row, wavelet)[:200] for row in green])

    assert np.abs(fit_wavelet(pulse, heard(pulse), heard(true)) - true).max() < 0.02


def test_rejects_silence():
    with pytest.raises(InvalidInput, match="waveform/water"):
        fit_wavelet(pulses(), np.ones((3, 200)), np.zeros((3, 200)))


def test_a_thousandth_of_the_strongest_energy_counts_as_noise():
    """An impulse has the same energy at all frequencies, so the factor is the same at all."""
    simulated = np.zeros((1, 200))
    simulated[0, 7] = 1.0
    assert fit_wavelet(pulses(), simulated, 2.0 * simulated) == pytest.approx(
        2.0 / 1.001 * pulses(), abs=1e-9
    )
