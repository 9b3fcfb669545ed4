"""Resource use of a service at one moment (memory, descriptors, threads, rows, files), and its growth."""

import sqlite3
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

from .live_service import LiveService

MIB = 2**20
# Rows of things that clients make; all of these are deleted again. TaskCancelled uploads go by their age.
TABLES = (
    "datasets",
    "jobs",
    "events",
    "volumes",
    "uploaded_volumes",
    "meshes",
    "geometry_fields",
    "checksums",
)
# Files of the same; ``uploads`` go by their age.
FOLDERS = ("incoming", "datasets", "volumes", "exports", "animations", "meshes", "fields", "work", "reports")


@dataclass(frozen=True)
class Footprint:
    """One sample.

    Attributes:
        service_mib, workers_mib: resident memory, the second of all workers, MiB.
        descriptors, threads, processes: of the service and all below it.
        rows: by table; bytes: in the folders of the tenants, but for unfinished uploads.
        log_bytes: of the log.
    """

    service_mib: float
    workers_mib: float
    descriptors: int
    threads: int
    processes: int
    rows: dict[str, int]
    bytes: int
    log_bytes: int


def measured(service: LiveService) -> Footprint:
    """The footprint now."""
    own = psutil.Process(service.process.pid)
    workers = [psutil.Process(pid) for pid in service.worker_pids()]
    family = [own, *own.children(recursive=True)]
    return Footprint(
        service_mib=own.memory_info().rss / MIB,
        workers_mib=sum(worker.memory_info().rss for worker in workers) / MIB,
        descriptors=sum(process.num_fds() for process in family),
        threads=sum(process.num_threads() for process in family),
        processes=len(family),
        rows=rows(service.data),
        bytes=sum(path.stat().st_size for path in stored(service.data)),
        log_bytes=service.log.stat().st_size,
    )


def rows(data: Path) -> dict[str, int]:
    """How many rows each table has that clients fill, without empty ones."""
    with closing(_database(data)) as database:
        result = {name: database.execute(f"SELECT count(*) FROM {name}").fetchone()[0] for name in TABLES}
    return {name: count for name, count in result.items() if count}


def stored(data: Path) -> list[Path]:
    """Files of what clients made, but for unfinished uploads."""
    folders = [tenant / name for tenant in (data / "tenants").iterdir() for name in FOLDERS]
    return [path for folder in folders for path in folder.rglob("*") if path.is_file()]


def oldest_upload(data: Path) -> float | None:
    """When the oldest unfinished upload was begun, s since 1970."""
    query = "SELECT min(created) FROM uploads WHERE state = 'receiving'"
    with closing(_database(data)) as database:
        result = database.execute(query).fetchone()[0]
    return None if result is None else float(result)


def rise(values: Sequence[float]) -> float:
    """By how much a line fitted to evenly spaced values rises from the first to the last."""
    if len(values) < 2:
        return 0.0
    slope, _ = np.polyfit(np.arange(len(values)), values, 1)
    return float(slope) * (len(values) - 1)


def _database(data: Path) -> sqlite3.Connection:
    return sqlite3.connect(f"file:{data / 'bentray.sqlite'}?mode=ro", uri=True, timeout=30.0)
