"""Task graph of a full-waveform refinement of one slice through all its bands."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ...task_graph import Task
from ...wave.emissions import Engine
from ...wave.simulation import Unknown
from ..result import Iteration
from . import band_inversion
from .band_inversion import EmitterMisfit, InversionState, Model
from .grid_change import resampled, resampled_pairs
from .inversion_state import ActiveBand, BandEnd, Curvature, Image, RefinementCheckpoint
from .iterations import iteration_records
from .source_estimation import estimate_source
from .wave_scan import WaveScan
from .waveform_problem import WaveProblem
from .waveform_settings import WaveSettings

# Emitters of a task by engine: a device has many in flight.
EMITTERS_OF_A_TASK: dict[Engine, int] = {"compiled": 1, "opencl": 64}

# Bands whose simulated water shots have a lower correlation with the recorded ones are skipped: their waves
# are too long for the array and its absorbing edges, or were not emitted.
MIN_WATER_CORRELATION = 0.9


class RefinementGraph:
    """Task graph of all bands: simulations of single emitters in any order, then one update, repeatedly.

    Args:
        scan: see ``WaveScan``.
        start: the initial image.
        index: of the slice, for the history.
        earlier: history of the initial image and of other slices.
        stage: number of the first band among all stages.

    Attributes:
        ends: results of the finished bands.
    """

    def __init__(
        self,
        scan: WaveScan,
        start: Image,
        index: int = 0,
        earlier: tuple[Iteration, ...] = (),
        stage: int = 0,
    ) -> None:
        self._scan, self._start = scan, start
        self._index, self._earlier, self._stage = index, earlier, stage
        self._sizes = [band.evaluations(scan.plan.held_out) for band in scan.plan.bands]
        self.ends: tuple[BandEnd, ...] = ()
        self._band: ActiveBand | None = None
        self._misfits: dict[int, Any] = {}

    @property
    def number(self) -> int:
        """Number of the active band, from 0."""
        return len(self.ends)

    @property
    def over(self) -> bool:
        """Whether all bands are finished."""
        return self.number == len(self._sizes)

    @property
    def total(self) -> int:
        """Largest number of emitter passes, without those that an early end of a band has saved."""
        return self._finished + sum(self._sizes[self.number :])

    @property
    def done(self) -> int:
        """Emitter passes made, without those of shortened steps."""
        if self._band is None:
            return self._finished
        further = len(self._misfits) * self._emitters_of_a_task
        return self._finished + self._passes(self.number, len(self._band.state.history), further)

    @property
    def _finished(self) -> int:
        """Emitter passes of the finished bands."""
        return sum(self._passes(number, len(end.history)) for number, end in enumerate(self.ends))

    def _passes(self, number: int, iterations: int, further: int = 0) -> int:
        """Emitter passes of a band that has finished some iterations, at most the planned ones."""
        settings = self._scan.plan
        each = settings.bands[number].emitters + settings.held_out
        return min(each * iterations + min(further, each), self._sizes[number])

    @property
    def history(self) -> tuple[Iteration, ...]:
        """The earlier history, then one stage per band."""
        bands = [(end.history, end.given) for end in self.ends]
        if self._band is not None:
            bands.append((self._band.state.history, -1))
        records = list(self._earlier)
        for number, (history, given) in enumerate(bands):
            band, stage = self._scan.plan.bands[number], self._stage + number
            residual = next((record.residual_rms_s for record in reversed(records) if record.given), math.nan)
            records += iteration_records(band, history, self._index, stage, given, residual)
        return tuple(records)

    @property
    def image(self) -> Image:
        """The image of the last finished band."""
        return self.ends[-1].image if self.ends else self._start

    @property
    def checkpoint(self) -> RefinementCheckpoint:
        """The state, without misfits of an unfinished iteration."""
        return RefinementCheckpoint(self.ends, self._band)

    def restore(self, checkpoint: RefinementCheckpoint) -> None:
        """See ``task_graph.ResumableGraph``."""
        self.ends, self._band = checkpoint.ends, checkpoint.band

    def first(self) -> list[Task]:
        """See ``task_graph.TaskGraph``."""
        if self.over:
            return []
        if self._band is None:
            curvature = self.ends[-1].curvature if self.ends else None
            return [Task(start_band, (self._scan, self.number, self.image, curvature))]
        model, number = self._band.model, self._emitters_of_a_task
        return [
            Task(evaluate_emitter, (self._scan, self.number, model, first, number), keep_on_worker=True)
            for first in range(0, self._band.emitters, number)
        ]

    def after(self, task: Task, result: Any) -> list[Task]:
        """See ``task_graph.TaskGraph``."""
        if task.function is start_band:
            self._band = result
            if self.ends:
                self.ends = (*self.ends[:-1], replace(self.ends[-1], curvature=None))
            if result is None:
                self.ends = (*self.ends, BandEnd(self.image, skipped=False, history=()))
            return self.first()
        assert self._band is not None
        if task.function is evaluate_emitter:
            self._misfits[task.arguments[3]] = result
            if len(self._misfits) * self._emitters_of_a_task < self._band.emitters:
                return []
            # In the order of the emitters, not of completion: floating-point sums depend on it.
            misfits = [misfit for _, misfit in sorted(self._misfits.items())]
            return [Task(update_image, (self._scan, self.number, self._band.state, misfits))]
        self._misfits = {}
        self._band = replace(self._band, state=result)
        if result.done:
            grid = self._band.spacing, self._band.origin
            image, curvature = self._after_band(Image(result.image, *grid)), None
            if self._of == "speed" and len(result.steps):
                high_hz = self._scan.plan.bands[self.number].high_hz
                curvature = Curvature(result.steps, result.changes, *grid, high_hz)
            self.ends = (*self.ends, BandEnd(image, result.skipped, result.history, curvature))
            self._band = None
            # Further bands of the speed would skip more cycles or fit more noise.
            while result.skipped and not self.over and self._of == "speed":
                self.ends = (*self.ends, BandEnd(self.image, skipped=True, history=()))
        return self.first()

    @property
    def _emitters_of_a_task(self) -> int:
        return EMITTERS_OF_A_TASK[self._scan.plan.engine]

    @property
    def _of(self) -> Unknown:
        """The unknown of the active band."""
        return self._scan.plan.bands[self.number].of

    def _after_band(self, result: Image) -> Image:
        """The image after a band: its speed, or the previous image with its attenuation."""
        if self._of == "speed":
            return result
        speed = self.image
        attenuation = resampled(result, speed.spacing, speed.origin, speed.speed.shape)
        return replace(speed, attenuation=attenuation)


def start_band(
    scan: WaveScan, number: int, image: Image, curvature: Curvature | None = None
) -> ActiveBand | None:
    """Task: the initial state of a band; None if it is skipped, see ``MIN_WATER_CORRELATION``.

    Args:
        scan: of the refinement.
        number: of the band, from 0.
        image: to begin with.
        curvature: of the misfit in the band before, if that was one of the speed too.
    """
    problem = scan.problem(number)
    if problem.water_correlation < MIN_WATER_CORRELATION:
        return None
    count, models = len(band_inversion.emitters(problem)), starting_models(image, problem, scan.plan)
    start = models[0]
    if len(models) > 1 and problem.held.size:
        # A task that starts a band has no device.
        here = replace(scan.plan, engine="compiled")
        start = min(models, key=lambda model: held_out_misfit(problem, here, model))
    grid = problem.band.spacing_m, problem.origin
    if problem.band.of == "speed":
        state = band_inversion.begin(start.speed)
        if curvature is not None:
            steps, changes = resampled_pairs(curvature, problem.band.high_hz, *grid, problem.region)
            state = replace(state, steps=steps, changes=changes)
        return ActiveBand(state, *grid, count, None, start.wavelet)
    lossless = band_inversion.begin(np.zeros_like(start.speed))
    return ActiveBand(lossless, *grid, count, start.speed, start.wavelet)


def evaluate_emitter(scan: WaveScan, number: int, model: Model, first: int, count: int = 1) -> EmitterMisfit:
    """Task: misfit and gradient of some emitters, by their places among the band's emitters."""
    problem = scan.problem(number)
    emitters = band_inversion.emitters(problem)[first : first + count]
    return band_inversion.evaluate(problem, scan.plan, model, emitters)


def update_image(
    scan: WaveScan, number: int, state: InversionState, misfits: list[EmitterMisfit]
) -> InversionState:
    """Task: the next image."""
    return band_inversion.step(scan.problem(number), scan.plan, state, misfits)


def starting_models(image: Image, problem: WaveProblem, settings: WaveSettings) -> list[Model]:
    """An image on the grid of a problem: as it is, and with water in the nodes that no band changes.

    Those nodes are near the array. Water in the place of an object that reaches there would cause wrong
    speeds elsewhere, and the more the coarser the grid; but there the image of rays is least accurate. So
    held-out emitters decide. Each model has a source of its own where that is estimated.

    Returns:
        One model where both are the same.
    """
    low, high = settings.speed_bounds_mps
    speed = np.clip(resampled(image, problem.band.spacing_m, problem.origin, problem.region.shape), low, high)
    cleared = np.where(problem.region, speed, problem.water.speed)
    speeds = [speed] if np.array_equal(speed, cleared) else [speed, cleared]
    window = settings.window_s
    return [
        Model(speed, None, estimate_source(problem, speed, window) if settings.estimates_source else None)
        for speed in speeds
    ]


def held_out_misfit(problem: WaveProblem, settings: WaveSettings, model: Model) -> float:
    """Sum of the misfits of held-out emitters."""
    return band_inversion.evaluate(problem, settings, model, problem.held).held
