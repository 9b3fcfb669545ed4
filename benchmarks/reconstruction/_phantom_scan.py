"""The phantoms of Tables 6 and 7 as the benchmarks of the reconstruction scan them, and the errors."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.noise import with_noise
from bentray_kernels.acquisition.simulation.ring_scan import Ring, TravelTimeScan
from bentray_kernels.phantoms import TABLE7_SIDE_M, table7
from bentray_kernels.tomography import (
    Progress,
    Reconstruction,
    Settings,
    mean_absolute_error,
    reconstruct,
    rmse,
)
from bentray_service.cli.output.terminal import Step
from bentray_workers.simulation.plane import SimulationSettings, ring_radius
from bentray_workers.simulation.simulation_run import simulate


@dataclass(frozen=True)
class ReconstructionError:
    """A reconstruction and its errors against the ground truth.

    Attributes:
        result: the reconstruction.
        mae_percent: mean absolute error of the speed inside the breast, per cent of its range (Li 2008, 6.4).
        rmse_of_range: root mean square error of the speed inside the breast, as a fraction of its range.
        whole_image_rmse: as ``rmse_of_range``, over the whole image, as in Li 2008, section 7.3.1.
        attenuation_rmse: as ``rmse_of_range``, of the attenuation; NaN without one.
        seconds: computing time.
        how: summary for the detail of a row.
    """

    result: Reconstruction
    mae_percent: float
    rmse_of_range: float
    whole_image_rmse: float
    attenuation_rmse: float
    seconds: float
    how: str


@dataclass(frozen=True)
class PhantomScan:
    """A simulated scan and what is really there; errors are read inside the breast's outline.

    Attributes:
        scan: what was simulated.
        dataset: with amplitudes where they were asked for.
    """

    scan: TravelTimeScan
    dataset: Dataset

    @classmethod
    def of_table6(cls, asked: SimulationSettings, progress: Step) -> PhantomScan:
        """Simulate with the cores of this machine."""
        what = f"simulating, coupling {asked.coupling_mps:g}"
        dataset = simulate(asked, lambda p: progress(p.done, p.total, what))
        return cls(asked.scan(), dataset)

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
        return cls(scan, dataset)

    @property
    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest speed of the phantom, m/s: the dissertation leaves the coupling out."""
        return self.scan.phantom.speed_range()

    @property
    def truth(self) -> np.ndarray:
        """True speed at the nodes of a reconstruction, m/s."""
        return self.scan.phantom.speed(self.scan.nodes, self.scan.side_m)

    def run(self, progress: Step, what: str, **changes: object) -> ReconstructionError:
        """Reconstruct with some settings and compare."""
        scan, nodes, elements = self.scan, self.scan.nodes, self.scan.ring.elements
        settings = Settings.of(**{"method": "sart", "nodes": nodes, "side_m": scan.side_m, **changes})

        def show(p: Progress) -> None:
            progress(p.done, p.total, what)

        started = time.perf_counter()
        result = reconstruct(self.dataset, settings, show)
        seconds = time.perf_counter() - started
        how = (
            f"{what}; {result.settings.method}, {nodes}² nodes, {elements} elements, "
            f"{len(result.history)} sweeps"
        )
        truth, inside = self.truth, scan.phantom.inside(nodes, scan.side_m)
        low, high = self.speed_range
        losses = float("nan")
        if result.attenuation is not None:
            known = scan.phantom.attenuation(nodes, scan.side_m)
            losses = rmse(result.attenuation, known, inside) / float(np.ptp(known[inside]))
        return ReconstructionError(
            result,
            100.0 * mean_absolute_error(result.speed, truth, inside, high - low),
            rmse(result.speed, truth, inside) / (high - low),
            rmse(result.speed, truth, np.ones(truth.shape, dtype=bool)) / (high - low),
            losses,
            seconds,
            f"{how}, {seconds:.1f} s",
        )
