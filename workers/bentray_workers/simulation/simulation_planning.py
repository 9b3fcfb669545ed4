"""What a simulated scan will take, computed before it starts, and whether the workers and a disk have it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from bentray_kernels.errors import InvalidInput

from ..cluster.capacities import MIB, Offer
from ..files.hdf5_reading import Limits
from .cost import costly_setting, cpu_seconds, result_bytes, task_bytes
from .parts import count_of
from .request import AskedSimulation

# A file of its own for each part, and each read again: more than this no disk is glad of.
MOST_TASKS = 200_000


@dataclass(frozen=True)
class SimulationPlan:
    """How a simulation is cut into tasks and what it takes.

    Attributes:
        tasks: how many there are.
        workers: how many are connected and can hold each of them.
        call_bytes: of each kind of task.
        result_bytes: of the file, at most; as much is kept beside it until the job ends.
        minutes: about how long these workers take, were they cores of 2020 with nothing else to do.
        why: all of it in a sentence.
    """

    tasks: int
    workers: int
    call_bytes: Mapping[str, int]
    result_bytes: int
    minutes: float
    why: str

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON, with the names that plans of reconstructions have."""
        sizes = {"call_bytes": dict(self.call_bytes), "largest_bytes": max(self.call_bytes.values())}
        return {**asdict(self), **sizes, "decomposition": "emitters", "lane": "recon"}


def plan_simulation(asked: AskedSimulation, offers: Sequence[Offer]) -> SimulationPlan:
    """The plan of a simulation on the workers that are connected now.

    Args:
        asked: what is to be simulated.
        offers: the connected workers; none says nothing, for some may come.

    Raises:
        InvalidInput: for tasks that no worker can hold, and for a scan that nobody could read again, naming
            the setting that costs most.
    """
    settings = asked.chosen()
    calls, size = task_bytes(settings), result_bytes(settings)
    most = Limits().total_bytes
    if size > most:
        found = f"{settings.elements}, a file of {size} bytes"
        raise InvalidInput("elements", found, f"so few that the file has at most {most} bytes")
    fitting = [offer for offer in offers if "recon" in offer.lanes]
    room = max((offer.task_bytes for offer in fitting), default=math.inf)
    name, largest = max(calls.items(), key=lambda item: item[1])
    if largest > room:
        field = costly_setting(settings, name)
        found = f"{getattr(settings, field):g}, for which a task ({name}) takes {largest} bytes"
        raise InvalidInput(field, found, f"settings whose tasks take at most {room:.0f} bytes")
    tasks = count_of(settings) + 1
    if tasks > MOST_TASKS:
        raise InvalidInput("elements", f"{settings.elements}, {tasks} tasks", f"at most {MOST_TASKS} tasks")
    able = [offer for offer in fitting if offer.task_bytes >= largest]
    shared, each = cpu_seconds(settings)
    minutes = (shared / max(1, len(able)) + each) / 60.0
    who = f"on {len(able)} of {len(offers)} workers" if offers else "on one worker; none is connected yet"
    why = (
        f"{tasks} tasks, about {_told(minutes)} {who}; the largest ({name}) takes {largest / MIB:.0f} MiB, "
        f"the file {size / MIB:.1f} MiB at most."
    )
    return SimulationPlan(tasks, len(able), calls, size, minutes, why)


def _told(minutes: float) -> str:
    return f"{60.0 * minutes:.0f} s" if minutes < 2.0 else f"{minutes:.0f} minutes"
