"""Made-up ring scans: Ricker pulses at known delays."""

import numpy as np

from bentray_kernels.acquisition import Dataset, Waveform
from bentray_kernels.acquisition.simulation.ring_scan import Ring

WATER_MPS = 1480.0
FREQUENCY_HZ = 1.0e6
RATE_HZ = 8.0e6
RADIUS_M = 0.05
START_S = -4.0e-6


def ricker(time_s: np.ndarray, frequency_hz: float) -> np.ndarray:
    a = (np.pi * frequency_hz * time_s) ** 2
    return (1.0 - 2.0 * a) * np.exp(-a)


def ring(elements: int = 32) -> np.ndarray:
    return Ring(elements, RADIUS_M).positions()


def scan(
    delay_s: np.ndarray | float = 0.0,
    *,
    elements: int = 32,
    noise: float = 0.0,
    gain: float = 1.0,
    seed: int = 0,
    rate_hz: float = RATE_HZ,
    frequency_hz: float = FREQUENCY_HZ,
) -> Dataset:
    """float32 traces; the object's pulse is ``delay_s`` later than the water's and ``gain`` times as high."""
    position = ring(elements)
    every = np.arange(elements)
    distance = np.linalg.norm(position[:, None] - position[None], axis=-1)
    last = 2.0 * RADIUS_M / WATER_MPS + 12.0e-6
    time = START_S + np.arange(int((last - START_S) * rate_hz)) / rate_hz
    arrival = (distance / WATER_MPS)[..., None]
    late = np.broadcast_to(np.asarray(delay_s, dtype=float), distance.shape)[..., None]
    random = np.random.default_rng(seed)

    def traces(at: np.ndarray, height: float) -> np.ndarray:
        clean = height * ricker(time - at, frequency_hz)
        # Noise takes as long as the pulses, and most scans have none.
        noisy = clean + noise * random.standard_normal(clean.shape) if noise else clean
        return noisy.astype(np.float32)

    return Dataset(
        element_position_m=position,
        tx=every,
        rx=every,
        water_speed_mps=WATER_MPS,
        waveform=Waveform(traces(arrival + late, gain), traces(arrival, 1.0)),
        sampling_rate_hz=rate_hz,
        center_frequency_hz=frequency_hz,
        t0_s=START_S,
    )


def smooth_delay(elements: int, largest_s: float, seed: int = 0) -> np.ndarray:
    """(elements, elements) delays that change slowly around the ring and are the same both ways."""
    random = np.random.default_rng(seed)
    angle = 2.0 * np.pi * np.arange(elements) / elements
    a, b = angle[:, None], angle[None, :]
    phase = random.uniform(0.0, 2.0 * np.pi, 2)
    return largest_s * 0.5 * (np.cos(a + b + phase[0]) + np.cos(a - b) * np.cos(phase[1]))


def blob_delay(elements: int) -> np.ndarray:
    """(elements, elements) straight-ray delays of a slow disc of 20 mm about the centre, s."""
    position = ring(elements)
    along = np.linspace(0.0, 1.0, 401)[:, None, None, None]
    path = position[None, :, None] * (1.0 - along) + position[None, None, :] * along
    inside = np.exp(-((np.linalg.norm(path, axis=-1) / 0.02) ** 4)).mean(axis=0)
    distance = np.linalg.norm(position[:, None] - position[None], axis=-1)
    return np.asarray(inside * distance * (1.0 / 1450.0 - 1.0 / WATER_MPS))


def absorbed(traces: np.ndarray, loss_np: np.ndarray, rate_hz: float, frequency_hz: float) -> np.ndarray:
    """Traces (..., nt) that have lost ``loss_np``, (...), at that frequency, and at others in proportion."""
    length = 4 * traces.shape[-1]
    part = np.fft.rfftfreq(length, 1.0 / rate_hz) / frequency_hz
    left = np.fft.rfft(traces, length) * np.exp(-loss_np[..., None] * part)
    return np.asarray(np.fft.irfft(left, length)[..., : traces.shape[-1]])


def later(traces: np.ndarray, seconds: np.ndarray | float, rate_hz: float) -> np.ndarray:
    """float32 traces moved by any time, of each where there are several; their ends are as good as silent."""
    turn = -2j * np.pi * np.fft.rfftfreq(traces.shape[-1], 1.0 / rate_hz)
    spectra = np.fft.rfft(traces, axis=-1) * np.exp(turn * np.asarray(seconds)[..., None])
    return np.fft.irfft(spectra, traces.shape[-1], axis=-1).astype(np.float32)
