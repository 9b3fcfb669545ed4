"""Held-out validation of an image by simulated and recorded traces of emitters that are not used for it."""

from dataclasses import dataclass, replace

from ...task_graph import Task
from ..result import Iteration
from .inversion_state import Image
from .refinement_graph import held_out_misfit, starting_models
from .wave_scan import WaveScan
from .waveform_settings import WaveSettings

# Number of the band of the continuation, from 1, around the centre of the pulse, where noise matters least.
CENTRAL = 3

# No validation below this correlation of simulated and recorded water shots. Noise reduces it too; the limit
# is lower than that of a refined band, because all compared images have the same noise.
MIN_VALID_CORRELATION = 0.7

# Emitters whose water shots calibrate the source; held-out ones are the settings' ``held_out``.
SHOTS = 4


@dataclass(frozen=True)
class Validation:
    """Misfits of an image; None where its water shots could not be simulated.

    Attributes:
        misfit: mean over held-out emitters, through the image.
        water: of water shots in water: noise and errors of the simulator.
    """

    misfit: float | None = None
    water: float | None = None


@dataclass(frozen=True)
class ValidationCheckpoint:
    """State of a ``ValidationGraph``; see ``task_graph.Checkpoint``."""

    state: Validation | None

    @property
    def milestone(self) -> tuple[bool]:
        return (self.state is not None,)


class ValidationGraph:
    """The one task that validates an image; see ``task_graph.TaskGraph``.

    Args:
        scan: with the settings of ``validation_settings``.
        image: to be validated.
        history: of the image.

    Attributes:
        total: emitter passes.
    """

    def __init__(self, scan: WaveScan, image: Image, history: tuple[Iteration, ...]) -> None:
        self._scan, self._image = scan, image
        self.history = history
        self.checkpoint = ValidationCheckpoint(None)
        self.total = evaluations(scan.plan)

    @property
    def done(self) -> int:
        return 0 if self.checkpoint.state is None else self.total

    @property
    def validation(self) -> Validation:
        """The misfits, once the task has run."""
        assert self.checkpoint.state is not None
        return self.checkpoint.state

    def restore(self, checkpoint: ValidationCheckpoint) -> None:
        """See ``task_graph.ResumableGraph``."""
        self.checkpoint = checkpoint

    def first(self) -> list[Task]:
        """The task, unless it is finished."""
        return [Task(validate_image, (self._scan, self._image))] if self.checkpoint.state is None else []

    def after(self, task: Task, result: Validation) -> list[Task]:
        """No further task."""
        self.checkpoint = ValidationCheckpoint(result)
        return []


def validation_settings(plan: WaveSettings) -> WaveSettings:
    """The settings of a refinement restricted to the band of the validation, with a few emitters."""
    speed = [band for band in plan.bands if band.of == "speed"]
    return replace(plan, bands=(replace(speed[:CENTRAL][-1], emitters=SHOTS),))


def evaluations(settings: WaveSettings) -> int:
    """Emitter passes of one validation."""
    return SHOTS + settings.held_out


def validate_image(scan: WaveScan, image: Image) -> Validation:
    """Task: the misfits of an image."""
    settings, problem = scan.plan, scan.problem(0)
    if problem.water_correlation < MIN_VALID_CORRELATION or not problem.held.size:
        return Validation()
    models = starting_models(image, problem, settings)
    held = min(held_out_misfit(problem, settings, model) for model in models)
    return Validation(held / problem.held.size, 1.0 - problem.water_correlation)
