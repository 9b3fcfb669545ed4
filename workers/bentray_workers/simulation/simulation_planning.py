"""Plan of a simulated scan: tasks, memory, CPU time and file size, checked against the workers."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from bentray_kernels.errors import InvalidInput

from ..cluster.capacities import MIB, WorkerCapacity
from ..cluster.task_costs import TaskPlan, bytes_of, largest_of
from ..cluster.task_words import task_in_words
from ..files.hdf5_reading import Limits
from .cost import costly_setting, cpu_seconds, result_bytes, task_sizes
from .parts import count_of
from .request import PhantomScan

# Each part is a file that is written and read again.
MAX_TASKS = 200_000


@dataclass(frozen=True, kw_only=True)
class SimulationPlan(TaskPlan):
    """Tasks of a simulation and their cost.

    Attributes:
        result_bytes: of the file, at most; the parts take as much until the job ends.
        minutes: estimated duration on these workers, if they are idle cores of 2020.
    """

    decomposition: str = "emitters"
    lane: str = "recon"
    result_bytes: int
    minutes: float


def plan_simulation(request: PhantomScan, capacities: Sequence[WorkerCapacity]) -> SimulationPlan:
    """The plan of a simulation on the workers that are connected now.

    Args:
        request: the simulation.
        capacities: of the connected workers; without any, no limit is checked.

    Raises:
        InvalidInput: for tasks that no worker can run, and for a file too large to be read again, naming
            the setting with the largest effect.
    """
    settings = request.chosen()
    calls, size = bytes_of(task_sizes(settings)), result_bytes(settings)
    most = Limits().total_bytes
    if size > most:
        given = f"{settings.elements}, a file of {size} bytes"
        raise InvalidInput("elements", given, f"so few that the file has at most {most} bytes")
    able = [capacity for capacity in capacities if "recon" in capacity.resources]
    limit = max((capacity.task_bytes for capacity in able), default=math.inf)
    name, largest = largest_of(calls)
    if largest > limit:
        field = costly_setting(settings, name)
        given = (
            f"{getattr(settings, field):g}, for which a task ({task_in_words(name)}) takes {largest} bytes"
        )
        raise InvalidInput(field, given, f"settings whose tasks take at most {limit:.0f} bytes")
    tasks = count_of(settings) + 1
    if tasks > MAX_TASKS:
        raise InvalidInput("elements", f"{settings.elements}, {tasks} tasks", f"at most {MAX_TASKS} tasks")
    able = [capacity for capacity in able if capacity.task_bytes >= largest]
    shared, each = cpu_seconds(settings)
    minutes = (shared / max(1, len(able)) + each) / 60.0
    where = "on one worker; none is connected yet"
    if capacities:
        where = f"on {len(able)} of {len(capacities)} workers"
    why = (
        f"{tasks} tasks, about {_duration(minutes)} {where}; the largest ({task_in_words(name)}) takes "
        f"{largest / MIB:.0f} MiB, the file {size / MIB:.1f} MiB at most."
    )
    return SimulationPlan(
        tasks=tasks, workers=len(able), call_bytes=calls, why=why, result_bytes=size, minutes=minutes
    )


def _duration(minutes: float) -> str:
    return f"{60.0 * minutes:.0f} s" if minutes < 2.0 else f"{minutes:.0f} minutes"
