"""Scans of breasts of which no two are alike: anatomy, water, elements and noise are drawn."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.noise import with_noise
from bentray_kernels.acquisition.simulation.ring_scan import Ring, TravelTimeScan
from bentray_kernels.phantoms import DETAILED_SIDE_M, DetailedBreast, EllipsePhantom
from bentray_kernels.phantoms.detailed_breast import Anatomy
from bentray_kernels.phantoms.ellipses import Ellipse

RADIUS_M, NODES, SEED = 0.1, 96, 71
ELEMENTS, SNRS, WATERS_MPS = (64, 96, 128), (10.0, 30.0, 100.0), (1440.0, 1480.0, 1500.0, 1520.0)


@dataclass(frozen=True)
class BreastScan:
    """A scan and its truth.

    Attributes:
        name: number, elements, signal-to-noise ratio and water.
        dataset: travel times with noise.
        breast: the phantom, centred on 0.
    """

    name: str
    dataset: Dataset
    breast: DetailedBreast | EllipsePhantom


def breast_scans(count: int, seed: int = SEED, water_mps: float | None = None) -> Iterator[BreastScan]:
    """Scans of breasts of ellipses and of detailed ones by turns; the same on every run.

    Times are those of another Eikonal solver on a grid four times as fine, with white noise.

    Args:
        count: of the scans.
        seed: another one for other breasts.
        water_mps: speed of the water, m/s; None: drawn.
    """
    for number in range(count):
        random = np.random.default_rng((seed, number))
        drawn = float(random.choice(WATERS_MPS))
        water = drawn if water_mps is None else water_mps
        breast = detailed(random, water) if number % 2 else _of_ellipses(random, water)
        ring = Ring(ELEMENTS[number % len(ELEMENTS)], RADIUS_M)
        everyone = np.arange(ring.elements)
        times = TravelTimeScan(breast, ring, DETAILED_SIDE_M, nodes=NODES).delta_tof(everyone)
        snr = float(random.choice(SNRS))
        noisy, _ = with_noise(times, snr, random, ~np.eye(ring.elements, dtype=bool))
        np.fill_diagonal(noisy, np.nan)
        dataset = Dataset(ring.positions(), everyone, everyone, water, delta_tof_s=noisy)
        name = f"{number}: {ring.elements} elements, SNR {snr:.0f}, water {water:.0f} m/s"
        yield BreastScan(name, dataset, breast)


def detailed(random: np.random.Generator, water_mps: float) -> DetailedBreast:
    """A breast of any density with a tumour and a cyst."""
    centres = [_random_centre(random, 0.045) for _ in range(2)]
    sizes = random.uniform(0.0025, 0.007, 2)
    lesions = (
        Ellipse(centres[0], (sizes[0], 0.8 * sizes[0]), 1575.0, 25.0, "tumour", random.uniform(0.0, np.pi)),
        Ellipse(centres[1], (sizes[1], sizes[1]), 1480.0, 0.0, "cyst"),
    )
    axis = random.uniform(0.062, 0.076)
    anatomy = Anatomy(
        int(random.integers(1000)),
        (axis, axis * random.uniform(0.9, 1.0)),
        random.uniform(0.5, 0.95),
        random.uniform(-1.3, 0.5),
        lesions,
    )
    return DetailedBreast(water_mps, anatomy=anatomy)


def _of_ellipses(random: np.random.Generator, water_mps: float) -> EllipsePhantom:
    """Skin of 2 mm, fat, up to three glands and up to five lesions, all of one speed each."""
    wide = random.uniform(0.055, 0.075)
    axes = wide, wide * random.uniform(0.85, 1.0)
    turn = random.uniform(0.0, np.pi)
    inner = axes[0] - 0.002, axes[1] - 0.002
    ellipses = [
        Ellipse((0.0, 0.0), axes, 1560.0, 20.0, "skin", turn),
        Ellipse((0.0, 0.0), inner, random.uniform(1435.0, 1465.0), 5.0, "fat", turn),
    ]
    for _ in range(int(random.integers(1, 4))):
        size = random.uniform(0.2, 0.5) * axes[1]
        centre = _random_centre(random, 0.9 * axes[1] - size - 0.004)
        shape = size, size * random.uniform(0.4, 1.0)
        ellipses.append(Ellipse(centre, shape, random.uniform(1500.0, 1540.0), 10.0, "gland", turn))
    for _ in range(int(random.integers(1, 6))):
        size = random.uniform(0.002, 0.008)
        centre = _random_centre(random, 0.75 * axes[1] - size)
        speed = float(random.choice((1480.0, 1550.0, 1570.0)))
        ellipses.append(Ellipse(centre, (size, size * random.uniform(0.6, 1.0)), speed, 25.0, "lesion"))
    return EllipsePhantom(water_mps, tuple(ellipses))


def _random_centre(random: np.random.Generator, within_m: float) -> tuple[float, float]:
    distance, turn = random.uniform(0.0, within_m), random.uniform(0.0, 2.0 * np.pi)
    return distance * np.cos(turn), distance * np.sin(turn)
