"""Task graph of the reflection image of one slice: travel times, the pulse, then sums over emissions."""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ...acquisition import Dataset
from ...arrays import Floats, Ints
from ...errors import InvalidInput
from ...opencl.lost_device import computed
from ...task_graph import Task
from ..result import Iteration
from ..scan import Source
from .delay_and_sum import PAIR_ANGLE_DEG, Signals, Sums, empty_sums, sum_echoes
from .delay_and_sum_opencl import sum_echoes_opencl
from .echoes import (
    Pulse,
    analytic,
    echo_window,
    high_pass,
    measure_pulse,
    upsampling,
    without_water_shot,
)
from .element_times import ElementTimes, joined, solve_times, times_between
from .reflection_plan import ReflectionPlan, emissions_per_task

# Elements whose travel times are solved in one task.
ELEMENTS = 16

# Emissions that the pulse is measured in.
PULSE_EMISSIONS = 8


@dataclass(frozen=True)
class ReflectionState:
    """Sums over the first emissions.

    Attributes:
        pulse: of the scan.
        batches: number of summed batches of emissions.
        of: number of all batches.
        echo, power, weight: as in ``delay_and_sum.Sums``.
    """

    pulse: Pulse
    batches: int
    of: int
    echo: Any
    power: Any
    weight: Any


@dataclass(frozen=True)
class ReflectionCheckpoint:
    """State of a ``ReflectionGraph``; see ``task_graph.Checkpoint``.

    Attributes:
        state: None until the pulse is measured.
    """

    state: ReflectionState | None

    @property
    def milestone(self) -> tuple[Any, ...]:
        # The sums are large: between quarters of the emissions they are saved by the clock.
        return (None if self.state is None else 4 * self.state.batches // self.state.of,)


# Records in checkpoints.
RECORDS = (ReflectionCheckpoint, ReflectionState, Pulse)


class ReflectionGraph:
    """Travel times of all elements, the pulse, and the emissions in batches, summed in their order.

    Args:
        at: source of the traces, and the slice.
        plan: of the image.
        samples: of each trace.
        rate_hz: of the traces.
        history: of the reconstruction, for its progress.

    Attributes:
        total: number of emissions.
        history: as given.
    """

    def __init__(
        self,
        at: tuple[Source, int],
        plan: ReflectionPlan,
        samples: int,
        rate_hz: float,
        history: tuple[Iteration, ...] = (),
    ) -> None:
        self._at, self._plan = at, plan
        self.history = history
        each = emissions_per_task(len(plan.receivers), samples * upsampling(rate_hz, plan.frequency_hz))
        emissions = plan.emissions
        if emissions.size == 0:
            raise InvalidInput("mask/valid", "no pair of two elements", "pairs with traces")
        self._batches = [emissions[k : k + each] for k in range(0, len(emissions), each)]
        self._groups = [slice(k, k + ELEMENTS) for k in range(0, len(plan.elements), ELEMENTS)]
        self._times: dict[int, Any] = {}
        self._waiting: dict[int, Sums] = {}
        self._state: ReflectionState | None = None
        self.total = len(emissions)

    @property
    def done(self) -> int:
        """Emissions that are computed."""
        summed = 0 if self._state is None else self._state.batches
        return sum(map(len, self._batches[:summed])) + sum(len(self._batches[k]) for k in self._waiting)

    @property
    def checkpoint(self) -> ReflectionCheckpoint:
        """The state, without sums that wait for those of earlier emissions."""
        return ReflectionCheckpoint(self._state)

    def restore(self, checkpoint: ReflectionCheckpoint) -> None:
        """See ``task_graph.ResumableGraph``."""
        self._state = checkpoint.state

    @property
    def sums(self) -> Sums:
        """Over the emissions so far."""
        state = self._state
        if state is None:
            return empty_sums(self._plan.pixels.inside.shape)
        return Sums(state.echo, state.power, state.weight)

    @property
    def pulse(self) -> Pulse | None:
        """Pulse of the scan, once it is measured."""
        return None if self._state is None else self._state.pulse

    def first(self) -> list[Task]:
        """See ``task_graph.TaskGraph``."""
        if self.done == self.total:
            return []
        plan = self._plan
        return [
            Task(
                solve_element_times,
                (plan.speed, plan.spacing, plan.elements[group], number),
                keep_on_worker=True,
            )
            for number, group in enumerate(self._groups)
        ]

    def after(self, task: Task, result: Any) -> list[Task]:
        """See ``task_graph.TaskGraph``."""
        if task.function is solve_element_times:
            self._times[task.arguments[-1]] = result
            if len(self._times) < len(self._groups):
                return []
            if self._state is None:
                return [Task(measure_scan_pulse, (self._at, self._plan, self._all_times))]
            return self._summing()
        if task.function is measure_scan_pulse:
            self._state = ReflectionState(
                result, 0, len(self._batches), *empty_sums(self._plan.pixels.inside.shape)
            )
            return self._summing()
        assert self._state is not None
        self._waiting[task.arguments[-1]] = result
        # In the order of the emitters, not of completion: floating-point sums depend on it.
        while (number := self._state.batches) in self._waiting:
            pairs = zip(self.sums, self._waiting.pop(number), strict=True)
            self._state = ReflectionState(
                self._state.pulse, number + 1, self._state.of, *(a + b for a, b in pairs)
            )
        if self.done == self.total:
            self._times = {}
        return []

    @property
    def _all_times(self) -> list[Any]:
        return [times for _, times in sorted(self._times.items())]

    def _summing(self) -> list[Task]:
        assert self._state is not None
        return [
            Task(
                sum_emissions,
                (self._at, self._plan, self._state.pulse, self._all_times, self._batches[number], number),
            )
            for number in range(self._state.batches, len(self._batches))
        ]


def solve_element_times(speed: Floats, spacing: float, elements: Floats, _number: int) -> ElementTimes:
    """Task: travel times of some elements to all nodes."""
    return solve_times(speed, spacing, elements)


def measure_scan_pulse(at: tuple[Source, int], plan: ReflectionPlan, times: list[ElementTimes]) -> Pulse:
    """Task: the pulse, from the water shot, else from waves transmitted through the object."""
    emissions = plan.emissions
    chosen = emissions[:: max(1, len(emissions) // PULSE_EMISSIONS)]
    with at[0].traces(at[1]) as dataset:
        recorded, rate = dataset.traces, dataset.rate_hz
        if recorded.water is not None:
            shots, expected = recorded.water, _water_times(plan, chosen)
        else:
            shots, expected = recorded.object, _transmitted(plan, times, chosen)
        # One emission at a time is in memory.
        traces = (high_pass(np.asarray(shots[e], np.float32), rate, plan.frequency_hz) for e in chosen)
        return measure_pulse(traces, expected, plan.used[chosen], _sample_times(dataset))


def sum_emissions(
    at: tuple[Source, int],
    plan: ReflectionPlan,
    pulse: Pulse,
    times: list[ElementTimes],
    emissions: Ints,
    _number: int,
) -> Sums:
    """Task: the sums over one batch of emissions."""
    transmitted = _transmitted(plan, times, emissions)
    with at[0].traces(at[1]) as dataset:
        signals = echo_signals(dataset, plan, pulse, transmitted, emissions)
    work = partial(
        sum_echoes_opencl if plan.engine == "opencl" else sum_echoes,
        signals,
        joined(times),
        plan.spacing,
        plan.emitters[emissions],
        plan.receivers,
        plan.pixels,
        PAIR_ANGLE_DEG,
    )
    # A device that fails leaves this batch to compiled code; the log says so.
    return computed(work)[0]


def echo_signals(
    dataset: Dataset, plan: ReflectionPlan, pulse: Pulse, transmitted_s: Floats, emissions: Ints
) -> Signals:
    """Analytic signals of some emissions without the waves that were transmitted.

    With a water shot also without the tails of these waves, see ``echoes.without_water_shot``.

    Args:
        dataset: the slice with its traces.
        plan: of the image.
        pulse: of the scan.
        transmitted_s: (emissions, nrx), travel times of the transmitted waves, s.
        emissions: indices.
    """
    recorded, rate = dataset.traces, dataset.rate_hz
    at = _sample_times(dataset)
    factor, period = upsampling(rate, plan.frequency_hz), 1.0 / plan.frequency_hz
    used = plan.used[emissions].copy()
    signals = np.zeros((len(emissions), len(plan.receivers), 2, factor * at.size), dtype=np.float32)
    for n, e in enumerate(emissions):
        traces = recorded.scale * np.asarray(recorded.object[e], dtype=np.float64)
        if recorded.object_scale is not None:
            traces *= recorded.object_scale[e][:, None]
        used[n] &= np.isfinite(traces).all(axis=1)
        traces[~used[n]] = 0.0
        traces = high_pass(traces, rate, plan.frequency_hz)
        window = echo_window(transmitted_s[n], pulse, at, period)
        if recorded.water is None:
            traces *= window
        else:
            # Its size cancels in the least squares.
            water = np.array(recorded.water[e], dtype=np.float64)
            water[~(used[n] & np.isfinite(water).all(axis=1))] = 0.0
            later = transmitted_s[n] - _water_times(plan, emissions[n : n + 1])[0]
            water = high_pass(water, rate, plan.frequency_hz, later)
            traces = without_water_shot(traces, water, transmitted_s[n] + pulse.delay_s, window, at, period)
        # The beginning of the window has made low frequencies again, of equal phase in all traces.
        signals[n] = analytic(high_pass(traces, rate, plan.frequency_hz), factor)
    # Beyond the record the nearest sample is read.
    signals[..., 0] = 0.0
    signals[..., -1] = 0.0
    return Signals(signals, used, at[0] - pulse.delay_s, factor * rate)


def _sample_times(dataset: Dataset) -> Floats:
    samples = dataset.traces.object.shape[-1]
    return dataset.t0_s + np.arange(samples, dtype=np.float64) / dataset.rate_hz


def _water_times(plan: ReflectionPlan, emissions: Ints) -> Floats:
    """Times along straight lines through water, (emissions, nrx), s."""
    sent, received = plan.elements[plan.emitters[emissions]], plan.elements[plan.receivers]
    return np.asarray(np.linalg.norm(sent[:, None] - received[None], axis=-1) / plan.water_mps)


def _transmitted(plan: ReflectionPlan, times: list[ElementTimes], emissions: Ints) -> Floats:
    """Predicted times of the first arrivals, (emissions, nrx), s."""
    whole = joined(times)
    which = plan.emitters[emissions]
    of_emitters = ElementTimes(whole.place[which], whole.slowness[which])
    return times_between(of_emitters, plan.spacing, plan.elements[plan.receivers] / plan.spacing)
