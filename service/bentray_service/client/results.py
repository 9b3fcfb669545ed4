"""A volume as a result with coordinates and units, read from the downloaded file."""

from __future__ import annotations

from pathlib import Path

from ..interactive.result import Result, result_of
from ..routes.models.job_records import VolumeRecord


def read_result(path: Path, record: VolumeRecord) -> Result:
    """Read the HDF5 file of a volume with the given record."""
    from bentray_workers.files.volume_export import read_image

    named = ("id", "title", "job", "dataset", "sha256")
    attributes = {name: str(value) for name in named if (value := getattr(record, name))}
    return result_of(read_image(path), attributes, unit=record.unit)
