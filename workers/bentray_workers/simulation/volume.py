"""A travel-time scan of the 3-D breast phantom (Li 2008, Table 7): settings and dataset."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from bentray_kernels.acquisition import Dataset, Truth
from bentray_kernels.acquisition.noise import with_noise
from bentray_kernels.acquisition.simulation.fine_medium import FineMedium
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.acquisition.simulation.volume_scan import VolumeScan
from bentray_kernels.arrays import Floats
from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import TABLE7_FREQUENCY_HZ, TABLE7_GRIDS, TABLE7_SIDE_M, table7, table7_slices
from bentray_kernels.requests.limits import SPEED_MPS
from bentray_kernels.requests.ranges import SEED, check_ranges, ranged

from .plane import ring_radius
from .ranges import ELEMENTS, NODES, REFINEMENT, SLICES, SNR

# The coarsest voxels in which the lesions of the phantom are separate.
MIN_NODES = min(nodes for nodes, _ in TABLE7_GRIDS)


@dataclass(frozen=True)
class VolumeSimulationSettings:
    """A scan of the 3-D breast phantom (Li 2008, Table 7).

    Attributes:
        nodes: nodes along x and y of the truth, and of the reconstruction it is meant for.
        slices: heights of the ring, one node apart, centred on the phantom.
        elements: of the ring, each emitter and receiver.
        coupling_mps: speed of sound in the coupling medium around the breast, m/s.
        refinement: of the simulation grid over the image grid; at least 4, or 2 with ``three_d``.
        three_d: 3-D wave fronts; else each slice is simulated in 2-D.
        array: ``moved``, one ring at each height in turn, whose elements receive their own ring only;
            ``rings``, all rings at once, each element receiving every other, with ``three_d`` only.
        attenuation: whether to record amplitudes beside the travel times.
        snr: root mean square of the data over the standard deviation of Gaussian noise on them; None: none.
        seed: of the noise.
    """

    nodes: int = ranged(128, NODES)
    slices: int = ranged(40, SLICES)
    elements: int = ranged(256, ELEMENTS)
    coupling_mps: float = ranged(1500.0, SPEED_MPS)
    refinement: int = ranged(4, REFINEMENT)
    three_d: bool = False
    array: Literal["moved", "rings"] = "moved"
    attenuation: bool = False
    snr: float | None = ranged(None, SNR)
    seed: int = ranged(0, SEED)

    def __post_init__(self) -> None:
        check_ranges(self)
        if self.array not in ("moved", "rings"):
            raise InvalidInput("array", repr(self.array), "moved or rings")
        if self.array == "rings" and not self.three_d:
            raise InvalidInput("array", repr(self.array), "moved, unless three_d is true")
        self.scan()

    def scan(self) -> VolumeScan:
        """The scan; the ring leaves the margin that a reconstruction of as many nodes leaves."""
        return VolumeScan(
            table7(self.coupling_mps, max(self.nodes, MIN_NODES)),
            Ring(self.elements, ring_radius(TABLE7_SIDE_M, self.nodes)),
            tuple(table7_slices(self.nodes, self.slices).tolist()),
            TABLE7_SIDE_M,
            self.nodes,
            self.refinement,
            self.three_d,
        )

    @property
    def scans(self) -> int:
        """Number of scans that are simulated separately."""
        return 1 if self.array == "rings" else self.slices

    @property
    def emitters(self) -> int:
        """Emitters of each of them."""
        return self.slices * self.elements if self.array == "rings" else self.elements

    def medium_number(self, scan: int) -> int:
        """Number of the medium of a scan: each 2-D slice is a medium of its own."""
        return 0 if self.three_d else scan

    def medium(self, number: int) -> FineMedium:
        """A medium by its number, sampled on the fine grid."""
        scan = self.scan()
        dataset = scan if self.three_d else scan.slice(number)
        return dataset.medium(attenuation=self.attenuation)

    def elements_in_medium(self, scan: int) -> Floats:
        """(n, ndim), m, in the coordinates of the medium."""
        whole = self.scan()
        if not self.three_d:
            return whole.slice(scan).elements()
        elements = whole.elements()
        if self.array == "rings":
            return elements
        return elements[scan * self.elements : (scan + 1) * self.elements]


def scan_of(settings: VolumeSimulationSettings, delta: Floats, ratio: Floats | None) -> Dataset:
    """The dataset of simulated travel times and amplitudes, with noise.

    Args:
        settings: of the scan.
        delta: (scans, emitters, emitters), s.
        ratio: as ``delta``, Np, or None without attenuation.
    """
    scan, count = settings.scan(), settings.emitters
    rings = settings.array == "rings"
    sigma_s = 0.0
    if settings.snr is not None:
        random = np.random.default_rng(settings.seed)
        pairs = np.broadcast_to(~np.eye(count, dtype=bool), delta.shape)
        delta, sigma_s = with_noise(delta, settings.snr, random, pairs)
        if ratio is not None:
            ratio, _ = with_noise(ratio, settings.snr, random, pairs)
    if rings:
        delta, ratio = delta[0], None if ratio is None else ratio[0]
    return Dataset(
        element_position_m=scan.positions() if rings else scan.ring.positions(),
        tx=np.arange(count),
        rx=np.arange(count),
        water_speed_mps=settings.coupling_mps,
        water_attenuation_np_m=scan.phantom.coupling_np_m if settings.attenuation else None,
        delta_tof_s=delta,
        sigma_s=np.full(delta.shape, sigma_s) if sigma_s > 0.0 else None,
        log_ratio_np=ratio,
        amplitude_frequency_hz=TABLE7_FREQUENCY_HZ if settings.attenuation else None,
        roi=scan.phantom.inside(scan.nodes, scan.side_m, scan.z_m),
        truth=_truth(scan),
        slice_z_m=None if rings else np.array(scan.z_m),
        array_type="rings" if rings else "ring",
        radius_m=scan.ring.radius_m,
        picker=f"none: simulated travel times, factored fast marching in {2 + scan.three_d} dimensions",
        title=f"3-D breast phantom (Li 2008, Table 7), coupling {settings.coupling_mps:g} m/s",
        source="made by bentray simulate",
        license="CC0-1.0",
    )


def _truth(scan: VolumeScan) -> Truth:
    spacing = scan.side_m / (scan.nodes - 1)
    return Truth(
        sound_speed_mps=scan.phantom.speed(scan.nodes, scan.side_m, scan.z_m),
        spacing_m=(spacing, spacing, spacing),
        origin_m=(-0.5 * scan.side_m, -0.5 * scan.side_m, scan.z_m[0]),
        attenuation_np_m=scan.phantom.attenuation(scan.nodes, scan.side_m, scan.z_m),
        axes="x,y,z",
    )
