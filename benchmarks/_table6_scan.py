"""The Table 6 phantom as the benchmarks of the reconstruction scan it, and their errors."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.tomography import (
    Progress,
    Reconstruction,
    Settings,
    mean_absolute_error,
    reconstruct,
    rmse,
)
from bentray_service.cli.terminal import Step
from bentray_workers.simulation import SimulationSettings, simulate


@dataclass(frozen=True)
class Found:
    """A reconstruction beside the truth.

    Attributes:
        result: the reconstruction.
        error: mean absolute error of the speed inside the breast, per cent of its range (chapter 6.4).
        rms: root mean square error of it, of the range.
        attenuation_rms: as ``rms`` of the attenuation; NaN without one.
        seconds: it took.
        how: in words, for the detail of a row.
    """

    result: Reconstruction
    error: float
    rms: float
    attenuation_rms: float
    seconds: float
    how: str


@dataclass(frozen=True)
class Table6Scan:
    """A simulated scan and what is really there; errors are read inside the breast's outline.

    Attributes:
        asked: what was simulated.
        dataset: with amplitudes where they were asked for.
    """

    asked: SimulationSettings
    dataset: Dataset

    @classmethod
    def simulated(cls, asked: SimulationSettings, progress: Step) -> Table6Scan:
        """Simulate with the cores of this machine."""
        what = f"simulating, coupling {asked.coupling_mps:g}"
        return cls(asked, simulate(None, asked, lambda p: progress(p.done, p.total, what)))

    @property
    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest speed of the phantom, m/s: the dissertation leaves the coupling out."""
        return self.asked.scan().phantom.speed_range()

    def run(self, progress: Step, what: str, **changes: object) -> Found:
        """Reconstruct with some settings and compare."""
        scan, nodes = self.asked.scan(), self.asked.nodes
        settings = Settings(**{"nodes": nodes, "side_m": scan.side_m, **changes})

        def show(p: Progress) -> None:
            progress(p.done, p.total, what)

        started = time.perf_counter()
        result = reconstruct(self.dataset, settings, show)
        seconds = time.perf_counter() - started
        used = sum(1 for sweep in result.history)
        how = (
            f"{what}; {result.settings.method}, {nodes}² nodes, {self.asked.elements} elements, {used} sweeps"
        )
        truth, inside = scan.phantom.speed(nodes, scan.side_m), scan.phantom.inside(nodes, scan.side_m)
        low, high = self.speed_range
        losses = float("nan")
        if result.attenuation is not None:
            known = scan.phantom.attenuation(nodes, scan.side_m)
            losses = rmse(result.attenuation, known, inside) / float(np.ptp(known[inside]))
        return Found(
            result,
            100.0 * mean_absolute_error(result.speed, truth, inside, high - low),
            rmse(result.speed, truth, inside) / (high - low),
            losses,
            seconds,
            f"{how}, {seconds:.1f} s",
        )
