"""Geometry fields made by tasks: laid out, filled in batches of rows, and kept as a folder of files."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from bentray_kernels.tomography import Progress

from ..cluster.task_loop import Cancelled
from ..cluster.task_pool import Tasks
from ..files.geometry_field_folder import FieldFiles, read_json
from .field_settings import FieldSettings
from .field_tasks import TASK_RAYS, finish, inner_rows, lay_out, outer_rows

Work = tuple[Callable[..., Any], tuple[Any, ...]]


def build(
    tasks: Tasks,
    mesh_path: Path,
    settings: FieldSettings,
    target: Path,
    work_dir: Path,
    on_progress: Callable[[Progress], None],
    on_saved: Callable[[], None],
    stop: Callable[[], bool],
) -> dict[str, Any]:
    """Make the field of a mesh; one that is there already is taken as it is.

    Args:
        tasks: where the work is done.
        mesh_path: of a mesh file, readable by every worker.
        settings: what to make.
        target: the folder of the field; it appears whole or not at all.
        work_dir: a folder of the same file system, which every worker can read and write. Layout and rows
            that an unfinished run of the same mesh and settings left there are not made again.
        on_progress: called after each task.
        on_saved: the same.
        stop: polled between tasks; true ends with ``Cancelled``.

    Returns:
        The figures of the field: sizes, errors and seconds.

    Raises:
        Cancelled: when ``stop`` said so.
        InvalidInput: from the mesh or the settings.
    """
    if not target.exists():
        folder, done = work_dir / "field", work_dir / "done"
        for made in (folder, done):
            made.mkdir(exist_ok=True)
        files = FieldFiles(folder)
        run = partial(_run, tasks, on_saved=on_saved, stop=stop)
        if not files.layout.exists():
            on_progress(Progress(0, 0))
            run([(lay_out, (mesh_path, settings, folder))], told=lambda count: None)
        if not files.figures.exists():
            work = list(_batches(files, settings, done))
            missing = [one for one in work if not one[1][-1].exists()]
            # Laid out before, to be finished after.
            total, before = len(work) + 2, 1 + len(work) - len(missing)
            on_progress(Progress(before, total))
            run(missing, told=lambda count: on_progress(Progress(before + count, total)))
            run([(finish, (folder, settings, done))], told=lambda count: on_progress(Progress(total, total)))
        _move(folder, target)
    else:
        on_progress(Progress(1, 1))
    return read_json(FieldFiles(target).figures)


def bytes_of(folder: Path) -> int:
    """Of all files of a field."""
    return sum(path.stat().st_size for path in folder.iterdir())


def _batches(files: FieldFiles, settings: FieldSettings, done: Path) -> Iterator[Work]:
    """Rows of both tables, each batch with the file that says that it is done."""
    outer, inner = settings.samples, settings.inner_samples
    parts: tuple[tuple[Callable[..., Any], str, int, int], ...] = (
        (outer_rows, "outer", outer, 6 * outer**2),
        (inner_rows, "inner", inner, read_json(files.layout)["points"]),
    )
    for function, name, n, rows in parts:
        step = max(1, TASK_RAYS // (6 * n * n))
        for first in range(0, rows, step):
            last = min(first + step, rows)
            yield function, (files.folder, n, first, last, done / f"{name}-{first:05d}.json")


def _run(
    tasks: Tasks,
    work: list[Work],
    told: Callable[[int], None],
    on_saved: Callable[[], None],
    stop: Callable[[], bool],
) -> None:
    """Do all of the work, a few tasks at a time; ``told`` how many have ended after each."""
    waiting, count = list(reversed(work)), 0
    running: list[Any] = []
    try:
        while waiting or running:
            while tasks.may_begin(len(running), len(waiting)):
                function, arguments = waiting.pop()
                running.append(tasks.submit(function, *arguments))
            for future in tasks.ended(running):
                running.remove(future)
                future.result()
                count += 1
                on_saved()
                told(count)
            if stop():
                raise Cancelled
    finally:
        for future in running:
            future.cancel()
        tasks.may_begin(0, 0)


def _move(folder: Path, target: Path) -> None:
    """Put a finished folder in its place; another job may have been there first, with the same content."""
    try:
        folder.rename(target)
    except OSError as error:
        if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
            raise
    handle = os.open(target.parent, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
