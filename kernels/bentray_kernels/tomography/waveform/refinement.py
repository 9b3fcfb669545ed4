"""What waveforms make of a reconstruction along rays: chains that begin with its image, and the result."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...acquisition import Dataset
from .. import pairs
from ..model_selection.selection import CLEARLY
from ..numerics import recorded
from ..reconstruction_graph import Run, progress_of
from ..result import Reconstruction
from ..settings import Settings
from .automatic_settings import scale_of, wave_settings
from .inversion_state import BandEnd, Image
from .refinement_graph import RefinementGraph, WaveScan, resampled
from .validation import ValidationGraph, evaluations, validation_settings
from .waveform_cost import advice
from .waveform_settings import WaveSettings

# Makes the scan in which the tasks of one slice find their data.
WaveScanOf = Callable[[WaveSettings, int], WaveScan]


class Refinement:
    """A refinement that is to come.

    Args:
        dataset: its traces may still lie in its file.
        settings: as requested.
        samples: of each trace of object and water; 0: none.
        scan_of: see ``WaveScanOf``.

    Attributes:
        total: emitter passes that it takes at most.
        within_budget: whether there is a time budget that allows it.

    Raises:
        InvalidInput: for a scan that lacks what waves need.
    """

    def __init__(self, dataset: Dataset, settings: Settings, samples: int, scan_of: WaveScanOf) -> None:
        self._scan_of = scan_of
        self._water_np_m = dataset.water_attenuation_np_m or 0.0
        slices = pairs.count(dataset, settings)
        scale = scale_of(dataset, settings, samples, slices)
        self._settings = scale.budgeted(settings)
        self._plan = wave_settings(scale, self._settings)
        # What ``advised`` states is the time without a budget.
        self._whole_minutes = scale.minutes(settings)
        budget = -1.0 if settings.minutes is None else settings.minutes
        self.within_budget = scale.minutes(self._settings) <= budget
        self.total = slices * sum(band.evaluations(self._plan.held_out) for band in self._plan.bands)

    def refined(self, rays: Reconstruction, run_graphs: Run, before: int) -> Reconstruction:
        """The image of the rays, refined slice after slice: the emitters of one are enough for many workers.

        Args:
            rays: the reconstruction.
            run_graphs: runs graphs to their end.
            before: emitter passes that were made.
        """
        images = _slices(rays, rays.speed)
        each = self.total // len(images)
        history, chains = rays.history, []
        for index, image in enumerate(images):
            scan = self._scan_of(self._plan, index)
            chains.append(RefinementGraph(scan, image, index, history, self._stage(rays)))
            run_graphs(chains[-1:], before + each * index, self.total - each * (index + 1))
            history = chains[-1].history
        if self._settings.method == "auto" and not predicts_better(chains):
            told = (
                f"{_summary(rays, self._plan, chains)}; not clearly better, so the image of the rays is given"
            )
            return replace(rays, history=history, provenance={**rays.provenance, "waveform": told})
        return self._result(rays, chains)

    @property
    def passes(self) -> int:
        """Emitter passes of ``advised``."""
        return evaluations(self._plan)

    def advised(self, rays: Reconstruction, noise_s: float, run_graphs: Run, before: int) -> Reconstruction:
        """The reconstruction with a sentence whether full-waveform refinement is advised.

        Args:
            rays: the reconstruction, with its trials; of several slices the middle one is validated.
            noise_s: standard deviation of the travel times, s.
            run_graphs: runs graphs to their end.
            before: emitter passes that were made.
        """
        images = _slices(rays, rays.speed)
        index = len(images) // 2
        judge = ValidationGraph(
            self._scan_of(validation_settings(self._plan), index), images[index], rays.history
        )
        run_graphs([judge], before, 0)
        told = advice(judge.validation, rays.trials[0], noise_s, self._whole_minutes)
        return replace(rays, provenance={**rays.provenance, "waveform": told})

    def _stage(self, rays: Reconstruction) -> int:
        return 1 + max(sweep.stage for sweep in rays.history)

    def _result(self, rays: Reconstruction, chains: Sequence[RefinementGraph]) -> Reconstruction:
        """The result of finished chains, on the finest grid that one of them reached."""
        finest = min((chain.image for chain in chains), key=lambda image: image.spacing)

        def laid(images: Sequence[Image]) -> NDArray[np.float64]:
            grid = _at(finest)
            parts = [image.speed if _at(image) == grid else resampled(image, *grid) for image in images]
            return np.ascontiguousarray(np.stack(parts, axis=-1)) if rays.speed.ndim == 3 else parts[0]

        def of_rays(values: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
            return None if values is None else laid(_slices(rays, values))

        def losses(image: Image) -> Image:
            assert image.attenuation is not None
            return replace(image, speed=image.attenuation + self._water_np_m)

        refined = None
        if all(chain.image.attenuation is not None for chain in chains):
            refined = laid([losses(chain.image) for chain in chains])
        coverage = of_rays(rays.coverage)
        assert coverage is not None
        return replace(
            rays,
            speed=laid([chain.image for chain in chains]),
            coverage=coverage,
            attenuation=refined if refined is not None else of_rays(rays.attenuation),
            recovery=of_rays(rays.recovery),
            spacing_m=(finest.spacing, finest.spacing, *rays.spacing_m[2:]),
            origin_m=(*finest.origin, *rays.origin_m[2:]),
            settings=replace(self._settings, method="waveform"),
            history=progress_of(chains[-1:]).history,
            # They are of the rays' image.
            residuals=None,
            provenance={
                **rays.provenance,
                "ray_numerics": rays.provenance["numerics"],
                **recorded(self._settings.numerics),
                "waveform": _summary(rays, self._plan, chains),
            },
        )


def predicts_better(chains: Sequence[RefinementGraph]) -> bool:
    """Whether held-out emitters are predicted clearly better by what waves made, over all slices.

    A band begins with the image that the one before left, so that what bands of the speed gain multiplies.
    """
    gains = [
        math.prod(
            end.held / end.history[0].held
            for end in chain.ends
            if end.history and end.image.attenuation is None
        )
        for chain in chains
    ]
    return sum(gains) / len(gains) < CLEARLY


def _at(image: Image) -> tuple[float, tuple[float, float], tuple[int, ...]]:
    """The grid of an image."""
    return image.spacing, image.origin, image.speed.shape


def _slices(rays: Reconstruction, values: NDArray[np.float64]) -> list[Image]:
    """An array of a reconstruction as an image a slice."""
    origin = (rays.origin_m[0], rays.origin_m[1])
    every = np.moveaxis(np.atleast_3d(values), -1, 0)
    return [Image(np.ascontiguousarray(image), rays.spacing_m[0], origin) for image in every]


def _summary(rays: Reconstruction, plan: WaveSettings, chains: Sequence[RefinementGraph]) -> str:
    """What it began with and how each band predicted the emitters that were held out."""
    used = rays.settings
    text = f"begun from the image of {used.rays} rays ({used.method})"
    for number, band in enumerate(plan.bands):
        ends = [end for end in (chain.ends[number] for chain in chains) if end.history or not end.skipped]
        if ends:
            what = "attenuation (experimental), " if band.of == "attenuation" else ""
            corners = f"{1e-3 * band.low_hz:.0f} to {1e-3 * band.high_hz:.0f} kHz"
            text += f"; {what}{corners}: {_band_summary(ends)}"
    return text


def _band_summary(ends: Sequence[BandEnd]) -> str:
    """What a band gave, over all slices that reached it."""
    looked = [end for end in ends if end.history]
    if not looked:
        return "passed over, for its water shots could not be simulated"
    first, last = np.mean([(end.history[0].held, end.held) for end in looked], axis=0)
    text = f"misfit of held-out emitters {first:.2g}, then {last:.2g}"
    skipped = sum(end.skipped for end in looked)
    if skipped:
        where = f" in {skipped} slices" if len(ends) > 1 else ""
        text += f", stopped{where} as it rose: cycles were skipped, or noise was fitted"
    return text
