"""The Dask cluster of the service: workers, and plans of jobs."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from bentray_kernels.tomography.settings import Settings
from bentray_workers.cluster.capacities import WorkerCapacity, capacities_of, probed_capacities
from bentray_workers.cluster.connected import connected_workers
from bentray_workers.cluster.connection import Cluster
from bentray_workers.cluster.scheduler_load import SchedulerLoad, load_of
from bentray_workers.cluster.worker_health import WorkerHealth, health_of
from bentray_workers.files.dataset.counts import DatasetCounts
from bentray_workers.files.dataset.scan import counts_in, measured_frequency
from bentray_workers.reconstruction import planning
from bentray_workers.rendering import turntable_planning
from bentray_workers.rendering.refraction_view import check_even
from bentray_workers.rendering.scene_cache import check_size
from bentray_workers.rendering.turntable import Turntable
from bentray_workers.simulation import simulation_planning
from bentray_workers.simulation.request import PhantomScan

from .rows.tables import VolumeRow

Answer = TypeVar("Answer")


def check_renderable(volume: VolumeRow) -> None:
    """Reject a volume that cannot be rendered: not 3-D, non-uniform spacing, or too large for any worker.

    Raises:
        InvalidInput: naming ``volume``.
    """
    check_even(tuple(volume.shape), tuple(volume.spacing_m))
    check_size(tuple(volume.shape))


class Compute:
    """The cluster of this service."""

    def __init__(self, cluster: Cluster, fetch: Callable[[Path], Path]) -> None:
        """Args:
        cluster: with the pool.
        fetch: makes an input file available at its path; see ``Store.fetch``.
        """
        self._cluster = cluster
        self._fetch = fetch
        self._changing = threading.Lock()
        self._addresses: set[str] = set()
        self._lost = 0

    @property
    def client(self) -> Any:
        """The ``distributed.Client`` for jobs."""
        return self._cluster.client

    def workers(self) -> int:
        """Number of connected workers; 0 without scheduler."""
        return self._asked(lambda client: len(connected_workers(client)), 0)

    def health(self) -> tuple[WorkerHealth, ...]:
        """The health of the connected workers; none without scheduler."""
        return self._asked(health_of, ())

    def lost_workers(self) -> int:
        """Workers that have left since the first call: a worker that restarts has a new address."""
        with self._changing:
            # Without a scheduler nothing is known about them.
            present = self._asked(lambda client: set(connected_workers(client)), self._addresses)
            self._lost += len(self._addresses - present)
            self._addresses = present
            return self._lost

    def scheduler_load(self) -> SchedulerLoad | None:
        """The load of the scheduler; None if it does not answer."""
        return self._asked(load_of, None)

    def plan(self, counts: dict[str, Any] | None, path: Path, settings: Settings) -> dict[str, Any]:
        """Plan the reconstruction of a dataset on the connected workers.

        Args:
            counts: from ``files.dataset.counts.record_of``; None, or without a centre frequency: they
                are read from the file.
            path: of the file.
            settings: of the reconstruction.

        Raises:
            InvalidInput: when no worker has enough memory or the required resource.
        """
        nothing: tuple[WorkerCapacity, ...] = ()
        capacities = self._asked(lambda client: probed_capacities(client, settings), nothing)
        stored = counts_in(self._fetch(path)) if counts is None else DatasetCounts(**counts)
        if stored.samples and stored.frequency_hz is None:
            stored = replace(stored, frequency_hz=measured_frequency(self._fetch(path)))
        return planning.plan(stored.summary(settings), settings, capacities).to_dict()

    def plan_simulation(self, request: PhantomScan) -> dict[str, Any]:
        """Plan a simulation in the same way."""
        return simulation_planning.plan_simulation(request, self.capacities()).to_dict()

    def plan_turntable(self, shape: Sequence[int], turntable: Turntable) -> dict[str, Any]:
        """Plan a turntable in the same way."""
        return turntable_planning.plan_turntable(shape, turntable, self.capacities()).to_dict()

    def capacities(self) -> tuple[WorkerCapacity, ...]:
        """Capacities of the connected workers; none without scheduler, for which a job waits."""
        return self._asked(capacities_of, ())

    def _asked(self, question: Callable[[Any], Answer], otherwise: Answer) -> Answer:
        """What the scheduler answers; ``otherwise`` without a scheduler."""
        try:
            return question(self.client)
        except (OSError, TimeoutError):
            return otherwise
