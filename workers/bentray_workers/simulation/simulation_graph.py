"""Task graph of a simulated scan: its parts into files, then the dataset of all parts."""

from pathlib import Path
from typing import Any

from bentray_kernels.task_graph import Task

from .assembly import write_scan
from .kinds import Simulated
from .parts import make_part, missing, parts_of


class SimulationGraph:
    """See ``task_graph.TaskGraph``; a finished part is a file, which a resumed run uses.

    Args:
        settings: of the scan.
        folder: for the parts; every worker can read and write there. It exists.
        target: the dataset file, replaced whole or not touched.

    Attributes:
        result: what ``assembly.write_scan`` returned; None before.
    """

    def __init__(self, settings: Simulated, folder: Path, target: Path) -> None:
        self._settings, self._folder, self._target = settings, folder, target
        parts = parts_of(settings)
        self._missing = list(missing(parts, folder))
        self.result: dict[str, Any] | None = None
        self.total = len(parts) + 1
        self.done = len(parts) - len(self._missing)

    def first(self) -> list[Task]:
        return [Task(make_part, (self._settings, part, self._folder)) for part in self._missing] or [
            self._write()
        ]

    def after(self, task: Task, result: Any) -> list[Task]:
        self.done += 1
        if task.function is write_scan:
            self.result = result
            return []
        return [self._write()] if self.done == self.total - 1 else []

    def _write(self) -> Task:
        return Task(write_scan, (self._settings, self._folder, self._target))
