"""A travel-time scan of a 2-D breast phantom: settings and dataset."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Literal

import numpy as np

from bentray_kernels.acquisition import Dataset, Truth
from bentray_kernels.acquisition.noise import with_noise
from bentray_kernels.acquisition.simulation.fine_medium import FineMedium
from bentray_kernels.acquisition.simulation.ring_scan import Ring, TravelTimeScan
from bentray_kernels.arrays import Floats
from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import (
    DETAILED_SIDE_M,
    LARGE_LESIONS,
    TABLE6_SIDE_M,
    DetailedBreast,
    EllipsePhantom,
    table6,
    table6_vertical,
)
from bentray_kernels.requests.limits import SPEED_MPS
from bentray_kernels.requests.ranges import SEED, Range, check_ranges, ranged
from bentray_kernels.tomography.problem import MARGIN_NODES

from .ranges import ELEMENTS, NODES, NOISE_S, REFINEMENT, SNR

PlanePhantom = Literal["table6", "table6-vertical", "detailed", "breast"]
TITLES = {
    "table6": "2-D breast phantom (Li 2008, Table 6)",
    "table6-vertical": "2-D breast phantom (Li 2008, Table 6), vertical slice",
    "detailed": "2-D breast phantom with glandular texture",
    "breast": "2-D breast phantom with skin, fat, gland and four lesions",
}
SIDES_M = {
    "table6": TABLE6_SIDE_M,
    "table6-vertical": TABLE6_SIDE_M,
    "detailed": DETAILED_SIDE_M,
    "breast": DETAILED_SIDE_M,
}
PLANE_PHANTOMS: Mapping[str, Callable[[float], EllipsePhantom | DetailedBreast]] = MappingProxyType(
    {
        "table6": table6,
        "table6-vertical": table6_vertical,
        "detailed": DetailedBreast,
        "breast": partial(DetailedBreast, anatomy=LARGE_LESIONS),
    }
)


@dataclass(frozen=True)
class SimulationSettings:
    """A scan of a 2-D breast phantom.

    Attributes:
        phantom: that of Li 2008, Table 6, in its horizontal or vertical slice, or one with skin and glandular
            texture, of small or of large lesions.
        nodes: nodes along a side of the truth image, and of the reconstruction it is meant for.
        elements: of the ring, each emitter and receiver.
        coupling_mps: speed of sound in the coupling medium around the breast, m/s.
        refinement: of the simulation grid over the image grid, at least 4.
        noise_s: standard deviation of Gaussian noise on the travel times, s.
        seed: of the noise.
        attenuation: whether to record amplitudes beside the travel times.
        snr: root mean square of the data over the standard deviation of Gaussian noise on them, travel
            times and amplitudes alike; None: no such noise.
    """

    phantom: PlanePhantom = "table6"
    nodes: int = ranged(128, NODES)
    elements: int = ranged(256, ELEMENTS)
    coupling_mps: float = ranged(1500.0, SPEED_MPS)
    refinement: int = ranged(4, Range(4, REFINEMENT.most))
    noise_s: float = ranged(0.0, NOISE_S)
    seed: int = ranged(0, SEED)
    attenuation: bool = False
    snr: float | None = ranged(None, SNR)

    def __post_init__(self) -> None:
        check_ranges(self)
        if self.snr is not None and self.noise_s > 0.0:
            raise InvalidInput("snr", self.snr, "nothing where noise_s is given")
        self.scan()

    def scan(self) -> TravelTimeScan:
        """The scan; the ring leaves the margin that a reconstruction of as many nodes leaves."""
        side = SIDES_M[self.phantom]
        ring = Ring(self.elements, ring_radius(side, self.nodes))
        phantom = plane_phantom(self.phantom, self.coupling_mps)
        return TravelTimeScan(phantom, ring, side, self.nodes, self.refinement)

    @property
    def scans(self) -> int:
        """Number of scans that are simulated separately."""
        return 1

    @property
    def emitters(self) -> int:
        """Emitters of each of them."""
        return self.elements

    def medium_number(self, scan: int) -> int:
        """Number of the medium of a scan: there is one of each."""
        return scan

    def medium(self, number: int) -> FineMedium:
        """The medium, sampled on the fine grid."""
        return self.scan().medium(attenuation=self.attenuation)

    def elements_in_medium(self, scan: int) -> Floats:
        """(elements, 2), m, in the coordinates of the medium."""
        return self.scan().elements()


def plane_phantom(name: PlanePhantom, coupling_mps: float) -> EllipsePhantom | DetailedBreast:
    """A 2-D phantom in water of a speed, m/s."""
    return PLANE_PHANTOMS[name](coupling_mps)


def ring_radius(side_m: float, nodes: int) -> float:
    """Radius, m, of a ring in a square of ``nodes`` with the margin that a reconstruction leaves."""
    return 0.5 * side_m * (1.0 - 2.0 * MARGIN_NODES / (nodes - 1))


def scan_of(settings: SimulationSettings, delta: Floats, ratio: Floats | None) -> Dataset:
    """The dataset of simulated travel times and amplitudes, with noise.

    Args:
        settings: of the scan.
        delta: (elements, elements), s; may be changed.
        ratio: as ``delta``, Np, or None without attenuation.
    """
    scan = settings.scan()
    random = np.random.default_rng(settings.seed)
    sigma_s = settings.noise_s
    pairs = ~np.eye(settings.elements, dtype=bool)
    if settings.noise_s > 0.0:
        delta += random.normal(0.0, settings.noise_s, delta.shape)
        np.fill_diagonal(delta, 0.0)
    elif settings.snr is not None:
        delta, sigma_s = with_noise(delta, settings.snr, random, pairs)
        if ratio is not None:
            ratio, _ = with_noise(ratio, settings.snr, random, pairs)
    spacing = scan.side_m / (scan.nodes - 1)
    phantom = scan.phantom
    return Dataset(
        element_position_m=scan.ring.positions(),
        tx=np.arange(settings.elements),
        rx=np.arange(settings.elements),
        water_speed_mps=settings.coupling_mps,
        water_attenuation_np_m=phantom.coupling_np_m if settings.attenuation else None,
        delta_tof_s=delta,
        sigma_s=np.full(delta.shape, sigma_s) if sigma_s > 0.0 else None,
        log_ratio_np=ratio,
        roi=phantom.inside(scan.nodes, scan.side_m),
        truth=Truth(
            sound_speed_mps=phantom.speed(scan.nodes, scan.side_m),
            spacing_m=(spacing, spacing),
            origin_m=(-0.5 * scan.side_m, -0.5 * scan.side_m),
            attenuation_np_m=phantom.attenuation(scan.nodes, scan.side_m),
        ),
        radius_m=scan.ring.radius_m,
        picker=f"none: simulated travel times, factored fast marching, {scan.fine_nodes}² nodes",
        title=f"{TITLES[settings.phantom]}, coupling {settings.coupling_mps:g} m/s",
        source="made by bentray simulate",
        license="CC0-1.0",
    )
