"""The cluster as the service sees it: how many workers there are, and pictures rendered by them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography.settings import Settings
from bentray_workers import field_picture, picture_tasks, planning, refraction, simulation_planning
from bentray_workers.asked_simulation import AskedSimulation
from bentray_workers.dataset_summary import summary_of
from bentray_workers.field_view import FieldView
from bentray_workers.isosurface_mesh import mesh_volume
from bentray_workers.lanes import RENDER
from bentray_workers.offers import offers_of, prepared_offers
from bentray_workers.quality import quality_page, quality_report
from bentray_workers.refraction_view import RefractionView

from .refusals import Busy

RENDER_SECONDS = 60.0
# Above the tasks of reconstructions, so that a picture is next when a lane is shared.
RENDER_PRIORITY = 10


class Cluster(Protocol):
    """What :func:`bentray_workers.cluster.open_cluster` gives; tests bring a lighter one."""

    @property
    def client(self) -> Any: ...

    def describe(self) -> dict[str, Any]: ...


class Compute:
    """The worker pool of this service."""

    def __init__(self, cluster: Cluster, bring: Callable[[Path], Path]) -> None:
        """Args:
        cluster: with the pool.
        bring: lets what a task is to read lie at its path; see ``Store.bring``.
        """
        self._cluster = cluster
        self._bring = bring

    @property
    def client(self) -> Any:
        """The ``distributed.Client`` that jobs are given."""
        return self._cluster.client

    def workers(self) -> int:
        """How many workers are connected now; 0 when the scheduler is gone."""
        try:
            return int(self._cluster.describe()["workers"])
        except (OSError, TimeoutError):
            return 0

    def plan(self, path: Path, settings: Settings) -> dict[str, Any]:
        """How a dataset file would be reconstructed by the workers that are connected now.

        Raises:
            InvalidInput: for tasks that none of them can hold, or a lane that none offers.
        """
        try:
            offers = prepared_offers(self.client, settings)
        except (OSError, TimeoutError):
            # The scheduler is gone; the job waits until it is back, on workers of which nothing is known.
            offers = ()
        return planning.plan(summary_of(self._bring(path), settings), settings, offers).to_dict()

    def plan_simulation(self, asked: AskedSimulation) -> dict[str, Any]:
        """The same of a simulation."""
        try:
            offers = offers_of(self.client)
        except (OSError, TimeoutError):
            offers = ()
        return simulation_planning.plan_simulation(asked, offers).to_dict()

    def slice_png(self, path: Path, **how: Any) -> bytes:
        """One slice of a reconstruction file as PNG; ``how`` as in ``bentray_workers.images.slice``.

        Raises:
            InvalidInput: from the renderer.
            Busy: when no worker delivered it in time.
        """
        return self._drawn(picture_tasks.slice_png, path, how)

    def volume_slice_png(self, path: Path, **how: Any) -> bytes:
        """The same of an uploaded volume; ``how`` as in ``bentray_workers.images.volume_slice``."""
        return self._drawn(picture_tasks.volume_slice_png, path, how)

    def refraction_png(self, path: Path, view: RefractionView) -> bytes:
        """A volume or reconstruction file as glass; raises as ``slice_png`` does."""
        return self._finished(refraction.submit(self.client, self._bring(path), view, RENDER_PRIORITY), path)

    def field_png(self, folder: Path, view: FieldView) -> bytes:
        """A scene with a geometry field; raises as ``slice_png`` does."""
        begun = field_picture.submit(self.client, self._bring(folder), view, RENDER_PRIORITY)
        return self._finished(begun, folder)

    def field_map_png(self, folder: Path, what: str) -> bytes:
        """The geometry image of a field, as ``bentray_workers.field_picture.map_png``."""
        return self._drawn(field_picture.map_png, folder, {"what": what})

    def quality(self, path: Path, picker: str) -> dict[str, Any]:
        """The examination of a dataset file, see ``bentray_workers.quality``; raises as ``slice_png``."""
        return dict(self._done(self._begun(quality_report, path, {"picker": picker}), path))

    def quality_png(self, path: Path, picker: str) -> bytes:
        """The page about it."""
        return self._drawn(quality_page, path, {"picker": picker})

    def mesh_volume(self, path: Path, iso: float | None, step: int, target: Path) -> dict[str, Any]:
        """The iso-surface of a volume as a mesh file; as ``bentray_workers.isosurface_mesh.mesh_volume``."""
        how = {"iso": iso, "step": step, "target": target}
        return dict(self._done(self._begun(mesh_volume, path, how), path))

    def _drawn(self, draw: Callable[..., bytes], path: Path, how: dict[str, Any]) -> bytes:
        return self._finished(self._begun(draw, path, how), path)

    def _begun(self, task: Callable[..., Any], path: Path, how: dict[str, Any]) -> Any:
        place = {"resources": RENDER, "priority": RENDER_PRIORITY}
        return self.client.submit(task, self._bring(path), **how, pure=False, **place)

    def _finished(self, future: Any, path: Path) -> bytes:
        return bytes(self._done(future, path))

    def _done(self, future: Any, path: Path) -> Any:
        try:
            return future.result(timeout=RENDER_SECONDS)
        except TimeoutError:
            raise Busy(
                "workers", f"no answer in {RENDER_SECONDS:g} s", "another try, or more workers"
            ) from None
        except (InvalidInput, OSError):
            # What is deleted or damaged meanwhile is told as that, not as a worker sees it.
            self._bring(path)
            raise
        finally:
            future.release()
