"""A simulated scan on a cluster: parts as tasks, kept as files, gone on from after any death."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

from distributed import Client, Future

from bentray_kernels.tomography import Progress

from ..cluster.attempts import Attempts
from ..cluster.fair_shares import Share, alone
from ..cluster.task_loop import Cancelled, finished
from .assembly import finish
from .request import AskedSimulation
from .tasks import folder_of, make_part, missing, parts_of


def simulate_scan(
    client: Client,
    asked: AskedSimulation,
    target: Path,
    work_dir: Path,
    on_progress: Callable[[Progress], None],
    on_saved: Callable[[], None],
    stop: Callable[[], bool],
    share: Share | None = None,
) -> dict[str, Any]:
    """Simulate a scan into a dataset file, to the bits that ``simulate`` gives in one process.

    Args:
        client: of the cluster.
        asked: what to simulate.
        target: the file to write, by a worker, whole or not at all.
        work_dir: a folder that every worker can read and write; parts that an unfinished run of the same scan
            left there are not made again.
        on_progress: called after each task.
        on_saved: the same.
        stop: polled all the while; true ends with ``Cancelled``, whatever tasks are at work.
        share: of the workers; None: all of them.

    Returns:
        As ``simulation.assembly.finish``.

    Raises:
        Cancelled: when ``stop`` said so.
        KilledWorker: for a task that kills its workers.
    """
    settings = asked.chosen()
    folder = folder_of(work_dir)
    folder.mkdir(exist_ok=True)
    parts = parts_of(settings)
    waiting = deque(missing(parts, folder))
    attempts, share = Attempts(client, work_dir), share or alone(client, "recon")
    done, total = len(parts) - len(waiting), len(parts) + 1
    on_progress(Progress(done, total))
    running: set[Future] = set()
    result: dict[str, Any] | None = None
    try:
        while result is None:
            ending = done == len(parts) and not running
            while share.may_begin(len(running), len(waiting) + ending):
                call, *given = (finish, folder, target) if ending else (make_part, waiting.popleft(), folder)
                priority = share.priority(len(running))
                running.add(attempts.submit(call, settings, *given, priority=priority))
                ending = False
            if not running:
                share.wait()
            for future in finished(client, list(running)):
                running.remove(future)
                again, given = attempts.ended(future)
                if again is not None:
                    running.add(again)
                    continue
                done += 1
                result = given
                on_saved()
                on_progress(Progress(done, total))
            if result is None and stop():
                raise Cancelled
    finally:
        for future in running:
            future.cancel()
        share.pause()
    return result
