"""The ingest process: limits its resources, reads an untrusted file, writes the canonical file, prints JSON.

``python -m bentray_service.ingest.ingest_process WHAT IN OUT --memory BYTES --seconds SECONDS --given JSON``

Before writing, it prints ``{"reserve": bytes}`` and waits for the line ``go`` on its input.
"""

from __future__ import annotations

import argparse
import errno
import json
import math
import resource
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bentray_workers.files.dataset.counts import record_of, text

if TYPE_CHECKING:
    from bentray_workers.files.volume import Volume

OnSize = Callable[[int], None]

OPEN_FILES = 64
# Maximum ratio of the size of the canonical file to that of a large upload, due to fast compression.
PACKING = 2

# Key of the metadata of a dataset that is a stored scan to be corrected; its id is ``origin``.
CORRECTION = "correction"
# Key of the metadata that the process is not told: the name of the file.
FILE_NAME = "filename"

# Accepted types, with a description of the formats.
ACCEPTED = {
    "dataset": "a scan as uct-transmission, zea or openUSCT (HDF5), MATLAB 5 or 7.3, .npz of arrays, or a "
    "zip of k-Wave outputs or of a measurement of KIT 3D USCT",
    "volume": "a volume as NumPy (.npy, .npz), NRRD, NIfTI or HDF5 of Bentray, or raw bytes with shape and "
    "dtype",
    "mesh": "a triangle mesh as PLY, OBJ, OFF, STL, glTF or GLB",
}


def main() -> None:
    """Print ``{"ok": summary}``, ``{"error": {field, found, accepted}}`` or ``{"full": true}``."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=list(ACCEPTED))
    parser.add_argument("source", type=Path)
    parser.add_argument("target", type=Path)
    parser.add_argument("--memory", type=int, required=True)
    parser.add_argument("--seconds", type=float, required=True)
    parser.add_argument("--given", type=json.loads, required=True, help="metadata of the file")
    arguments = parser.parse_args()
    limit_resources(arguments.memory, arguments.seconds, PACKING * arguments.source.stat().st_size)
    outcome = convert_upload(
        arguments.what, arguments.source, arguments.target, arguments.given, request_space
    )
    sys.stdout.write(json.dumps(outcome) + "\n")


def limit_resources(memory_bytes: int, seconds: float, file_bytes: int = 0) -> None:
    """Limit the resources of this process; the file size limit is at least ``file_bytes``."""
    cpu = math.ceil(seconds)
    for what, amount in (
        (resource.RLIMIT_AS, memory_bytes),
        (resource.RLIMIT_FSIZE, max(memory_bytes, file_bytes)),
        (resource.RLIMIT_CPU, cpu),
        (resource.RLIMIT_NOFILE, OPEN_FILES),
        (resource.RLIMIT_CORE, 0),
    ):
        hard = resource.getrlimit(what)[1]
        allowed = amount if hard == resource.RLIM_INFINITY else min(amount, hard)
        resource.setrlimit(what, (allowed, allowed))


def request_space(size: int) -> None:
    """Send the maximum size of the canonical file to the service, and wait for its permission."""
    sys.stdout.write(json.dumps({"reserve": size}) + "\n")
    sys.stdout.flush()
    if not sys.stdin.readline():
        # The service has died or has refused the request.
        raise SystemExit(1)


def convert_upload(
    what: str,
    source: Path,
    target: Path,
    given: dict[str, Any],
    on_size: OnSize = lambda size: None,
) -> dict[str, Any]:
    """Convert ``source`` to the canonical file ``target``; returns a summary of the content, or an error.

    ``on_size`` is called before writing with the maximum size without the header, bytes.
    """
    try:
        from bentray_kernels.errors import InvalidInput

        import_module(READERS[what])
    except (ImportError, MemoryError):
        # Without memory, the import of NumPy fails.
        return _error(
            "file", "out of memory at the start of the reader", "a larger BENTRAY_INGEST_MEMORY_BYTES"
        )
    try:
        return {"ok": CONVERTED[what](source, target, given, on_size)}
    except InvalidInput as error:
        return _error(error.field, error.value, error.accepted)
    except MemoryError:
        return _error("file", "data larger than the memory of the reader", "a smaller file")
    except Exception as error:
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
            return {"full": True}
        # Any other exception is caused by the file.
        return _error("file", f"{type(error).__name__}: {error}", ACCEPTED[what])


def _dataset(source: Path, target: Path, given: dict[str, Any], on_size: OnSize) -> dict[str, Any]:
    if CORRECTION in given:
        from bentray_workers.files.dataset.copy import Correction, correct_dataset

        correction = Correction(**given[CORRECTION])
        return record_of(correct_dataset(source, target, correction, origin=given["origin"], on_size=on_size))
    from bentray_workers.foreign_scans import ScanMetadata, convert_dataset

    return record_of(
        convert_dataset(source, target, on_size=on_size, given=ScanMetadata.from_options(**given))
    )


def _volume(source: Path, target: Path, given: dict[str, Any], on_size: OnSize) -> dict[str, Any]:
    from bentray_workers.files.volume import write_volume
    from bentray_workers.files.volume_formats import VolumeMetadata, import_volume

    volume = import_volume(source, VolumeMetadata(**given))
    on_size(volume.values.nbytes)
    write_volume(target, volume)
    return volume_summary(volume)


def _mesh(source: Path, target: Path, given: dict[str, Any], on_size: OnSize) -> dict[str, Any]:
    from bentray_workers.files.mesh import StoredMesh, summary_of, write_mesh
    from bentray_workers.files.mesh_formats import read_mesh

    mesh = read_mesh(source.read_bytes())
    stored = StoredMesh(mesh.surface.mesh, mesh.colours)
    on_size(stored.nbytes)
    write_mesh(target, stored)
    return summary_of(stored, mesh.surface, mesh.format) | {"title": text(given["title"])}


CONVERTED = {"dataset": _dataset, "volume": _volume, "mesh": _mesh}
# Imported by type, for a fast start.
READERS = {
    "dataset": "bentray_workers.foreign_scans",
    "volume": "bentray_workers.files.volume_formats",
    "mesh": "bentray_workers.files.mesh_formats",
}


def volume_summary(volume: Volume) -> dict[str, Any]:
    """The columns of a volume, as plain values."""
    return {
        "title": text(volume.title),
        "shape": list(volume.values.shape),
        "spacing_m": list(volume.spacing_m),
        "origin_m": list(volume.origin_m),
        "value_range": list(volume.range()),
    }


def _error(field: str, found: str, accepted: str) -> dict[str, Any]:
    return {"error": {"field": text(field), "found": text(found), "accepted": text(accepted)}}


if __name__ == "__main__":
    main()
