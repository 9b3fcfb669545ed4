"""Plan of a turntable: tasks, memory and counted work of its frames, checked against the workers."""

from collections.abc import Sequence
from dataclasses import dataclass

from ..cluster.capacities import MIB, WorkerCapacity
from ..cluster.task_costs import TaskPlan
from .picture_cost import Cost, check_memory, refraction_bytes, refraction_seconds
from .tiles import tile_rows
from .turntable import Turntable, draw_frame_tile, write_frame


@dataclass(frozen=True, kw_only=True)
class TurntablePlan(TaskPlan):
    """Tasks of a turntable and their cost.

    Attributes:
        work_class: turntables of one class take times in proportion to ``work_s``.
        work_s: time of the counted work on these workers, if they are idle cores of 2023.
        speed_known: as of plans of reconstructions.
    """

    decomposition: str = "frames"
    lane: str = "drawing"
    work_class: str
    work_s: float
    speed_known: bool = True


def plan_turntable(
    shape: Sequence[int], turntable: Turntable, capacities: Sequence[WorkerCapacity]
) -> TurntablePlan:
    """The plan of a turntable on the workers that are connected now.

    Args:
        shape: of the volume, (nx, ny, nz).
        turntable: what to draw.
        capacities: of the connected workers; without any, no limit is checked.

    Raises:
        InvalidInput: naming ``volume``, where no worker has enough memory, with the bytes found and accepted.
    """
    size = refraction_bytes(shape, turntable)
    check_memory("volume", f"shape {tuple(shape)}", Cost(0.0, size), capacities)
    able = sum(capacity.task_bytes >= size for capacity in capacities)
    scene, frame = refraction_seconds(shape, turntable)
    # Every worker filters the volume once.
    work = scene + turntable.frames * frame / max(1, able)
    tasks = turntable.frames * (len(tile_rows(turntable)) + 1) + 1
    where = f"on {able} of {len(capacities)} workers" if capacities else "on no worker yet"
    why = (
        f"{tasks} tasks for {turntable.frames} frames {where}; the largest (drawing rows of a frame) takes "
        f"{size / MIB:.0f} MiB."
    )
    name = "glass" if turntable.mode == "refract" else "lit surface"
    calls = {draw_frame_tile.__name__: size, write_frame.__name__: size}
    return TurntablePlan(
        tasks=tasks, workers=able, call_bytes=calls, why=why, work_class=f"turntable, {name}", work_s=work
    )
