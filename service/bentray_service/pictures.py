"""Pictures and files that workers make while somebody waits: in turn, bounded, ended with the request."""

from __future__ import annotations

import asyncio
import errno
import time
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from distributed import KilledWorker

from bentray_kernels.errors import InvalidInput
from bentray_workers.cluster.capacities import WorkerCapacity, capacities_by_address
from bentray_workers.files import volume_export
from bentray_workers.images import drawing_tasks
from bentray_workers.reconstruction.quality_report import quality_page, quality_report
from bentray_workers.rendering import field_picture, picture_cost, refraction
from bentray_workers.rendering.field_view import FieldView
from bentray_workers.rendering.isosurface_mesh import mesh_volume
from bentray_workers.rendering.picture_cost import Cost, VolumeFile
from bentray_workers.rendering.refraction_view import RefractionView
from bentray_workers.rendering.tiles import PictureTasks

from .compute import Cluster
from .picture_queue import LONG_S, PictureQueue
from .refusals import Busy, StorageFull
from .rows.records import DatasetRow, FieldRow, VolumeRow
from .rows.tenants import Tenant

# From the admission of a picture to its end.
RENDER_SECONDS = 120.0
# Above the tasks of reconstructions, so that a picture is next when a lane is shared.
RENDER_PRIORITY = 10
# Threads that hand tasks out and fetch results; none of them waits for a task.
THREADS = 8
# The scheduler is asked for its workers, and a task that is not done is looked after, s.
ASK_S, LOOK_S = 5.0, 5.0
FULL = (errno.ENOSPC, errno.EDQUOT)
# How often a task may see its worker leave.
MOST_TRIES = 2

Found = TypeVar("Found")


class Pictures:
    """What the render lane of the workers does for this service.

    Every method waits without holding a thread, and may be cancelled, which ends the work on the cluster.
    They raise InvalidInput for what takes too long or more memory than any worker has, and from the task
    itself; TooOften where too much waits already; Busy where it was not done in time.
    """

    def __init__(self, cluster: Cluster, fetch: Callable[[Path], Path]) -> None:
        """Args:
        cluster: with the workers.
        bring: lets what a task is to read lie at its path; see ``Store.fetch``.
        """
        self._cluster = cluster
        self._fetch = fetch
        self._threads = ThreadPoolExecutor(THREADS, "pictures")
        self._asker = ThreadPoolExecutor(1, "workers")
        self._asking: asyncio.Future[dict[str, WorkerCapacity]] | None = None
        self._queue = PictureQueue(self._workers)

    async def slice_png(self, tenant: Tenant, volume: VolumeRow, path: Path, how: dict[str, Any]) -> bytes:
        """One slice of a volume as PNG.

        Args:
            tenant: whose turn it takes.
            volume: its row.
            path: of its file.
            how: as in ``bentray_workers.images.slice``, or ``volume_slice`` of an upload.
        """
        cost = picture_cost.slice_cost(VolumeFile.of(volume), how.get("size"))
        draw = drawing_tasks.slice_png if "job_id" in volume else drawing_tasks.volume_slice_png
        return bytes(await self._one(tenant, ("size", "this slice", cost), path, draw, how))

    async def refraction_png(
        self, tenant: Tenant, volume: VolumeRow, path: Path, view: RefractionView
    ) -> bytes:
        """A volume as glass."""
        cost = picture_cost.refraction_cost(VolumeFile.of(volume), view)
        what = "volume", f"shape {tuple(volume['shape'])}", cost
        return bytes(await self._made(tenant, what, path, lambda here: refraction.tasks_of(here, view)))

    async def field_png(self, tenant: Tenant, field: FieldRow, folder: Path, view: FieldView) -> bytes:
        """A scene with a geometry field."""
        what = "field", str(field["id"]), picture_cost.field_cost(field["figures"], view)
        return bytes(await self._made(tenant, what, folder, lambda here: field_picture.tasks_of(here, view)))

    async def field_map_png(self, tenant: Tenant, field: FieldRow, folder: Path, which: str) -> bytes:
        """The geometry image of a field, as ``bentray_workers.rendering.field_picture.map_png``."""
        what = "field", str(field["id"]), picture_cost.map_cost(field["figures"])
        return bytes(await self._one(tenant, what, folder, field_picture.map_png, {"what": which}))

    async def quality(self, tenant: Tenant, dataset: DatasetRow, path: Path, picker: str) -> dict[str, Any]:
        """The examination of a dataset file, see ``bentray_workers.reconstruction.quality_report``."""
        what = "dataset", str(dataset["id"]), picture_cost.quality_cost(dataset)
        return dict(await self._one(tenant, what, path, quality_report, {"picker": picker}))

    async def quality_png(self, tenant: Tenant, dataset: DatasetRow, path: Path, picker: str) -> bytes:
        """The page about it."""
        what = "dataset", str(dataset["id"]), picture_cost.quality_cost(dataset)
        return bytes(await self._one(tenant, what, path, quality_page, {"picker": picker}))

    async def mesh_volume(
        self, tenant: Tenant, volume: VolumeRow, path: Path, iso: float | None, step: int, target: Path
    ) -> dict[str, Any]:
        """The iso-surface of a volume as a mesh file; as ``isosurface_mesh.mesh_volume``."""
        what = "volume", f"shape {tuple(volume['shape'])}", picture_cost.mesh_cost(VolumeFile.of(volume))
        how = {"iso": iso, "step": step, "target": target}
        return dict(await self._one(tenant, what, path, mesh_volume, how))

    async def export(self, tenant: Tenant, volume: VolumeRow, path: Path, target: Path, name: str) -> None:
        """A volume in another format, a key of ``volume_export.FORMATS``."""
        what = "volume", f"shape {tuple(volume['shape'])}", picture_cost.export_cost(VolumeFile.of(volume))
        how = {"target": target, "name": name}
        await self._one(tenant, what, path, volume_export.export_volume, how)

    def waiting(self) -> dict[Tenant, int]:
        """PictureTasks that wait for a worker, by tenant."""
        return self._queue.waiting()

    async def close(self) -> None:
        """Ask for no workers any more, in the loop that asked."""
        await self._queue.close()

    def stop(self) -> None:
        """Begin nothing more."""
        for pool in (self._threads, self._asker):
            pool.shutdown(wait=False, cancel_futures=True)

    async def _one(
        self,
        tenant: Tenant,
        what: tuple[str, str, Cost],
        path: Path,
        task: Callable[..., Any],
        how: dict[str, Any],
    ) -> Any:
        return await self._made(tenant, what, path, lambda here: PictureTasks([(task, here)], None), how)

    async def _made(
        self,
        tenant: Tenant,
        what: tuple[str, str, Cost],
        path: Path,
        tasks_of: Callable[[Path], PictureTasks],
        how: Mapping[str, Any] | None = None,
    ) -> Any:
        """The result of some tasks.

        Args:
            tenant: whose turn it takes.
            what: the field that a refusal names, what it found, and the cost.
            path: of what is read, to be brought first.
            tasks_of: gives the tasks for where it lies.
            how: more arguments of each task.
        """
        field, found, cost = what
        workers = await self._queue.workers()
        picture_cost.check_memory(field, found, cost, list(workers.values()))
        try:
            async with self._queue.admitted(tenant, cost.seconds), asyncio.timeout(RENDER_SECONDS):
                tasks = tasks_of(await self._in_thread(lambda: self._fetch(path)))
                try:
                    return await _Run(self, tenant, cost, dict(how or {})).all(tasks)
                except (InvalidInput, FileNotFoundError):
                    # What is deleted or damaged meanwhile is told as that, not as a worker sees it.
                    await self._in_thread(lambda: self._fetch(path))
                    raise
        except TimeoutError:
            raise Busy(
                "workers", f"no answer in {RENDER_SECONDS:g} s", "another try, or more workers"
            ) from None

    async def _in_thread(self, work: Callable[[], Found]) -> Found:
        return await asyncio.get_running_loop().run_in_executor(self._threads, work)

    async def _workers(self) -> dict[str, WorkerCapacity]:
        """The connected workers; none while the scheduler is away."""
        if self._asking is None or self._asking.done():
            self._asking = asyncio.get_running_loop().run_in_executor(
                self._asker, lambda: capacities_by_address(self._cluster.client)
            )
        with suppress(OSError, TimeoutError):
            async with asyncio.timeout(ASK_S):
                return await asyncio.shield(self._asking)
        return {}


class _Run:
    """The tasks of one picture."""

    def __init__(self, pictures: Pictures, tenant: Tenant, cost: Cost, how: dict[str, Any]) -> None:
        self._pictures, self._tenant, self._cost, self._how = pictures, tenant, cost, how
        self._long = cost.seconds > LONG_S
        self._begun: list[Any] = []

    async def all(self, tasks: PictureTasks) -> Any:
        """Run them and fetch the result of the last; all of them are released at the end."""
        running: list[asyncio.Task[Any]] = []
        try:
            # The first one tells how long the others will take.
            first = await self._ended(tasks.tiles[0])
            running = [asyncio.create_task(self._ended(part)) for part in tasks.tiles[1:]]
            last = first
            if tasks.stack is not None:
                last = await self._ended((tasks.stack, [first, *await asyncio.gather(*running)]))
            return await self._result(last)
        finally:
            for one in running:
                one.cancel()
            await asyncio.gather(*running, return_exceptions=True)
            for future in self._begun:
                future.release()

    async def _ended(self, task: tuple[Any, ...]) -> Any:
        """The future of a task that has been done; raises what the task did."""
        for _ in range(MOST_TRIES):
            async with self._pictures._queue.place(self._tenant, self._fits, long=self._long) as address:
                begun = time.monotonic()
                future = await self._pictures._in_thread(partial(self._submit, address, task))
                self._begun.append(future)
                if not await self._leaves(future, address):
                    self._long = time.monotonic() - begun > LONG_S
                    if future.status != "finished":
                        await self._result(future)
                    return future
                future.release()
        raise Busy("workers", f"{MOST_TRIES} that left while they drew this", "another try, or more workers")

    async def _result(self, future: Any) -> Any:
        """What a task gave, or raised."""

        def fetched() -> Any:
            try:
                return future.result(timeout=RENDER_SECONDS)
            except (KilledWorker, CancelledError) as error:
                found = f"one that was lost while it drew this ({type(error).__name__})"
                raise Busy("workers", found, "another try, or more workers") from error
            except OSError as error:
                if error.errno not in FULL:
                    raise
                raise StorageFull("storage", "no space for the file", "more free space") from error

        return await self._pictures._in_thread(fetched)

    def _fits(self, offer: WorkerCapacity) -> bool:
        return "render" in offer.resources and offer.task_bytes >= self._cost.bytes

    def _submit(self, address: str, task: tuple[Any, ...]) -> Any:
        where = picture_cost.placed(self._cost.bytes, {address: self._pictures._queue.offer(address)})
        return self._pictures._cluster.client.submit(
            *task, **self._how, pure=False, priority=RENDER_PRIORITY, **where, workers=[address]
        )

    async def _leaves(self, future: Any, address: str) -> bool:
        """Wait until a task has been done; whether its worker leaves before."""
        loop = asyncio.get_running_loop()
        done = asyncio.Event()

        def tell(_: Any) -> None:
            # Nobody listens once the service has stopped.
            with suppress(RuntimeError):
                loop.call_soon_threadsafe(done.set)

        future.add_done_callback(tell)
        while True:
            try:
                async with asyncio.timeout(LOOK_S):
                    await done.wait()
            except TimeoutError:
                workers = await self._pictures._queue.workers()
                if workers and address not in workers:
                    return True
            else:
                return False
