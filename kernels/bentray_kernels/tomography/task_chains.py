"""What is to be done for one slice or volume, as calls that may run anywhere.

A chain says which calls may run now, takes what they gave, and says which may follow. It never runs one: a
loop in this process does, or a cluster.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol, runtime_checkable

from ..arrays import Floats, Ints
from . import attenuation, resolution
from .finite_frequency import nodes_wide
from .gauss_newton import gauss_newton_step
from .gauss_newton.linearisation import Rows
from .grid_schedule import start
from .problem import Problem
from .result import Progress, Sweep
from .sart import sart_step
from .settings import Settings

# Long enough that scheduling costs nothing, short enough to show progress and to stop soon.
TASK_S = 0.5
# Nodes that the wave fronts of a first batch pass, a tenth of a second or so; then the clock tells.
FIRST_NODES = 2_000_000

# Emitters whose rays are traced in one call of Gauss–Newton, and after the last image.
BATCH = 16


class Scan(Protocol):
    """Where calls find their data; it travels with them, so it holds a path or the dataset itself."""

    def stages(self) -> tuple[Settings, ...]:
        """Settings of each stage, see ``grid_schedule``."""

    def problem(self, index: int, stage: int = -1) -> Problem:
        """The problem of one slice at a stage, the last by default; made once."""


class Call(NamedTuple):
    """A call that may run now.

    Attributes:
        keep: what it gives is needed by other calls only and may stay where it was made; ``Chain.after`` is
            then given a handle, which stands for the value among the arguments of later calls.
    """

    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    keep: bool = False


@runtime_checkable
class Standing(Protocol):
    """Where a chain stands; all that is needed to go on, to the bit."""

    @property
    def state(self) -> Any:
        """Where what is under way stands; another object as soon as it moves."""

    @property
    def passed(self) -> tuple[Any, ...]:
        """What differs as soon as a pass, a stage or what follows them is finished."""


class Calls(Protocol):
    """What is to be done, call by call: a ``Chain``, or what goes on from the image of one.

    Attributes:
        done, total: emitter passes that are made, or that an early end made needless; of how many at most.
        history: of all stages so far.
        standing: where it stands, to be kept.
    """

    @property
    def done(self) -> int: ...
    @property
    def total(self) -> int: ...
    @property
    def history(self) -> tuple[Sweep, ...]: ...
    @property
    def standing(self) -> Standing: ...

    def restore(self, standing: Any) -> None:
        """Go on from where a chain of the same scan and index stood; to be called before ``first``."""

    def first(self) -> list[Call]:
        """Calls to begin with, or to go on with after ``restore``."""

    def after(self, call: Call, given: Any) -> list[Call]:
        """Calls that may follow one that has finished.

        Args:
            call: the one that has finished.
            given: what it gave, or its handle where ``call.keep``.
        """


# Runs chains to their end, and tells the passes done of all after each call; the numbers are of passes made
# before and of those that come after, at most.
Drive = Callable[[Sequence[Calls], int, int], None]


@dataclass(frozen=True)
class ChainState:
    """Where a chain stands; all that is needed to go on, to the bit.

    Attributes:
        number: of the stage under way, from 0.
        over: emitter passes of the stages before it.
        history: of the stages before it.
        state: where it stands.
        found: what each call after the last stage gave; None: nothing yet.
    """

    number: int
    over: int
    history: tuple[Sweep, ...]
    state: sart_step.State | gauss_newton_step.Iterate
    found: tuple[Floats | float | None, ...]

    @property
    def passed(self) -> tuple[Any, ...]:
        """What differs as soon as a pass, a stage or what follows them is finished."""
        return (
            self.number,
            self.state.sweep,
            self.state.done,
            tuple(value is not None for value in self.found),
        )


class Chain:
    """All stages of one slice, then its attenuation and resolution where they are wanted.

    Attributes:
        total: emitter passes that it takes at most.
    """

    def __init__(self, scan: Scan, index: int) -> None:
        self._scan, self._index = scan, index
        self._plans = scan.stages()
        self._history: tuple[Sweep, ...] = ()
        self._over = 0
        self._stage = self._staged(0, start(scan.problem(index, 0), None))
        self._finish = self._gatherings()
        self.total = sum(
            len(scan.problem(index, number).sounding) * plan.sweeps for number, plan in enumerate(self._plans)
        )
        self.total += sum(sum(part.sizes) for part in self._finish)

    def _gatherings(self) -> list[Gathering]:
        """What is read along the finished image's rays."""
        settings, problem = self._plans[-1], self._scan.problem(self._index)
        wanted = []
        if settings.attenuation and problem.log_ratio is not None:
            wanted.append(Gathering(look_losses, attenuate, attenuation.heard(problem)))
        if settings.resolution_check:
            wanted.append(Gathering(look_again, recover, problem.sounding))
        return wanted

    @property
    def done(self) -> int:
        """Emitter passes that are made, or that an early end made needless."""
        return self._over + self._stage.done + sum(part.done for part in self._finish)

    @property
    def state(self) -> sart_step.State | gauss_newton_step.Iterate:
        """Where the stage under way stands."""
        return self._stage.state

    def found(self, then: Callable[..., Any]) -> Any:
        """What a call after the last stage gave; None before it has, and where it is not wanted."""
        return next((part.value for part in self._finish if part.then is then), None)

    @property
    def history(self) -> tuple[Sweep, ...]:
        """Of all stages so far."""
        return self._history + self._stage.history

    @property
    def standing(self) -> ChainState:
        """Where the chain stands; rows of an iteration that is not finished are not in it."""
        found = tuple(part.value for part in self._finish)
        return ChainState(self._stage.number, self._over, self._history, self._stage.state, found)

    def restore(self, standing: ChainState) -> None:
        """Go on from where a chain of the same scan and index stood; to be called before ``first``."""
        self._history, self._over = standing.history, standing.over
        self._stage = self._staged(standing.number, standing.state.slowness)
        self._stage.state = standing.state
        for part, value in zip(self._finish, standing.found, strict=True):
            part.value = value

    def first(self) -> list[Call]:
        """Calls to begin with, or to go on with after ``restore``."""
        return self._next() if self._stage.state.done else self._stage.first()

    def after(self, call: Call, given: Any) -> list[Call]:
        """Calls that may follow one that has finished.

        Args:
            call: the one that has finished.
            given: what it gave, or its handle where ``call.keep``.
        """
        for part in self._finish:
            if call.function in (part.look, part.then):
                return part.after(call, given)
        follow = self._stage.after(call, given)
        return follow if follow or not self._stage.state.done else self._next()

    def _next(self) -> list[Call]:
        """What follows a stage that is done."""
        image, number = self._stage.state.slowness, self._stage.number + 1
        if number == len(self._plans):
            wanted = [part for part in self._finish if part.value is None]
            return [call for part in wanted for call in part.first(self._scan, self._index, image)]
        self._history = self.history
        self._over += self._stage.total
        earlier, problem = (self._scan.problem(self._index, k) for k in (number - 1, number))
        self._stage = self._staged(number, start(problem, image, earlier))
        return self._stage.first()

    def _staged(self, number: int, begun: Floats) -> Stage:
        kind = GaussNewtonStage if self._plans[number].method == "gauss-newton" else SartStage
        return kind(self._scan, self._index, number, begun)


class Gathering:
    """Rows of all emitters along the finished image, then one call that uses them all.

    Attributes:
        look, then: the two calls.
        sizes: emitters of each part.
        value: what ``then`` gave.
    """

    def __init__(self, look: Callable[..., Rows], then: Callable[..., Any], emitters: Ints) -> None:
        self.look, self.then = look, then
        self.sizes = [len(part) for part in cut(emitters)]
        self.value: Any = None
        self._rows: dict[int, Any] = {}

    @property
    def done(self) -> int:
        """Emitters looked at."""
        return sum(
            self.sizes[part] for part in (range(len(self.sizes)) if self.value is not None else self._rows)
        )

    def first(self, scan: Scan, index: int, image: Floats) -> list[Call]:
        """Calls to begin with; without emitters the one that uses their rows, which are none."""
        if not self.sizes:
            return [Call(self.then, (scan, index, []))]
        return [Call(self.look, (scan, index, image, part), keep=True) for part in range(len(self.sizes))]

    def after(self, call: Call, given: Any) -> list[Call]:
        """Keep one part's rows; with the last part, the call that uses them all."""
        if call.function is self.then:
            self.value, self._rows = given, {}
            return []
        scan, index, _, part = call.arguments
        self._rows[part] = given
        if len(self._rows) < len(self.sizes):
            return []
        return [Call(self.then, (scan, index, [rows for _, rows in sorted(self._rows.items())]))]


class Stage(ABC):
    """The calls of one stage.

    Attributes:
        number: from 0.
        state: where it stands.
        total: emitter passes that it takes at most.
    """

    state: sart_step.State | gauss_newton_step.Iterate

    def __init__(self, scan: Scan, index: int, number: int) -> None:
        self._at = scan, index, number
        self.number = number
        problem = scan.problem(index, number)
        self._emitters = len(problem.sounding)
        self.total = self._emitters * scan.stages()[number].sweeps

    @property
    def done(self) -> int:
        """Emitter passes that are made, or that an early end made needless."""
        if self.state.done:
            return self.total
        return self._emitters * self.state.sweep + self.state.emitter

    @property
    def history(self) -> tuple[Sweep, ...]:
        """Of this stage."""
        return tuple(replace(sweep, stage=self.number) for sweep in self.state.history)

    @abstractmethod
    def first(self) -> list[Call]:
        """Calls to begin with."""

    @abstractmethod
    def after(self, call: Call, given: Any) -> list[Call]:
        """As ``Chain.after``."""


class SartStage(Stage):
    """Batches of emitters, each used on the image that the one before left."""

    def __init__(self, scan: Scan, index: int, number: int, image: Floats) -> None:
        super().__init__(scan, index, number)
        self.state: sart_step.State = sart_step.begin(image)
        self._batch = max(1, FIRST_NODES // image.size)

    def first(self) -> list[Call]:
        return [Call(advance, (*self._at, self.state, self._batch))]

    def after(self, call: Call, given: Any) -> list[Call]:
        used = -self.state.emitter
        self.state, seconds = given
        self._batch = next_batch(self._batch, used + self.state.emitter, seconds)
        return [] if self.state.done else self.first()


class GaussNewtonStage(Stage):
    """The rays of all emitters in any order, then one step from all of them, again and again."""

    def __init__(self, scan: Scan, index: int, number: int, image: Floats) -> None:
        super().__init__(scan, index, number)
        self.state: gauss_newton_step.Iterate = gauss_newton_step.begin(image)
        self._sizes = [len(part) for part in cut(scan.problem(index, number).sounding)]
        self._rows: dict[int, Any] = {}

    @property
    def done(self) -> int:
        return super().done + (0 if self.state.done else sum(self._sizes[part] for part in self._rows))

    def first(self) -> list[Call]:
        # Without what only the step needs.
        image = self.state.slowness
        return [Call(look, (*self._at, image, part), keep=True) for part in range(len(self._sizes))]

    def after(self, call: Call, given: Any) -> list[Call]:
        if call.function is look:
            self._rows[call.arguments[-1]] = given
            if len(self._rows) < len(self._sizes):
                return []
            return [Call(step, (*self._at, self.state, [rows for _, rows in sorted(self._rows.items())]))]
        self.state, self._rows = given, {}
        return [] if self.state.done else self.first()


def advance(
    scan: Scan, index: int, stage: int, state: sart_step.State, emitters: int
) -> tuple[sart_step.State, float]:
    """Call: use more emitters of one slice; returns the new state and the seconds it took."""
    begun = time.perf_counter()
    problem = scan.problem(index, stage)
    state = sart_step.advance(problem, scan.stages()[stage], state, emitters, index)
    return state, time.perf_counter() - begun


def look(scan: Scan, index: int, stage: int, slowness: Floats, part: int) -> Rows:
    """Call: the rays of one batch of emitters through an image."""
    problem = scan.problem(index, stage)
    return gauss_newton_step.look(problem, scan.stages()[stage], slowness, cut(problem.sounding)[part])


def step(
    scan: Scan, index: int, stage: int, state: gauss_newton_step.Iterate, rows: list[Rows]
) -> gauss_newton_step.Iterate:
    """Call: the next image."""
    return gauss_newton_step.step(scan.problem(index, stage), scan.stages()[stage], state, rows, index)


def look_losses(scan: Scan, index: int, slowness: Floats, part: int) -> Rows:
    """Call: as ``look`` for the amplitudes, through the finished image."""
    problem = scan.problem(index)
    emitters = cut(attenuation.heard(problem))[part]
    return attenuation.look(problem, scan.stages()[-1], slowness, emitters)


def attenuate(scan: Scan, index: int, rows: list[Rows]) -> Floats:
    """Call: the attenuation."""
    return attenuation.attenuation(scan.problem(index), scan.stages()[-1], rows)


def look_again(scan: Scan, index: int, slowness: Floats, part: int) -> Rows:
    """Call: as ``look`` through the finished image."""
    problem = scan.problem(index)
    return resolution.look(problem, scan.stages()[-1], slowness, cut(problem.sounding)[part])


def measured(chains: Sequence[Calls], before: int = 0, after: int = 0) -> Progress:
    """Progress over all chains and passes before and after them; a stage that ended early counts as whole."""
    history = sorted((s for c in chains for s in c.history), key=lambda s: (s.stage, s.sweep, s.slice))
    done, total = (before + sum(getattr(c, name) for c in chains) for name in ("done", "total"))
    return Progress(done, total + after, tuple(history))


def recover(scan: Scan, index: int, rows: list[Rows]) -> Floats:
    """Call: the resolution check."""
    problem = scan.problem(index)
    return resolution.recovery(problem, rows, nodes_wide(problem, scan.stages()[-1]))


def next_batch(batch: int, used: int, seconds: float) -> int:
    """Emitters that take about ``TASK_S``; a batch that ended with its sweep tells too little."""
    if used != batch or seconds <= 0.0:
        return batch
    return max(1, min(4 * batch, int(batch * TASK_S / seconds)))


def cut(emitters: Ints) -> list[Ints]:
    """``BATCH`` emitters at a time."""
    return [emitters[k : k + BATCH] for k in range(0, len(emitters), BATCH)]
