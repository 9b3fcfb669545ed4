"""A small ring scan of a blob, simulated more finely in space and time than any refinement here does."""

import functools

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.waveform import Waveform
from bentray_kernels.task_graph import ThreadPool, run
from bentray_kernels.tomography.scan import MemorySource
from bentray_kernels.tomography.waveform.inversion_state import Image
from bentray_kernels.tomography.waveform.refinement_graph import RefinementGraph
from bentray_kernels.tomography.waveform.wave_scan import WaveScan
from bentray_kernels.tomography.waveform.waveform_settings import Band, WaveSettings
from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.simulation import simulate

WATER, RADIUS, CENTRE_HZ, RATE_HZ, T0 = 1500.0, 0.024, 2.5e5, 2.5e6, -2e-6
SPACING, FINER, ELEMENTS = 5e-4, 8, 24


def blob(x, y):
    """Speed about the centre of the ring, m/s."""
    return (
        WATER
        + 45.0 * np.exp(-(((x - 0.004) ** 2 + (y + 0.003) ** 2) / 0.005**2))
        - 30.0 * np.exp(-(((x + 0.007) ** 2 + (y - 0.004) ** 2) / 0.004**2))
    )


RIM_MPS = 1420.0


def within_rim(x, y):
    """Where ``scan(rim=True)`` has oil of ``RIM_MPS``: nearer to the elements than a band changes."""
    depth = RADIUS - np.hypot(x, y)
    return (depth > 0.0015) & (depth < 0.008)


def lossy(x, y):
    """Attenuation of ``scan(loss=True)`` there, Np/m."""
    return 40.0 * np.exp(-((x**2 + (y - 0.005) ** 2) / 0.006**2))


def _traces(speed, loss, positions, emitter, wavelet, step):
    medium = Medium.from_speed(speed, SPACING, step, attenuation=loss, edge_nodes=40)
    return simulate(medium, positions[emitter], positions, wavelet)[:, ::FINER]


@functools.cache
def scan(seed=0, noise=0.0, loss=False, rim=False):
    """The dataset; every second element emits."""
    angle = 2.0 * np.pi * np.arange(ELEMENTS) / ELEMENTS + 0.1
    ring = RADIUS * np.column_stack((np.cos(angle), np.sin(angle)))
    half = 56
    axis = SPACING * np.arange(-half, half + 1)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    step = 1.0 / (RATE_HZ * FINER)
    time = T0 + step * np.arange(120 * FINER)
    late = (time - 8e-6) * CENTRE_HZ
    wavelet = np.exp(-((0.9 * late) ** 2)) * np.sin(2.0 * np.pi * late)
    emitters = np.arange(0, ELEMENTS, 2)
    positions = ring + SPACING * half
    object_mps = np.where(within_rim(x, y), RIM_MPS, blob(x, y)) if rim else blob(x, y)
    both = [
        np.stack([_traces(speed, absorbed, positions, e, wavelet, step) for e in emitters])
        for speed, absorbed in ((object_mps, lossy(x, y) if loss else None), (np.full_like(x, WATER), None))
    ]
    rng = np.random.default_rng(seed)
    noisy = [
        (part + noise * part.std() * rng.standard_normal(part.shape)).astype(np.float32) for part in both
    ]
    return Dataset(
        ring,
        emitters,
        np.arange(ELEMENTS),
        WATER,
        waveform=Waveform(*noisy),
        center_frequency_hz=CENTRE_HZ,
        sampling_rate_hz=RATE_HZ,
        t0_s=T0,
    )


def nodes_of(image):
    """Coordinates of the nodes of an image, m."""
    lines = (o + image.spacing * np.arange(n) for o, n in zip(image.origin, image.speed.shape, strict=True))
    return np.meshgrid(*lines, indexing="ij")


def true_image(spacing=1e-3, half=28):
    """The blob on so many nodes to each side."""
    line = spacing * np.arange(-half, half + 1)
    return Image(blob(*np.meshgrid(line, line, indexing="ij")), spacing, (line[0], line[0]))


def error(image):
    """Rms error of an image inside 15 mm, m/s."""
    x, y = nodes_of(image)
    return float(np.sqrt(((image.speed - blob(x, y))[np.hypot(x, y) < 0.015] ** 2).mean()))


# Two bands that find the blob from water in a second or two, and one that finds no loss.
SETTINGS = WaveSettings(
    (
        Band(8e4, 1.7e5, 2.0e-3, iterations=3, emitters=8, smoothing_m=3e-3),
        Band(8e4, 2.8e5, 1.3e-3, iterations=4, emitters=8, smoothing_m=2e-3),
        Band(1.8e5, 2.8e5, 1.3e-3, iterations=2, emitters=8, smoothing_m=3e-3, of="attenuation"),
    ),
    nearest_m=0.012,
    held_out=2,
)


def water(nodes=60):
    """An image of water alone; the blob is weak enough to begin with it."""
    side = 0.06
    return Image(np.full((nodes, nodes), WATER), side / (nodes - 1), (-0.5 * side, -0.5 * side))


def refine(dataset, settings, start, threads=1):
    """The finished graph of a refinement in this process."""
    graph = RefinementGraph(WaveScan(MemorySource(dataset), settings), start)
    run({"refinement": graph}, ThreadPool(threads))
    return graph


@functools.cache
def refined():
    """The refinement by ``SETTINGS`` in one thread."""
    return refine(scan(), SETTINGS, water())
