"""Rendering of images and export of files on workers, with time limits and cancellation."""

import asyncio
import errno
import hashlib
import json
import logging
import time
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from distributed import KilledWorker

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.names import DEFAULT_PICKER
from bentray_workers.cluster.capacities import WorkerCapacity, capacities_by_address
from bentray_workers.cluster.connection import Cluster
from bentray_workers.cluster.resources import PICTURE_PRIORITY
from bentray_workers.files import volume_export
from bentray_workers.files.atomic import write_bytes
from bentray_workers.files.export.registry import FormatName
from bentray_workers.images import drawing_tasks
from bentray_workers.images.result_summary import result_summary
from bentray_workers.images.truth_export import export_truth
from bentray_workers.reconstruction.quality_report import quality_page, quality_report
from bentray_workers.reconstruction.scan_views import emission_traces, scan_geometry, scan_thumbnail
from bentray_workers.rendering import field_picture, picture_cost, refraction
from bentray_workers.rendering.coefficients import coefficients_npy
from bentray_workers.rendering.field_view import FieldView
from bentray_workers.rendering.histogram import volume_histogram
from bentray_workers.rendering.isosurface_mesh import mesh_volume
from bentray_workers.rendering.picture_cost import Cost, VolumeFile
from bentray_workers.rendering.refraction_view import RefractionView
from bentray_workers.rendering.tiles import PictureTasks

from . import __version__
from .errors import Busy, StorageFull
from .files.data_folder import Files
from .picture_queue import LONG_S, Picture, PictureQueue
from .rows.accounts import Account, Accounts
from .rows.ids import Tenant
from .rows.tables import DatasetRow, FieldRow, MeshRow, VolumeRow

# Time limit of an image, s.
RENDER_SECONDS = 120.0
# Threads that submit tasks and fetch results, without waiting for tasks.
THREADS = 8
# Time limit for the list of workers, and interval between checks of a running task, s.
ASK_S, LOOK_S = 5.0, 5.0
FULL = (errno.ENOSPC, errno.EDQUOT)
# Histograms kept, of 10 to 50 kB each.
MAX_HISTOGRAMS = 256
# Maximum number of attempts when workers leave.
MAX_TRIES = 2

# Scans whose report takes longer are examined when they are stored, s.
EXAMINED_S = 1.1

log = logging.getLogger("bentray.pictures")

Found = TypeVar("Found")
# What is drawn or exported.
Input = DatasetRow | VolumeRow | FieldRow | MeshRow


class Pictures:
    """Rendering on the workers of this service.

    Methods wait without a thread; cancellation ends the work on the cluster. They raise InvalidInput for too
    large or too slow requests and from the task itself, RateLimited when too many images are in progress,
    and Busy after the time limit.
    """

    def __init__(self, cluster: Cluster, accounts: Accounts, files: Files) -> None:
        """Args:
        cluster: with the workers.
        accounts: who take turns.
        files: of the stored items.
        """
        self._cluster, self._accounts, self._files = cluster, accounts, files
        self._threads = ThreadPoolExecutor(THREADS, "pictures")
        self._asker = ThreadPoolExecutor(1, "workers")
        self._asking: asyncio.Future[dict[str, WorkerCapacity]] | None = None
        self._queue = PictureQueue(self._workers)
        self._histograms: dict[tuple[Any, ...], dict[str, Any]] = {}
        self._reports: dict[Path, asyncio.Future[bytes]] = {}
        self._examining, self._examinations = asyncio.Lock(), set[asyncio.Task[None]]()
        self._loop: asyncio.AbstractEventLoop | None = None

    def open(self) -> None:
        """Allow ``examine``, in the event loop that uses this object."""
        self._loop = asyncio.get_running_loop()

    def examine(self, dataset: Input) -> None:
        """Make the quality report of a new dataset that takes long, from any thread; one at a time."""
        if self._loop is None or not isinstance(dataset, DatasetRow):
            return
        if picture_cost.quality_cost(dataset.values()).seconds < EXAMINED_S:
            return

        async def work() -> None:
            async with self._examining:
                try:
                    await self.quality(dataset, DEFAULT_PICKER)
                except Exception as error:
                    log.info("%s is examined when its report is requested: %s", dataset.id, error)

        def begin() -> None:
            task = asyncio.ensure_future(work())
            self._examinations.add(task)
            task.add_done_callback(self._examinations.discard)

        # The event loop is closed after the service has stopped.
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(begin)

    async def slice_png(self, volume: VolumeRow, how: dict[str, Any]) -> bytes:
        """Render one slice of a volume as PNG.

        Args:
            volume: its row.
            how: arguments of the functions in ``bentray_workers.images.slice``.
        """
        cost = picture_cost.slice_cost(VolumeFile.from_row(volume.values()), how.get("size"))
        draw = drawing_tasks.slice_png if volume.job_id is not None else drawing_tasks.volume_slice_png
        return bytes(await self._one(volume, cost, draw, how, refused=("size", "this slice")))

    async def refraction_png(self, volume: VolumeRow, view: RefractionView) -> bytes:
        """Render a volume with refraction."""
        cost = picture_cost.refraction_cost(VolumeFile.from_row(volume.values()), view)
        return bytes(await self._made(volume, cost, view.mode, lambda here: refraction.tasks_of(here, view)))

    async def coefficients(self, volume: VolumeRow, view: RefractionView) -> bytes:
        """Filter a volume, see ``bentray_workers.rendering.coefficients``."""
        cost = picture_cost.filter_cost(VolumeFile.from_row(volume.values()))
        return bytes(await self._one(volume, cost, coefficients_npy, {"view": view}))

    async def histogram(self, volume: VolumeRow, quantity: str, bins: int) -> dict[str, Any]:
        """Compute the histogram of a volume, see ``volume_histogram``; recent ones are kept."""
        key = volume.id, volume.created, quantity, bins
        if key not in self._histograms:
            cost = picture_cost.filter_cost(VolumeFile.from_row(volume.values()))
            how = {"quantity": quantity, "bins": bins}
            self._histograms[key] = dict(await self._one(volume, cost, volume_histogram, how))
            while len(self._histograms) > MAX_HISTOGRAMS:
                del self._histograms[next(iter(self._histograms))]
        return self._histograms[key]

    async def mesh_png(self, mesh: FieldRow | MeshRow, view: FieldView) -> bytes:
        """Render a scene with a geometry field, or with a mesh that needs none."""
        figures = mesh.figures if isinstance(mesh, FieldRow) else {"faces": mesh.faces}
        cost, (kind, _) = picture_cost.field_cost(figures, view), _named(mesh)
        return bytes(await self._made(mesh, cost, kind, lambda here: field_picture.tasks_of(here, view)))

    async def field_map_png(self, field: FieldRow, which: str) -> bytes:
        """Render the geometry image of a field, see ``bentray_workers.rendering.field_picture.map_png``."""
        cost = picture_cost.map_cost(field.figures)
        return bytes(await self._one(field, cost, field_picture.map_png, {"quantity": which}))

    async def quality(self, dataset: DatasetRow, picker: str) -> dict[str, Any]:
        """The quality report of a dataset, see ``bentray_workers.reconstruction.quality_report``."""
        return dict(json.loads(await self._examined(dataset, picker, "json", quality_report)))

    async def quality_png(self, dataset: DatasetRow, picker: str) -> bytes:
        """The quality report of a dataset as an image."""
        return await self._examined(dataset, picker, "png", quality_page)

    async def _examined(self, dataset: DatasetRow, picker: str, form: str, task: Callable[..., Any]) -> bytes:
        cost, how = picture_cost.quality_cost(dataset.values()), {"picker": picker, **_water(dataset)}
        return await self._kept(dataset, f"{picker}.{form}", cost, task, how)

    async def thumbnail(self, dataset: DatasetRow) -> bytes:
        """A small picture of a dataset, see ``scan_thumbnail``."""
        cost = picture_cost.emission_cost(dataset.values())
        return await self._kept(dataset, "thumbnail.png", cost, scan_thumbnail, {})

    async def _kept(
        self, dataset: DatasetRow, name: str, cost: Cost, task: Callable[..., Any], how: dict[str, Any]
    ) -> bytes:
        """What is kept of a dataset, or a new one, which all who request it share and which outlives them."""
        stated = repr((__version__, dataset.water_temperature_c))
        name = f"{hashlib.sha256(stated.encode()).hexdigest()[:16]}-{name}"
        path = self._files.of(dataset.tenant).report(dataset.id, name)
        with suppress(FileNotFoundError):
            return await self._in_thread(path.read_bytes)

        async def keep() -> bytes:
            try:
                made = await self._one(dataset, cost, task, how)
                content = made if isinstance(made, bytes) else json.dumps(made).encode()
                with suppress(OSError):
                    await self._in_thread(lambda: write_bytes(path, content))
                return content
            finally:
                del self._reports[path]

        if path not in self._reports:
            self._reports[path] = asyncio.ensure_future(keep())
        return await asyncio.shield(self._reports[path])

    async def scan_geometry(self, dataset: DatasetRow) -> dict[str, Any]:
        """Read the geometry of a dataset, see ``bentray_workers.reconstruction.scan_views``."""
        cost = picture_cost.geometry_cost(dataset.values())
        return dict(await self._one(dataset, cost, scan_geometry, _water(dataset)))

    async def emission_traces(self, dataset: DatasetRow, how: dict[str, Any]) -> dict[str, Any]:
        """Read the traces of one emission; ``how``: arguments of ``scan_views.emission_traces``."""
        cost = picture_cost.emission_cost(dataset.values())
        return dict(await self._one(dataset, cost, emission_traces, {**how, **_water(dataset)}))

    async def mesh_volume(
        self, volume: VolumeRow, iso: float | None, step: int, target: Path
    ) -> dict[str, Any]:
        """Extract the iso-surface of a volume to a mesh file, see ``isosurface_mesh.mesh_volume``."""
        cost = picture_cost.mesh_cost(VolumeFile.from_row(volume.values()), step)
        return dict(await self._one(volume, cost, mesh_volume, {"iso": iso, "step": step, "target": target}))

    async def export(
        self, volume: VolumeRow, target: Path, name: FormatName, selection: volume_export.Selection
    ) -> None:
        """Export a volume to another format, a key of ``EXPORTED``."""
        cost = picture_cost.export_cost(VolumeFile.from_row(volume.values()), name)
        how = {"target": target, "name": name, "selection": selection}
        await self._one(volume, cost, volume_export.export_volume, how)

    async def export_truth(self, volume: VolumeRow, scan: DatasetRow, target: Path, name: FormatName) -> None:
        """Export the truth of a scan at the nodes of a reconstruction, see ``images.truth_export``."""
        cost = picture_cost.truth_cost(VolumeFile.from_row(volume.values()), scan.values())
        how = {"scan": await self._fetched(scan), "target": target, "name": name}
        await self._one(volume, cost, export_truth, how, refused=("quantity", "truth"))

    async def summary(self, volume: VolumeRow, scan: DatasetRow) -> dict[str, Any]:
        """Summarise a reconstruction, see ``images.result_summary``."""
        cost = picture_cost.truth_cost(VolumeFile.from_row(volume.values()), scan.values())
        return dict(await self._one(volume, cost, result_summary, {"scan": await self._fetched(scan)}))

    def load(self, tenant: Tenant) -> dict[str, Any]:
        """Waiting images of the account of a tenant, workers that draw, and the time left, s, if known."""
        account = self._accounts.of(tenant)
        return {
            "waiting_images": self._queue.waiting().get(account, 0),
            "drawing_workers": self._queue.busy,
            "images_s": self._queue.left_s(account),
        }

    async def close(self) -> None:
        """Stop polling for workers and examining, in the event loop that uses this object."""
        self._loop = None
        running: list[asyncio.Future[Any]] = [*self._examinations, *self._reports.values()]
        for task in running:
            task.cancel()
        await asyncio.gather(*running, return_exceptions=True)
        await self._queue.close()

    def stop(self) -> None:
        """Start no further tasks."""
        for pool in (self._threads, self._asker):
            pool.shutdown(wait=False, cancel_futures=True)

    async def _one(
        self,
        item: Input,
        cost: Cost,
        task: Callable[..., Any],
        how: dict[str, Any],
        refused: tuple[str, str] | None = None,
    ) -> Any:
        def alone(here: Path) -> PictureTasks:
            return PictureTasks([(task, here)], None)

        return await self._made(item, cost, task.__name__, alone, how, refused)

    async def _made(
        self,
        item: Input,
        cost: Cost,
        kind: str,
        tasks_of: Callable[[Path], PictureTasks],
        how: Mapping[str, Any] | None = None,
        refused: tuple[str, str] | None = None,
    ) -> Any:
        """Run tasks and return the result of the last one.

        Args:
            item: input, fetched from the store first.
            cost: of the tasks.
            kind: images of one kind take times in proportion to their costs.
            tasks_of: creates the tasks for the path of the input.
            how: further arguments of each task.
            refused: field and value of a refusal; None: those of the item.
        """
        account = self._accounts.of(item.tenant)
        workers = await self._queue.workers()
        picture_cost.check_memory(*(refused or _named(item)), cost, list(workers.values()))
        try:
            async with (
                self._queue.admitted(account, cost.seconds, kind) as picture,
                asyncio.timeout(RENDER_SECONDS),
            ):
                tasks = tasks_of(await self._fetched(item))
                try:
                    return await _Run(self, account, cost, picture, dict(how or {})).all(tasks)
                except (InvalidInput, FileNotFoundError):
                    # Report an input that was deleted or damaged in the meantime.
                    await self._fetched(item)
                    raise
        except TimeoutError:
            raise Busy(
                "workers", f"no answer in {RENDER_SECONDS:g} s", "a later request, or more workers"
            ) from None

    async def _fetched(self, item: Input) -> Path:
        """The path of an item, where the store makes it available."""
        path = self._files.of(item.tenant).stored(item.id)
        return await self._in_thread(lambda: self._files.store.fetch(path))

    async def _in_thread(self, work: Callable[[], Found]) -> Found:
        return await asyncio.get_running_loop().run_in_executor(self._threads, work)

    async def _workers(self) -> dict[str, WorkerCapacity]:
        """The connected workers; none without scheduler."""
        if self._asking is None or self._asking.done():
            self._asking = asyncio.get_running_loop().run_in_executor(
                self._asker, lambda: capacities_by_address(self._cluster.client)
            )
        with suppress(OSError, TimeoutError):
            async with asyncio.timeout(ASK_S):
                return await asyncio.shield(self._asking)
        return {}


def _named(item: Input) -> tuple[str, str]:
    """Field and value of an item in a refusal."""
    if isinstance(item, DatasetRow):
        return "dataset", item.id
    if isinstance(item, VolumeRow):
        return "volume", f"shape {tuple(item.shape)}"
    return ("field" if isinstance(item, FieldRow) else "mesh"), item.id


def _water(dataset: DatasetRow) -> dict[str, float]:
    """The water that the user states for a scan, as an argument of tasks; else nothing."""
    stated = dataset.water_temperature_c
    return {} if stated is None else {"water_temperature_c": stated}


class _Run:
    """The tasks of one image."""

    def __init__(
        self, pictures: Pictures, account: Account, cost: Cost, picture: Picture, how: dict[str, Any]
    ) -> None:
        self._pictures, self._account, self._cost, self._how = pictures, account, cost, how
        self._picture = picture
        self._long = cost.seconds > LONG_S
        self._begun: list[Any] = []

    async def all(self, tasks: PictureTasks) -> Any:
        """Run the tasks and return the result of the last one; all are released at the end."""
        running: list[asyncio.Task[Any]] = []
        try:
            # The first task shows how long the others will take.
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
        """Run a task; returns its future, or raises its error."""
        for _ in range(MAX_TRIES):
            async with self._pictures._queue.place(self._account, self._fits, long=self._long) as address:
                begun = time.monotonic()
                self._picture.begun = self._picture.begun or begun
                future = await self._pictures._in_thread(partial(self._submit, address, task))
                self._begun.append(future)
                if not await self._leaves(future, address):
                    self._long = time.monotonic() - begun > LONG_S
                    if future.status != "finished":
                        await self._result(future)
                    return future
                future.release()
        raise Busy("workers", f"{MAX_TRIES} that left during this task", "a later request, or more workers")

    async def _result(self, future: Any) -> Any:
        """The result of a task; its error is raised."""

        def fetched() -> Any:
            try:
                return future.result(timeout=RENDER_SECONDS)
            except (KilledWorker, CancelledError) as error:
                found = f"one lost during this task ({type(error).__name__})"
                raise Busy("workers", found, "a later request, or more workers") from error
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
            *task, **self._how, pure=False, priority=PICTURE_PRIORITY, **where, workers=[address]
        )

    async def _leaves(self, future: Any, address: str) -> bool:
        """Wait for the end of a task; returns True if its worker leaves before."""
        loop = asyncio.get_running_loop()
        done = asyncio.Event()

        def show(_: Any) -> None:
            # The event loop is closed after the service has stopped.
            with suppress(RuntimeError):
                loop.call_soon_threadsafe(done.set)

        future.add_done_callback(show)
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
