"""Where a refinement stands: the band under way, what the bands before left."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...arrays import Floats
from . import band_inversion
from .band_inversion import Model, WaveIterate, WavePass


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
class BandEnd:
    """What a band left.

    Attributes:
        image: the image.
        skipped: whether held-out emitters ended the band, or one before it, so that it was left out.
        history: a record for each image that was looked at; none of a band that was passed over or left out.
    """

    image: Image
    skipped: bool
    history: tuple[WavePass, ...]

    @property
    def held(self) -> float:
        """Misfit of held-out emitters in that image; NaN where none was looked at."""
        if not self.history:
            return math.nan
        judged = self.skipped or self.image.attenuation is not None
        return self.history[band_inversion.given_by(self.history, judged=judged)].held


@dataclass(frozen=True)
class Entered:
    """The band under way, without its problem, which only tasks make.

    Attributes:
        state: where it stands.
        origin: of its grid, m.
        emitters: how many there are to look at in each iteration.
        frozen: (nx, ny), the speed where the attenuation is refined, m/s; else None.
    """

    state: WaveIterate
    origin: tuple[float, float]
    emitters: int
    frozen: Floats | None = None

    @property
    def model(self) -> Model:
        """What is to be looked at next."""
        if self.frozen is None:
            return Model(self.state.image)
        return Model(self.frozen, self.state.image)


@dataclass(frozen=True)
class RefinementCheckpoint:
    """State of a ``RefinementGraph``; see ``task_graph.Checkpoint``.

    Attributes:
        ends: of the bands before.
        band: the band under way; None between two.
    """

    ends: tuple[BandEnd, ...]
    band: Entered | None

    @property
    def state(self) -> WaveIterate | None:
        """Where the band under way stands."""
        return None if self.band is None else self.band.state

    @property
    def milestone(self) -> tuple[int, ...]:
        """As ``task_graph.Checkpoint``."""
        return len(self.ends), len(self.state.history) if self.state is not None else -1
