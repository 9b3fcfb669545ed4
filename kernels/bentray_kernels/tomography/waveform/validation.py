"""Whether waves through an image agree with recorded ones, on emitters that no refinement begins with."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...task_graph import Task
from ..result import Sweep
from .band_inversion import Model, look
from .inversion_state import Image
from .refinement_graph import WaveScan, on_grid
from .waveform_settings import WaveSettings

# The band of the continuation, from 1, that holds the middle of the pulse: there noise counts least.
WHOLE = 3

# Where water shots are simulated with a lower correlation than this nothing is said. Noise lowers it as well,
# and less is asked than of a band that refines: images are held against each other, and all hear the noise.
LEAST_LIKENESS = 0.7

# Emitters whose water shots tell the pulse; those that judge are the settings' ``held_out``.
SHOTS = 4


@dataclass(frozen=True)
class Judgement:
    """What waves say of an image; None where its water shots could not be simulated.

    Attributes:
        misfit: of held-out emitters through the image, a mean.
        water: of water shots in water: noise, and what the simulator cannot do.
    """

    misfit: float | None = None
    water: float | None = None


@dataclass(frozen=True)
class ValidationCheckpoint:
    """State of a ``Judge``; see ``task_graph.Checkpoint``."""

    state: Judgement | None

    @property
    def milestone(self) -> tuple[bool]:
        return (self.state is not None,)


class Judge:
    """The one task that judges an image; see ``task_graph.TaskGraph``.

    Args:
        scan: with the settings of ``judging``.
        image: to be judged.
        history: of what led to it.

    Attributes:
        total: emitter passes that it takes.
    """

    def __init__(self, scan: WaveScan, image: Image, history: tuple[Sweep, ...]) -> None:
        self._scan, self._image = scan, image
        self.history = history
        self.checkpoint = ValidationCheckpoint(None)
        self.total = passes(scan.settings())

    @property
    def done(self) -> int:
        return 0 if self.checkpoint.state is None else self.total

    @property
    def judgement(self) -> Judgement:
        """What waves say, once the call has been made."""
        assert self.checkpoint.state is not None
        return self.checkpoint.state

    def restore(self, checkpoint: ValidationCheckpoint) -> None:
        """As ``task_graph.ResumableGraph``."""
        self.checkpoint = checkpoint

    def first(self) -> list[Task]:
        """The call, unless it has been made."""
        return [Task(judge_by_waves, (self._scan, self._image))] if self.checkpoint.state is None else []

    def after(self, task: Task, result: Judgement) -> list[Task]:
        """Nothing follows it."""
        self.checkpoint = ValidationCheckpoint(result)
        return []


def judging(plan: WaveSettings) -> WaveSettings:
    """The settings of a refinement in the one band that judges, of a few emitters."""
    speed = [band for band in plan.bands if band.of == "speed"]
    return replace(plan, bands=(replace(speed[:WHOLE][-1], emitters=SHOTS),))


def passes(settings: WaveSettings) -> int:
    """Emitter passes of one judge."""
    return SHOTS + settings.held_out


def judge_by_waves(scan: WaveScan, image: Image) -> Judgement:
    """Task: what waves say of an image."""
    settings, problem = scan.settings(), scan.problem(0)
    if problem.likeness < LEAST_LIKENESS or not problem.held.size:
        return Judgement()
    model = Model(np.clip(on_grid(image, problem), *settings.speed_bounds_mps))
    held = look(problem, settings, model, problem.held).held / problem.held.size
    return Judgement(held, 1.0 - problem.likeness)
