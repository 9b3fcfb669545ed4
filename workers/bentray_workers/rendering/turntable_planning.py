"""Plan of a turntable: tasks, memory and counted work of its frames, checked against the workers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from ..cluster.capacities import MIB, WorkerCapacity
from .picture_cost import Cost, check_memory, refraction_bytes, refraction_seconds
from .tiles import tile_rows
from .turntable import Turntable, draw_frame_tile, write_frame


@dataclass(frozen=True)
class TurntablePlan:
    """Tasks of a turntable and their cost.

    Attributes:
        tasks: number of tasks.
        workers: connected workers that can run each of them.
        call_bytes: memory of each kind of task.
        work_class: turntables of one class take times in proportion to ``work_s``.
        work_s: time of the counted work on these workers, if they are idle cores of 2023.
        why: summary in a sentence.
    """

    tasks: int
    workers: int
    call_bytes: Mapping[str, int]
    work_class: str
    work_s: float
    why: str

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON, with the names of plans of reconstructions."""
        sizes = {"call_bytes": dict(self.call_bytes), "largest_bytes": max(self.call_bytes.values())}
        return {**asdict(self), **sizes, "decomposition": "frames", "lane": "drawing", "speed_known": True}


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
    return TurntablePlan(tasks, able, calls, f"turntable, {name}", work, why)
