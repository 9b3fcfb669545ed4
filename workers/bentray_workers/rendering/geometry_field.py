"""Computation of a geometry field: layout, table rows in batches, accuracy, kept as a folder of files."""

import errno
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Unpack

from distributed import Client

from bentray_kernels.task_graph import Task
from bentray_kernels.tomography import Progress

from ..cluster.resources import DRAWING
from ..cluster.task_pool import JobControl, run_job
from ..files.atomic import sync
from ..files.geometry_field_folder import FieldFiles, read_json
from .field_settings import FieldSettings
from .field_tasks import SAMPLING, TASK_RAYS, finish, inner_rows, outer_rows, parameterise_mesh


class GeometryFieldGraph:
    """Task graph: the layout, rows of both tables, then borders and accuracy.

    Args:
        mesh_path: of a mesh file, readable by every worker.
        settings: of the field.
        work_dir: a folder which every worker can read and write. Layout and rows that an unfinished run of
            the same mesh and settings left there are used.

    Attributes:
        folder: of the field while it is computed.
    """

    def __init__(self, mesh_path: Path, settings: FieldSettings, work_dir: Path) -> None:
        self.folder, self._finished_batches = work_dir / "field", work_dir / "done"
        for folder in (self.folder, self._finished_batches):
            folder.mkdir(exist_ok=True)
        self._mesh_path, self._settings = mesh_path, settings
        self._files = FieldFiles(self.folder)
        self.done = self.total = 0
        self._first = self._remaining()

    def progress(self) -> Progress:
        """The stage with its count: those of the layout are read from the file of its task."""
        if self.total:
            return Progress(self.done, self.total, phase=SAMPLING)
        with suppress(OSError, ValueError):
            return Progress(**read_json(self._files.stage))
        return Progress(0, 0)

    def first(self) -> list[Task]:
        return self._first

    def after(self, task: Task, result: Any) -> list[Task]:
        if task.function is parameterise_mesh:
            return self._remaining()
        self.done += 1
        return [self._finish()] if self.done == self.total - 1 else []

    def _remaining(self) -> list[Task]:
        """Tasks that can run now, by the files that exist."""
        if not self._files.layout.exists():
            return [Task(parameterise_mesh, (self._mesh_path, self._settings, self.folder))]
        if self._files.figures.exists():
            self.done = self.total = 1
            return []
        batches = self._batches()
        missing = [task for task in batches if not task.arguments[-1].exists()]
        # The layout comes before them, the last task after them.
        self.done, self.total = 1 + len(batches) - len(missing), len(batches) + 2
        return missing or [self._finish()]

    def _finish(self) -> Task:
        return Task(finish, (self.folder, self._settings, self._finished_batches))

    def _batches(self) -> list[Task]:
        """Rows of both tables; the last argument of each is the file that marks it as finished."""
        outer, inner = self._settings.samples, self._settings.inner_samples
        fields: tuple[tuple[Callable[..., None], str, int, int], ...] = (
            (outer_rows, "outer", outer, 6 * outer**2),
            (inner_rows, "inner", inner, read_json(self._files.layout)["points"]),
        )
        tasks = []
        for function, name, n, rows in fields:
            step = max(1, TASK_RAYS // (6 * n * n))
            for first in range(0, rows, step):
                mark = self._finished_batches / f"{name}-{first:05d}.json"
                tasks.append(Task(function, (self.folder, n, first, min(first + step, rows), mark)))
        return tasks


def build_field(
    client: Client | None,
    mesh_path: Path,
    settings: FieldSettings,
    target: Path,
    work_dir: Path,
    **control: Unpack[JobControl],
) -> dict[str, Any]:
    """Compute the geometry field of a mesh; an existing one is used as it is.

    Args:
        client: of a cluster; None: the cores of this process.
        mesh_path: of a mesh file, readable by every worker.
        settings: of the field.
        target: the folder of the field; it appears whole or not at all.
        work_dir: a folder of the same file system, see ``GeometryFieldGraph``.
        control: see ``JobControl``.

    Returns:
        The figures of the field: sizes, errors and seconds.

    Raises:
        Cancelled: when ``stop`` returned true.
        InvalidInput: from the mesh or the settings.
    """
    if not target.exists():
        graph = GeometryFieldGraph(mesh_path, settings, work_dir)
        where, now = {"resources": DRAWING}, graph.progress
        run_job(client, graph, work_dir, lane="drawing", placement=lambda: where, current=now, **control)
        _move(graph.folder, target)
    elif on_progress := control.get("on_progress"):
        on_progress(Progress(1, 1))
    return read_json(FieldFiles(target).figures)


def bytes_of(folder: Path) -> int:
    """Size of all files of a field."""
    return sum(path.stat().st_size for path in folder.iterdir())


def _move(folder: Path, target: Path) -> None:
    """Rename a finished folder to its target; another job may have made the same one meanwhile."""
    try:
        folder.rename(target)
    except OSError as error:
        if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
            raise
    sync(target.parent)
