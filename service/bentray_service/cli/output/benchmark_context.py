"""The context of a benchmark for one run: its size, progress, the folder for pictures and the cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from bentray_workers.files.atomic import write_bytes

from .terminal import Step

if TYPE_CHECKING:
    from bentray_workers.cluster.connection import Cluster

# Processes of a cluster that is started for a benchmark: two cores, as in the targets.
LOCAL_WORKERS = 2


@dataclass(frozen=True)
class BenchmarkContext:
    """The argument of ``rows`` of each benchmark.

    Attributes:
        quick: smaller problems, as a quick check.
        progress: called with the steps done of all, and a note.
        pictures: existing folder for pictures; None: no picture is drawn.
        scheduler: address of a Dask scheduler; None: workers are started on this machine.
        tls: folder of certificates for ``tls://`` addresses.
        scratch: folder for temporary files, with the same path on the workers; None: that of the system.
        data: folder of public data that the user downloaded; None: rows that need it are left out.
    """

    quick: bool
    progress: Step
    pictures: Path | None = None
    scheduler: str | None = None
    tls: Path | None = None
    scratch: Path | None = None
    data: Path | None = None

    def save_picture(self, name: str, draw: Callable[[], bytes]) -> None:
        """Write ``draw()`` to the file ``name`` in the folder for pictures, if there is one."""
        if self.pictures is not None:
            write_bytes(self.pictures / name, draw())

    def cluster(self) -> Cluster:
        """A client of the scheduler, or of new workers on this machine; a context manager.

        Raises:
            InvalidInput: when no scheduler answers at the address.
        """
        from bentray_workers.cluster.connection import open_cluster

        if self.scheduler is None:
            return open_cluster(workers=LOCAL_WORKERS)
        return open_cluster(self.scheduler, tls=self.tls)

    @contextmanager
    def temporary_folder(self) -> Iterator[Path]:
        """A folder that workers can read; it is deleted at the end."""
        with TemporaryDirectory(dir=self.scratch) as folder:
            yield Path(folder)
