"""Task graph of a full-waveform refinement of one slice through all its bands."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from scipy.ndimage import map_coordinates

from ...arrays import Floats
from ...task_graph import Task
from ..result import Sweep
from . import band_inversion
from .band_inversion import EmitterMisfit, InversionState, Model
from .inversion_state import ActiveBand, BandEnd, Image, RefinementCheckpoint
from .iterations import iteration_records
from .waveform_problem import WaveProblem
from .waveform_settings import WaveSettings

# A band whose water shots are simulated with a lower correlation than this with the recorded ones is passed
# over: its waves are too long for the array and its absorbing edges, or were not sent.
LEAST_CORRELATION = 0.9


class WaveScan(Protocol):
    """Where calls find their data; it travels with them, so it holds a path or the dataset itself."""

    def settings(self) -> WaveSettings:
        """How to band_inversion."""

    def problem(self, number: int) -> WaveProblem:
        """The problem of a band, from 0; made once in a process."""


class RefinementGraph:
    """Task graph of all bands: simulations of single emitters in any order, then one update, repeatedly.

    Args:
        scan: see ``WaveScan``.
        start: the image to begin with.
        index: of the slice, for the history.
        earlier: what led to the start, and other slices; it comes first in the history.
        stage: number of the first band among all stages.

    Attributes:
        ends: where bands ended.
        total: emitter passes that it takes at most, but for shortened steps, which count as none.
    """

    def __init__(
        self,
        scan: WaveScan,
        start: Image,
        index: int = 0,
        earlier: tuple[Sweep, ...] = (),
        stage: int = 0,
    ) -> None:
        self._scan, self._start = scan, start
        self._index, self._earlier, self._stage = index, earlier, stage
        self._sizes = [band.evaluations(scan.settings().held_out) for band in scan.settings().bands]
        self.ends: tuple[BandEnd, ...] = ()
        self._band: ActiveBand | None = None
        self._looks: dict[int, Any] = {}
        self.total = sum(self._sizes)

    @property
    def number(self) -> int:
        """Of the band under way, from 0."""
        return len(self.ends)

    @property
    def over(self) -> bool:
        """Whether nothing is left to do."""
        return self.number == len(self._sizes)

    @property
    def done(self) -> int:
        """Emitter passes that are made, or that an early end made needless."""
        if self.over:
            return self.total
        passed = sum(self._sizes[: self.number])
        if self._band is None:
            return passed
        band = self._scan.settings().bands[self.number]
        each = band.emitters + self._scan.settings().held_out
        seen = each * len(self._band.state.history) + len(self._looks)
        return passed + min(seen, self._sizes[self.number])

    @property
    def history(self) -> tuple[Sweep, ...]:
        """What led to the start, then of each band a stage."""
        passes = [end.history for end in self.ends]
        if self._band is not None:
            passes.append(self._band.state.history)
        found = list(self._earlier)
        for number, of_band in enumerate(passes):
            skipped = number < self.number and self.ends[number].skipped
            over = number < self.number
            found += iteration_records(
                self._scan.settings(),
                number,
                of_band,
                self._index,
                self._stage + number,
                over=over,
                skipped=skipped,
                kept_s=next((s.residual_rms_s for s in reversed(found) if s.given), math.nan),
            )
        return tuple(found)

    @property
    def image(self) -> Image:
        """The image that the last finished band left."""
        return self.ends[-1].image if self.ends else self._start

    @property
    def checkpoint(self) -> RefinementCheckpoint:
        """The state, without misfits of an iteration that is not finished."""
        return RefinementCheckpoint(self.ends, self._band)

    def restore(self, checkpoint: RefinementCheckpoint) -> None:
        """As ``task_graph.ResumableGraph``."""
        self.ends, self._band = checkpoint.ends, checkpoint.band

    def first(self) -> list[Task]:
        """As ``task_graph.TaskGraph``."""
        if self.over:
            return []
        if self._band is None:
            return [Task(start_band, (self._scan, self.number, self.image))]
        model = self._band.model
        return [
            Task(evaluate_emitter, (self._scan, self.number, model, place), keep_on_worker=True)
            for place in range(self._band.emitters)
        ]

    def after(self, task: Task, result: Any) -> list[Task]:
        """As ``task_graph.TaskGraph``."""
        if task.function is start_band:
            self._band = result
            if result is None:
                self.ends = (*self.ends, BandEnd(self.image, skipped=False, history=()))
            return self.first()
        assert self._band is not None
        if task.function is evaluate_emitter:
            self._looks[task.arguments[-1]] = result
            if len(self._looks) < self._band.emitters:
                return []
            # In the order of the emitters, never in that of their coming.
            parts = [found for _, found in sorted(self._looks.items())]
            return [Task(update_image, (self._scan, self.number, self._band.state, parts))]
        self._looks = {}
        self._band = replace(self._band, state=result)
        if result.done:
            spacing = self._scan.settings().bands[self.number].spacing_m
            image = self._left(Image(result.image, spacing, self._band.origin))
            # The band is over, so that pairs of changes are not kept any longer.
            self.ends = (*self.ends, BandEnd(image, result.skipped, result.history))
            if result.skipped:
                self._leave_out()
            self._band = None
        return self.first()

    def _leave_out(self) -> None:
        """Go past further bands of the speed, which would skip more cycles or fit more noise."""
        while not self.over and self._scan.settings().bands[self.number].of == "speed":
            self.ends = (*self.ends, BandEnd(self.image, skipped=True, history=()))

    def _left(self, found: Image) -> Image:
        """The image after a band: the speed that it found, or the last one with the attenuation found."""
        if self._scan.settings().bands[self.number].of == "speed":
            return found
        last = self.image
        on_it = resampled(found, last.spacing, last.origin, last.speed.shape)
        return replace(last, attenuation=on_it)


def start_band(scan: WaveScan, number: int, image: Image) -> ActiveBand | None:
    """Task: what a band begins with; None where it is passed over, see ``LEAST_CORRELATION``."""
    problem = scan.problem(number)
    if problem.water_correlation < LEAST_CORRELATION:
        return None
    speed, count = on_grid(image, problem), len(band_inversion.emitters(problem))
    if problem.band.of == "speed":
        return ActiveBand(band_inversion.begin(speed), problem.origin, count)
    return ActiveBand(band_inversion.begin(np.zeros_like(speed)), problem.origin, count, speed)


def evaluate_emitter(scan: WaveScan, number: int, model: Model, place: int) -> EmitterMisfit:
    """Task: one emitter's look at an image, by its place among the band's emitters."""
    problem = scan.problem(number)
    return band_inversion.evaluate(
        problem, scan.settings(), model, band_inversion.emitters(problem)[place : place + 1]
    )


def update_image(
    scan: WaveScan, number: int, state: InversionState, parts: list[EmitterMisfit]
) -> InversionState:
    """Task: the next image."""
    return band_inversion.step(scan.problem(number), scan.settings(), state, parts)


def on_grid(image: Image, problem: WaveProblem) -> Floats:
    """An image on the grid of a problem, (nx, ny), m/s; water where nothing may change."""
    speed = resampled(image, problem.band.spacing_m, problem.origin, problem.region.shape)
    return np.where(problem.region, speed, problem.water.speed)


def resampled(image: Image, spacing: float, origin: tuple[float, float], shape: tuple[int, ...]) -> Floats:
    """An image on another grid, (nx, ny), m/s; beyond its own its outermost nodes go on."""
    lines = [
        (origin[axis] + spacing * np.arange(nodes) - image.origin[axis]) / image.spacing
        for axis, nodes in enumerate(shape)
    ]
    places = np.meshgrid(*lines, indexing="ij")
    # Cubic, for linear interpolation takes sharpness off at every change of grid; it may overshoot.
    speed = map_coordinates(image.speed, places, order=3, mode="nearest")
    return np.asarray(np.clip(speed, image.speed.min(), image.speed.max()))
