"""A refinement through all its bands, as calls that may run anywhere; see ``tomography.chains``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from scipy.ndimage import map_coordinates

from ..arrays import Floats
from ..tomography.chains import Call
from . import refine
from .problem import WaveProblem
from .refine import Iterate, Look
from .settings import WaveSettings


class Image(NamedTuple):
    """A speed image.

    Attributes:
        speed: (nx, ny), m/s.
        spacing: m.
        origin: position of node 0, m.
    """

    speed: Floats
    spacing: float
    origin: tuple[float, float]


class WaveScan(Protocol):
    """Where calls find their data; it travels with them, so it holds a path or the dataset itself."""

    def settings(self) -> WaveSettings:
        """How to refine."""

    def problem(self, number: int) -> WaveProblem:
        """The problem of a band, from 0; made once in a process."""


@dataclass(frozen=True)
class Standing:
    """Where a chain stands between two images; all that is needed to go on, to the bit.

    Attributes:
        ends: of the bands before.
        state: of the band under way.
    """

    ends: tuple[Iterate, ...]
    state: Iterate


class WaveChain:
    """The calls of all bands: looks of single emitters in any order, then one step, again and again.

    Attributes:
        ends: where bands ended.
        state: of the band under way; None before it is entered.
    """

    def __init__(self, scan: WaveScan, start: Image) -> None:
        self._scan, self._start = scan, start
        self.ends: tuple[Iterate, ...] = ()
        self.state: Iterate | None = None
        self._looks: dict[int, Look] = {}

    @property
    def number(self) -> int:
        """Of the band under way, from 0."""
        return len(self.ends)

    @property
    def over(self) -> bool:
        """Whether nothing is left to do: all bands are gone through, or held-out emitters ended it."""
        bands = len(self._scan.settings().bands)
        return self.number == bands or bool(self.ends and self.ends[-1].skipped)

    @property
    def image(self) -> Image:
        """The image that the last finished band left."""
        if not self.ends:
            return self._start
        problem = self._scan.problem(self.number - 1)
        return Image(self.ends[-1].speed, problem.band.spacing_m, problem.origin)

    @property
    def standing(self) -> Standing | None:
        """Where it stands, to be kept, without looks that wait for others; None between bands."""
        return None if self.state is None else Standing(self.ends, self.state)

    def restore(self, standing: Standing) -> None:
        """Go on from where a chain of the same scan stood; to be called before ``first``."""
        self.ends, self.state = standing.ends, standing.state

    def first(self) -> list[Call]:
        """Calls to begin with, or to go on with after ``restore``."""
        if self.over:
            return []
        if self.state is None:
            return [Call(enter, (self._scan, self.number, self.image))]
        if self.state.done:
            return self._next()
        count = len(refine.emitters(self._scan.problem(self.number)))
        return [Call(look, (self._scan, self.number, self.state.speed, place)) for place in range(count)]

    def after(self, call: Call, given: Any) -> list[Call]:
        """Calls that may follow one that has finished.

        Args:
            call: the one that has finished.
            given: what it gave.
        """
        if call.function is look:
            self._looks[call.arguments[-1]] = given
            if len(self._looks) < len(refine.emitters(self._scan.problem(self.number))):
                return []
            # In the order of the emitters, never in that of their coming.
            looks = [found for _, found in sorted(self._looks.items())]
            self._looks = {}
            return [Call(step, (self._scan, self.number, self.state, looks))]
        self.state = given
        return self.first()

    def _next(self) -> list[Call]:
        assert self.state is not None
        self.ends = (*self.ends, self.state)
        self.state = None
        return self.first()


def enter(scan: WaveScan, number: int, image: Image) -> Iterate:
    """Call: the state that a band begins with."""
    return refine.begin(on_grid(image, scan.problem(number)))


def look(scan: WaveScan, number: int, speed: Floats, place: int) -> Look:
    """Call: one emitter's look at an image, by its place among the band's emitters."""
    problem = scan.problem(number)
    return refine.look(problem, scan.settings(), speed, refine.emitters(problem)[place : place + 1])


def step(scan: WaveScan, number: int, state: Iterate, looks: list[Look]) -> Iterate:
    """Call: the next image."""
    return refine.step(scan.problem(number), scan.settings(), state, looks)


def on_grid(image: Image, problem: WaveProblem) -> Floats:
    """An image on the grid of a problem, (nx, ny), m/s; water where nothing may change."""
    lines = [
        (problem.origin[axis] + problem.band.spacing_m * np.arange(nodes) - image.origin[axis])
        / image.spacing
        for axis, nodes in enumerate(problem.region.shape)
    ]
    places = np.meshgrid(*lines, indexing="ij")
    # Cubic, for linear interpolation takes sharpness off at every change of grid; it may overshoot.
    speed = map_coordinates(image.speed, places, order=3, mode="nearest")
    speed = np.clip(speed, image.speed.min(), image.speed.max())
    return np.where(problem.region, speed, problem.water.speed)
