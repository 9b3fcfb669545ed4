"""The whole refinement in this process: one band after the other, from a given image."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

from ...acquisition import Dataset
from ...errors import InvalidInput
from ..task_chains import Call
from .band_inversion import WaveIterate
from .inversion_state import BandEnd, Image
from .preparation import prepare
from .source_calibration import Mapping
from .waveform_chain import WaveChain, step_by_waves
from .waveform_problem import WaveProblem
from .waveform_settings import WaveSettings

# Called with the problem of the band under way and where it stands.
Progress = Callable[[WaveProblem, WaveIterate], None]


class Refined(NamedTuple):
    """What a refinement gave.

    Attributes:
        image: on the grid of the last band.
        bands: where each band ended.
        skipped: whether held-out emitters stopped one of the speed.
    """

    image: Image
    bands: tuple[BandEnd, ...]
    skipped: bool


class Here:
    """A slice of a scan in this process."""

    def __init__(
        self, dataset: Dataset, settings: WaveSettings, run: Mapping = map, *, index: int = 0
    ) -> None:
        self._settings = settings
        self._made = cache(lambda number: prepare(dataset.slice(index), settings, number, run=run))

    def settings(self) -> WaveSettings:
        return self._settings

    def problem(self, number: int) -> WaveProblem:
        found: WaveProblem = self._made(number)
        return found


def refine(
    dataset: Dataset,
    settings: WaveSettings,
    start: Image,
    *,
    run: Mapping = map,
    progress: Progress | None = None,
) -> Refined:
    """Refine an image until simulated traces agree with recorded ones.

    Args:
        dataset: one slice with traces of object and water.
        settings: how.
        start: image of rays; from plain water, cycles of the signal are skipped.
        run: ``map``, or that of a pool of threads: the kernels release the GIL.
        progress: called after every image.

    Raises:
        InvalidInput: as ``prepare``; for a start outside the bounds of speed.
    """
    low, high = settings.speed_bounds_mps
    if not ((start.speed >= low) & (start.speed <= high)).all():
        found = f"{start.speed.min():g} to {start.speed.max():g} m/s"
        raise InvalidInput("start", found, f"speeds from {low:g} to {high:g} m/s")
    scan = Here(dataset, settings, run)
    chain = WaveChain(scan, start)
    calls = chain.first()
    while calls:
        # One call alone runs in this thread: it may itself use ``run``, whose threads must not wait on it.
        given = [_made(calls[0])] if len(calls) == 1 else list(run(_made, calls))
        number, done = chain.number, calls
        calls = [after for call, value in zip(done, given, strict=True) for after in chain.after(call, value)]
        if progress is not None and done[0].function is step_by_waves:
            progress(scan.problem(number), given[0])
    skipped = any(end.skipped for end in chain.ends if end.image.attenuation is None)
    return Refined(chain.image, chain.ends, skipped)


def _made(call: Call) -> Any:
    return call.function(*call.arguments)
