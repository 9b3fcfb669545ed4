"""Scans of the phantoms of Tables 6 and 7, errors of their images, and baselines of these errors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.noise import with_noise
from bentray_kernels.acquisition.simulation.ring_scan import Ring, TravelTimeScan
from bentray_kernels.phantoms import TABLE7_SIDE_M, table7
from bentray_kernels.tomography import Reconstruction, Settings
from bentray_service.cli.output.terminal import Step
from bentray_workers.simulation.plane import SimulationSettings, ring_radius
from bentray_workers.simulation.simulation_run import simulate

from ..shared._baselines import Compared, Images
from ..shared._image_error import ErrorOn, ImageError, Norm


@dataclass(frozen=True)
class ReconstructionError:
    """A reconstruction and its errors against the ground truth.

    Attributes:
        result: the reconstruction.
        mae_percent: mean absolute error of the speed inside the breast, per cent of its range (Li 2008, 6.4).
        whole_image_rmse: root mean square error of the speed over the whole image, as a fraction of its range
            inside the breast (Li 2008, section 7.3.1).
        attenuation_rmse: of the attenuation inside the breast, as a fraction of its range; NaN without one.
        how: summary for the detail of a row.
    """

    result: Reconstruction
    mae_percent: float
    whole_image_rmse: float
    attenuation_rmse: float
    how: str

    @property
    def side_m(self) -> float:
        """Side of the image, m."""
        return self.result.spacing_m[0] * (self.result.speed.shape[0] - 1)


@dataclass(frozen=True)
class PhantomScan:
    """A simulated scan and what is really there; errors are read inside the breast's outline.

    Attributes:
        scan: what was simulated.
        dataset: with amplitudes where they were asked for.
        progress: called while images are reconstructed.
    """

    scan: TravelTimeScan
    dataset: Dataset
    progress: Step

    @classmethod
    def of_table6(cls, asked: SimulationSettings, progress: Step) -> PhantomScan:
        """Simulate with the cores of this machine."""
        what = f"simulating, coupling {asked.coupling_mps:g}"
        dataset = simulate(asked, lambda p: progress(p.done, p.total, what))
        return cls(asked.scan(), dataset, progress)

    @classmethod
    def of_table7(
        cls, z_m: float, nodes: int, elements: int, coupling_mps: float, snr: float | None, progress: Step
    ) -> PhantomScan:
        """A slice of the 3-D breast phantom (Li 2008, Table 7) as a world of its own, with amplitudes."""
        ring = Ring(elements, ring_radius(TABLE7_SIDE_M, nodes))
        scan = TravelTimeScan(table7(coupling_mps, max(nodes, 128)).at(z_m), ring, TABLE7_SIDE_M, nodes)
        medium, everyone = scan.medium(attenuation=True), np.arange(elements)
        delta, ratio = np.empty((elements, elements)), np.empty((elements, elements))
        for first in range(0, elements, 16):
            progress(first, elements, f"simulating z = {1e3 * z_m:g} mm, coupling {coupling_mps:g}")
            batch = everyone[first : first + 16]
            delta[batch], ratio[batch] = medium.arrivals(scan.elements(), batch)
        if snr is not None:
            random, pairs = np.random.default_rng(0), ~np.eye(elements, dtype=bool)
            delta, _ = with_noise(delta, snr, random, pairs)
            ratio, _ = with_noise(ratio, snr, random, pairs)
        dataset = Dataset(
            ring.positions(), everyone, everyone, coupling_mps, delta_tof_s=delta, log_ratio_np=ratio
        )
        return cls(scan, dataset, progress)

    @property
    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest speed of the phantom, m/s: the dissertation leaves the coupling out."""
        return self.scan.phantom.speed_range()

    @property
    def truth(self) -> np.ndarray:
        """True speed at the nodes of a reconstruction, m/s."""
        return self.scan.phantom.speed(self.scan.nodes, self.scan.side_m)

    @cached_property
    def images(self) -> Images:
        """The images of this scan, each reconstructed once."""
        return Images.here(self.dataset, self.progress)

    def run(self, what: str, **changes: object) -> ReconstructionError:
        """Reconstruct with some settings of SART on the grid of the phantom, and compare."""
        scan = self.scan
        return self._made(
            what,
            Settings.from_values(**{"method": "sart", "nodes": scan.nodes, "side_m": scan.side_m, **changes}),
        )

    def run_default(self) -> ReconstructionError:
        """Reconstruct with the default settings, and compare."""
        return self._made("default settings", Settings())

    def _made(self, what: str, settings: Settings) -> ReconstructionError:
        image = self.images.made(settings)
        result = image.result
        how = (
            f"{what}; {result.settings.rays} {result.settings.method}, {result.speed.shape[0]}² nodes, "
            f"{self.scan.ring.elements} elements, {len(result.history)} iterations, {image.seconds:.1f} s"
        )
        return ReconstructionError(
            result,
            self.mean_absolute(result).of(result),
            self.whole_image_rms(result).of(result),
            self.attenuation_rms(result).of(result),
            how,
        )

    def compared(self, error: ReconstructionError, error_on: ErrorOn) -> Compared:
        """One of the errors below, and those of the baselines."""
        return self.images.compared(error.result, error_on)

    def mean_absolute(self, image: Reconstruction) -> ImageError:
        """Mean absolute error of the speed inside the breast, per cent of the phantom's range."""
        low, high = self.speed_range
        return self._speed_error(image, 0.01 * (high - low), "mean absolute")

    def rms(self, image: Reconstruction) -> ImageError:
        """Root mean square error of the speed inside the breast, over the phantom's range."""
        low, high = self.speed_range
        return self._speed_error(image, high - low, "rms")

    def whole_image_rms(self, image: Reconstruction) -> ImageError:
        """The error ``rms`` over the whole image."""
        error = self.rms(image)
        return replace(error, region=np.ones(error.true.shape, dtype=bool))

    def attenuation_rms(self, image: Reconstruction) -> ImageError:
        """The error ``rms`` of the attenuation, over its range inside the breast."""
        nodes, side = _grid(image)
        phantom = self.scan.phantom
        true, inside = phantom.attenuation(nodes, side), phantom.inside(nodes, side)
        return ImageError(true, inside, float(np.ptp(true[inside])), quantity="attenuation")

    def _speed_error(self, image: Reconstruction, unit: float, norm: Norm) -> ImageError:
        nodes, side = _grid(image)
        phantom = self.scan.phantom
        return ImageError(phantom.speed(nodes, side), phantom.inside(nodes, side), unit, norm)


def _grid(image: Reconstruction) -> tuple[int, float]:
    """Nodes along a side of a square image, and the side, m; centred on 0."""
    nodes, spacing = image.speed.shape[0], image.spacing_m[0]
    side = spacing * (nodes - 1)
    assert np.allclose(image.origin_m[:2], -0.5 * side, rtol=0.0, atol=1e-3 * spacing)
    return nodes, side
