"""State of a refinement: the active band and the results of finished bands."""

import math
from dataclasses import dataclass

from ...arrays import Floats
from .band_inversion import Evaluation, InversionState, Model, given_by


@dataclass(frozen=True)
class Image:
    """An image.

    Attributes:
        speed: (nx, ny), m/s.
        spacing: m.
        origin: position of node 0, m.
        attenuation: (nx, ny), beyond the water's, Np/m; None where it was not refined.
    """

    speed: Floats
    spacing: float
    origin: tuple[float, float]
    attenuation: Floats | None = None


@dataclass(frozen=True)
class Curvature:
    """Pairs of changes of a finished band, see ``lbfgs``.

    Attributes:
        steps: (pairs, nx, ny), changes of the image, m/s, oldest first.
        changes: (pairs, nx, ny), changes of the gradient, s/m.
        spacing: of the nodes, m.
        origin: position of node 0, m.
        high_hz: upper corner of the band, Hz.
    """

    steps: Floats
    changes: Floats
    spacing: float
    origin: tuple[float, float]
    high_hz: float


@dataclass(frozen=True)
class BandEnd:
    """Result of a band.

    Attributes:
        image: the image.
        skipped: whether the held-out misfit ended the band, or an earlier band so that this one was skipped.
        history: a record for each evaluated image; empty for a skipped band.
        curvature: of the misfit by the speed, until the next band has begun.
    """

    image: Image
    skipped: bool
    history: tuple[Evaluation, ...]
    curvature: Curvature | None = None

    @property
    def given(self) -> int:
        """Index of that image in the history; -1 where none was evaluated."""
        by_held_out = self.skipped or self.image.attenuation is not None
        return given_by(self.history, by_held_out=by_held_out) if self.history else -1

    @property
    def held(self) -> float:
        """Misfit of held-out emitters in that image; NaN where none was evaluated."""
        return self.history[self.given].held if self.history else math.nan


@dataclass(frozen=True)
class ActiveBand:
    """The active band, without its problem, which only tasks make.

    Attributes:
        state: of the inversion.
        spacing: of the nodes of its grid, m.
        origin: position of node 0, m.
        emitters: number evaluated in each iteration.
        frozen: (nx, ny), the fixed speed while the attenuation is refined, m/s; else None.
        wavelet: (steps,), the source, if it was estimated anew with the image reached so far.
    """

    state: InversionState
    spacing: float
    origin: tuple[float, float]
    emitters: int
    frozen: Floats | None = None
    wavelet: Floats | None = None

    @property
    def model(self) -> Model:
        """The model to evaluate next."""
        if self.frozen is None:
            return Model(self.state.image, None, self.wavelet)
        return Model(self.frozen, self.state.image, self.wavelet)


@dataclass(frozen=True)
class RefinementCheckpoint:
    """State of a ``RefinementGraph``; see ``task_graph.Checkpoint``.

    Attributes:
        ends: results of the finished bands.
        band: the active band; None between two bands.
    """

    ends: tuple[BandEnd, ...]
    band: ActiveBand | None

    @property
    def state(self) -> InversionState | None:
        """State of the active band."""
        return None if self.band is None else self.band.state

    @property
    def milestone(self) -> tuple[int, ...]:
        """See ``task_graph.Checkpoint``."""
        return len(self.ends), len(self.state.history) if self.state is not None else -1
